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
/// Squares across a block.
const PARTS: usize = N / SIDE;

/// The paths along the rows of a band. It holds one thread's scratch.
pub struct RowPaths {
    shape: VolumeShape,
    /// By sixteen columns, then disparity: columns of rows.
    costs: Vec<Square>,
    added: Vec<Square>,
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
        let columns = shape.padded();
        let squares = vec![Square::default(); columns / SIDE * shape.count];
        Self {
            shape,
            costs: squares.clone(),
            added: squares,
            steps: vec![[0; ROWS]; columns],
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
    for (part, squares) in transposed.chunks_exact_mut(count).enumerate() {
        let (block, part) = (part / PARTS, part % PARTS);
        let squares = &mut squares[..shape.reached_in(block)];
        // A band at the bottom may have fewer rows; the content of the others does not matter.
        let lanes: [_; ROWS] = std::array::from_fn(|row| {
            &costs[row.min(rows - 1) * stride + block * count..][..squares.len()]
        });
        for (i, to) in squares.iter_mut().enumerate() {
            let mut square = Square::default();
            for row in 0..ROWS {
                square[row] = lanes[row][i].0.as_chunks().0[part];
            }
            *to = transpose_square(&square);
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
        let (first, column) = (x / SIDE * count, x % SIDE);
        let costs = &transposed[first..][..shape.reached(x)];
        let added = &mut added[first..][..count];
        advance(
            before,
            now,
            ([0], 0),
            costs.iter().map(|square| &square[column]),
            penalties.small,
            [steps[x]],
            added.iter_mut().map(|square| FromLeft(&mut square[column])),
        );
        std::mem::swap(before, now);
    }
    before.fill([[OUTSIDE; ROWS]]);
    now.fill([[OUTSIDE; ROWS]]);
    for x in (0..shape.width).rev() {
        let (first, column) = (x / SIDE * count, x % SIDE);
        let costs = &transposed[first..][..shape.reached(x)];
        let added = &mut added[first..][..count];
        // The last column has no column after it.
        let step = steps[(x + 1).min(shape.width - 1)];
        advance(
            before,
            now,
            ([0], 0),
            costs.iter().map(|square| &square[column]),
            penalties.small,
            [step],
            added
                .iter_mut()
                .map(|square| FromRight(&mut square[column])),
        );
        std::mem::swap(before, now);
    }

    for (part, squares) in added.chunks_exact(count).enumerate() {
        let (block, part) = (part / PARTS, part % PARTS);
        for (i, square) in squares[..shape.reached_in(block)].iter().enumerate() {
            for (row, lanes) in transpose_square(square).iter().take(rows).enumerate() {
                let sums = &mut sums[row * stride + block * count + i].0;
                sums.as_chunks_mut().0[part] = *lanes;
            }
        }
    }
}
