//! Hot loops: one readable implementation compiled per instruction set and chosen at run time.
//!
//! Every function here takes the [`Isa`] it runs on. Its body is plain Rust over fixed-size lanes,
//! marked `#[inline(always)]` and inlined into one function per instruction set, where the compiler
//! vectorizes the lanes. Arithmetic is on integers. The exceptions (the spread of v2, the networks
//! of filters) compute each lane with single operations in a fixed order, so every variant gives
//! the same bytes; the tests compare all variants with a slow oracle.

mod capped_ssd;
mod census;
mod choose;
mod dense;
#[cfg(feature = "internal")]
mod descent;
mod filter;
mod gaps;
mod halve;
mod isa;
mod lanes;
mod pairs;
mod paths;
mod row_paths;
mod row_winners;
mod sad;
mod scanline;
mod sliding_ssd;
mod small_census;
mod ssd_search;
mod strip_paths;
mod texture;
mod volume;
mod window_table;
mod write;

pub use capped_ssd::CAP;
pub use census::{CENSUS_BYTES, CENSUS_MARGIN, CENSUS_REACH};
pub use choose::{ChosenRow, Totals};
pub use dense::LANES;
#[cfg(feature = "internal")]
pub use descent::AdamStep;
pub use filter::PREFILTER_CAP;
pub use gaps::{
    GAP_TENSORS, GAP_WEIGHTS, GapCandidates, GapFault, GapNetwork, GapVotes, HYPOTHESES,
    HYPOTHESIS_FEATURES, PIXEL_FEATURES,
};
#[cfg(feature = "internal")]
pub use gaps::{GapPass, GapSamples};
pub use isa::{Isa, isa};
pub use lanes::Lanes;
pub use pairs::Group;
pub use paths::{PathBlock, Penalties};
pub use row_paths::RowPaths;
pub use row_winners::{RowWinners, WinnerTest};
pub use sad::{PIXELS, SadBlock, SadTest, SadWinners, Sads};
pub use scanline::{ScanlinePaths, edge, edge_before};
pub use sliding_ssd::{Match, REACH, WINDOW, weight};
pub use small_census::{SMALL_CENSUS_PLANES, SMALL_CENSUS_REACH, STEPS};
pub use ssd_search::{FilterDecision, SsdSearch};
pub use strip_paths::{PathCost, StripPlace};
pub use texture::DogTaps;
pub use volume::{OUTSIDE, VolumeShape};
pub use window_table::{NO_SUM, Proposal, TableSearch, WindowTable, window_sums};

use crate::stereo::{Gray, Reason, RowMut};

