//! `index.html`: one file that fetches nothing and is readable without its script.

pub(crate) mod figures;
pub(crate) mod frames;
pub(crate) mod heat;
pub(crate) mod plots;
pub(crate) mod replays;
pub(crate) mod report_page;
pub(crate) mod scenes;
pub(crate) mod shades;
pub(crate) mod stored;
pub(crate) mod timeline;
pub(crate) mod view;

pub use figures::{
    CheckpointFigure, FrameShot, ParameterSweep, Rank, ReportPage, SceneFigure, SceneResult,
};
pub use replays::Replays;
pub use timeline::WorstSecond;
