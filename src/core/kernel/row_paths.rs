//! SGM cost aggregation along the rows, from both ends, in bands of rows.
//!
//! A path along a row reads its neighbour in the row, which is another lane of a volume's block. So
//! the blocks are transposed first, with the rows of the band as lanes, and the sums are transposed
//! back.

use super::lanes::{SIDE, Square, transpose_square};
use super::paths::{PathOutput, advance};
use super::volume::OUTSIDE;
use super::{Lanes, Penalties, VolumeShape};
use crate::error::Result;
use crate::stereo::{Gray, buffer};
use std::ops::Range;

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
    pub fn new(shape: VolumeShape) -> Result<Self> {
        let columns = shape.padded();
        let squares = columns / SIDE * shape.count;
        Ok(Self {
            shape,
            costs: buffer(Square::default(), squares)?,
            added: buffer(Square::default(), squares)?,
            steps: vec![[0; ROWS]; columns],
            lines: [(); 2].map(|()| vec![[[0; ROWS]]; shape.count + 2]),
        })
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
    let rows = costs.len() / paths.shape.stride();
    paths.load_costs(costs, rows);
    paths.load_steps(image, top..top + rows, penalties);
    paths.follow_from_left(penalties.small);
    paths.follow_from_right(penalties.small);
    paths.write_sums(rows, sums);
}

impl RowPaths {
    /// Transposes the costs of a band of `rows` rows.
    #[inline(always)]
    fn load_costs(&mut self, costs: &[Lanes<u8>], rows: usize) {
        let (shape, count, stride) = (&self.shape, self.shape.count, self.shape.stride());
        for (part, squares) in self.costs.chunks_exact_mut(count).enumerate() {
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
    }

    /// Looks up P2 of the steps along those rows of the image.
    #[inline(always)]
    fn load_steps(&mut self, image: &Gray, rows: Range<usize>, penalties: &Penalties) {
        let width = self.shape.width;
        for (block, steps) in self.steps.as_chunks_mut::<ROWS>().0.iter_mut().enumerate() {
            for (steps, y) in steps.iter_mut().zip(rows.clone()) {
                let grey = image.row(y);
                for (step, x) in steps.iter_mut().zip(block * ROWS..width) {
                    let difference = grey[x].abs_diff(grey[x.saturating_sub(1)]);
                    *step = penalties.large[usize::from(difference)];
                }
            }
            *steps = transpose_square(steps);
        }
    }

    /// At the end of the rows no path has begun, so all its costs are `OUTSIDE` and it adds
    /// nothing.
    #[inline(always)]
    fn begin(&mut self) {
        for line in &mut self.lines {
            line.fill([[OUTSIDE; ROWS]]);
        }
    }

    #[inline(always)]
    fn follow_from_left(&mut self, small: u8) {
        self.begin();
        let (shape, [before, now]) = (&self.shape, &mut self.lines);
        for x in 0..shape.width {
            let (first, column) = (x / SIDE * shape.count, x % SIDE);
            let costs = &self.costs[first..][..shape.reached(x)];
            let added = &mut self.added[first..][..shape.count];
            advance(
                before,
                now,
                ([0], 0),
                costs.iter().map(|square| &square[column]),
                small,
                [self.steps[x]],
                added.iter_mut().map(|square| FromLeft(&mut square[column])),
            );
            std::mem::swap(before, now);
        }
    }

    #[inline(always)]
    fn follow_from_right(&mut self, small: u8) {
        self.begin();
        let (shape, [before, now]) = (&self.shape, &mut self.lines);
        for x in (0..shape.width).rev() {
            let (first, column) = (x / SIDE * shape.count, x % SIDE);
            let costs = &self.costs[first..][..shape.reached(x)];
            let added = &mut self.added[first..][..shape.count];
            // The last column has no column after it.
            let step = self.steps[(x + 1).min(shape.width - 1)];
            advance(
                before,
                now,
                ([0], 0),
                costs.iter().map(|square| &square[column]),
                small,
                [step],
                added
                    .iter_mut()
                    .map(|square| FromRight(&mut square[column])),
            );
            std::mem::swap(before, now);
        }
    }

    /// Transposes what the paths added back.
    #[inline(always)]
    fn write_sums(&self, rows: usize, sums: &mut [Lanes<u8>]) {
        let (count, stride) = (self.shape.count, self.shape.stride());
        for (part, squares) in self.added.chunks_exact(count).enumerate() {
            let (block, part) = (part / PARTS, part % PARTS);
            let reached = self.shape.reached_in(block);
            for (i, square) in squares[..reached].iter().enumerate() {
                for (row, lanes) in transpose_square(square).iter().take(rows).enumerate() {
                    let sums = &mut sums[row * stride + block * count + i].0;
                    sums.as_chunks_mut().0[part] = *lanes;
                }
            }
        }
    }
}
