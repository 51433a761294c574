//! A folder of many pairs as a source.

use super::map_files::MapFiles;
use super::pairs::{FolderRequest, PairFiles, pairs};

use super::cameras::{CAM_TO_CAM, cameras, size_mismatch};
use super::layout::{Cameras, Layout};
use super::poses::poses;
use super::stamps::{Stamp, stamps};
use crate::source::frames::{Source, warn_of_rig};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use svl_core::stereo::{Exposure, Frame, Geometry, Pose, StereoCalibration};
use svl_core::{Error, Result};
use svl_files::{BitDepth, DecodedImage, GreyLevels, SideBySide, read_image};
use svl_recording::{SensorSelection, StampOrigin};
use svl_score::losses::Losses;

/// The pairs of a folder, in the natural order of their names.
///
/// Pairs that cannot be read are dropped and counted, and the first one is reported.
pub struct FolderSource {
    folder: PathBuf,
    layout: Option<&'static Layout>,
    pairs: Vec<(PairFiles, Stamp)>,
    poses: Vec<Option<Pose>>,
    pub(crate) stamps: Option<StampOrigin>,
    unpaired: u64,
    unreadable: u64,
    pub(crate) depth: BitDepth,
    places: Option<SideBySide>,
    pub(super) geometry: Geometry,
    pub(crate) calibration: std::result::Result<Option<StereoCalibration>, String>,
    /// Size of the first pair that can be read.
    pub(crate) size: (usize, usize),
    /// True if a pair of another size was met.
    sizes_differ: bool,
    next: usize,
}

impl FolderSource {
    /// The pairs in `folder`.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Usage`] for a request that contradicts itself; [`Error::Format`]
    /// if it has no pair, with its contents, or none that can be read.
    pub fn new(folder: &Path, request: &FolderRequest) -> Result<Self> {
        let found = pairs(folder, request)?;
        let (origin, stamps) = match (request.fps, stamps(folder, found.layout, &found.pairs)?) {
            (None, Some(stamps)) => (None, stamps),
            (hz, _) => {
                let origin = hz.map_or(StampOrigin::UNKNOWN, StampOrigin::Given);
                let numbers = 0..found.pairs.len() as u64;
                let stamps = numbers.map(|i| (origin.stamp_ns(i), None)).collect();
                (Some(origin), stamps)
            }
        };
        let places = request.side_by_side;
        let size = size(&found.pairs, places)?;
        let calibrated = cameras(folder, found.layout, size)?;
        // One that cannot be read is reported in its turn.
        let readable = found
            .pairs
            .iter()
            .filter_map(|pair| read(pair, places).ok());
        let depth = BitDepth::decide(request.bits, &GreyLevels::from_pairs(readable))?;
        Ok(Self {
            folder: folder.to_owned(),
            layout: found.layout,
            poses: poses(folder, found.layout, &found.pairs)?,
            pairs: found.pairs.into_iter().zip(stamps).collect(),
            stamps: origin,
            unpaired: found.unpaired,
            unreadable: 0,
            depth,
            places,
            geometry: calibrated.geometry,
            calibration: calibrated.calibration,
            size,
            sizes_differ: false,
            next: 0,
        })
    }

    /// The truths of the files that a pattern names.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`], [`Error::Usage`].
    pub fn truth(&self, selection: &SensorSelection) -> Result<MapFiles> {
        MapFiles::new(&self.folder, self.layout, selection)
    }

    /// The words that KITTI's cameras, which a file above the folder has, are unknown.
    pub(crate) fn lacks_cameras(&self) -> Option<String> {
        let cameras = self.layout.map(|layout| &layout.cameras);
        let is_open = matches!(self.geometry, Geometry::Rectified(None));
        (is_open && matches!(cameras, Some(Cameras::CamToCam(_)))).then(|| {
            format!(
                "{}: no {CAM_TO_CAM} in it or the two folders above, so there are no distances: \
                 unpack the day's calibration there, or add --calib FILE",
                self.folder.display()
            )
        })
    }

