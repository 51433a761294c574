//! The thesis's picture of a depth grid (figure 7.3): on the left image, in every cell a red square
//! as large as what it shows is near, and a red dot where nothing is known. svl adds the cell's
//! 20th percentile in yellow and its 80th in violet.
//!
//! [`marks`] is the geometry; the HTML report draws it as SVG and the Rerun sink as boxes.

mod corners;
pub mod errors;
mod geometry;
mod picture;
mod preview;

pub use corners::corners_drawn;
pub use geometry::{Mark, NEAR_M, Nearness, Rect, Squares, marks, squares};
pub use picture::Picture;
pub use preview::{disparities, preview, viridis};
