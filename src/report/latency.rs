//! Delays of the topics that maps are read from, as a run knows them.

use serde::{Deserialize, Serialize};

/// Log time minus stamp of a topic's messages and of the left images: transport and processing on
/// the robot, not time of matching.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TopicDelay {
    pub topic: String,
    /// Name of the recording.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// Median and 99th percentile, by nearest rank; none without stamps.
    pub topic_ms: Option<[f64; 2]>,
    pub images_ms: Option<[f64; 2]>,
}
