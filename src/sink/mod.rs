//! Where frames and estimates go.

mod checkpoints;
mod pictures;
mod recording;
mod rerun;
mod table;

pub use checkpoints::CheckpointSink;
pub use pictures::{PictureSink, ReportPictures};
pub use recording::RecordingSink;
pub use rerun::{BoardView, RerunSink, RerunTarget, RunInfo, VIEWER_HINT, save_recording_layout};
pub use table::TableSink;

use crate::error::Result;
use crate::manifest::Manifest;
use crate::score::{Judge, Judged};
use crate::stereo::Losses;
use std::sync::{Arc, Mutex, PoisonError};

/// Takes the frames of one run after the other.
pub trait Sink: Send {
    /// A run begins.
    ///
    /// # Errors
    /// As [`Sink::take`].
    fn begin_run(&mut self, _: &RunStart<'_>) -> Result<()> {
        Ok(())
    }

    /// Takes a frame with its scored estimates.
    ///
    /// # Errors
    /// What keeps it from being kept. What was taken before stays readable.
    fn take(&mut self, judged: &Judged) -> Result<()>;

    /// The run is over, complete or not.
    ///
    /// # Errors
    /// As [`Sink::take`].
    fn end_run(&mut self, _: &RunEnd<'_>) -> Result<()> {
        Ok(())
    }

    /// Completes the output, after the last run.
    ///
    /// # Errors
    /// As [`Sink::take`].
    fn finish(self: Box<Self>) -> Result<()>;
}

/// What holds for a run.
#[derive(Clone, Copy)]
pub struct RunStart<'a> {
    pub manifest: &'a Manifest,
    /// Seed of the arena's run.
    pub seed: Option<u64>,
    pub judge: &'a Judge,
}

/// How a run ended.
#[derive(Clone, Copy)]
pub struct RunEnd<'a> {
    /// What of the source is in no frame.
    pub losses: &'a Losses,
    /// Why the run ended before its end.
    pub error: Option<&'a str>,
}

/// Finishes all sinks in their order, also after one that fails.
///
/// # Errors
/// The first of them.
pub fn finish(sinks: Vec<Box<dyn Sink>>) -> Result<()> {
    sinks
        .into_iter()
        .map(Sink::finish)
        .fold(Ok(()), Result::and)
}

/// What a sink leaves when it is finished, for its maker and for the sinks that finish after it.
pub struct Outbox<T>(Arc<Mutex<Option<T>>>);

impl<T> Default for Outbox<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T> Clone for Outbox<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Outbox<T> {
    /// Leaves the value, for who holds a copy of the outbox.
    pub fn put(&self, value: T) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(value);
    }

    /// Looks at what was left; nothing before the sink is finished.
    pub fn with<R>(&self, look: impl FnOnce(Option<&T>) -> R) -> R {
        look(
            self.0
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .as_ref(),
        )
    }

    /// Takes what was left.
    pub fn take(&self) -> Option<T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}
