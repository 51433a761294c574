//! ROS messages that svl reads, of ROS 2 in little-endian CDR and of ROS 1, and that it writes, of
//! ROS 2.

mod message;
mod read;
mod result_message;
mod results;
mod scan;
mod write;

pub(super) use read::*;
pub use result_message::{ResultMessage, ResultOptions};
pub use results::{diagnostics, result_messages};
pub(crate) use scan::FLOOR_FRAME;
pub use scan::static_transforms;
pub(super) use write::*;

/// The encoding of ROS 1's messages.
pub(super) const ROS1: &str = "ros1";

/// OMG encapsulation header of little-endian CDR, with which a message of ROS 2 begins.
pub const CDR_LE: [u8; 4] = [0, 1, 0, 0];
