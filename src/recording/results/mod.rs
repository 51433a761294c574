//! Results of algorithms, as svl records them and as ROS 2 messages.

pub(crate) mod cells;
pub(crate) mod result;
pub(crate) mod ros_messages;
pub(crate) mod scan;
