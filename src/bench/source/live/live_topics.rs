//! Live topics in the table of sources, also of an svl that was built without them.

use crate::source::opened::open_source::{Heard, Opened};
use crate::source::opened::request::Request;
use svl_core::Result;

/// Options that they accept.
pub(crate) const OPTIONS: &[&str] = &[
    "left",
    "right",
    "left_info",
    "right_info",
    "bits",
    "max_skew_ms",
    "stamps",
    "right_offset_ms",
    "queue",
    "when_full",
    "camera_height_m",
];

/// Listens at the named topics; the second argument is true once it shall stop.
pub type Listen = fn(&str, fn() -> bool) -> Result<Heard>;

/// Topics of a network, as an entry of the sources.
pub struct LiveTopics {
    /// Beginning of their names, for completion scripts.
    pub prefix: &'static str,
    /// Listens for some seconds, to say what there is, unless it is stopped.
    ///
    /// # Errors
    /// [`svl_core::Error::Other`] if nothing is published, and those of the network.
    pub listen: Listen,
}

pub(crate) fn open(request: &Request<'_>) -> Result<Opened> {
    #[cfg(feature = "ros2")]
    {
        super::ros2::open(request)
    }
    #[cfg(not(feature = "ros2"))]
    Err(without_ros2(request.name))
}

pub(crate) fn listen(name: &str, stopped: fn() -> bool) -> Result<Heard> {
    #[cfg(feature = "ros2")]
    {
        super::ros2::listen(name, stopped)
    }
    #[cfg(not(feature = "ros2"))]
    {
        let _ = stopped;
        Err(without_ros2(name))
    }
}

/// The cure of an svl that was built without live topics.
pub(crate) const CURE: Option<&str> = if cfg!(feature = "ros2") {
    None
} else {
    Some("`cargo install --locked --path . --features ros2` adds it")
};

/// The error of an svl that was built without ROS 2.
#[cfg(not(feature = "ros2"))]
pub(crate) fn without_ros2(name: &str) -> svl_core::Error {
    let cure = CURE.unwrap_or_default();
    let name = name.trim_end_matches(':');
    svl_core::Error::Invalid(format!("{name}: this svl was built without ROS 2; {cure}"))
}
