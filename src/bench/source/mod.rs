//! Where frames come from.

mod alignment_monitor;
mod arena;
mod board;
mod calibration;
pub mod dataset;
mod folder;
mod limited;
mod live;
mod measured;
mod open;
mod recording;
mod rectified;
mod reference;
mod resized;
mod runs;
mod stressed;
mod video;

pub use alignment_monitor::AlignmentMonitor;
pub use arena::ArenaSource;
pub use board::BoardSource;
pub use calibration::{Calib, CalibrationFiles};
pub use folder::{FolderRequest, FolderSource};
pub use limited::Limited;
pub use live::LiveSource;
pub use measured::MeasuredSource;
pub use open::{
    CAMERAS, Opened, Request, SOURCES, SourceKind, SourceOption, expected, open, open_arena,
    open_recording,
};
pub use recording::RecordingSource;
pub use rectified::{AssumeRectified, RectifiedSource};
pub use reference::ReferenceSource;
pub use resized::Resized;
pub use runs::{RunSource, run_request};
pub use stressed::StressedSource;
pub use video::VideoSource;

use svl_core::Result;
use svl_core::stereo::{Frame, Losses};
use svl_data::score::Judged;

/// A sequence of frames, pulled one by one.
pub trait Source: Send {
    /// One word or two for a person: what is being read.
    fn name(&self) -> String;

    /// The next frame, or nothing at the end.
    ///
    /// # Errors
    /// What keeps the next frame from being read. The source may be asked again unless the error
    /// says the file is damaged.
    fn next(&mut self) -> Result<Option<Frame>>;

    /// How many frames there are in all, where that is known.
    fn pairs(&self) -> Option<u64>;

    /// Makes the source give the frame at `index`, counted from 0, next. False where it can only
    /// read on: it gives then what it would have given.
    ///
    /// # Errors
    /// As [`Source::next`].
    fn seek(&mut self, _index: u64) -> Result<bool> {
        Ok(false)
    }

    /// Ends the source and says what of it is in no frame. `taken`: frames that were used.
    fn finish(&mut self, _taken: u64) -> Losses {
        Losses::default()
    }

    /// Whether the next frame depends on what the algorithms made of the last one.
    fn listens(&self) -> bool {
        false
    }

    /// Hears what was made of the frame given out last; only a source that listens is asked.
    fn hear(&mut self, _: &Judged) {}
}
