//! Sums of the strips along columns and rows, and the winners of a row in both images.

use super::Lanes;
use super::lanes::{SIDE, Square, transpose_square};
use super::small_census::SMALL_CENSUS_PLANES;
use crate::stereo::Reason;

const N: usize = Lanes::COUNT;

/// The winners of a row, as many as its blocks have pixels.
pub struct RowWinners {
    /// The disparity of the least sum, and that sum.
    pub best: Vec<u8>,
    pub least: Vec<u8>,
    /// The least sum of a disparity that is not its neighbour; 255 if there is none.
    pub second: Vec<u8>,
    /// The sums below and above the winner.
    pub below: Vec<u8>,
    pub above: Vec<u8>,
    /// The winner of each right pixel.
    pub right: Vec<u8>,
}

impl RowWinners {
    pub fn new(pixels: usize) -> Self {
        let row = || vec![0; pixels];
        Self {
            best: row(),
            least: row(),
            second: row(),
            below: row(),
            above: row(),
            right: row(),
        }
    }
}

/// See [`super::sum_strips`].
#[inline(always)]
pub(super) fn sum(
    columns: &[Lanes<u8>],
    rows: &[Lanes<u8>],
    count: usize,
    [first, top]: [usize; 2],
    stride: usize,
    out: &mut [u8],
) {
    // Within its strip of rows.
    let lane = top % N;
    for d in 0..count {
        for x in (0..N).step_by(SIDE) {
            if (first + x) * count >= rows.len() {
                continue;
            }
            let mut square = Square::default();
            for (i, along) in square.iter_mut().enumerate() {
                if let Some(row) = rows.get((first + x + i) * count + d) {
                    *along = *row.0[lane..].first_chunk().expect("lanes of a square");
                }
            }
            for (y, across) in transpose_square(&square).iter().enumerate() {
                let Some(column) = columns.get(y * count + d) else {
                    break;
                };
                let column: &[u8; SIDE] = column.0[x..].first_chunk().expect("a square's side");
                let out = &mut out[(y * count + d) * stride + first + x..][..SIDE];
                for i in 0..SIDE {
                    out[i] = column[i] + across[i];
                }
            }
        }
    }
}

/// See [`super::choose_winners`].
#[inline(always)]
pub(super) fn choose(sums: &[u8], stride: usize, out: &mut RowWinners) {
    let count = sums.len() / stride;
    let at = |d: usize, x: usize| -> &[u8; N] {
        sums[d * stride + x..]
            .first_chunk()
            .expect("a block and its margin")
    };
    for x in (0..out.best.len()).step_by(N) {
        let (mut least, mut best) = (*at(0, x), [0_u8; N]);
        let (mut right_least, mut right) = (least, [0_u8; N]);
        for d in 1..count {
            lower(at(d, x), d, &mut least, &mut best);
            lower(at(d, x + d), d, &mut right_least, &mut right);
        }
        let (mut second, mut below, mut above) = ([u8::MAX; N], [0; N], [0; N]);
        for d in 0..count {
            let sum = at(d, x);
            for l in 0..N {
                // 0, 1, 2 below, at and above the winner.
                let from = (d as u8).wrapping_sub(best[l]).wrapping_add(1);
                second[l] = second[l].min(sum[l] | mask(from < 3));
                below[l] |= sum[l] & mask(from == 0);
                above[l] |= sum[l] & mask(from == 2);
            }
        }
        let put = |row: &mut [u8], lanes: [u8; N]| row[x..x + N].copy_from_slice(&lanes);
        put(&mut out.best, best);
        put(&mut out.least, least);
        put(&mut out.second, second);
        put(&mut out.below, below);
        put(&mut out.above, above);
        put(&mut out.right, right);
    }
}

/// All bits set, or none. Compilers turn masks into vector selects, but branches into branches.
#[inline(always)]
fn mask(condition: bool) -> u8 {
    u8::from(condition).wrapping_neg()
}

/// Replaces the least sums by those of a disparity that are lower.
#[inline(always)]
fn lower(sum: &[u8; N], d: usize, least: &mut [u8; N], best: &mut [u8; N]) {
    for l in 0..N {
        let lower = mask(sum[l] < least[l]);
        best[l] = best[l] & !lower | d as u8 & lower;
        least[l] = least[l].min(sum[l]);
    }
}

/// See [`super::winner_fractions`].
#[inline(always)]
pub(super) fn fractions(winners: &RowWinners, count: usize, out: &mut [i16]) {
    let last = count as u8 - 1;
    for (x, out) in out.iter_mut().enumerate() {
        let best = winners.best[x];
        let least = i32::from(winners.least[x]);
        let (below, above) = (i32::from(winners.below[x]), i32::from(winners.above[x]));
        let rise = below.max(above) - least;
        // Floats hold these numbers, and the quotient of two of them is never rounded up to a whole
        // number; with 16 added it is positive, so that truncating it is the floor.
        let (number, twice) = (16 * (below - above) + rise, 2 * rise.max(1));
        let quotient = (number + 16 * twice) as f32 / twice as f32;
        // SAFETY: it is 0 ..= 8192, as a sum is a byte.
        let eighths = unsafe { quotient.to_int_unchecked::<i32>() } - 16;
        let inner = best > 0 && best < last && rise > 0;
        *out = 16 * i16::from(best) + eighths as i16 * i16::from(inner);
    }
}

/// Thresholds that a winner must pass, and the cost of leaving the image.
#[derive(Clone, Copy, Debug)]
pub struct WinnerTest {
    pub unique: u32,
    pub out: u8,
}

/// See [`super::test_winners`].
#[inline(always)]
pub(super) fn test(
    test: &WinnerTest,
    winners: &RowWinners,
    [left, right]: [[&[u8]; SMALL_CENSUS_PLANES]; 2],
    costs: &mut [u8],
    why: &mut [Reason],
) {
    let width = costs.len();
    let [left, right] = [left, right].map(|planes| planes.map(|plane| &plane[..width]));
    let (best, right_best) = (&winners.best[..width], &winners.right[..width]);
    let (least, second) = (&winners.least[..width], &winners.second[..width]);
    for (x, (cost, why)) in costs.iter_mut().zip(why).enumerate() {
        let Some(match_x) = x.checked_sub(best[x].into()) else {
            (*cost, *why) = (test.out, Reason::Border);
            continue;
        };
        // Compared together: a single instruction where one exists.
        let a = left[0][x] ^ right[0][match_x];
        let b = left[1][x] ^ right[1][match_x];
        let c = left[2][x] ^ right[2][match_x];
        *cost = u32::from_le_bytes([a, b, c, 0]).count_ones() as u8;
        let (least, second) = (u32::from(least[x]), u32::from(second[x]));
        // If there is no second (255), every positive fraction passes.
        let unique = test.unique * (second - least) >= least + 8;
        let unique = unique | (second == 255 && test.unique > 0);
        *why = match (right_best[match_x] == best[x], unique) {
            (false, _) => Reason::Inconsistent,
            (true, false) => Reason::Ambiguous,
            (true, true) => Reason::Valid,
        };
    }
}
