//! Judgements: disparities and cells against truth, checkpoints over runs, and the benchmarks'
//! metric protocols.

mod cells;
mod checkpoint;
mod disparity;
mod judge;
mod metrics;
pub mod protocol;

pub use cells::{CellJudgement, CellTally, Verdict, judge_cells, true_grid};
pub use checkpoint::{
    CellExpectation, CellFinding, Checkpoint, CheckpointFrame, CheckpointPlace, CheckpointTally,
    ExpectedCell, RunPart,
};
pub use disparity::DisparityScore;
pub use judge::{Judge, Judged, JudgedEstimate};
pub use metrics::{
    Better, FrameFacts, METRICS, Metric, MetricOrigin, MetricTotal, MetricUnit, MetricValues,
};
