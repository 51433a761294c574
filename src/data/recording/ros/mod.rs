//! ROS messages that svl reads, of ROS 2 in little-endian CDR and of ROS 1, and that it writes, of
//! ROS 2.

mod message;
mod read;
mod results;
mod write;

pub(super) use read::*;
pub use results::{LiveMessage, diagnostics, result_messages};
pub(super) use write::*;

/// The encoding of ROS 1's messages.
pub(super) const ROS1: &str = "ros1";

/// OMG encapsulation header of little-endian CDR.
const CDR_LE: [u8; 4] = [0, 1, 0, 0];
