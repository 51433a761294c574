//! The metadata record `svl`: the origin of a recording.

use mcap::records::Metadata;
use svl_files::BuildInfo;

/// Name of the metadata record.
pub(crate) const RECORD: &str = "svl";

/// The metadata record `svl`: the svl that wrote the recording, and the source of its frames.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Header {
    /// Version of svl that wrote it.
    pub version: String,
    /// Git revision of that svl, if its build knew it.
    pub git_revision: Option<String>,
    /// Cargo profile of that build, if known.
    pub profile: Option<String>,
    /// Origin of the frames, e.g. `arena` or a folder.
    pub source: String,
    /// Name of the scenario.
    pub scenario: Option<String>,
    pub seed: Option<u64>,
    /// Basis of svl's rectification of the pairs, if any: the name of the attached calibration
    /// file, or a description.
    pub calibration: Option<String>,
    /// Other omissions or changes by svl, in words: pairs, parts of images.
    pub changes: Option<String>,
    /// Hash of everything that determines the frames. Recordings with equal hashes contain frames
    /// of the same simulated run, all or some.
    pub hash: Option<String>,
    /// Origin of the stamps, if not the cameras.
    pub stamps: Option<StampOrigin>,
    /// Number of bits used in the 16-bit images from which the pairs were made.
    pub bits: Option<u8>,
    /// Coordinate frame of the left images, if the source names one.
    pub frame_id: Option<String>,
    /// Height of the level camera above the floor, metres, if the source knows it.
    pub camera_height_m: Option<f64>,
}

impl Header {
    /// Scenario and seed of a simulated run: `arena seed 4`.
    pub fn simulated(&self) -> Option<String> {
        let (scenario, seed) = (self.scenario.as_ref()?, self.seed?);
        Some(format!("{scenario} seed {seed}"))
    }
}

/// Origin of the stamps of a source without stamps, with pairs per second. The skew is then
/// unknown.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum StampOrigin {
    /// Specified by the user.
    Given(f64),
    /// Unknown: a placeholder for an unknown rate.
    Nominal(f64),
}

impl StampOrigin {
    /// Stamps of pairs whose times are unknown: so far apart that none is the past of another.
    pub const UNKNOWN: Self = Self::Nominal(0.5);

    /// The stamp of pair `number`, from 0.
    pub fn stamp_ns(&self, number: u64) -> u64 {
        let (Self::Given(hz) | Self::Nominal(hz)) = self;
        (number as f64 / hz * 1e9).round() as u64
    }

    /// Note on rates and skews for the user.
    pub fn note(&self) -> Option<String> {
        match self {
            Self::Given(_) => None,
            Self::Nominal(hz) => Some(format!(
                "has no stamps: rate and skew are unknown, and {hz} pairs per second are assumed; \
                 --fps sets the rate"
            )),
        }
    }

    fn to_field(self) -> String {
        match self {
            Self::Given(hz) => format!("given {hz} Hz"),
            Self::Nominal(hz) => format!("nominal {hz} Hz"),
        }
    }

    fn from_field(text: &str) -> Option<Self> {
        let (kind, hz) = text.strip_suffix(" Hz")?.split_once(' ')?;
        let hz = hz.parse().ok().filter(|hz: &f64| hz.is_finite())?;
        match kind {
            "given" => Some(Self::Given(hz)),
            "nominal" => Some(Self::Nominal(hz)),
            _ => None,
        }
    }
}

impl Header {
    /// A header of this svl for frames from `source`.
    pub fn new(source: impl Into<String>) -> Self {
        let build = BuildInfo::current();
        Self {
            version: build.version.to_owned(),
            git_revision: build.git_revision.map(str::to_owned),
            profile: build.profile.map(str::to_owned),
            source: source.into(),
            ..Self::default()
        }
    }

    pub(crate) fn to_record(&self) -> Metadata {
        let fields = [
            ("version", Some(self.version.clone())),
            ("git_revision", self.git_revision.clone()),
            ("profile", self.profile.clone()),
            ("source", Some(self.source.clone())),
            ("scenario", self.scenario.clone()),
            ("seed", self.seed.map(|seed| seed.to_string())),
            ("calibration", self.calibration.clone()),
            ("changes", self.changes.clone()),
            ("hash", self.hash.clone()),
            ("stamps", self.stamps.map(StampOrigin::to_field)),
            ("bits", self.bits.map(|bits| bits.to_string())),
            ("frame_id", self.frame_id.clone()),
            (
                "camera_height_m",
                self.camera_height_m.map(|height_m| height_m.to_string()),
            ),
        ];
        let metadata = fields
            .into_iter()
            .filter_map(|(key, value)| Some((key.to_owned(), value?)))
            .collect();
        Metadata {
            name: RECORD.to_owned(),
            metadata,
        }
    }

    /// The header in a metadata record, if the record is named `svl`.
    pub(crate) fn from_record(Metadata { name, metadata }: &Metadata) -> Option<Self> {
        let field = |key: &str| metadata.get(key).cloned();
        (name == RECORD).then(|| Self {
            version: field("version").unwrap_or_default(),
            git_revision: field("git_revision"),
            profile: field("profile"),
            source: field("source").unwrap_or_default(),
            scenario: field("scenario"),
            // A seed that is not a number is damage in a text field; the rest of the header is
            // still valid.
            seed: field("seed").and_then(|seed| seed.parse().ok()),
            calibration: field("calibration"),
            changes: field("changes"),
            hash: field("hash"),
            stamps: field("stamps").and_then(|text| StampOrigin::from_field(&text)),
            bits: field("bits").and_then(|bits| bits.parse().ok()),
            frame_id: field("frame_id"),
            camera_height_m: field("camera_height_m").and_then(|height_m| height_m.parse().ok()),
        })
    }
}
