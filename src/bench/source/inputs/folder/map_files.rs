//! Files that have the disparities of pairs, as truth or as the map of an algorithm: depth images,
//! disparities, KITTI's laser scans.

use super::cameras::file_of_the_day;
use super::layout::{Cameras, Images, Layout, find_ending};
use super::stamps::epoch_ns;
use nalgebra::Isometry3;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use svl_calibrate::files::read_scanner;
use svl_core::depth::project;
use svl_core::doubt::TruthUnit;
use svl_core::stereo::{Frame, MapDensity, Plane, Rig};
use svl_core::{Error, Result, counted};
use svl_files::{has_ending, no_depth, read_depth, read_disparity_steps, read_points};
use svl_recording::{RawCamera, SensorRole, SensorSelection, disparities, warn_of, warn_once};
use svl_score::plausibility::{is_better_match, sign_doubt, split_unit, without};

/// Extensions of the files that are read.
const ENDINGS: &[&str] = &["png", "tif", "tiff", "npy", "npz", "pfm", "bin"];
/// Patterns that `svl info` looks for: the folders of other programs and of KITTI.
const USUAL: [&str; 7] = [
    "depth/*.png",
    "depth/*.npy",
    "disp_occ_0/*.png",
    "disp_occ/*.png",
    "disparity/*.png",
    "velodyne_points/data/*.bin",
    "velodyne/*.bin",
];
/// Images that have integers for values.
const INTEGERS: [&str; 3] = ["png", "tif", "tiff"];
/// KITTI's images are 256 times the disparity.
const KITTI: TruthUnit = TruthUnit::Disparity(256.0);
/// Largest difference of time between image and measurement that is not reported.
const MAX_OFFSET_NS: u64 = 5_000_000;

/// The files of a pattern, for the pairs of a source.
pub struct MapFiles {
    folder: PathBuf,
    pattern: String,
    role: SensorRole,
    /// Meaning of the files' values, if they are not those that depths have by default.
    unit: Option<TruthUnit>,
    /// True if their names say that they are disparities.
    is_recognized: bool,
    /// By the part at `*` of their names.
    files: Images,
    /// Files whose names are numbers, for pairs without a name or with other numbers.
    numbered: BTreeMap<u64, PathBuf>,
    /// Numbers of a file and of its pair, of which all others are as far apart.
    number_of: [u64; 2],
    /// Words for the user about the numbers, once they are used.
    numbering: Option<String>,
    /// Files whose names are times, by stamp.
    times: Vec<(u64, PathBuf)>,
    max_skew_ns: u64,
    /// Pose of the laser scanner in the left camera.
    scanner: Option<Isometry3<f64>>,
    /// Number of pairs so far without a file.
    pub without: u64,
    /// Stamp of the pair that each file answered.
    used: BTreeMap<PathBuf, u64>,
    /// True once the first pair with integers was looked at.
    has_decided: bool,
    /// True once a pair had a file.
    has_found: bool,
    /// Reported so far, each once.
    told: Told,
}

/// Files that cannot be read and are named, each with its reason.
const MAX_NAMED: u64 = 5;

/// Warnings that are given once, and the number of those of files that cannot be read.
#[derive(Default)]
struct Told {
    misfit: bool,
    negative: bool,
    unreadable: u64,
    late: bool,
}