    /// Warns once of a pair whose size differs from that of the first one.
    fn compare_size(&mut self, frame: &Frame) {
        let ((width, height), (first_width, first_height)) = (frame.pair.size(), self.size);
        if (width, height) != self.size && !std::mem::replace(&mut self.sizes_differ, true) {
            tracing::warn!(
                "{}: pair {} has {width}x{height} pixels, the first {first_width}x{first_height}; \
                 a camera's are all of one size",
                self.folder.display(),
                frame.name.as_deref().unwrap_or_default()
            );
        }
    }

    fn read(&mut self, number: usize) -> Result<Frame> {
        let (files, (stamp_ns, skew_ns)) = &self.pairs[number];
        let wrong = |reason: String| Error::format(&files.left, reason);
        let pair = self.depth.pair(read(files, self.places)?);
        let (pair, color) = pair.map_err(|e| wrong(e.to_string()))?;
        if self.geometry.rig().is_some() && pair.size() != self.size {
            return Err(wrong(size_mismatch(self.size, pair.size())));
        }
        let sequence = number as u64;
        Ok(Frame {
            sequence,
            stamp_ns: *stamp_ns,
            name: Some(String::from_utf8_lossy(&files.key).into_owned()),
            pose: self.poses[number],
            color,
            exposure: Exposure {
                trigger_id: sequence,
                skew_ns: *skew_ns,
                drops: self.unpaired,
                ..Exposure::default()
            },
            ..Frame::new(pair, self.geometry)
        })
    }
}

fn read(files: &PairFiles, places: Option<SideBySide>) -> Result<[DecodedImage; 2]> {
    let left = read_image(&files.left)?;
    match &files.right {
        Some(right) => Ok([left, read_image(right)?]),
        None => left
            .halves(places.unwrap_or(SideBySide::LeftRight))
            .map_err(|reason| Error::format(&files.left, reason.to_string())),
    }
}

/// The size of the first pair that can be read.
///
/// # Errors
/// That of the first one, where none can.
fn size(pairs: &[PairFiles], places: Option<SideBySide>) -> Result<(usize, usize)> {
    let mut first = None;
    for files in pairs {
        match read(files, places) {
            Ok([left, right]) if left.size() == right.size() => return Ok(left.size()),
            Ok([left, right]) => {
                let (left, right) = (left.size(), right.size());
                let unlike = Error::PairSize { left, right }.to_string();
                first = first.or(Some(Error::format(&files.left, unlike)));
            }
            Err(error) => first = first.or(Some(error)),
        }
    }
    Err(first.unwrap_or_else(|| Error::Invalid("there are no pairs".to_owned())))
}

impl Source for FolderSource {
    fn name(&self) -> String {
        self.folder.display().to_string()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        while self.next < self.pairs.len() {
            self.next += 1;
            match self.read(self.next - 1) {
                Ok(frame) => {
                    self.compare_size(&frame);
                    warn_of_rig(&self.name(), &frame);
                    return Ok(Some(frame));
                }
                Err(error) => {
                    // One line in the log, like recordings; the number follows at the end.
                    if self.unreadable == 0 {
                        tracing::warn!("{error}; this pair is left out");
                    }
                    self.unreadable += 1;
                }
            }
        }
        Ok(None)
    }

    fn pairs(&self) -> Option<u64> {
        Some(self.pairs.len() as u64)
    }

    fn numbers(&self) -> Option<RangeInclusive<u64>> {
        let names = self.pairs.iter();
        let numbers = names.map(|(files, _)| str::from_utf8(&files.key).ok()?.parse().ok());
        let numbers: Vec<u64> = numbers.collect::<Option<_>>()?;
        Some(*numbers.iter().min()?..=*numbers.iter().max()?)
    }

    fn seek(&mut self, index: u64) -> Result<bool> {
        self.next = (index as usize).min(self.pairs.len());
        Ok(true)
    }

    fn finish(&mut self, _: u64) -> Losses {
        Losses {
            unpaired: self.unpaired,
            unreadable: self.unreadable,
            ..Losses::default()
        }
    }
}
