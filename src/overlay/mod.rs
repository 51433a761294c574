//! The thesis's picture of a depth grid (figure 7.3): on the left image, in every cell a red square as large as what it
//! shows is near, and a red dot where nothing is known. svl adds the cell's 20th percentile in yellow and its 80th in
//! violet.
//!
//! [`marks`] is the geometry; the HTML report draws it as SVG and the Rerun sink as boxes.

mod geometry;
mod preview;

pub use geometry::{Mark, NEAR_M, Nearness, Rect, Squares, marks, squares};
pub use preview::{preview, viridis};