impl MapFiles {
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] if no file fits the pattern, or for a laser scanner whose
    /// position is unknown; [`Error::Usage`] for a pattern without `*` and an impossible unit.
    pub(crate) fn new(
        folder: &Path,
        layout: Option<&Layout>,
        selection: &SensorSelection,
    ) -> Result<Self> {
        let (pattern, said) = split_unit(&selection.topic)?;
        let recognized = by_name(pattern).filter(|_| said.is_none());
        let found = Self {
            unit: said.or(recognized),
            is_recognized: recognized.is_some(),
            max_skew_ns: selection.max_skew_ns,
            ..Self::find(folder, pattern, SensorRole::Truth)?
        };
        let has_scans = found.files.values().any(|path| has_ending(path, "bin"));
        Ok(Self {
            scanner: has_scans.then(|| scanner(folder, layout)).transpose()?,
            ..found
        })
    }

    /// The files of an algorithm's maps, disparities unless `unit_m` is given. The pattern is a
    /// path of its own. Pairs without a name have the files of their numbers.
    ///
    /// # Errors
    /// The errors of [`MapFiles::new`]; [`Error::Format`] for two files of one number.
    pub(crate) fn for_maps(
        pattern: &str,
        (unit_m, scale): (Option<f64>, Option<f64>),
        max_skew_ns: u64,
    ) -> Result<Self> {
        let folder = Path::new(if pattern.starts_with('/') { "/" } else { "." });
        let found = Self::find(folder, pattern, SensorRole::Map)?;
        let unit = match (unit_m, scale) {
            (Some(unit_m), _) => TruthUnit::Depth(unit_m as f32),
            (None, Some(scale)) => TruthUnit::Disparity(scale as f32),
            (None, None) if has_integers(Path::new(pattern)) => KITTI,
            (None, None) => TruthUnit::Disparity(1.0),
        };
        Ok(Self {
            unit: Some(unit),
            max_skew_ns,
            ..found
        })
    }

    /// The files of a pattern, before their meaning is known.
    fn find(folder: &Path, pattern: &str, role: SensorRole) -> Result<Self> {
        let asked = asked(role, pattern);
        if pattern.matches('*').count() != 1 {
            return Err(Error::Usage(format!(
                "{asked}: is a pattern with one * for the part that is equal in the names of the \
                 images"
            )));
        }
        let files = find_ending(folder, pattern, ENDINGS)?;
        if files.is_empty() {
            let ending = Path::new(pattern).extension().unwrap_or_default();
            let is_read = ENDINGS
                .iter()
                .any(|known| ending.eq_ignore_ascii_case(known));
            let why = match role {
                _ if !is_read && ending != "*" => {
                    format!("is not read; convert to one of {}", ENDINGS.join(", "))
                }
                SensorRole::Truth => format!("no such file; usual ones are {}", USUAL.join(", ")),
                SensorRole::Map => "no such file".to_owned(),
            };
            return Err(Error::format(folder, format!("{asked}: {why}")));
        }
        let mut numbered = BTreeMap::new();
        for (key, path) in &files {
            let number = str::from_utf8(key).ok().and_then(|key| key.parse().ok());
            let Some(number) = number else { continue };
            let other: Option<PathBuf> = numbered.insert(number, path.clone());
            // Truths have the names of the images, unless these are other numbers.
            if let Some(other) = other.filter(|_| role == SensorRole::Map) {
                let both = format!("and {} have one number; leave one of them", other.display());
                return Err(Error::format(path, both));
            }
        }
        let stamp = |(key, path): (&Vec<u8>, &PathBuf)| Some((epoch_ns(key)?, path.clone()));
        Ok(Self {
            folder: folder.to_owned(),
            pattern: pattern.to_owned(),
            role,
            unit: None,
            is_recognized: false,
            times: files.iter().filter_map(stamp).collect(),
            files,
            numbered,
            number_of: [0; 2],
            numbering: None,
            max_skew_ns: 0,
            scanner: None,
            without: 0,
            used: BTreeMap::new(),
            has_decided: false,
            has_found: false,
            told: Told::default(),
        })
    }

    /// The option, as the user wrote it.
    fn asked(&self) -> String {
        asked(self.role, &self.pattern)
    }

    /// The usual patterns that have files.
    pub(crate) fn usual(folder: &Path) -> Vec<String> {
        let has_files = |pattern: &&str| {
            find_ending(folder, pattern, ENDINGS).is_ok_and(|files| !files.is_empty())
        };
        let usual = USUAL.into_iter().filter(has_files);
        usual.map(str::to_owned).collect()
    }

    /// The meaning of its values, where their names say it and the user does not.
    pub fn note(&self) -> Option<String> {
        let unit = self.unit.filter(|_| self.is_recognized)?;
        Some(format!(
            "--truth '{}': by their names they are disparities, read as :{unit}; :unit=0.001 is \
             for depths in millimetres",
            self.pattern
        ))
    }

    /// Pattern of the files, with the meaning of their values.
    pub(crate) fn name(&self) -> String {
        let unit = self.unit.map(|unit| format!(":{unit}"));
        self.pattern.clone() + &unit.unwrap_or_default()
    }

    /// Disparities from the file with the frame's name, or else, of those whose names are times,
    /// from the one nearest to its stamp.
    ///
    /// # Errors
    /// [`Error::Format`] for a pair without a rig, and for depth images of raw pairs or of another
    /// size.
    pub fn measured(&mut self, frame: &Frame) -> Result<Option<(Plane<f32>, MapDensity)>> {
        let is_disparity = matches!(self.unit, Some(TruthUnit::Disparity(_)));
        let rig = frame.rig().copied();
        if rig.is_none() && !is_disparity {
            let why = "pairs without a calibration have no distances to compare: --calib FILE";
            return Err(self.wrong(why));
        }
        let Some((path, apart_ns)) = self.file(frame) else {
            self.without += 1;
            self.warn_of_misfit(frame);
            return Ok(None);
        };
        self.has_found = true;
        if let Some(words) = self.numbering.take_if(|_| number(frame).is_some()) {
            tracing::warn!("{}: {words}", self.asked());
        }
        self.used.insert(path.clone(), frame.stamp_ns);
        self.warn_of_time(frame, &path, apart_ns);
        let (size, raw) = (frame.pair.size(), RawCamera::from_frame(frame));
        let disparity = if has_ending(&path, "bin") {
            self.points(&path, rig, raw, size)
        } else if raw.is_some() {
            let why = "its depth images belong to the images before svl rectifies them; rectify \
                       all of them first, or give --calib none if they are rectified";
            return Err(self.wrong(why));
        } else {
            self.disparity(&path, rig, frame)
        };
        let disparity = match disparity {
            Ok(disparity) => disparity,
            Err(error) => {
                self.told.unreadable += 1;
                let what = match self.role {
                    SensorRole::Truth => "truth",
                    SensorRole::Map => "map",
                };
                match self.told.unreadable {
                    ..MAX_NAMED => tracing::warn!("{error}; left out, its pair has no {what}"),
                    MAX_NAMED => tracing::warn!(
                        "{error}; left out, its pair has no {what}; further files that cannot be \
                         read are not named"
                    ),
                    _ => {}
                }
                self.without += 1;
                return Ok(None);
            }
        };
        if disparity.size() != size {
            let ((w, h), (width, height)) = (disparity.size(), size);
            let why = format!(
                "is {w}x{h}, the left image {width}x{height}: depth images have to \
                               be those of the left camera"
            );
            return Err(Error::format(path, why));
        }
        let known = disparity.pixels().filter(|d| d.is_finite()).count();
        // Laser points in an image, as KITTI's depth maps, are spread as in a cloud.
        let density = if 2 * known < size.0 * size.1 && self.role == SensorRole::Truth {
            MapDensity::Sparse
        } else {
            MapDensity::Dense
        };
        Ok(Some((disparity, density)))
    }

    /// The disparities of a laser scan.
    fn points(
        &self,
        path: &Path,
        rig: Option<Rig>,
        raw: Option<RawCamera>,
        size: (usize, usize),
    ) -> Result<Plane<f32>> {
        let rig = rig.ok_or_else(|| self.wrong("laser scans need a calibration: --calib FILE"))?;
        let points = read_points(path)?;
        let pose = self.scanner.unwrap_or_default();
        let rotation = raw.map(|raw| raw.rotation).unwrap_or_default();
        let points = points.iter().map(|point| rotation * (pose * point));
        Ok(project(points, &rig, size))
    }

    /// The disparities of a file of depths or disparities. Of the first one that does not say which
    /// it has, the pair decides.
    fn disparity(&mut self, path: &Path, rig: Option<Rig>, frame: &Frame) -> Result<Plane<f32>> {
        let unit_m = match (self.unit, rig) {
            (Some(TruthUnit::Disparity(scale)), _) => {
                let map = read_disparity_steps(path, scale, self.has_zeros(path))?;
                return Ok(self.without_negative(map));
            }
            (Some(TruthUnit::Depth(unit_m)), _) => Some(unit_m),
            (None, _) => None,
        };
        let read = read_depth(path, unit_m)?;
        if let Some(words) = no_depth(&read) {
            warn_once(format!("{}: {words}", self.asked()));
        }
        let depth = self.role.depths(&read);
        let rig = rig.ok_or_else(|| self.wrong("depths need a calibration: --calib FILE"))?;
        let from_depth = disparities(&depth, &rig);
        let is_open = self.unit.is_none() && has_integers(path) && !self.has_decided;
        if is_open && from_depth.size() == frame.pair.size() {
            self.has_decided = true;
            let TruthUnit::Disparity(scale) = KITTI else {
                return Ok(from_depth);
            };
            let as_disparity = read_disparity_steps(path, scale, false)?;
            if is_better_match(&frame.pair, &as_disparity, &from_depth) {
                tracing::warn!(
                    "{}: its values match the two images as disparities and not as depths: read as \
                     :{KITTI}; :unit=0.001 is for depths in millimetres",
                    self.asked()
                );
                self.unit = Some(KITTI);
                return Ok(as_disparity);
            }
        }
        Ok(from_depth)
    }

    /// True if 0 is a disparity: that of a point at infinity, in a matcher's PFM.
    fn has_zeros(&self, path: &Path) -> bool {
        self.role == SensorRole::Map && has_ending(path, "pfm")
    }

    /// The map without negative values, which programs write for none, as OpenCV's matchers.
    fn without_negative(&mut self, map: Plane<f32>) -> Plane<f32> {
        if self.role == SensorRole::Truth {
            return map;
        }
        let (Ok((map, _)) | Err(map)) = without(map, |d| d < 0.0);
        let doubt = sign_doubt(&self.asked(), &map).filter(|_| !self.told.negative);
        self.told.negative |= doubt.is_some();
        doubt.inspect(|doubt| warn_of(&self.folder.display().to_string(), doubt));
        map
    }

    /// Learns the numbers of the source's pairs. The files have these, or count the pairs: from 1,
    /// from 0, or from the first file. Where that is open they are the pairs', and it is said.
    pub(crate) fn count_pairs(&mut self, pairs: Option<RangeInclusive<u64>>) {
        let (Some(pairs), Some((&first, _)), Some((&last, _))) = (
            pairs.filter(|_| self.times.is_empty()),
            self.numbered.first_key_value(),
            self.numbered.last_key_value(),
        ) else {
            return;
        };
        let (start, end) = pairs.into_inner();
        let fits = |from: &u64| first >= *from && last - from <= end.saturating_sub(start);
        let is_apart = start.checked_add(1) == Some(first) || first > end || last < start;
        let counted = Some(first).filter(|_| is_apart);
        let from = [start, 1, 0].into_iter().chain(counted).find(fits);
        self.number_of = [from.unwrap_or(start), start];
        let numbers = format!("numbers {first} to {last} for pairs {start} to {end}");
        self.numbering = match from {
            Some(from) if from != start => Some(format!("{numbers}: {from} is pair {start}")),
            // Pairs 5 to 9 may have some of the files of all; numbers from 1 may count from 1.
            None if first <= start && last >= end => None,
            Some(_) if [first, start] != [1, 0] => None,
            _ => Some(format!(
                "{numbers} are read as the pairs' own, so that some have none; if {first} is pair \
                 {start}, number the files from {start}"
            )),
        };
    }

    /// Warns of files that no pair used, but not of measurements that have times of their own.
    pub(crate) fn warn_of_unused(&self) {
        let mut unused = self
            .files
            .values()
            .filter(|path| !self.used.contains_key(*path));
        let has_names = self.times.is_empty() && self.has_found;
        let is_named = self.role == SensorRole::Map || has_names;
        if let Some(first) = unused.next().filter(|_| is_named) {
            tracing::warn!(
                "{}: {} used by no pair, the first is {}; {} without one",
                self.asked(),
                counted(1 + unused.count() as u64, "file"),
                first.display(),
                counted(self.without, "pair")
            );
        }
    }

    /// Warns once of names and times that fit no pair.
    fn warn_of_misfit(&mut self, frame: &Frame) {
        if self.has_found || std::mem::replace(&mut self.told.misfit, true) {
            return;
        }
        let number = frame.sequence.to_string();
        let pair = frame.name.as_deref().unwrap_or(&number);
        let skew = match self.role {
            SensorRole::Truth => "truth_skew_ms",
            SensorRole::Map => "skew_ms=",
        };
        let file = self.files.keys().next();
        let file = file.map(|key| String::from_utf8_lossy(key));
        tracing::warn!(
            "{}: no file fits the pair '{pair}': the part at * is '{}' in the first file; names \
             have to be equal, or times at most {} ms apart ({skew})",
            self.asked(),
            file.unwrap_or_default(),
            self.max_skew_ns as f64 / 1e6
        );
    }

    /// Warns once of a file of another time: nothing moves it to that of the pair.
    fn warn_of_time(&mut self, frame: &Frame, path: &Path, apart_ns: u64) {
        let is_late = apart_ns > MAX_OFFSET_NS && frame.stamp_ns > 0;
        if !is_late || std::mem::replace(&mut self.told.late, true) {
            return;
        }
        tracing::warn!(
            "{}: {} is {:.1} ms from its pair: at 1 m/s the scene moves by {:.0} mm",
            self.asked(),
            path.display(),
            apart_ns as f64 / 1e6,
            apart_ns as f64 / 1e6
        );
    }

    /// The frame's file and its distance in time, in ns; zero if names are no times.
    fn file(&self, frame: &Frame) -> Option<(PathBuf, u64)> {
        let apart = |stamp_ns: u64| stamp_ns.abs_diff(frame.stamp_ns);
        // A scene of a data set also by its own name, without that of the data set.
        let name = frame.name.as_deref();
        let own = name.and_then(|name| Some(name.rsplit_once('/')?.1));
        let [of_file, of_pair] = self.number_of;
        let names = name.into_iter().chain(own).map(str::as_bytes);
        for name in names.filter(|_| of_file == of_pair) {
            if let Some(path) = self.files.get(name) {
                return Some((path.clone(), epoch_ns(name).map_or(0, apart)));
            }
        }
        let number = number(frame).filter(|_| name.is_none() || of_file != of_pair);
        let number = number.and_then(|number| number.checked_sub(of_pair)?.checked_add(of_file));
        if let Some(path) = number.and_then(|number| self.numbered.get(&number)) {
            return Some((path.clone(), 0));
        }
        // A file answers one pair.
        let is_free = |path: &PathBuf| {
            let pair_ns = self.used.get(path);
            pair_ns.is_none_or(|pair_ns| *pair_ns == frame.stamp_ns)
        };
        let free = self.times.iter().filter(|(_, path)| is_free(path));
        let (stamp_ns, path) = free.min_by_key(|(stamp_ns, _)| apart(*stamp_ns))?;
        let apart_ns = apart(*stamp_ns);
        (apart_ns <= self.max_skew_ns).then(|| (path.clone(), apart_ns))
    }

    fn wrong(&self, why: &str) -> Error {
        let files = counted(self.files.len() as u64, "file");
        let reason = format!("{}, {files}: {why}", self.asked());
        Error::format(&self.folder, reason)
    }
}

