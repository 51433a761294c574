//! SGM cost aggregation (Hirschmüller 2008, section 2.3) along eight paths that end in a pixel, and
//! the disparity of the least sum.
//!
//! First the paths along the rows, in bands. Then two sweeps follow three directions each, one
//! downwards and one upwards, at the same time. In its first half of the image each sweep stores
//! the sums of its paths. Then they change halves: each adds its paths to the sums that the other
//! has stored, and chooses the disparities. The result depends only on the costs.
//!
//! Threads process a sweep as a wavefront: each takes the next row and follows its blocks from the
//! left, a block as soon as the row before has passed the block after it. So a sweep can occupy
//! half as many threads as a row has blocks.

use super::CostVolume;
use crate::error::Result;
use crate::kernel::{
    ChosenRow, Isa, Lanes, OUTSIDE, PathBlock, Penalties, RowPaths, Totals, VolumeShape,
    choose_row, finish_paths, follow_paths, follow_rows,
};
use crate::stereo::{Gray, Reason, buffer};
use parking_lot::{Mutex, MutexGuard};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The aggregation, with its scratch memory.
pub struct Aggregation {
    shape: VolumeShape,
    /// Sums of the paths along the rows.
    along: Vec<Lanes<u8>>,
    /// Sums of the paths of the sweep that reached the row first.
    sums: Vec<Lanes<u8>>,
    /// Downwards and upwards.
    sweeps: [Sweep; 2],
    workers: Vec<Worker>,
}

/// The disparities chosen from the sums.
pub struct Chosen {
    shape: VolumeShape,
    /// In the left image, in 16ths of a pixel.
    left: Vec<i16>,
    why: Vec<Reason>,
    /// In the right image, in pixels, whole blocks.
    right: Vec<i16>,
}

struct Sweep {
    upwards: bool,
    blocks: Vec<SweepBlock>,
}

/// A block of columns.
struct SweepBlock {
    paths: Mutex<PathBlock>,
    /// Rows that have passed it.
    rows: AtomicUsize,
}

/// A thread's scratch memory.
struct Worker {
    along: RowPaths,
    totals: Totals,
    /// Costs of the diagonals that enter a block from the blocks before and after it.
    before: Vec<u8>,
    after: Vec<u8>,
}

/// The left image, whose steps of grey set the penalties.
#[derive(Clone, Copy)]
struct PenalizedImage<'a> {
    image: &'a Gray,
    penalties: &'a Penalties,
}

/// Neighbouring rows of [`Chosen`].
struct ChosenRows<'a> {
    left: &'a mut [i16],
    why: &'a mut [Reason],
    right: &'a mut [i16],
}

impl Aggregation {
    /// Bytes per [`Lanes`] of the cost volume, for the volume and the sums.
    pub const BYTES: usize = 3 * size_of::<Lanes<u8>>();

    /// For costs of that shape, on the threads of rayon's current pool.
    pub fn new(shape: VolumeShape) -> Result<Self> {
        let sums = || buffer(Lanes::splat(0), shape.stride() * shape.height);
        Ok(Self {
            shape,
            along: sums()?,
            sums: sums()?,
            sweeps: [false, true].map(|upwards| Sweep::new(shape, upwards)),
            workers: (0..rayon::current_num_threads())
                .map(|_| Worker::new(shape))
                .collect::<Result<_>>()?,
        })
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
        let penalized = PenalizedImage { image, penalties };
        self.begin(isa, costs, penalized);
        self.finish(isa, costs, penalized, uniqueness, chosen);
    }

