//! Scores: disparities and cells against truth, checkpoints over runs, and the benchmarks' metric
//! protocols.

mod area;
mod cells;
mod checkpoint;
mod columns;
mod disparity;
mod filtered;
mod judged;
mod measured;
mod metrics;
mod piece;
pub mod protocol;
pub mod signs;
mod sparse;
mod truth;
mod way;

pub use area::{AreaChoice, CellArea};
pub use cells::{
    CellJudgement, CellTallies, CellTally, NearJudgement, Verdict, is_right, judge_cells,
};
pub use checkpoint::{
    CellExpectation, CellFinding, Checkpoint, CheckpointFault, CheckpointFrame, CheckpointPlace,
    CheckpointTally, ExpectedCell, FrameOrigin, LabelledPair,
};
pub use columns::ColumnChoice;
pub use disparity::DisparityScore;
pub use filtered::FilterTally;
pub use judged::{Judge, Judged, JudgedEstimate, MatchFailure};
pub use measured::{CaseKind, Cases, Measured, Minimum};
pub use metrics::{
    Better, CellNumber, DriveNumber, EstimatedNumber, FrameFacts, METRICS, Metric, MetricFault,
    MetricLevel, MetricOrigin, MetricSource, MetricTotal, MetricUnit, MetricValues, PLACES,
    TruthLevel,
};
pub use piece::{PieceConfig, PieceSight, PieceView, TestPiece, size_words};
pub use truth::{CellTruth, NearTruth, TrueCells};
pub use way::{BodyPose, DrivenWay, RobotSize, WayBounds};
