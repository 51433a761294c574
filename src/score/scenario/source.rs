//! `[source]`: the source of frames and its options. One declaration serves as the keys of a
//! scenario and the options of the command line.

use super::{CropScale, PairRange, SeedList};
use crate::losses::LossLimit;
use clap::builder::NonEmptyStringValueParser;
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use svl_core::matcher::with_paths;
use svl_core::stereo::FloorPlane;
use svl_core::{Error, Result, joined};
use svl_files::SideBySide;

const FPS: RangeInclusive<f64> = 0.001..=100_000.0;
const BITS: RangeInclusive<u8> = 8..=16;
const SKEW_MS: RangeInclusive<f64> = 0.0..=60_000.0;
/// A clock may begin when its machine starts.
const OFFSET_MS: RangeInclusive<f64> = -1e13..=1e13;
const SECONDS: RangeInclusive<f64> = 0.0..=1e9;

/// The source of a run, with its options.
///
/// Each is a key of `[source]` and, except a few, an option of the command line, which overrides
/// the key.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, clap::Args)]
#[command(next_help_heading = "Source")]
#[serde(deny_unknown_fields)]
pub struct SourceOptions {
    #[arg(skip)]
    pub kind: ScenarioKind,
    /// Recordings, bags and folders of pairs: paths and patterns (`*`, `?`, `[a-z]`, `**`), one run
    /// for each file.
    #[arg(skip)]
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<String>,
    /// Folder of the data sets, for scenarios that read scenes [default: what SVL_DATASETS names]
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,
    /// These scenes below the folder of the data sets in place of the scenario's; DIR/* are all in
    /// a folder
    #[arg(
        long, value_name = "SCENE", num_args = 1..,
        value_parser = NonEmptyStringValueParser::new()
    )]
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scenes: Vec<String>,
    /// These seeds in place of the arena's, as 4..10 or 4,7,9
    #[arg(long, value_name = "SEEDS", value_parser = clap::value_parser!(SeedList))]
    pub seeds: Option<SeedList>,
    /// The left images: a topic, a pattern or a video [default: found by type and name]
    ///
    /// A topic of another program's recording; in a folder a pattern, as 'a/*.png', where * is the
    /// same in left and right, or a video
    #[arg(
        long, value_name = "TOPIC|PATTERN", value_parser = NonEmptyStringValueParser::new()
    )]
    pub left: Option<String>,
    /// The right images
    #[arg(
        long, value_name = "TOPIC|PATTERN", value_parser = NonEmptyStringValueParser::new()
    )]
    pub right: Option<String>,
    /// Topic of the left camera's calibrations in another program's recording [default: found by
    /// namespace and name]
    #[arg(long, value_name = "TOPIC", value_parser = NonEmptyStringValueParser::new())]
    pub left_info: Option<String>,
    /// Topic of the right camera's calibrations
    #[arg(long, value_name = "TOPIC", value_parser = NonEmptyStringValueParser::new())]
    pub right_info: Option<String>,
    /// Each image holds both, as its halves [default: no; without a layout left-right]
    ///
    /// Layouts: left-right, right-left, top-bottom, bottom-top
    #[arg(
        long, value_name = "LAYOUT", num_args = 0..=1,
        require_equals = true, default_missing_value = "left-right",
        value_parser = clap::value_parser!(SideBySide)
    )]
    pub side_by_side: Option<SideBySide>,
    /// Pairs per second of a folder or video [default: by its stamps, if any]
    #[arg(long, value_name = "HZ", value_parser = within(FPS))]
    pub fps: Option<f64>,
    /// Number of bits of 16 that the images use [default: 10, 12, 14 or 16, by the values of the
    /// first 16 pairs]
    #[arg(long, value_name = "N", value_parser = within(BITS))]
    pub bits: Option<u8>,
    /// Largest skew of a pair made by stamp [default: 5; with cameras a quarter of their period,
    /// half of it when they are free-running]
    #[arg(long, value_name = "MS", value_parser = within(SKEW_MS))]
    pub max_skew_ms: Option<f64>,
    /// Unit of the stamps of a recording that are not in nanoseconds though they are written so:
    /// milliseconds or microseconds; or use log times, which are later, in place of all stamps
    /// [default: the stamps as they are written]
    #[arg(long, value_name = "ms|us|log")]
    pub stamps: Option<StampSource>,
    /// Added to the stamps of the right images of a recording, whose clock is not that of the left
    /// ones [default: 0, and no pairs if log times show another offset]
    #[arg(
        long, value_name = "MS", value_parser = within(OFFSET_MS), allow_negative_numbers = true
    )]
    pub right_offset_ms: Option<f64>,
    /// Another sensor's topic or files, which measure the truth
    ///
    /// In a recording the topic of a depth image, a disparity image, a point cloud or a laser scan;
    /// of a folder, the files: `depth/*.png`, `velodyne/*.bin`, with the unit in metres
    /// `depth/*.png:unit=0.0002`, or disparities `disp_occ_0/*.png:disparity=256`. It takes the
    /// place of the recording's own truth
    #[arg(long, value_name = "TOPIC|PATTERN", value_parser = NonEmptyStringValueParser::new())]
    pub truth: Option<String>,
    /// Largest difference of the stamps of a pair and its measurement [default: 20].
    #[arg(skip)]
    pub truth_skew_ms: Option<f64>,
    /// Height of the level left camera above the floor, metres: truth near that plane is floor, and
    /// no obstacle [default: by base_footprint in /tf_static, else unknown]
    #[arg(long = "camera-height", value_name = "M", value_parser = within(FloorPlane::HEIGHTS_M))]
    pub camera_height_m: Option<f64>,
    /// Rectify the pairs by a calibration [default: by the camera_info of a bag of raw images, else
    /// none]
    ///
    /// A file, two with a comma between, the folder of the two, two cameras of Kalibr's chain
    /// (FILE:cam2,cam3), or a recording that keeps it; take them as rectified (none), with the
    /// focal length and baseline of their camera_info; or leave them raw
    #[arg(long, value_name = "FILE|none|raw", value_parser = NonEmptyStringValueParser::new())]
    pub calib: Option<String>,
    /// Part of the raw images to keep, as OpenCV's alpha: 0 only valid pixels, 1 all [default: as
    /// in the file, else 0]
    #[arg(long, value_name = "0..1", value_parser = within(0.0..=1.0))]
    pub alpha: Option<f64>,
    /// Crop the rectified images
    #[arg(long, value_name = "X,Y,WIDTH,HEIGHT", value_parser = crop)]
    pub crop: Option<[usize; 4]>,
    /// Shrink the rectified images, after the crop: their new size over the old, at most 1
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    pub scale: Option<f64>,
    /// Take every n-th pair, the first among them
    #[arg(long, value_name = "N", value_parser = within(1..=1_000_000_000u64))]
    pub every: Option<u64>,
    /// Take the pairs from S seconds after the first pair on
    #[arg(long = "from", value_name = "S", value_parser = within(SECONDS))]
    pub from_s: Option<f64>,
    /// Take the pairs before S seconds after the first pair
    #[arg(long = "to", value_name = "S", value_parser = within(SECONDS))]
    pub to_s: Option<f64>,
    /// Exit with 0 where no more is lost: N pairs, or P per cent. Lost are images without a partner
    /// and pairs that cannot be read, of all pairs read; and of each algorithm the pairs that it
    /// fails on, of its pairs [default: 0]
    #[arg(long, value_name = "N|P%", allow_negative_numbers = true)]
    pub allow_loss: Option<LossLimit>,
}

