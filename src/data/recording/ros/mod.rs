//! ROS 2 messages that svl reads and writes, in little-endian CDR.

mod message;
mod read;
mod results;
mod scan;
mod write;

pub use message::{ResultMessage, ResultOptions};
pub(super) use read::*;
pub use results::{diagnostics, result_messages};
pub use scan::scan_transform;
pub(super) use write::*;

/// OMG encapsulation header of little-endian CDR.
const CDR_LE: [u8; 4] = [0, 1, 0, 0];