/// The number of a pair: its name, or that in its source.
fn number(frame: &Frame) -> Option<u64> {
    let name = frame.name.as_deref();
    name.map_or(Some(frame.sequence), |name| name.parse().ok())
}

/// The option, as the user wrote it.
fn asked(role: SensorRole, pattern: &str) -> String {
    match role {
        SensorRole::Truth => format!("--truth '{pattern}'"),
        SensorRole::Map => format!("files:'{pattern}'"),
    }
}

/// True for a file whose values are integers.
fn has_integers(path: &Path) -> bool {
    INTEGERS.iter().any(|ending| has_ending(path, ending))
}

/// The meaning of values in a folder of disparities: integers as KITTI's, floats in pixels.
fn by_name(pattern: &str) -> Option<TruthUnit> {
    let is_disparity = pattern.to_lowercase().contains("disp");
    let unit = if has_integers(Path::new(pattern)) {
        KITTI
    } else {
        TruthUnit::Disparity(1.0)
    };
    (is_disparity && !has_ending(Path::new(pattern), "bin")).then_some(unit)
}

/// The pose of KITTI's scanner, by the calibrations in the folder or the two above it.
fn scanner(folder: &Path, layout: Option<&Layout>) -> Result<Isometry3<f64>> {
    let real = folder.canonicalize().map_err(|e| Error::io(folder, e))?;
    let file = |name: &str| file_of_the_day(&real, name);
    match layout.map(|layout| &layout.cameras) {
        Some(Cameras::CamToCam([left, _])) => {
            if let (Some(scanner), Some(cameras)) =
                (file("calib_velo_to_cam.txt"), file("calib_cam_to_cam.txt"))
            {
                return read_scanner(&scanner, &cameras, left);
            }
        }
        Some(Cameras::Projections([left, _])) => {
            if let Some(calib) = file("calib.txt") {
                return read_scanner(&calib, &calib, left);
            }
        }
        _ => {}
    }
    let why = "laser scans need KITTI's calib_velo_to_cam.txt and calib_cam_to_cam.txt, or a \
               calib.txt with Tr, in the folder or above it";
    Err(Error::format(folder, why))
}
