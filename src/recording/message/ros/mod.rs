//! ROS messages that svl reads, of ROS 2 in little-endian CDR and of ROS 1, and that it writes, of
//! ROS 2.

pub(crate) mod message;
pub(crate) mod read;
pub(crate) mod result_message;
pub(crate) mod write;

pub(crate) use read::*;
pub(crate) use write::*;
