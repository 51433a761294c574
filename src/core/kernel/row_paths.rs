//! SGM cost aggregation along the rows, from both ends, in bands of rows.
//!
//! A path along a row reads its neighbour in the row, which is another lane of a volume's block. So
//! the blocks are transposed first, with the rows of the band as lanes, and the sums are transposed
//! back.

use super::lanes::{SIDE, Square, transpose_square};
use super::paths::{PathOutput, advance};
use super::volume::OUTSIDE;
use super::{Lanes, Penalties, VolumeShape};
use crate::stereo::Gray;

const N: usize = Lanes::COUNT;
const ROWS: usize = RowPaths::ROWS;

/// The paths along the rows of a band. It holds one thread's scratch.
pub struct RowPaths {
    shape: VolumeShape,
    /// By column, then disparity.
    costs: Vec<[u8; ROWS]>,
    added: Vec<[u8; ROWS]>,
    /// P2 of the step from the column before.
    steps: Vec<[u8; ROWS]>,
    /// Path costs of the column behind, and of this one.
    lines: [Vec<[[u8; ROWS]; 1]>; 2],
}

impl RowPaths {
    /// Rows of a band: few enough that the scratch stays in a core's own cache.
    pub const ROWS: usize = SIDE;

    /// Paths over volumes of that shape.
    pub fn new(shape: VolumeShape) -> Self {
        let lanes = |count: usize| vec![[0; ROWS]; count];
        let columns = shape.padded();
        Self {
            shape,
            costs: lanes(columns * shape.count),
            added: lanes(columns * shape.count),
            steps: lanes(columns),
            lines: [(); 2].map(|()| vec![[[0; ROWS]]; shape.count + 2]),
        }
    }
}

struct FromLeft<'a>(&'a mut [u8; ROWS]);

impl PathOutput<1, ROWS> for FromLeft<'_> {
    #[inline(always)]
    fn put(self, _: &[u8; ROWS], [added]: [[u8; ROWS]; 1]) {
        *self.0 = added;
    }
}

/// Adds to the sums of [`FromLeft`].
struct FromRight<'a>(&'a mut [u8; ROWS]);

impl PathOutput<1, ROWS> for FromRight<'_> {
    #[inline(always)]
    fn put(self, _: &[u8; ROWS], [added]: [[u8; ROWS]; 1]) {
        for (sum, added) in self.0.iter_mut().zip(added) {
            *sum += added;
        }
    }
}

/// See [`super::follow_rows`].
#[inline(always)]
pub(super) fn follow(
    paths: &mut RowPaths,
    costs: &[Lanes<u8>],
    image: &Gray,
    top: usize,
    penalties: &Penalties,
    sums: &mut [Lanes<u8>],
) {
    let RowPaths {
        shape,
        costs: transposed,
        added,
        steps,
        lines: [before, now],
    } = paths;
    let (count, stride) = (shape.count, shape.stride());
    let rows = costs.len() / stride;
    for block in 0..shape.blocks() {
        for i in 0..shape.reached_in(block) {
            for l in (0..N).step_by(ROWS) {
                let mut square = Square::default();
                for row in 0..ROWS {
                    // A band at the bottom may have fewer rows; the content of the others does not
                    // matter.
                    let lanes = &costs[row.min(rows - 1) * stride + block * count + i].0;
                    square[row].copy_from_slice(&lanes[l..][..ROWS]);
                }
                for (column, lanes) in transpose_square(&square).iter().enumerate() {
                    transposed[(block * N + l + column) * count + i] = *lanes;
                }
            }
        }
    }
    for (block, steps) in steps.as_chunks_mut::<ROWS>().0.iter_mut().enumerate() {
        for (row, steps) in steps.iter_mut().take(rows).enumerate() {
            let grey = image.row(top + row);
            for (step, x) in steps.iter_mut().zip(block * ROWS..shape.width) {
                *step = penalties.large[usize::from(grey[x].abs_diff(grey[x.saturating_sub(1)]))];
            }
        }
        *steps = transpose_square(steps);
    }

    // From the left: at column 0 no path has begun, so all its costs are `OUTSIDE` and it adds
    // nothing.
    before.fill([[OUTSIDE; ROWS]]);
    now.fill([[OUTSIDE; ROWS]]);
    for x in 0..shape.width {
        let (costs, added) = (
            &transposed[x * count..][..shape.reached(x)],
            &mut added[x * count..][..count],
        );
        advance(
            before,
            now,
            ([0], 0),
            costs.iter(),
            penalties.small,
            [steps[x]],
            added.iter_mut().map(FromLeft),
        );
        std::mem::swap(before, now);
    }
    before.fill([[OUTSIDE; ROWS]]);
    now.fill([[OUTSIDE; ROWS]]);
    for x in (0..shape.width).rev() {
        let (costs, added) = (
            &transposed[x * count..][..shape.reached(x)],
            &mut added[x * count..][..count],
        );
        // The last column has no column after it.
        let step = steps[(x + 1).min(shape.width - 1)];
        advance(
            before,
            now,
            ([0], 0),
            costs.iter(),
            penalties.small,
            [step],
            added.iter_mut().map(FromRight),
        );
        std::mem::swap(before, now);
    }

    for block in 0..shape.blocks() {
        for i in 0..shape.reached_in(block) {
            for l in (0..N).step_by(ROWS) {
                let mut square = Square::default();
                for (column, lanes) in square.iter_mut().enumerate() {
                    *lanes = added[(block * N + l + column) * count + i];
                }
                for (row, part) in transpose_square(&square).iter().take(rows).enumerate() {
                    sums[row * stride + block * count + i].0[l..][..ROWS].copy_from_slice(part);
                }
            }
        }
    }
}
