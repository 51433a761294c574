//! The images of a pair before they are decoded.

use crate::decode::pixels::MessageImage;
use crate::message::MessageResult;

/// An image that waits for its partner.
pub(crate) enum PairImage {
    Image(MessageImage),
    /// The picture of a video's message with that number.
    Picture(u64),
}

/// An image, or the reason why it cannot be read.
pub(crate) type ReadImage = MessageResult<PairImage>;

/// The images of a pair, left and right, with their stamps.
pub(crate) type PairImages = [(u64, ReadImage); 2];
