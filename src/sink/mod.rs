//! Where frames and estimates go.

mod judge;
mod recording;
mod rerun;
mod rows;

pub use judge::{Findings, Judge};
pub use recording::RecordingSink;
pub use rerun::{
    BoardView, Edges, RerunSink, RerunTarget, RunInfo, VIEWER_HINT, save_recording_layout,
};
pub use rows::{Identity, RowSink};

use crate::error::Result;
use crate::stereo::{Estimate, Frame};

/// Takes every frame of a run with the estimates made of it.
pub trait Sink: Send {
    /// # Errors
    /// What keeps it from being kept. What was taken before stays readable.
    fn push(&mut self, frame: &Frame, estimates: &[Estimate]) -> Result<()>;

    /// Completes the output.
    ///
    /// # Errors
    /// As [`Sink::push`].
    fn finish(&mut self) -> Result<()>;
}
