//! Rectification: from the pictures of two cameras to pairs whose rows agree (thesis, section 2.3).

mod bouguet;
mod framing;
mod rectifier;
mod remap;
mod view;

pub use bouguet::bouguet;
pub use framing::Framing;
pub use rectifier::Rectifier;
pub use remap::Remap;
