//! A source of frames.

pub(crate) mod frames;
pub(crate) mod inputs;
pub(crate) mod layers;
pub(crate) mod live;
pub(crate) mod open;
pub(crate) mod opened;

pub use frames::Source;
pub use inputs::arena::ArenaSource;
pub use inputs::board::BoardSource;
pub use inputs::cameras::CameraSource;
pub use inputs::dataset;
pub use inputs::folder::map_files::MapFiles;
pub use inputs::folder::pairs::FolderRequest;
pub use inputs::folder::source::FolderSource;
pub use inputs::recording::RecordingSource;
pub use inputs::video::source::VideoSource;
pub use layers::alignment_monitor::{AlignmentMonitor, PairAlignment, only_pair};
pub use layers::board_truth::{BoardScale, RigScale};
pub use layers::chain::Chain;
pub use layers::distinct::OnePicture;
pub(crate) use layers::floored::ToldFloor;
pub use layers::limited::FirstPairs;
pub(crate) use layers::measured::{SourceMaps, refuse_topics};
pub use layers::registered::{PairRegister, Registration};
pub use layers::stressed::Perturbation;
#[cfg(not(feature = "ros2"))]
pub(crate) use live::live_topics::without_ros2;
pub use live::live_topics::{Listen, LiveTopics};
pub use open::facts::{NearestDistance, SourceFacts, TruthFacts};
pub use open::run_source::{RunSource, run_request};
pub use open::sources::{
    SOURCES, SourceKind, SourceOrigin, expected, open, open_arena, open_pair, open_recording,
};
pub use open::usability::Usability;
pub use opened::calibration::{Calib, CalibrationFiles};
pub use opened::open_source::{Heard, Opened};
pub use opened::request::Request;