    /// Follows the rows, and each sweep to the middle, where they meet: until there they write
    /// disjoint halves.
    fn begin(&mut self, isa: Isa, costs: &CostVolume, penalized: PenalizedImage<'_>) {
        let PenalizedImage { image, penalties } = penalized;
        let (shape, sweeps) = (&self.shape, &mut self.sweeps);
        let (middle, height, stride) = (shape.height / 2, shape.height, shape.stride());
        let bands = self.along.chunks_mut(stride * RowPaths::ROWS);
        let bands = Mutex::new((0..height).step_by(RowPaths::ROWS).zip(bands));
        let follow_bands = |worker: &mut Worker| {
            while let Some((top, sums)) = next(&bands) {
                let costs = costs.rows(top..height.min(top + RowPaths::ROWS));
                follow_rows(isa, &mut worker.along, costs, image, top, penalties, sums);
            }
        };
        sweeps.iter_mut().for_each(Sweep::restart);
        let (top, bottom) = self.sums.split_at_mut(middle * stride);
        let rows = [
            in_order(false, (0..middle).zip(top.chunks_exact_mut(stride))),
            in_order(true, (middle..height).zip(bottom.chunks_exact_mut(stride))),
        ];
        on_rows(
            &mut self.workers,
            follow_bands,
            rows,
            |i, passed, (y, sums), worker| {
                let (costs, grey) = (costs.row(y), sweeps[i].grey(image, y));
                let Worker { before, after, .. } = worker;
                sweeps[i].pass_row(shape, passed, [before, after], |paths, lanes| {
                    let (costs, sums) = (&costs[lanes.clone()], &mut sums[lanes]);
                    follow_paths(isa, paths, costs, grey, penalties, sums);
                });
            },
        );
    }

    /// Each sweep resumes over the half in which the other has left its sums.
    fn finish(
        &mut self,
        isa: Isa,
        costs: &CostVolume,
        penalized: PenalizedImage<'_>,
        uniqueness: u32,
        chosen: &mut Chosen,
    ) {
        let PenalizedImage { image, penalties } = penalized;
        let (shape, sweeps) = (&self.shape, &self.sweeps);
        let (middle, height, stride) = (shape.height / 2, shape.height, shape.stride());
        let first_half = [middle, height - middle];
        let (top, bottom) = chosen.split(middle);
        let rows = [
            in_order(false, (middle..height).zip(bottom.rows(shape))),
            in_order(true, (0..middle).zip(top.rows(shape))),
        ];
        on_rows(
            &mut self.workers,
            |_| (),
            rows,
            |i, passed, (y, mut chosen), worker| {
                let (costs, grey) = (costs.row(y), sweeps[i].grey(image, y));
                let [sums, along] =
                    [&self.sums, &self.along].map(|sums| &sums[y * stride..][..stride]);
                let (passed, totals) = (first_half[i] + passed, &mut worker.totals);
                let beside = [&mut worker.before, &mut worker.after];
                sweeps[i].pass_row(shape, passed, beside, |paths, lanes| {
                    let sums = [&sums[lanes.clone()], &along[lanes.clone()]];
                    finish_paths(isa, paths, &costs[lanes], grey, penalties, sums, totals);
                });
                choose_row(isa, totals, uniqueness, &mut chosen);
            },
        );
    }
}

impl Sweep {
    fn new(shape: VolumeShape, upwards: bool) -> Self {
        let block = |block| SweepBlock {
            paths: Mutex::new(PathBlock::new(shape, block)),
            rows: AtomicUsize::new(0),
        };
        Self {
            upwards,
            blocks: (0..shape.blocks()).map(block).collect(),
        }
    }

    fn restart(&mut self) {
        for block in &mut self.blocks {
            *block.rows.get_mut() = 0;
            // A thread that panicked has left nothing that a restart does not reset.
            block.paths.get_mut().restart();
        }
    }

    /// Row `y` of the image and the previous one of the sweep. The first row of a sweep has no
    /// previous row, and none of its paths reads it.
    fn grey<'a>(&self, image: &'a Gray, y: usize) -> [&'a [u8]; 2] {
        let behind = if self.upwards {
            (y + 1).min(image.height() - 1)
        } else {
            y.saturating_sub(1)
        };
        [image.row(y), image.row(behind)]
    }

    /// Follows the blocks of a row that comes after `passed` others: `follow` gets the paths of
    /// each and its lanes of the row's costs.
    fn pass_row(
        &self,
        shape: &VolumeShape,
        passed: usize,
        [before, after]: [&mut Vec<u8>; 2],
        mut follow: impl FnMut(&mut PathBlock, Range<usize>),
    ) {
        let _release = ReleaseOnPanic(self);
        before.fill(OUTSIDE);
        for (i, block) in self.blocks.iter().enumerate() {
            match self.blocks.get(i + 1) {
                Some(next) => next.after(passed).first(after),
                None => after.fill(OUTSIDE),
            }
            let first = i * shape.count;
            let mut paths = block.after(passed);
            paths.enter(before, after);
            follow(&mut paths, first..first + shape.reached_in(i));
            drop(paths);
            block.rows.store(passed + 1, Ordering::Release);
        }
    }
}