/// The unit that the user names for the stamps of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum StampSource {
    Ms,
    Us,
    Log,
}

/// The kind of a scenario's frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ScenarioKind {
    Arena,
    Drive,
    Dataset,
    #[default]
    Recording,
}

/// The keys for pairs from any source.
macro_rules! of_pairs {
    ($($key:literal),*) => { &[$($key,)* "every", "from_s", "to_s", "allow_loss"] };
}

impl ScenarioKind {
    const ALL: [Self; 4] = [Self::Arena, Self::Drive, Self::Dataset, Self::Recording];

    fn name(self) -> &'static str {
        match self {
            Self::Arena => "arena",
            Self::Drive => "drive",
            Self::Dataset => "dataset",
            Self::Recording => "recording",
        }
    }

    fn noun(self) -> &'static str {
        match self {
            Self::Arena => "the arena",
            Self::Drive => "drives",
            Self::Dataset => "scenes of data sets",
            Self::Recording => "recordings",
        }
    }

    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Arena => of_pairs!["seeds"],
            Self::Drive => &["seeds", "allow_loss"],
            Self::Dataset => of_pairs!["data", "scenes", "camera_height_m"],
            Self::Recording => of_pairs![
                "files",
                "left",
                "right",
                "left_info",
                "right_info",
                "side_by_side",
                "fps",
                "bits",
                "max_skew_ms",
                "stamps",
                "right_offset_ms",
                "truth",
                "truth_skew_ms",
                "camera_height_m",
                "calib",
                "alpha",
                "crop",
                "scale"
            ],
        }
    }
}