/// Defines, per kernel, a safe function that runs its body compiled for the given instruction set;
/// a body followed by `, pairs` gets that set's [`pairs::Pairs`] as its first argument. The body's
/// path may contain `LANES_8` and `LANES_16`, the lanes of 8 and 16 bits that fit the registers.
macro_rules! kernels {
    ($(
        $(#[$doc:meta])*
        pub fn $name:ident($($arg:ident: $ty:ty),* $(,)?) = $body:path $(, $pairs:ident)?;
    )*) => {$(
        $(#[$doc])*
        pub fn $name(isa: Isa, $($arg: $ty),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx2,fma")]
                fn avx512($($arg: $ty),*) {
                    #[allow(dead_code)]
                    const LANES_8: usize = 64;
                    #[allow(dead_code)]
                    const LANES_16: usize = 64;
                    // SAFETY: this runs on CPUs that have it.
                    $body($(unsafe { $pairs::Avx512::new() },)? $($arg),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn avx2($($arg: $ty),*) {
                    #[allow(dead_code)]
                    const LANES_8: usize = 32;
                    #[allow(dead_code)]
                    const LANES_16: usize = 64;
                    // SAFETY: as above.
                    $body($(unsafe { $pairs::Avx2::new() },)? $($arg),*)
                }
                if isa == Isa::AVX512 {
                    // SAFETY: an `Isa` other than portable comes only from `Isa::available`, which
                    // asked this CPU.
                    return unsafe { avx512($($arg),*) };
                }
                if isa == Isa::AVX2 {
                    // SAFETY: as above.
                    return unsafe { avx2($($arg),*) };
                }
            }
            #[allow(dead_code)]
            const LANES_8: usize = 16;
            #[allow(dead_code)]
            const LANES_16: usize = if cfg!(target_arch = "aarch64") { 64 } else { 32 };
            #[cfg(target_arch = "aarch64")]
            dotprod!([$($pairs)?] isa, $body, ($($arg: $ty),*));
            debug_assert!(isa == Isa::BASELINE || cfg!(target_arch = "aarch64"));
            $body($($pairs::Portable,)? $($arg),*)
        }
    )*};
}

/// Runs a kernel that gets [`pairs::Pairs`] on CPUs with dot products. No compiler finds their
/// instruction, so that the others would only be compiled twice.
#[cfg(target_arch = "aarch64")]
macro_rules! dotprod {
    ([] $isa:ident, $body:path, $arguments:tt) => {};
    ([$pairs:ident] $isa:ident, $body:path, ($($arg:ident: $ty:ty),*)) => {
        #[target_feature(enable = "neon,dotprod")]
        fn dotprod($($arg: $ty),*) {
            // SAFETY: this runs on CPUs that have it.
            $body(unsafe { $pairs::DotProd::new() }, $($arg),*)
        }
        if $isa == Isa::DOTPROD {
            // SAFETY: as for AVX.
            return unsafe { dotprod($($arg),*) };
        }
    };
}

kernels! {
    /// Row `y` of `image` convolved along its columns, edges replicated: `(Σ w·I + 32768) >> 16`.
    ///
    /// `weights[k]` belongs to the rows `y - k` and `y + k`; with both sides counted they sum to
    /// 65536.
    pub fn smooth_row(image: &Gray, y: usize, weights: &[u32], out: &mut [u8]) =
        filter::smooth, pairs;

    /// For each row of `inputs` and each row of `weights`, both `stride` long, the bias plus the
    /// sum of their products: one row of `out` per row of `inputs`. `stride` is a multiple of
    /// [`LANES`].
    pub fn weighted_sums(
        inputs: &[f32],
        weights: &[f32],
        bias: &[f32],
        stride: usize,
        out: &mut [f32],
    ) = dense::sums;

    /// Adds the `rows` to `out`, each as long as `out` and multiplied by its factor.
    #[cfg(feature = "internal")]
    pub fn add_scaled(rows: &[f32], factors: &[f32], out: &mut [f32]) = descent::add;

    /// A step of Adam by a gradient: changes the running means of gradient and square, and the
    /// weights.
    #[cfg(feature = "internal")]
    pub fn adam(
        step: AdamStep,
        gradient: &[f32],
        mean: &mut [f32],
        square: &mut [f32],
        weights: &mut [f32],
    ) = descent::adam;

    /// Marks the pixels of `row` where the fine difference of Gaussians answers at least as
    /// strongly as the coarse one.
    pub fn textured_row(row: &[u8], taps: &DogTaps, out: &mut [bool]) = texture::dog, pairs;

    /// Marks the pixels of `row` whose window has `9·ΣI² − (ΣI)²` of at least `least`; none where
    /// no window fits.
    pub fn deviating_row(row: &[u8], least: u32, out: &mut [bool]) = texture::deviation;

    /// Transposes the rows of a block, `y ..` of `image`, into columns of lanes: one per pixel of a
    /// row. Lanes below the image are zero or unchanged.
    pub fn transpose(image: &Gray, y: usize, out: &mut [Lanes<u16>]) = lanes::transpose;

    /// The least capped SSD of each window of a block of rows with the windows up to `sums.len()`
    /// pixels to either side in the same image, `u16::MAX` if there is none.
    pub fn least_ssd(
        block: &[Lanes<u16>],
        sums: &mut [Lanes<u16>],
        out: &mut [Lanes<u16>],
    ) = capped_ssd::least;

    /// Transposes the lanes of a block back into rows, one after the other.
    pub fn transpose_back(columns: &[Lanes<u16>], out: &mut [u16]) = lanes::transpose_back;

    /// For each window of a block of rows the disparity of least cost, ties to the lower one. The
    /// rows are written one after the other, as many as `out` holds.
    pub fn matches(
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        search: &mut SsdSearch,
        out: &mut [Match],
    ) = ssd_search::matches, pairs;

    /// Same as [`matches()`]; also marks windows in which a disparity not next to the winner costs
    /// less than `thousandths` more.
    pub fn matches_and_rivals(
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        search: &mut SsdSearch,
        thousandths: u32,
        out: &mut [Match],
        doubts: &mut [FilterDecision],
    ) = ssd_search::matches_and_rivals, pairs;

    /// Same as [`matches()`]; also reports if the standard deviation of all disparities, each
    /// weighted by `(cost + 25)⁻²`, is at least `threshold_px`, or [`FilterDecision::Open`] if
    /// single precision cannot decide.
    pub fn matches_and_spread(
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        search: &mut SsdSearch,
        threshold_px: f32,
        out: &mut [Match],
        doubts: &mut [FilterDecision],
    ) = ssd_search::matches_and_spread, pairs;

    /// The cheapest window of the table for each window of a row of the right image. Ties: the
    /// nearest row, then the row above, then the lower disparity.
    pub fn propose_row(
        search: &TableSearch<'_>,
        row: &[u8],
        out: &mut [Proposal],
    ) = window_table::propose_row, pairs;

    /// Finds the cheapest scanline paths through the first [`ScanlinePaths::ROWS`] rows of a block
    /// from `first`. An occlusion costs `occlusion` per pixel; a match that keeps its disparity
    /// earns `reward`.
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
    pub fn accept_row(
        first: i32,
        winners: &[Match],
        textured: &[bool],
        row: &mut RowMut<'_>,
    ) = write::accept;

    /// Rejects the valid pixels of a row whose SSD is not below its reference, unless either is
    /// capped.
    pub fn self_check_row(references: &[u16], row: &mut RowMut<'_>) = write::self_check;

    /// The x-Sobel response of the middle one of three rows, capped to ±[`PREFILTER_CAP`], with
    /// [`PREFILTER_CAP`] added; 0 in the columns at both ends.
    pub fn sobel_row(rows: [&[u8]; 3], out: &mut [u8]) = filter::sobel;

    /// The Laplacian of a Gaussian of σ 1 at the middle one of five rows, capped as the response of
    /// [`sobel_row`]; 0 in the two columns at either end.
    pub fn log_row(rows: [&[u8]; 5], out: &mut [u8]) = filter::log;

    /// Slides column sums of absolute differences down by a row: `left` and `right` hold the row
    /// that enters and the one that leaves.
    ///
    /// `columns` holds `blocks` sums for each column; at index `i` a left pixel is compared with
    /// the right one `i` further on. The rows are long enough for that.
    pub fn slide_columns(
        left: [&[u8]; 2],
        right: [&[u8]; 2],
        blocks: usize,
        columns: &mut [Sads],
    ) = sad::slide;

    /// Slides column sums of the strength of the prefilter's response down by a row: the first of
    /// `rows` enters, the second leaves.
    pub fn slide_texture(rows: [&[u8]; 2], sums: &mut [u16]) = sad::slide_texture;

    /// Sums of `window` neighbouring columns, starting at each column.
    pub fn run_sums(columns: &[u16], window: usize, out: &mut [u16]) = sad::run_sums;

    /// The disparity of the least sum of `window` neighbouring columns for each pixel, ties to the
    /// earlier index, and the number of its rivals: others must be worse by `uniqueness` per cent
    /// (0: not counted).
    pub fn least_sads(
        columns: &[Sads],
        window: usize,
        uniqueness: u32,
        block: &mut SadBlock,
        out: &mut [SadWinners],
    ) = sad::least;

    /// Writes a row of winners with their fractions of a pixel, or the reason for their rejection.
    pub fn accept_sads(
        winners: &[SadWinners],
        textures: &[u16],
        test: &SadTest,
        row: &mut RowMut<'_>,
    ) = sad::accept;

    /// The census transform of a row: its bytes, in planes `stride` apart.
    ///
    /// `rows` are the row and the three above and below, each with [`CENSUS_REACH`] further pixels
    /// at both ends.
    pub fn census_row(rows: [&[u8]; 7], stride: usize, out: &mut [u8]) = census::census;

    /// Hamming distances between the censuses of a row of the left image and those of the right
    /// one: a row of the cost volume.
    ///
    /// Both and `outside` have [`CENSUS_MARGIN`] elements before the first pixel and after the last
    /// block; `outside` is [`OUTSIDE`] beyond the image, else 0.
    pub fn census_costs(
        shape: &VolumeShape,
        left: &[u8],
        right: &[u8],
        outside: &[u8],
        out: &mut [Lanes<u8>],
    ) = census::costs::<LANES_8>;

    /// Aggregates costs along both directions of the rows from `top` of `image` on, at most a band,
    /// and writes what the paths add to the matching costs. `costs` and `sums` are those rows of
    /// the volume.
    pub fn follow_rows(
        paths: &mut RowPaths,
        costs: &[Lanes<u8>],
        image: &Gray,
        top: usize,
        penalties: &Penalties,
        sums: &mut [Lanes<u8>],
    ) = row_paths::follow;

    /// Aggregates costs along `paths` over the next row of a sweep, and writes what they add to its
    /// matching costs. `costs` are those of the disparities that the block reaches.
    ///
    /// `grey` is the row of the left image and the previous one in the direction of the sweep.
    pub fn follow_paths(
        paths: &mut PathBlock,
        costs: &[Lanes<u8>],
        grey: [&[u8]; 2],
        penalties: &Penalties,
        sums: &mut [Lanes<u8>],
    ) = paths::follow::<LANES_8>;

    /// Same as [`follow_paths`], but sums all eight path costs: `sums` are what the paths of the
    /// other sweep and those along the row add.
    pub fn finish_paths(
        paths: &mut PathBlock,
        costs: &[Lanes<u8>],
        grey: [&[u8]; 2],
        penalties: &Penalties,
        sums: [&[Lanes<u8>]; 2],
        totals: &mut Totals,
    ) = paths::finish::<LANES_8>;

    /// Winner-takes-all over a row, in both images. Other disparities must be worse by `uniqueness`
    /// per cent.
    pub fn choose_row(
        totals: &Totals,
        uniqueness: u32,
        row: &mut ChosenRow<'_>,
    ) = choose::choose::<LANES_16>;

    /// A row at half size: the low-pass `[1 3 3 1]` of four neighbouring rows in both directions,
    /// edges replicated, `(Σ + 8) >> 4`: quarters of grey levels, 0 ..= 1020.
    ///
    /// `smooth` is scratch, one pixel longer than the image at either end.
    pub fn halve_row(rows: [&[u8]; 4], smooth: &mut [u16], out: &mut [u16]) = halve::halve;

    /// A row of an image at half size, halved again: `(Σ + 32) >> 6`, quarters of grey levels, too.
    pub fn quarter_row(rows: [&[u16]; 4], smooth: &mut [u16], out: &mut [u16]) = halve::quarter;

    /// The 5 x 5 census of the middle one of five rows, a bit for each darker neighbour, in blocks.
    /// The rows have [`SMALL_CENSUS_REACH`] further pixels at both ends.
    pub fn small_census_row(
        rows: [&[u16]; 5],
        out: [&mut [u8]; SMALL_CENSUS_PLANES],
    ) = small_census::census;

    /// Penalty of a disparity change by more than one between two pixels each, by the table of
    /// their differences.
    pub fn step_penalties(
        pixels: [&[u16]; 2],
        table: &[u8; STEPS],
        out: &mut [u8],
    ) = small_census::penalties;

    /// Transposes a plane of bytes: `rows` are `stride` apart, the columns of `out` `height`, both
    /// multiples of 16.
    pub fn transpose_plane(
        rows: &[u8],
        stride: usize,
        height: usize,
        out: &mut [u8],
    ) = lanes::transpose_plane;

    /// Hamming distances of the censuses of a strip, and the sums of their paths along it in both
    /// directions.
    ///
    /// `line` has one element more than there are disparities; the last is [`u8::MAX`].
    pub fn follow_strip(
        place: &StripPlace,
        censuses: [[&[u8]; SMALL_CENSUS_PLANES]; 2],
        cost: PathCost<'_>,
        costs: &mut [Lanes<u8>],
        line: &mut [Lanes<u8>],
        sums: &mut [Lanes<u8>],
    ) = strip_paths::follow;

    /// Adds the sums of a strip of columns, from a row on, and those of the strip of rows that
    /// contains the row: up to 16 rows from `top`, the columns of a block from `first`, for `count`
    /// disparities. In `out` each disparity of a row takes `stride` pixels.
    pub fn sum_strips(
        columns: &[Lanes<u8>],
        rows: &[Lanes<u8>],
        count: usize,
        first_top: [usize; 2],
        stride: usize,
        out: &mut [u8],
    ) = row_winners::sum;

    /// The winners of a row in both images, ties to the lower disparity. `sums` has `stride` pixels
    /// per disparity, [`u8::MAX`] beyond the image.
    pub fn choose_winners(
        sums: &[u8],
        stride: usize,
        out: &mut RowWinners,
    ) = row_winners::choose;

    /// Sixteenths of a half pixel of a row of winners: the winner, and the equiangular fraction
    /// `⌊(16·(below − above) + rise) / (2·rise)⌋` with `rise = max(below, above) − least`; no
    /// fraction at both ends of the `count` disparities.
    pub fn winner_fractions(
        winners: &RowWinners,
        count: usize,
        out: &mut [i16],
    ) = row_winners::fractions;

    /// Tests a row of winners: *border* if they lead out of the right image, *inconsistent* if the
    /// right image prefers another, *ambiguous* if `unique·(second − least) < least + 8`. Also
    /// writes their matching costs. The censuses begin at the first pixels of the rows.
    pub fn test_winners(
        test: &WinnerTest,
        winners: &RowWinners,
        censuses: [[&[u8]; SMALL_CENSUS_PLANES]; 2],
        costs: &mut [u8],
        why: &mut [Reason],
    ) = row_winners::test;

    /// Medians of nine, three rows by three columns; the outermost columns count twice, as they
    /// have no neighbour beyond them.
    pub fn median_row(rows: [&[i16]; 3], out: &mut [i16]) = filter::median;

    /// Bilinear interpolation between the four pixels of `source` starting at each of `places`; its
    /// rows are `stride` apart. `parts` are the fractions to the right and downwards, in 256ths.
    /// The result is rounded to nearest.
    ///
    /// `source` extends a row and a pixel beyond every place.
    pub fn remap_row(
        source: &[u8],
        stride: usize,
        places: &[u32],
        parts: [&[u8]; 2],
        out: &mut [u8],
    ) = filter::remap;

    /// The features of the hypotheses from measurements at their pixels.
    pub fn describe_hypotheses(candidates: &mut GapCandidates) = gaps::features::describe;

    /// The votes of the hypotheses by their features.
    pub fn weigh_hypotheses(
        network: &GapNetwork,
        candidates: &GapCandidates,
        votes: &mut GapVotes,
    ) = gaps::network::weigh, pairs;

    /// The scores of the hypotheses by a network in floats, in the order of [`GAP_TENSORS`].
    #[cfg(feature = "internal")]
    pub fn score_hypotheses(
        weights: &[f32],
        samples: &GapSamples,
        pass: &mut GapPass,
    ) = gaps::training::forward;

    /// Adds the gradients of the weights by those of the scores, for each lane.
    #[cfg(feature = "internal")]
    pub fn add_gap_gradient(
        weights: &[f32],
        samples: &GapSamples,
        pass: &GapPass,
        slopes: &[[f32; Group::ROWS]; HYPOTHESES + 1],
        gradient: &mut [[f32; Group::ROWS]],
    ) = gaps::training::backward;
}
