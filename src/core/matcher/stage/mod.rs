//! The published stages that the matchers are composed of.

mod aggregation;
mod blocks;
mod census;
mod check;
mod consistency;
mod costs;
mod prefilter;
mod propagation;
mod sad;
mod scanline;
mod smoothing;
mod speckle;
mod ssd;
mod strip;
mod subpixel;
mod symmetry;
mod texture;

pub use aggregation::{Aggregation, Chosen};
pub use blocks::Blocks;
pub use census::CostVolume;
pub use check::{BACK_CHECK, SelfCheck, back_check};
pub use consistency::OnePassCheck;
pub use costs::{CostFilter, CostSearch};
pub use prefilter::{EdgeImage, Prefilter};
pub use propagation::{Propagation, PropagationPixel, bridge};
pub use sad::SadSearch;
pub use scanline::{PathCosts, Scanlines};
pub use smoothing::VerticalSmoothing;
pub use speckle::Speckles;
pub use ssd::{BlockSearch, DisparityRange};
pub use strip::{Bands, Strip};
pub use subpixel::{SUBPIXEL, refine};
pub use symmetry::SymmetricCheck;
pub use texture::{DeviationTexture, DogTexture, TextureFilter};

use crate::kernel::{Isa, Lanes};
use crate::matcher::{Parameter, Range};
use crate::stereo::{Plane, RowMut};
use rayon::prelude::*;

/// The uniqueness ratio, as a parameter of the matchers.
pub const fn uniqueness(default: i32) -> Parameter {
    Parameter {
        name: "uniqueness",
        unit: "%",
        range: Range::int(default, 0..=100),
        description: "by how much every other disparity must be worse, 0 = not tested",
    }
}

/// Finds the matches of a block of rows, which are the lanes of its columns. It holds one thread's
/// scratch.
pub trait RowSearch: Send + 'static {
    /// Matches the first `rows` of a block of the left image with the same rows of the right one.
    fn search(&mut self, isa: Isa, left: &[Lanes<u16>], right: &[Lanes<u16>], rows: usize);

    /// Writes the winners of the row `lane` of the block, whose pixels are `pair`: *border* if no
    /// disparity is admissible, *untextured* where `textured` is false.
    fn write_row(
        &self,
        isa: Isa,
        lane: usize,
        pair: [&[u8]; 2],
        textured: &[bool],
        row: &mut RowMut<'_>,
    );
}

/// Checks the matches of a block of rows. It holds one thread's scratch.
pub trait RowCheck: Send + 'static {
    /// Finds the values that the matches of the block's first `rows` are compared with.
    fn search(&mut self, isa: Isa, left: &[Lanes<u16>], right: &[Lanes<u16>], rows: usize);

    /// Rejects matches of the row `lane` of the block, whose left pixels are `left`.
    fn check_row(&self, isa: Isa, lane: usize, left: &[u8], row: &mut RowMut<'_>);
}

/// Runs `work` on each row of `plane` with its index, on the threads of rayon's current pool, at
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
            // A task per row would cost more than the row.
            .with_min_len(together)
            .for_each(|(y, row)| work(y, row));
    }
}

/// Same as [`each_row`], on the rows of a plane without gaps.
///
/// # Panics
/// If the plane has gaps between its rows: scratch planes have none.
pub(super) fn each_plane_row<T: Copy + Send>(
    plane: &mut Plane<T>,
    together: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    let width = plane.width();
    each_row(
        plane.as_mut_slice().expect("gapless"),
        width,
        together,
        work,
    );
}

/// Runs `work` on bands of `plane`, of `pixels` each, with their index and one element of
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

/// Runs both, at the same time if rayon's current pool has threads for it.
pub(super) fn both(a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    if rayon::current_num_threads() == 1 {
        a();
        b();
    } else {
        // The calling thread runs one of the two, or both if the pool is busy.
        rayon::join(a, b);
    }
}