impl SourceOptions {
    /// The keys that are set, with their values.
    fn given(&self) -> Result<toml::Table> {
        let wrong = |e: toml::ser::Error| Error::Usage(format!("options of the source: {e}"));
        let mut table = toml::Table::try_from(self).map_err(wrong)?;
        table.remove("kind");
        Ok(table)
    }

    /// The options in a table of [`SourceOptions::given`].
    fn set(kind: ScenarioKind, mut table: toml::Table) -> Result<Self> {
        table.insert("kind".to_owned(), kind.name().into());
        let wrong = |e: toml::de::Error| Error::Usage(format!("options of the source: {e}"));
        Self::deserialize(toml::Value::Table(table)).map_err(wrong)
    }

    /// These options, overridden by those set in `given`.
    ///
    /// # Errors
    /// [`Error::Usage`] for a path that is not UTF-8.
    pub fn with(&self, given: &Self) -> Result<Self> {
        let mut table = self.given()?;
        table.extend(given.given()?);
        Self::set(self.kind, table)
    }

    /// The options that apply to scenarios of that kind.
    ///
    /// # Errors
    /// The errors of [`SourceOptions::with`].
    pub fn for_kind(&self, kind: ScenarioKind) -> Result<Self> {
        let mut table = self.given()?;
        table.retain(|key, _| kind.keys().contains(&key));
        Self::set(kind, table)
    }

    /// Rejects options that apply to none of these kinds.
    ///
    /// # Errors
    /// [`Error::Usage`] with the first, and its purpose.
    pub fn refuse_others(&self, kinds: &[ScenarioKind]) -> Result<()> {
        let given = self.given()?;
        let takes = |kind: &ScenarioKind, key: &str| kind.keys().contains(&key);
        let is_other = |key: &&String| !kinds.iter().any(|kind| takes(kind, key));
        let Some(key) = given.keys().find(is_other) else {
            return Ok(());
        };
        let takers = ScenarioKind::ALL
            .into_iter()
            .filter(|kind| takes(kind, key));
        let takers = joined(takers.map(ScenarioKind::noun));
        Err(Error::Usage(format!("{} is for {takers}", flag(key))))
    }

    /// Rejects options that a command does not accept.
    ///
    /// # Errors
    /// [`Error::Usage`] with the first, and `why`.
    pub fn refuse(&self, keys: &[&str], why: &str) -> Result<()> {
        let given = self.given()?;
        match given.keys().find(|key| keys.contains(&key.as_str())) {
            None => Ok(()),
            Some(key) => Err(Error::Usage(format!("{} {why}", flag(key)))),
        }
    }

