//! The messages of svl's recordings and of ROS, as bytes and as types.

pub(crate) mod geometry;
pub(crate) mod images;
pub(crate) mod message_error;
pub(crate) mod ros;
pub(crate) mod sync;
pub(crate) mod wire;

pub(crate) use message_error::{MessageError, MessageResult};
