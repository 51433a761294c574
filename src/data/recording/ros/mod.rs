//! ROS 2 messages that svl reads and writes, in little-endian CDR.

mod read;
mod results;
mod write;

pub(super) use read::*;
pub use results::{LiveMessage, diagnostics, result_messages};
pub(super) use write::*;

/// OMG encapsulation header of little-endian CDR.
const CDR_LE: [u8; 4] = [0, 1, 0, 0];
