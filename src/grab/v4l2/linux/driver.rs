//! What a camera asks of its driver: the seam at which tests put one that misbehaves.

use super::control::Range;
use super::stamp::Stamp;
use rustix::io::Errno;
use std::time::Duration;

/// A driver whose stream runs.
pub(super) trait Driver: Send {
    /// What a control can be set to, if the camera has it.
    fn range(&self, control: u32) -> Option<Range>;

    /// Sets a control, and says to what: a driver takes the nearest that it has.
    ///
    /// # Errors
    /// The driver's.
    fn set(&mut self, control: u32, value: i32) -> Result<i32, Errno>;

    /// Waits for the next filled buffer, and lets it be read before the driver fills it again.
    /// Nothing when none came.
    ///
    /// # Errors
    /// [`Fault`].
    fn next<T>(
        &mut self,
        patience: Duration,
        read: impl FnOnce(&[u8], Stamp) -> T,
    ) -> Result<Option<T>, Fault>;
}

/// What can go wrong with a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// One buffer is none; the next may be whole.
    Buffer(&'static str),
    /// There will be no other.
    Stream(Errno),
}
