//! Sources that run now: ROS 2 topics.

pub(crate) mod live_topics;
#[cfg(feature = "ros2")]
pub(crate) mod ros2;