    /// The keys that are set.
    ///
    /// # Errors
    /// The errors of [`SourceOptions::with`].
    pub fn keys(&self) -> Result<Vec<String>> {
        Ok(self.given()?.keys().cloned().collect())
    }

    /// The options for the pairs of one recording, as words of a command line; without the range.
    ///
    /// # Errors
    /// The errors of [`SourceOptions::with`].
    pub fn words(&self) -> Result<Vec<String>> {
        const OTHERS: &str = "files data scenes seeds every from_s to_s allow_loss truth_skew_ms";
        let text = |value: &toml::Value| {
            let text = value.as_str().map(str::to_owned);
            text.unwrap_or_else(|| value.to_string())
        };
        let mut words = Vec::new();
        for (key, value) in self.given()? {
            let texts: Vec<_> = match value.as_array() {
                Some(all) if key == "crop" => {
                    vec![all.iter().map(text).collect::<Vec<_>>().join(",")]
                }
                Some(all) => all.iter().map(text).collect(),
                None => vec![text(&value)],
            };
            let texts = texts
                .iter()
                .filter(|_| !OTHERS.split(' ').any(|own| own == key));
            words.extend(texts.map(|text| format!("{}={text}", flag(&key))));
        }
        Ok(words)
    }

    /// The seeds of the arena [default: 1].
    pub fn seeds(&self) -> Vec<u64> {
        let seeds = self.seeds.as_ref().map(SeedList::seeds);
        seeds.unwrap_or(&[1]).to_vec()
    }

    /// The selected pairs.
    pub fn range(&self) -> PairRange {
        PairRange {
            every: self.every,
            from_s: self.from_s,
            to_s: self.to_s,
        }
    }

    /// The selected part of the images.
    pub fn window(&self) -> CropScale {
        CropScale {
            crop: self.crop,
            scale: self.scale,
        }
    }

    /// # Errors
    /// [`Error::Invalid`] for a key that does not apply to scenarios of its kind, and for an empty
    /// selection.
    pub(super) fn validate(&self) -> Result<()> {
        let kind = self.kind;
        let given = self.given()?;
        if let Some(key) = given
            .keys()
            .find(|key| !kind.keys().contains(&key.as_str()))
        {
            let takes = |kind: &ScenarioKind| kind.keys().contains(&key.as_str());
            let takers = ScenarioKind::ALL.into_iter().filter(takes);
            let takers: Vec<_> = takers.map(|kind| format!("\"{}\"", kind.name())).collect();
            let takers = takers.join(" or ");
            let words = format!("source.{key} belongs to kind = {takers}");
            return Err(Error::Invalid(words));
        }
        let key = |key: &str| format!("source.{key}");
        if kind == ScenarioKind::Recording
            && (self.files.is_empty() || self.files.iter().any(String::is_empty))
        {
            let expected = "at least one path or pattern";
            return Err(Error::Invalid(format!("source.files: {expected}")));
        }
        if kind == ScenarioKind::Dataset && self.scenes.is_empty() {
            let needs = "kind = \"dataset\" needs source.scenes, at least one";
            return Err(Error::Invalid(needs.into()));
        }
        if self.left.is_some() != self.right.is_some() {
            let both = "source.left and source.right belong together: name both";
            return Err(Error::Invalid(both.into()));
        }
        self.check_named(&key, Error::Invalid)
    }

    /// Checks the options of a single source.
    ///
    /// # Errors
    /// [`Error::Usage`] for options that contradict each other, and for an empty selection.
    pub fn check(&self) -> Result<()> {
        self.check_named(&flag, Error::Usage)
    }

