//! Hot loops: one readable implementation compiled per instruction set and chosen at run time.
//!
//! Every function here takes the [`Isa`] it shall run on. Its body is plain Rust over fixed-size
//! lanes, marked `#[inline(always)]` and pulled into one function per instruction set, where the
//! compiler turns the lanes into vectors. Arithmetic is on integers, and where it is not (the
//! spread of v2) each lane's operations are single and in order, so every variant gives the same
//! bytes; `tests/v3.rs` and `tests/thesis.rs` hold them to it.

mod along;
mod block;
mod census;
mod choose;
mod deviation;
mod dog;
mod exact;
mod isa;
mod median;
mod pairs;
mod paths;
mod prefilter;
mod remap;
mod sad;
mod scanline;
mod slide;
mod smooth;
mod ssd;
mod table;
mod turn;
mod volume;
mod write;

pub use along::RowPaths;
pub use block::Lanes;
pub use census::{CENSUS_BYTES, CENSUS_MARGIN, CENSUS_REACH};
pub use choose::{ChosenRow, Totals};
pub use dog::DogTaps;
pub use exact::{Doubt, Match, Search};
pub use isa::{Isa, isa};
pub use paths::{Paths, Penalties};
pub use prefilter::PREFILTER_CAP;
pub use sad::{PIXELS, SadTest, SadWinners};
pub use scanline::{ScanlinePaths, edge, edge_before};
pub use ssd::CAP;
pub use table::{Claim, NO_SUM, TableSearch, WindowTable, window_sums};
pub use volume::{OUTSIDE, VolumeShape};

use crate::stereo::{Gray, RowMut};

