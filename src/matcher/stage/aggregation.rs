//! SGM cost aggregation (Hirschmüller 2008, section 2.3) along eight paths that end in a pixel, and
//! the disparity of the least sum.
//!
//! Two sweeps follow three directions each, one downwards and one upwards, and run at the same
//! time. In its first half of the image each stores what its paths add. Then they change halves:
//! each adds its paths and those along the row to what the other has stored, and chooses the
//! disparities. The result depends on nothing but the costs.

use super::{CostVolume, both};
use crate::kernel::{
    ChosenRow, Isa, Lanes, Paths, Penalties, RowPaths, Totals, VolumeShape, choose_row,
    finish_paths, follow_paths, follow_rows,
};
use crate::stereo::{Gray, Reason};
use std::ops::Range;

/// The aggregation, with its scratch memory.
pub struct Aggregation {
    shape: VolumeShape,
    /// What the paths of the sweep that came to a row first add to its costs.
    sums: Vec<Lanes<u8>>,
    down: PathSweep,
    up: PathSweep,
}

/// The disparities chosen from the sums.
pub struct Chosen {
    shape: VolumeShape,
    /// Of the left image, in 16ths of a pixel.
    left: Vec<i16>,
    why: Vec<Reason>,
    /// Of the right image, in pixels, whole blocks.
    right: Vec<i16>,
}

struct PathSweep {
    upwards: bool,
    paths: Paths,
    along: RowPaths,
    totals: Totals,
}

/// Neighbouring rows of [`Chosen`].
struct ChosenRows<'a> {
    left: &'a mut [i16],
    why: &'a mut [Reason],
    right: &'a mut [i16],
}

impl Aggregation {
    /// Bytes per [`Lanes`] of the cost volume, for that and for the sums.
    pub const BYTES: usize = 2 * size_of::<Lanes<u8>>();

    /// For costs of that shape.
    pub fn new(shape: VolumeShape) -> Self {
        let sweep = |upwards| PathSweep {
            upwards,
            paths: Paths::new(shape),
            along: RowPaths::new(shape),
            totals: Totals::new(shape),
        };
        Self {
            shape,
            sums: vec![Lanes::splat(0); shape.stride() * shape.height],
            down: sweep(false),
            up: sweep(true),
        }
    }

    /// Aggregates `costs`, those of the left image `image`, and chooses the disparities. Other
    /// disparities must be worse by `uniqueness` per cent.
    pub fn choose(
        &mut self,
        isa: Isa,
        costs: &CostVolume,
        image: &Gray,
        penalties: &Penalties,
        uniqueness: u32,
        chosen: &mut Chosen,
    ) {
        let Self {
            shape,
            sums,
            down,
            up,
        } = self;
        let (middle, height, stride) = (shape.height / 2, shape.height, shape.stride());
        let work = Work {
            isa,
            costs,
            image,
            penalties,
            uniqueness,
        };
        // The sweeps meet in the middle: until there they write disjoint halves and need no lock.
        let (top, bottom) = sums.split_at_mut(middle * stride);
        down.paths.restart();
        up.paths.restart();
        both(
            || work.begin(down, 0..middle, 0, top),
            || work.begin(up, (middle..height).rev(), middle, bottom),
        );
        // Then each goes on over the half that the other has left its sums in.
        let (top_chosen, bottom_chosen) = chosen.split(middle);
        both(
            || work.finish(down, middle..height, bottom, bottom_chosen),
            || work.finish(up, 0..middle, top, top_chosen),
        );
    }
}

/// Inputs of both sweeps.
struct Work<'a> {
    isa: Isa,
    costs: &'a CostVolume,
    image: &'a Gray,
    penalties: &'a Penalties,
    uniqueness: u32,
}

