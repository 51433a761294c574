//! The published steps that the matchers are composed of.

mod blocks;
mod census;
mod check;
mod claims;
mod paths;
mod prefilter;
mod sad;
mod smoothing;
mod speckle;
mod ssd;
mod texture;

pub use blocks::Blocks;
pub use census::CostVolume;
pub use check::{SelfCheck, back_check};
pub use claims::Claims;
pub use paths::{Chosen, PathSums};
pub use prefilter::{Edges, Prefilter};
pub use sad::SadSearch;
pub use smoothing::VerticalSmoothing;
pub use speckle::Speckles;
pub use ssd::{BlockSearch, DisparityRange};
pub use texture::DogTexture;

use rayon::prelude::*;

/// Runs `work` on each row of `plane` with its number, on the threads of rayon's current pool, at least `together` rows
/// on one thread.
fn each_row<T: Send>(plane: &mut [T], width: usize, together: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    if rayon::current_num_threads() == 1 {
        plane.chunks_exact_mut(width).enumerate().for_each(|(y, row)| work(y, row));
    } else {
        plane.par_chunks_exact_mut(width).enumerate().with_min_len(together).for_each(|(y, row)| work(y, row));
    }
}
