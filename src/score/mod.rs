//! Judgements: disparities and cells against truth, checkpoints over runs.

mod cells;
mod checkpoint;
mod disparity;

pub use cells::{CellJudgement, CellRule, CellTally, TrueGrid, Verdict};
pub use checkpoint::{Checkpoint, CheckpointFrame, CheckpointTally};
pub use disparity::DisparityScore;