impl Work<'_> {
    /// Row `y` of the image and the previous one of the sweep. The first row of a sweep has none;
    /// no path of it looks there.
    fn grey(&self, upwards: bool, y: usize) -> [&[u8]; 2] {
        let behind = if upwards {
            (y + 1).min(self.image.height() - 1)
        } else {
            y.saturating_sub(1)
        };
        [self.image.row(y), self.image.row(behind)]
    }

    /// Aggregates over `rows` of the first half of a sweep, whose top row is `top`, and stores what
    /// the paths add.
    fn begin(
        &self,
        sweep: &mut PathSweep,
        rows: impl Iterator<Item = usize>,
        top: usize,
        sums: &mut [Lanes<u8>],
    ) {
        let stride = self.costs.shape().stride();
        for y in rows {
            let (grey, sums) = (
                self.grey(sweep.upwards, y),
                &mut sums[(y - top) * stride..][..stride],
            );
            follow_paths(
                self.isa,
                &mut sweep.paths,
                self.costs.row(y),
                grey,
                self.penalties,
                sums,
            );
        }
    }

    /// Aggregates over the half that the other sweep began with, sums everything and chooses.
    fn finish(
        &self,
        sweep: &mut PathSweep,
        half: Range<usize>,
        sums: &[Lanes<u8>],
        mut chosen: ChosenRows<'_>,
    ) {
        let shape = self.costs.shape();
        let PathSweep {
            upwards,
            paths,
            along,
            totals,
        } = sweep;
        let bands = half
            .clone()
            .step_by(RowPaths::ROWS)
            .map(|top| top..half.end.min(top + RowPaths::ROWS));
        for band in in_order(bands, *upwards) {
            follow_rows(
                self.isa,
                along,
                self.costs.rows(band.clone()),
                self.image,
                band.start,
                self.penalties,
            );
            for y in in_order(band.clone(), *upwards) {
                let grey = self.grey(*upwards, y);
                let sums = [
                    &sums[(y - half.start) * shape.stride()..],
                    along.row(y - band.start),
                ];
                finish_paths(
                    self.isa,
                    paths,
                    self.costs.row(y),
                    grey,
                    self.penalties,
                    sums,
                    totals,
                );
                choose_row(
                    self.isa,
                    totals,
                    self.uniqueness,
                    &mut chosen.row(y - half.start, &shape),
                );
            }
        }
    }
}

/// `items` in the order of a sweep.
fn in_order<T>(
    items: impl DoubleEndedIterator<Item = T> + Clone,
    upwards: bool,
) -> impl Iterator<Item = T> {
    // Both directions as one type of iterator, without boxing it.
    let (down, up) = if upwards {
        (None, Some(items.rev()))
    } else {
        (Some(items), None)
    };
    down.into_iter().flatten().chain(up.into_iter().flatten())
}

impl Chosen {
    /// For costs of that shape.
    pub fn new(shape: VolumeShape) -> Self {
        let pixels = shape.width * shape.height;
        Self {
            shape,
            left: vec![0; pixels],
            why: vec![Reason::Border; pixels],
            right: vec![ChosenRow::NONE; shape.padded() * shape.height],
        }
    }

    /// The disparities of row `y` of the left image, in 16ths of a pixel; 0 at the *border*.
    pub fn left(&self, y: usize) -> &[i16] {
        &self.left[y * self.shape.width..][..self.shape.width]
    }

    /// *Valid*, *ambiguous* or *border*.
    pub fn why(&self, y: usize) -> &[Reason] {
        &self.why[y * self.shape.width..][..self.shape.width]
    }

    /// The disparities of row `y` of the right image, in pixels; [`ChosenRow::NONE`] where there is
    /// none.
    pub fn right(&self, y: usize) -> &[i16] {
        &self.right[y * self.shape.padded()..][..self.shape.width]
    }

    /// The rows above `middle`, and the others.
    fn split(&mut self, middle: usize) -> (ChosenRows<'_>, ChosenRows<'_>) {
        let (left, left_below) = self.left.split_at_mut(middle * self.shape.width);
        let (why, why_below) = self.why.split_at_mut(middle * self.shape.width);
        let (right, right_below) = self.right.split_at_mut(middle * self.shape.padded());
        (
            ChosenRows { left, why, right },
            ChosenRows {
                left: left_below,
                why: why_below,
                right: right_below,
            },
        )
    }
}

impl ChosenRows<'_> {
    fn row(&mut self, y: usize, shape: &VolumeShape) -> ChosenRow<'_> {
        ChosenRow {
            left: &mut self.left[y * shape.width..][..shape.width],
            why: &mut self.why[y * shape.width..][..shape.width],
            right: &mut self.right[y * shape.padded()..][..shape.padded()],
        }
    }
}
