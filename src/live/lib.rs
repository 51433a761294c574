//! Live ROS 2 topics over DDS.

pub mod dds;
