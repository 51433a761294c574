//! The safe choice: the disparity to report for a cell of the depth grid, and the probability that
//! it is right.
//!
//! A cell's score depends on a percentile of its true disparities. Among all disparities that could
//! be reported, the one is chosen whose tolerance interval leaves the least of the cell on either
//! side. The evidence gathered on the way becomes a probability by a table of steps.
//!
//! Disparities are in bins of 1/8 pixel.

mod fill;
mod levels;
mod map;
mod steps;
mod table;
mod time;
mod tolerance;

pub use fill::{fill_empty_rows, fill_row};
pub use levels::{DECIDES, LevelRule};
pub use map::safe_grid;
pub use steps::{Steps, TableFault};
pub use table::{Feature, VerdictTable, cell, least_score, probability, reported_depth};
pub use time::{CellPast, Past, TimeTable, follows};
pub use tolerance::Tolerance;

use crate::stereo::FittedTo;

/// Bins per pixel of disparity.
pub const BINS_PER_PX: i32 = 8;

/// Computation of cells from a disparity map: the filling of gaps, and the decision.
#[derive(Clone, Debug)]
pub struct SafeChoice {
    /// For images that are decided at their own size alone.
    pub table: VerdictTable,
    /// For those that are decided at several, and for small cells; `None` if none are.
    pub levels: Option<Box<LevelTables>>,
    /// The second decision, on unknown cells: whether something near is in them.
    pub near: Option<VerdictTable>,
    /// That on small cells: their nearer surface; `None` if none is looked for.
    pub near_small: Option<VerdictTable>,
    /// Part of the tolerance reserved for the matcher's own error, pixels.
    pub allowance_px: f64,
    /// The runs that tables and network were fitted to.
    pub fitted: FittedTo,
}

/// The decisions on the cells of images that are decided at several sizes, and on small cells.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelTables {
    pub finest: VerdictTable,
    pub middle: VerdictTable,
    pub coarsest: VerdictTable,
    /// For cells of few pixels, at any size.
    pub small: VerdictTable,
}

impl SafeChoice {
    /// The table of a level, of that many, for small cells or others.
    pub fn table_of_level(&self, level: usize, levels: usize, is_small: bool) -> &VerdictTable {
        match &self.levels {
            Some(tables) if is_small => &tables.small,
            Some(tables) if levels > 1 && level + 1 == levels => &tables.coarsest,
            Some(tables) if levels > 1 && level == 0 => &tables.finest,
            Some(tables) if levels > 1 => &tables.middle,
            _ => &self.table,
        }
    }
}

/// The pixels of a cell, collected: each votes for its bin, or for several and for none.
#[derive(Clone, Debug, Default)]
pub struct CellPixels {
    /// Per bin the votes for it, later those for lower bins: all votes in the lower half of the
    /// bits, those that support it in the upper.
    counts: Vec<u64>,
    /// All votes, and those for no bin.
    votes: i64,
    none: i64,
    /// Votes that agree with their pixel's best, if there are pixels with several.
    agreed: Option<i64>,
    pixels: i64,
    seen: i64,
    /// Sums over the pixels: matching costs, and steps of grey level to the left neighbour in
    /// quarters.
    cost: i64,
    texture: StepSum,
}

/// The steps of grey level of pixels to their left neighbours.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepSum {
    /// Their sum, quarters of a grey level.
    pub sum: i64,
    /// Pixels without a step.
    pub plain: i64,
}

impl StepSum {
    /// The sum of steps of a row.
    pub fn new(steps: impl Iterator<Item = u32>) -> Self {
        let add = |(sum, plain), step| (sum + step, plain + u32::from(step == 0));
        let (sum, plain) = steps.fold((0, 0), add);
        Self {
            sum: sum.into(),
            plain: plain.into(),
        }
    }
}

impl CellPixels {
    /// Counts over `bins` bins.
    pub fn new(bins: usize) -> Self {
        Self {
            counts: vec![0; bins + 1],
            ..Self::default()
        }
    }

    /// Removes all pixels.
    pub fn clear(&mut self) {
        self.counts.fill(0);
        (self.votes, self.none, self.agreed) = (0, 0, None);
        (self.pixels, self.seen, self.cost) = (0, 0, 0);
        self.texture = StepSum::default();
    }

    /// Adds pixels of a row: their bins, their seen flags, and the sums of their costs and steps.
    /// Each votes for its bin, and supports it if it was seen.
    pub fn add(&mut self, bins: &[i16], seen: &[u8], cost: i64, texture: StepSum) {
        for (&bin, &seen) in bins.iter().zip(seen) {
            // Counted one index higher, so that prefix sums are counts of lower bins.
            self.counts[bin as usize + 1] += 1 + (u64::from(seen) << 32);
        }
        self.votes += bins.len() as i64;
        self.measure(seen, cost, texture);
    }

    /// Adds the measurements of pixels of a row that do not vote.
    pub fn measure(&mut self, seen: &[u8], cost: i64, texture: StepSum) {
        self.pixels += seen.len() as i64;
        self.seen += i64::from(seen.iter().map(|&seen| u32::from(seen)).sum::<u32>());
        self.cost += cost;
        self.texture.sum += texture.sum;
        self.texture.plain += texture.plain;
    }

    /// Adds the votes of a pixel for some bins, which they support, and for none, the last;
    /// `agreed` are those that agree with its best.
    pub fn vote(&mut self, bins: &[i16], votes: &[u8], agreed: u8) {
        for (&bin, &votes) in bins.iter().zip(votes) {
            self.counts[bin as usize + 1] += u64::from(votes) << 32 | u64::from(votes);
        }
        self.votes += votes.iter().map(|&votes| i64::from(votes)).sum::<i64>();
        self.none += votes.get(bins.len()).map_or(0, |&none| none.into());
        self.agreed = Some(self.agreed.unwrap_or(0) + i64::from(agreed));
    }

    /// Turns counts per bin into counts of lower bins: after all pixels were added, once.
    pub fn count(&mut self) {
        let mut below = 0;
        for count in &mut self.counts {
            below += *count;
            *count = below;
        }
    }

    /// Votes for lower bins.
    fn all(&self, bin: usize) -> i64 {
        i64::from(self.counts[bin] as u32)
    }

    /// Votes for lower bins that support them.
    fn supporting(&self, bin: usize) -> i64 {
        (self.counts[bin] >> 32) as i64
    }

    /// The bins from the first to the last with a vote; empty without any.
    fn voted(&self) -> std::ops::Range<usize> {
        let reaches = |votes: i64| move |count: &u64| i64::from(*count as u32) < votes;
        let for_any = (self.votes - self.none).max(1);
        let [first, last] = [1, for_any].map(|n| self.counts[1..].partition_point(reaches(n)));
        first..(last + 1).min(self.counts.len() - 1)
    }

    /// Fraction of the pixels that were seen.
    pub fn valid_share(&self) -> f64 {
        self.seen as f64 / self.pixels.max(1) as f64
    }

    /// The 20th and the 80th percentile of the disparities.
    pub fn percentiles(&self) -> [i64; 2] {
        [20, 80].map(|percent| self.percentile(percent))
    }

    /// The first bin that is at least the disparity of `percent` of the votes for any.
    fn percentile(&self, percent: i64) -> i64 {
        let reached =
            |&count: &u64| 100 * i64::from(count as u32) >= percent * (self.votes - self.none);
        self.counts[1..].partition_point(|count| !reached(count)) as i64
    }
}
