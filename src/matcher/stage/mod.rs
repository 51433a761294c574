//! The published steps that the matchers of the thesis are composed of.

mod check;
mod smoothing;
mod ssd;
mod texture;

pub use check::{SelfCheck, back_check};
pub use smoothing::VerticalSmoothing;
pub use ssd::{BlockSearch, DisparityRange};
pub use texture::DogTexture;

use rayon::prelude::*;

/// Runs `work` on each row of `plane` with its number, on the threads of rayon's current pool.
fn each_row<T: Send>(plane: &mut [T], width: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    if rayon::current_num_threads() == 1 {
        plane.chunks_exact_mut(width).enumerate().for_each(|(y, row)| work(y, row));
    } else {
        plane.par_chunks_exact_mut(width).enumerate().with_min_len(8).for_each(|(y, row)| work(y, row));
    }
}

/// Into how many bands of rows an image of `height` rows is cut, each with its own scratch: a few per thread, so that
/// a thread that finishes early finds more to do.
pub(crate) fn bands(height: usize) -> usize {
    match rayon::current_num_threads() {
        1 => 1,
        threads => height.min(4 * threads),
    }
}
