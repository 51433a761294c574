//! Sums of strips along columns and rows brought together, and the winners of a row in both images.

use super::Lanes;
use super::lanes::{SIDE, Square, transpose_square};

const N: usize = Lanes::COUNT;

/// The winners of a row, as many as its blocks have pixels.
pub struct RowWinners {
    /// The disparity of the least sum, and that sum.
    pub best: Vec<u8>,
    pub least: Vec<u8>,
    /// The least sum of a disparity that is not its neighbour; 255 where there is none.
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
            let (sum, right_sum) = (at(d, x), at(d, x + d));
            for l in 0..N {
                best[l] = if sum[l] < least[l] { d as u8 } else { best[l] };
                least[l] = least[l].min(sum[l]);
                right[l] = if right_sum[l] < right_least[l] {
                    d as u8
                } else {
                    right[l]
                };
                right_least[l] = right_least[l].min(right_sum[l]);
            }
        }
        let (mut second, mut below, mut above) = ([u8::MAX; N], [0; N], [0; N]);
        for d in 0..count {
            let sum = at(d, x);
            for l in 0..N {
                // 0, 1, 2 below, at and above the winner.
                let from = (d as u8).wrapping_sub(best[l]).wrapping_add(1);
                let other = if from > 2 { sum[l] } else { u8::MAX };
                second[l] = second[l].min(other);
                below[l] = if from == 0 { sum[l] } else { below[l] };
                above[l] = if from == 2 { sum[l] } else { above[l] };
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

/// See [`super::fractions`].
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
        let eighths = ((number + 16 * twice) as f32 / twice as f32) as i32 - 16;
        let inner = best > 0 && best < last && rise > 0;
        *out = 16 * i16::from(best) + if inner { eighths as i16 } else { 0 };
    }
}
