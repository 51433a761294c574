//! Live ROS 2 topics, over DDS or a Foxglove bridge.

pub mod bridge;
pub mod dds;
