//! Rectification: from the pictures of two cameras to pairs whose rows agree (thesis, section 2.3).

mod alignment;
mod bouguet;
mod epipolar;
mod features;
mod framing;
mod rectifier;
mod remap;
mod uncalibrated;
mod view;

pub use alignment::{Alignment, AlignmentMeter};
pub use bouguet::bouguet;
pub use epipolar::Epipolar;
pub use features::{Match, matches};
pub use framing::Framing;
pub use rectifier::Rectifier;
pub use remap::Remap;
pub use uncalibrated::{Homographies, uncalibrated};