/// Makes, per kernel, a safe function that runs its body compiled for the given instruction set; a
/// body with `, pairs` behind it gets that set's [`pairs::Pairs`] as its first argument.
macro_rules! kernels {
    ($($(#[$doc:meta])* pub fn $name:ident($($arg:ident: $ty:ty),* $(,)?) = $body:path $(, $pairs:ident)?;)*) => {$(
        $(#[$doc])*
        pub fn $name(isa: Isa, $($arg: $ty),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx2,fma")]
                fn avx512($($arg: $ty),*) {
                    // SAFETY: this runs on CPUs that have it.
                    $body($(unsafe { $pairs::Avx512::new() },)? $($arg),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn avx2($($arg: $ty),*) {
                    // SAFETY: as above.
                    $body($(unsafe { $pairs::Avx2::new() },)? $($arg),*)
                }
                if isa == Isa::AVX512 {
                    // SAFETY: an `Isa` other than portable comes from `Isa::available` alone, which
                    // asked this CPU.
                    return unsafe { avx512($($arg),*) };
                }
                if isa == Isa::AVX2 {
                    // SAFETY: as above.
                    return unsafe { avx2($($arg),*) };
                }
            }
            debug_assert_eq!(isa, Isa::PORTABLE);
            $body($($pairs::Portable,)? $($arg),*)
        }
    )*};
}

kernels! {
    /// Row `y` of `image` convolved along its columns, edges replicated: `(Σ w·I + 32768) >> 16`.
    ///
    /// `weights[k]` belongs to the rows `y - k` and `y + k`; with both sides counted they sum to
    /// 65536.
    pub fn smooth_row(image: &Gray, y: usize, weights: &[u32], out: &mut [u8]) = smooth::row;

    /// Marks the pixels of `row` where the fine difference of Gaussians answers at least as
    /// strongly as the coarse one.
    pub fn textured_row(row: &[u8], taps: &DogTaps, out: &mut [bool]) = dog::row;

    /// Marks the windows of `row` with `9·ΣI² − (ΣI)²` of at least `least`; where no window fits
    /// there is none.
    pub fn deviating_row(row: &[u8], least: u32, out: &mut [bool]) = deviation::row;

    /// Rows `y ..` of `image`, as many as a block has, as columns of lanes: one per pixel of a row.
    pub fn transpose(image: &Gray, y: usize, out: &mut [Lanes<u16>]) = block::transpose;

    /// For each window of a block of rows the least capped SSD with windows up to `sums.len()`
    /// pixels to either side, `u16::MAX` where there is none.
    pub fn least_ssd(block: &[Lanes<u16>], sums: &mut [Lanes<u16>], out: &mut [Lanes<u16>]) = ssd::least;

    /// The lanes of a block as rows, one after the other.
    pub fn transpose_back(columns: &[Lanes<u16>], out: &mut [u16]) = block::transpose_back;

    /// For each window of a block of rows the disparity of least cost, ties to the lower one, as
    /// rows one after the other; as many rows as `out` holds.
    pub fn matches(
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        search: &mut Search,
        out: &mut [Match],
    ) = exact::matches, pairs;

    /// As [`matches()`], and whether a disparity not beside the winner costs less than
    /// `thousandths` more.
    pub fn matches_and_rivals(
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        search: &mut Search,
        thousandths: u32,
        out: &mut [Match],
        doubts: &mut [Doubt],
    ) = exact::matches_and_rivals, pairs;

    /// As [`matches()`], and whether the standard deviation of all disparities, each weighted by
    /// `(cost + 25)⁻²`, is at least `threshold_px`; [`Doubt::Open`] where single precision cannot
    /// tell.
    pub fn matches_and_spread(
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        search: &mut Search,
        threshold_px: f32,
        out: &mut [Match],
        doubts: &mut [Doubt],
    ) = exact::matches_and_spread, pairs;

    /// For each window of a row of the right image the cheapest window of the table it may match.
    /// Ties: the nearest row, then the row above, then the lower disparity.
    pub fn claim_row(search: &TableSearch<'_>, row: &[u8], out: &mut [Claim]) = table::claim_row, pairs;

    /// Finds the cheapest paths through the rows `first ..` of a block, as many as
    /// [`ScanlinePaths::ROWS`]. An occlusion costs `occlusion` per pixel, a match that keeps its
    /// disparity earns `reward`.
    pub fn find_paths(
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        first: usize,
        occlusion: i32,
        reward: i32,
        paths: &mut ScanlinePaths,
    ) = scanline::find;

    /// Writes a row of winners: valid where textured, else untextured. Disparities count from
    /// `first`.
    pub fn accept_row(first: i32, winners: &[Match], textured: &[bool], row: &mut RowMut<'_>) = write::accept;

    /// Rejects the valid pixels of a row whose SSD is not below its reference, where neither is
    /// capped.
    pub fn self_check_row(references: &[u16], row: &mut RowMut<'_>) = write::self_check;

    /// The x-Sobel response of the middle one of three rows, capped to ±[`PREFILTER_CAP`] and that
    /// added; the columns at both ends answer nothing.
    pub fn sobel_row(rows: [&[u8]; 3], out: &mut [u8]) = prefilter::sobel;

    /// The Laplacian of a Gaussian of σ 1 at the middle one of five rows, capped as [`sobel_row`]'s
    /// response; the two columns at either end answer nothing.
    pub fn log_row(rows: [&[u8]; 5], out: &mut [u8]) = prefilter::log;

    /// Moves column sums of absolute differences on by a row: `left` and `right` hold the row that
    /// comes in and the one that goes out.
    ///
    /// `sums` holds `stride` columns, whole blocks of [`PIXELS`], for each place in the range; at
    /// place `i` a left pixel meets the right one `i` further on. The rows hold as many pixels as
    /// are so met.
    pub fn slide_columns(left: [&[u8]; 2], right: [&[u8]; 2], stride: usize, sums: &mut [u16]) = sad::slide;

    /// Moves column sums of the strength of the prefilter's response on by a row, the first of
    /// `rows`; the second goes.
    pub fn slide_texture(rows: [&[u8]; 2], sums: &mut [u16]) = sad::slide_texture;

    /// Sums of `window` neighbouring columns, from each on; whole blocks of [`PIXELS`].
    pub fn run_sums(columns: &[u16], window: usize, out: &mut [u16]) = sad::run_sums;

    /// For each pixel the least sum of `window` neighbouring columns and its rivals, ties to the
    /// earlier place.
    pub fn least_sads(sums: &[u16], stride: usize, window: usize, out: &mut [SadWinners]) = sad::least;

    /// Writes a row of winners with their fractions of a pixel, or why they are none.
    pub fn accept_sads(winners: &[SadWinners], textures: &[u16], test: &SadTest, row: &mut RowMut<'_>) = sad::accept;

    /// The censuses of a row: its bytes, in planes that stand `stride` apart.
    ///
    /// `rows` are the row and the three above and below, each with [`CENSUS_REACH`] further pixels
    /// at both ends.
    pub fn census_row(rows: [&[u8]; 7], stride: usize, out: &mut [u8]) = census::census;

    /// Hamming distances between the censuses of a row of the left image and those of the right
    /// one: a row of the volume.
    ///
    /// Both and `outside` have [`CENSUS_MARGIN`] places before the first pixel and after the last
    /// block; `outside` has [`OUTSIDE`] where a place is outside the image, else 0.
    pub fn census_costs(
        shape: &VolumeShape,
        left: &[u8],
        right: &[u8],
        outside: &[u8],
        out: &mut [Lanes<u8>],
    ) = census::costs;

    /// Follows the paths along the rows from `top` of `image` on, whose `costs` are given: those of
    /// a band or less.
    pub fn follow_rows(
        paths: &mut RowPaths,
        costs: &[Lanes<u8>],
        image: &Gray,
        top: usize,
        penalties: &Penalties,
    ) = along::follow;

    /// Moves `paths` on by a row, and writes what they add to its costs.
    ///
    /// `grey` is the row of the left image and the one before it in the direction of the sweep.
    pub fn follow_paths(
        paths: &mut Paths,
        costs: &[Lanes<u8>],
        grey: [&[u8]; 2],
        penalties: &Penalties,
        sums: &mut [Lanes<u8>],
    ) = paths::follow;

    /// As [`follow_paths`], but sums all path costs: `sums` are what the paths of the other sweep
    /// and those along the row add.
    pub fn finish_paths(
        paths: &mut Paths,
        costs: &[Lanes<u8>],
        grey: [&[u8]; 2],
        penalties: &Penalties,
        sums: [&[Lanes<u8>]; 2],
        totals: &mut Totals,
    ) = paths::finish;

    /// The best disparities of a row. Other disparities must be worse by `uniqueness` per cent.
    pub fn choose_row(totals: &Totals, uniqueness: u32, row: &mut ChosenRow<'_>) = choose::choose;

    /// Medians of nine, three rows by three columns; the outermost columns have no neighbour beyond
    /// them and count twice.
    pub fn median_row(rows: [&[i16]; 3], out: &mut [i16]) = median::row;

    /// Pixels from between those of `source`, whose rows stand `stride` apart: of the four from
    /// `places` on, weighed by how far to the right and below, in 256ths, the two `parts` say that
    /// the wanted one lies. Rounded to the nearest.
    ///
    /// `source` reaches a row and a pixel beyond every place.
    pub fn remap_row(
        source: &[u8],
        stride: usize,
        places: &[u32],
        parts: [&[u8]; 2],
        out: &mut [u8],
    ) = remap::row;
}
