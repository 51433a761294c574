//! The sums of four paths: strips of columns and strips of rows, one task for each.

use super::census::{HalfImage, StepCosts, TwoWayPlane, padded};
use crate::error::Result;
use crate::kernel::{Isa, Lanes, PathCost, StripPlace, follow_strip, sum_strips};
use crate::matcher::stage::both;
use crate::stereo::buffer;
use rayon::prelude::*;

const N: usize = Lanes::COUNT;

/// The sums of all strips.
pub(super) struct StripSums {
    count: usize,
    strips: Vec<Strip>,
    columns: usize,
}

/// A strip with its memory.
struct Strip {
    place: StripPlace,
    costs: Vec<Lanes<u8>>,
    line: Vec<Lanes<u8>>,
    sums: Vec<Lanes<u8>>,
}

impl Strip {
    fn new(place: StripPlace, count: usize) -> Result<Self> {
        let lanes = |n: usize| buffer(Lanes::splat(u8::MAX), n);
        Ok(Self {
            place,
            costs: lanes(place.length * count)?,
            line: lanes(count + 1)?,
            sums: lanes(place.length * count)?,
        })
    }
}

impl StripSums {
    /// For images of `size` and `count` disparities; `margin` is that of the right censuses.
    pub(super) fn new(
        (width, height): (usize, usize),
        count: usize,
        margin: usize,
    ) -> Result<Self> {
        let column = |x: usize| StripPlace {
            length: height,
            start: x,
            right: margin + x,
            pitch: padded(width),
            towards: 1,
            column: x,
            lanes_are_columns: true,
        };
        let row = |y: usize| StripPlace {
            length: width,
            start: y,
            right: y,
            pitch: padded(height),
            towards: padded(height),
            column: 0,
            lanes_are_columns: false,
        };
        let columns = (0..width).step_by(N).map(column);
        let rows = (0..height).step_by(N).map(row);
        let strips = columns.chain(rows).map(|place| Strip::new(place, count));
        Ok(Self {
            count,
            strips: strips.collect::<Result<_>>()?,
            columns: width.div_ceil(N),
        })
    }

    /// Follows the paths of all strips, with the cost of a disparity that leads out of the right
    /// image, and of a change by one.
    pub(super) fn follow(
        &mut self,
        isa: Isa,
        images: &[HalfImage; 2],
        steps: &StepCosts,
        [out, small]: [u8; 2],
    ) {
        let follow = |strip: &mut Strip| {
            let by_column = strip.place.lanes_are_columns;
            let planes = images.each_ref().map(|image| {
                let plane = |plane| chosen(plane, by_column);
                image.census.each_ref().map(plane)
            });
            let cost = PathCost {
                out,
                small,
                large: if by_column {
                    &steps.down[..]
                } else {
                    &steps.across.columns
                },
            };
            let Strip {
                place,
                costs,
                line,
                sums,
            } = strip;
            follow_strip(isa, place, planes, cost, costs, line, sums);
        };
        // Columns in parallel with rows: each takes one of two threads about as long.
        let (columns, rows) = self.strips.split_at_mut(self.columns);
        both(
            || columns.par_iter_mut().for_each(follow),
            || rows.par_iter_mut().for_each(follow),
        );
    }

    /// The sums of a pixel.
    #[inline(always)]
    pub(super) fn pixel(&self, [x, y]: [usize; 2]) -> PixelSums<'_> {
        let strips = [&self.strips[x / N], &self.strips[self.columns + y / N]];
        let along = &strips[0].sums[y * self.count..][..self.count];
        let across = &strips[1].sums[x * self.count..][..self.count];
        PixelSums([along, across], [x % N, y % N])
    }

    /// The sums of up to 16 rows from `top` on, a multiple of 16: by row, disparity and column,
    /// with `stride` columns. Whole blocks are written, with [`u8::MAX`] beyond the image's
    /// `width`.
    pub(super) fn rows(&self, isa: Isa, top: usize, width: usize, stride: usize, out: &mut [u8]) {
        let rows = &self.strips[self.columns + top / N];
        for (i, columns) in self.strips[..self.columns].iter().enumerate() {
            let columns = &columns.sums[top * self.count..];
            sum_strips(
                isa,
                columns,
                &rows.sums,
                self.count,
                [i * N, top],
                stride,
                out,
            );
        }
        for line in out.chunks_exact_mut(stride) {
            line[width..padded(width)].fill(u8::MAX);
        }
    }
}

/// Sums of a pixel along the columns and along the rows, by disparity, and its lanes.
pub(super) struct PixelSums<'a>([&'a [Lanes<u8>]; 2], [usize; 2]);

impl PixelSums<'_> {
    #[inline(always)]
    pub(super) fn at(&self, disparity: usize) -> i32 {
        let Self([along, across], [x, y]) = self;
        i32::from(along[disparity].0[*x] + across[disparity].0[*y])
    }
}

/// The plane by column or by row.
fn chosen(plane: &TwoWayPlane, by_column: bool) -> &[u8] {
    if by_column {
        &plane.rows
    } else {
        &plane.columns
    }
}
