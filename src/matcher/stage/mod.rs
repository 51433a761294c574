//! The published steps that the matchers are composed of.

mod blocks;
mod census;
mod check;
mod claims;
mod costs;
mod deviation;
mod filter;
mod paths;
mod prefilter;
mod sad;
mod scanline;
mod smoothing;
mod speckle;
mod spread;
mod ssd;
mod strip;
mod subpixel;
mod symmetry;
mod texture;

pub use blocks::Blocks;
pub use census::CostVolume;
pub use check::{BACK_CHECK, SelfCheck, back_check};
pub use claims::Claims;
pub use costs::CostSearch;
pub use deviation::DeviationTexture;
pub use filter::{CostFilter, ErrorFilter, SpreadFilter};
pub use paths::{Chosen, PathSums};
pub use prefilter::{Edges, Prefilter};
pub use sad::SadSearch;
pub use scanline::{PathCosts, Scanlines};
pub use smoothing::VerticalSmoothing;
pub use speckle::Speckles;
pub use spread::{Spread, SpreadPixel, bridge};
pub use ssd::{BlockSearch, DisparityRange};
pub use strip::{Bands, Strip};
pub use subpixel::{SUBPIXEL, refine};
pub use symmetry::SymmetricCheck;
pub use texture::DogTexture;

use rayon::prelude::*;

/// Runs `work` on each row of `plane` with its number, on the threads of rayon's current pool, at
/// least `together` rows on one thread.
pub(super) fn each_row<T: Send>(
    plane: &mut [T],
    width: usize,
    together: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    if rayon::current_num_threads() == 1 {
        plane
            .chunks_exact_mut(width)
            .enumerate()
            .for_each(|(y, row)| work(y, row));
    } else {
        plane
            .par_chunks_exact_mut(width)
            .enumerate()
            .with_min_len(together)
            .for_each(|(y, row)| work(y, row));
    }
}

/// Runs `work` on bands of `plane`, of `pixels` each, with their number and one element of
/// `scratch`, on the threads of rayon's current pool.
pub(super) fn each_band<T: Send, S: Send>(
    plane: &mut [T],
    pixels: usize,
    scratch: &mut [S],
    work: impl Fn(usize, &mut [T], &mut S) + Sync,
) {
    let work = |(band, (plane, scratch)): (usize, (&mut [T], &mut S))| work(band, plane, scratch);
    if rayon::current_num_threads() == 1 {
        plane
            .chunks_mut(pixels)
            .zip(scratch)
            .enumerate()
            .for_each(work);
    } else {
        plane
            .par_chunks_mut(pixels)
            .zip(scratch)
            .enumerate()
            .for_each(work);
    }
}

/// Runs both, at the same time where rayon's current pool has threads for it.
pub(super) fn both(a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    if rayon::current_num_threads() == 1 {
        a();
        b();
    } else {
        rayon::join(a, b);
    }
}
