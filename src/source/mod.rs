//! Where frames come from.

mod arena;
mod board;
pub mod dataset;
mod limited;
mod live;
mod recording;
mod rectified;
mod watched;

pub use arena::ArenaSource;
pub use board::BoardSource;
pub use limited::Limited;
pub use live::{LastTally, LiveSource};
pub use recording::RecordingSource;
pub use rectified::RectifiedSource;
pub use watched::Watched;

use crate::error::Result;
use crate::stereo::Frame;

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

    /// What was left out so far.
    fn left_out(&self) -> LeftOut {
        LeftOut::default()
    }
}

/// What of a source is in no frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Images that found no partner.
    pub unpaired: u64,
    /// Images that came when those of their time had been given up, as the file is not in the order
    /// of their times.
    pub late: u64,
    /// Pairs that cannot be read.
    pub unreadable: u64,
}
