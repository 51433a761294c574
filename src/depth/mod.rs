//! From disparity to the grid of depths and to distance (thesis, section 5.1 and annex B).

mod curve;
mod grid;
mod pinhole;

pub use curve::DistanceCurve;
pub use grid::{MIN_VALID, grid};
pub use pinhole::PinholeFit;

/// The median of at least one value; of an even number the mean of the two in the middle.
///
/// # Panics
/// Without values.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let (below, above) = ((values.len() - 1) / 2, values.len() / 2);
    0.5 * (values[below] + values[above])
}
