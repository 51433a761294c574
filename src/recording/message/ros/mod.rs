//! ROS messages that svl reads, of ROS 2 in little-endian CDR and of ROS 1, and that it writes, of
//! ROS 2.

pub(crate) mod message;
pub(crate) mod read;
pub(crate) mod result_message;
pub(crate) mod write;

pub use crate::results::ros_messages::result_messages;
pub use crate::results::scan::static_transforms;
pub(crate) use read::*;
pub(crate) use write::*;

/// The encoding of ROS 1's messages.
pub(crate) const ROS1: &str = "ros1";

/// OMG encapsulation header of little-endian CDR, with which a message of ROS 2 begins.
pub const CDR_LE: [u8; 4] = [0, 1, 0, 0];
