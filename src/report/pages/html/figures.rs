//! The figures of a report's page: frames, scenes, checkpoints, sweeps.

use super::replays::Replays;
use super::stored;
use super::timeline::{ShownFrame, Timeline};
use crate::results::gate::GateState;
use crate::results::summary::Results;
use crate::rows::held::Row;
use crate::rows::records::CellRow;
use crate::show::plot::map::CourseMap;
use crate::show::table::model::Table;
use serde::{Deserialize, Serialize};
use svl_files::overlay::Mark;
use svl_score::judge::CellFinding;
use svl_score::manifest::Manifest;

/// Everything the page shows.
pub struct ReportPage {
    /// The manifest, whose scenario is the title.
    pub manifest: Manifest,
    /// The scenario's prose; an empty line begins a paragraph.
    pub description: String,
    pub summary: Results,
    /// Per algorithm the time of each pair, ms.
    pub times_ms: Vec<(String, Vec<f64>)>,
    /// The results of the scenario's limits, if they were asked for, in words.
    pub gate: Vec<(GateState, String)>,
    pub sweeps: Vec<ParameterSweep>,
    /// One figure per checkpoint, or per frame that is shown of a recording.
    pub figures: Vec<CheckpointFigure>,
    /// Scenes, if the frames are those of a data set.
    pub scenes: Vec<SceneFigure>,
    /// The results over time.
    pub timeline: Timeline,
    /// The recordings, for commands that show their frames.
    pub replays: Replays,
    /// The results per scene or course.
    pub cases: Option<Table>,
    /// Courses that algorithms drove through.
    pub maps: Vec<CourseMap>,
    /// Names of the files beside the page.
    pub files: Vec<String>,
}

impl ReportPage {
    /// True for an algorithm of a sweep.
    pub(super) fn is_swept(&self, label: &str) -> bool {
        let mut points = self.sweeps.iter().flat_map(|sweep| &sweep.points);
        points.any(|(_, own)| own == label)
    }
}

/// The frames of the figures without a checkpoint.
pub(crate) fn shown_frames(figures: &[CheckpointFigure]) -> Vec<ShownFrame> {
    let figures = figures.iter().enumerate();
    let frames = figures.filter(|(_, own)| own.checkpoint.is_none());
    let frames = frames.flat_map(|(figure, own)| {
        own.shots.iter().map(move |(rank, shot)| ShownFrame {
            algorithm: shot.row.algorithm.clone(),
            run: shot.row.origin().run_name(),
            sequence: shot.row.sequence,
            rank: match rank {
                Rank::Failed(rank) => Some(*rank),
                _ => None,
            },
            figure,
        })
    });
    frames.collect()
}

/// Algorithms that differ in one parameter alone.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterSweep {
    /// Kind of algorithm.
    pub algorithm: String,
    pub parameter: String,
    /// Values of the parameter, ascending, and the algorithms' labels.
    pub points: Vec<(String, String)>,
}

/// A row of shots under one heading.
#[derive(Clone, Default, Serialize, Deserialize)]
pub struct CheckpointFigure {
    /// Number of the checkpoint; absent without one.
    pub checkpoint: Option<u32>,
    pub title: String,
    /// Numbers of the checkpoints that the frame shows.
    #[serde(default)]
    pub shows: Vec<u32>,
    /// Time of the frame in its recording, s; absent of checkpoints, drives, and frames without
    /// times.
    pub at_s: Option<f64>,
    /// True for successive frames of one drive.
    #[serde(default)]
    pub is_film: bool,
    /// Description, may be empty.
    pub about: String,
    pub shots: Vec<(Rank, FrameShot)>,
}

/// One frame through one algorithm: its overlay, beside it the truth's, and the disparities.
#[derive(Clone, Default, Serialize, Deserialize)]
pub struct FrameShot {
    #[serde(with = "stored::row")]
    pub row: Row,
    /// The frame's cells, of which the caption lists the wrong ones.
    #[serde(with = "stored::rows")]
    pub cells: Vec<CellRow>,
    /// True if the checkpoint passes in this frame; absent without a checkpoint.
    pub passed: Option<bool>,
    /// Reasons why the checkpoint fails, besides the findings.
    pub failures: Vec<String>,
    /// Cells that fail the checkpoint.
    pub findings: Vec<CellFinding>,
    /// The left image as a PNG or JPEG file. The page holds it once, however many shots show it.
    #[serde(with = "stored::image")]
    pub left: Vec<u8>,
    /// Width and height that the marks are made for, pixels.
    pub size: (usize, usize),
    pub estimate: Vec<Mark>,
    pub truth: Option<Vec<Mark>>,
    /// The disparities as colours, an image file likewise, if the map is at hand.
    #[serde(with = "stored::optional_image")]
    pub preview: Option<Vec<u8>>,
    /// The true disparities in the same colours, and the errors, if the frame has a truth.
    #[serde(with = "stored::optional_image")]
    pub true_preview: Option<Vec<u8>>,
    #[serde(with = "stored::optional_image")]
    pub errors: Option<Vec<u8>>,
}

/// A scene with the result of each algorithm. Pictures are PNG or JPEG files.
#[derive(Clone, Serialize, Deserialize)]
pub struct SceneFigure {
    pub title: String,
    /// Width and height of the scene, to whose proportions the pictures are.
    pub size: (usize, usize),
    #[serde(with = "stored::image")]
    pub left: Vec<u8>,
    /// The disparity at the end of the colours' scale, which truth and algorithms share, pixels.
    pub max_px: f64,
    #[serde(with = "stored::optional_image")]
    pub truth: Option<Vec<u8>>,
    pub shots: Vec<SceneResult>,
}

/// A scene through one algorithm.
#[derive(Clone, Serialize, Deserialize)]
pub struct SceneResult {
    #[serde(with = "stored::row")]
    pub row: Row,
    #[serde(with = "stored::image")]
    pub disparities: Vec<u8>,
    #[serde(with = "stored::optional_image")]
    pub errors: Option<Vec<u8>>,
}

/// Place of a frame among those of its figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rank {
    Worst,
    Best,
    /// One of the frames spread over a recording.
    Sample,
    /// One of the worst frames of its algorithm, from 1, the worst, on.
    Failed(usize),
}
