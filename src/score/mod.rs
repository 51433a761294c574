//! Judgements: disparities and cells against truth, checkpoints over runs.

mod cells;
mod checkpoint;
mod disparity;

pub use cells::{CellJudgement, CellRule, CellTally, Verdict, judge_cells, true_grid};
pub use checkpoint::{Checkpoint, CheckpointFrame, CheckpointTally};
pub use disparity::DisparityScore;