impl SweepBlock {
    /// The paths, once that number of rows has passed. Rows are taken in order and wait only for
    /// earlier ones, so some thread can always proceed.
    fn after(&self, rows: usize) -> MutexGuard<'_, PathBlock> {
        let mut tries = 0;
        while self.rows.load(Ordering::Acquire) < rows {
            tries += 1;
            if tries < 100 {
                std::hint::spin_loop();
            } else {
                std::thread::yield_now();
            }
        }
        self.paths.lock()
    }
}

/// Releases the threads that wait for a row whose thread panics.
struct ReleaseOnPanic<'a>(&'a Sweep);

impl Drop for ReleaseOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            for block in &self.0.blocks {
                block.rows.store(usize::MAX, Ordering::Release);
            }
        }
    }
}

impl Worker {
    fn new(shape: VolumeShape) -> Result<Self> {
        let beside = vec![OUTSIDE; PathBlock::slots(&shape)];
        Ok(Self {
            along: RowPaths::new(shape)?,
            totals: Totals::new(shape)?,
            before: beside.clone(),
            after: beside,
        })
    }
}

/// Runs `first` with each worker, and then `work` on the rows of both sweeps with the index of the
/// sweep, the number of rows already taken, the row and a worker. Each worker runs on a thread of
/// rayon's current pool, as far as it has threads.
fn on_rows<R: Send>(
    workers: &mut [Worker],
    first: impl Fn(&mut Worker) + Sync,
    rows: [impl Iterator<Item = R> + Send; 2],
    work: impl Fn(usize, usize, R, &mut Worker) + Sync,
) {
    let rows = rows.map(|rows| Mutex::new(rows.enumerate()));
    let all = |(number, worker): (usize, &mut Worker)| {
        first(worker);
        // Each begins with one sweep and then helps with the other.
        for i in [number % 2, 1 - number % 2] {
            while let Some((taken, row)) = next(&rows[i]) {
                work(i, taken, row, worker);
            }
        }
    };
    if let [worker] = workers {
        all((0, worker));
    } else {
        workers
            .par_iter_mut()
            .enumerate()
            .with_max_len(1)
            .for_each(all);
    }
}

/// The next of the items that threads share.
fn next<T>(items: &Mutex<impl Iterator<Item = T>>) -> Option<T> {
    items.lock().next()
}

/// `items` in the order of a sweep.
fn in_order<T>(
    upwards: bool,
    items: impl DoubleEndedIterator<Item = T>,
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
    pub fn new(shape: VolumeShape) -> Result<Self> {
        let pixels = shape.width * shape.height;
        Ok(Self {
            shape,
            left: buffer(0, pixels)?,
            why: buffer(Reason::Border, pixels)?,
            right: buffer(ChosenRow::NONE, shape.padded() * shape.height)?,
        })
    }

    /// The disparities of row `y` of the left image, in 16ths of a pixel; 0 at the *border*.
    pub fn left(&self, y: usize) -> &[i16] {
        &self.left[y * self.shape.width..][..self.shape.width]
    }

    /// *Valid*, *ambiguous* or *border*.
    pub fn why(&self, y: usize) -> &[Reason] {
        &self.why[y * self.shape.width..][..self.shape.width]
    }

    /// The disparities of row `y` of the right image, in pixels; [`ChosenRow::NONE`] if there is
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

impl<'a> ChosenRows<'a> {
    fn rows(
        self,
        shape: &VolumeShape,
    ) -> impl DoubleEndedIterator<Item = ChosenRow<'a>> + ExactSizeIterator {
        let left = self.left.chunks_exact_mut(shape.width);
        let why = self.why.chunks_exact_mut(shape.width);
        let right = self.right.chunks_exact_mut(shape.padded());
        let rows = left.zip(why).zip(right);
        rows.map(|((left, why), right)| ChosenRow { left, why, right })
    }
}