    /// The fault, with the names of the options, as an error of that kind.
    fn check_named(&self, name: &dyn Fn(&str) -> String, wrong: fn(String) -> Error) -> Result<()> {
        let needs = |key, other| Err(wrong(format!("{} is for {}", name(key), name(other))));
        if self.truth_skew_ms.is_some() && self.truth.is_none() {
            return needs("truth_skew_ms", "truth");
        }
        if self.alpha.is_some() && self.calib.is_none() {
            return needs("alpha", "calib");
        }
        let outside = |value: Option<f64>, range: RangeInclusive<f64>| {
            let is_outside = value.is_some_and(|value| !range.contains(&value));
            is_outside.then_some(range)
        };
        let bits = f64::from(*BITS.start())..=f64::from(*BITS.end());
        for (key, outside) in [
            ("fps", outside(self.fps, FPS)),
            ("bits", outside(self.bits.map(f64::from), bits)),
            ("max_skew_ms", outside(self.max_skew_ms, SKEW_MS)),
            ("truth_skew_ms", outside(self.truth_skew_ms, SKEW_MS)),
            (
                "camera_height_m",
                outside(self.camera_height_m, FloorPlane::HEIGHTS_M),
            ),
            ("alpha", outside(self.alpha, 0.0..=1.0)),
        ] {
            if let Some(range) = outside {
                let (key, first, last) = (name(key), range.start(), range.end());
                return Err(wrong(format!("{key}: {first} to {last}")));
            }
        }
        let checked = self.range().validate();
        let checked = checked.and_then(|()| self.window().validate());
        checked.map_err(|error| wrong(error.to_string()))
    }

    /// Resolves paths relative to a folder: those of calibrations, data sets and algorithms, which
    /// then work from the working folder. Files are unchanged, as patterns are expanded below the
    /// folder.
    pub(super) fn rooted(mut self, folder: &Path) -> Self {
        self.calib = self
            .calib
            .map(|calib| calib_with_paths(&calib, |path| folder.join(path)));
        self.data = self.data.map(|data| folder.join(data));
        self
    }
}

/// The text of an algorithm from a file in `folder`, converted for the working folder: its files
/// are relative to `folder`, as are the words of a command that are files there.
pub(super) fn algorithm_of(text: &str, folder: &Path) -> String {
    let file = |path: &str| folder.join(path).display().to_string();
    let word = |word: &str| {
        if folder.join(word).is_file() {
            file(word)
        } else {
            word.to_owned()
        }
    };
    with_paths(text, &file, &word)
}

/// A `--calib` value with its paths replaced: two files are separated by a comma, and a chain has
/// its cameras behind it.
pub(super) fn calib_with_paths(calib: &str, replaced: impl Fn(&Path) -> PathBuf) -> String {
    match calib {
        "own" | "none" | "raw" => calib.to_owned(),
        files => {
            let (files, cameras) = files.split_at(files.find(":cam").unwrap_or(files.len()));
            let files = files.split(',').map(|file| replaced(Path::new(file)));
            let files: Vec<_> = files.map(|file| file.display().to_string()).collect();
            files.join(",") + cameras
        }
    }
}

/// The option for a key.
pub fn flag(key: &str) -> String {
    match key {
        "from_s" => "--from".to_owned(),
        "to_s" => "--to".to_owned(),
        "camera_height_m" => "--camera-height".to_owned(),
        key => format!("--{}", key.replace('_', "-")),
    }
}

/// Parses a number in a range.
pub fn within<N>(
    range: RangeInclusive<N>,
) -> impl Fn(&str) -> std::result::Result<N, String> + Clone + Send + Sync
where
    N: FromStr + PartialOrd + Display + Clone + Send + Sync,
{
    move |text| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("expected a number, {} to {}", range.start(), range.end()))
    }
}

fn crop(text: &str) -> std::result::Result<[usize; 4], String> {
    let sides = text.split(',').map(|side| side.trim().parse().ok());
    let sides = sides.collect::<Option<Vec<usize>>>();
    let sides = sides.and_then(|sides| sides.try_into().ok());
    sides.ok_or_else(|| "expected four numbers of pixels, X,Y,WIDTH,HEIGHT".to_owned())
}
