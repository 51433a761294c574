//! Overlays on images: the depth grid, error maps, previews of disparities, corners of boards.
//!
//! The thesis's overlay of a depth grid (figure 7.3) has a square in every known cell, the larger
//! the nearer its content, and a dot in an unknown one, both in red; here they are green and grey,
//! as red is what is wrong. svl adds the cell's 20th percentile in yellow and its 80th in violet.
//! [`marks`] is the geometry; the HTML report draws it as SVG and the Rerun sink as boxes.

mod codes;
mod colors;
mod corners;
pub mod errors;
mod geometry;
mod picture;
mod preview;

pub use codes::{
    CODES_PER_LN, CODES_PER_PX, depth_codes, disparity_codes, lowest_disparity, no_depth_classes,
    reason_classes, sparse_disparities, ssdpi_codes,
};
pub use colors::{
    COLOR_COUNT, REFERENCE_COLOR, algorithm_colors, kind_of_label, parameter_color, plot_color,
};
pub use corners::corners_drawn;
pub use geometry::{Mark, NEAR_M, Nearness, Rect, Squares, marks, squares};
pub use picture::Picture;
pub use preview::{ColorEnd, NO_DISPARITY, color_end, disparities, preview, viridis};
