//! A message of a result, and the choices of its user.

use crate::message::wire::Encoded;

/// A message of a result.
pub struct ResultMessage {
    /// Last part of the topic's name; the whole name if it begins with `/`.
    pub topic: &'static str,
    pub(crate) message: Encoded,
}

impl ResultMessage {
    /// Type of the message, as in a bag: `sensor_msgs/msg/PointCloud2`.
    pub fn schema(&self) -> &'static str {
        self.message.schema
    }

    /// In CDR, with its encapsulation header.
    pub fn into_data(self) -> Vec<u8> {
        self.message.data
    }
}

/// The choices of a user of the messages.
#[derive(Clone, Debug)]
pub struct ResultOptions {
    /// The optical frame of the left camera.
    pub frame_id: String,
    /// Height of the camera above the floor, metres; without it the scan has only cells at the
    /// camera's height or above.
    pub camera_height_m: Option<f64>,
    /// Distance in the scan of cells with something near and no distance of their own; without it
    /// they are unknown.
    pub near_m: Option<f64>,
    /// True for a cloud of pixels in place of cells.
    pub dense: bool,
}

impl ResultOptions {
    /// The messages as they are without any choice.
    pub fn new(frame_id: &str) -> Self {
        Self {
            frame_id: frame_id.to_owned(),
            camera_height_m: None,
            near_m: None,
            dense: false,
        }
    }
}
