//! The safe choice: the disparity to report for a cell of the depth grid, and the probability that
//! it is right.
//!
//! A cell's score depends on a percentile of its true disparities. Among all disparities that could
//! be reported, the one is chosen whose tolerance interval leaves the least of the cell on either
//! side. The evidence gathered on the way becomes a probability by a table of steps.
//!
//! Disparities are in bins of 1/8 pixel.

mod fill;
mod map;
mod tolerance;
mod verdict;

pub use fill::{fill_empty_rows, fill_row};
pub use map::{FilledMap, safe_grid};
pub use tolerance::Tolerance;
pub use verdict::{Feature, VerdictTable};

use crate::stereo::{Cell, CellDepth, CellEvidence, FittedTo, Rig};

/// Bins per pixel of disparity.
pub const BINS_PER_PX: i32 = 8;

/// Rule that decides on cells.
#[derive(Clone, Debug)]
pub struct Decision {
    /// The percentile of the cell's disparities to report, 1..=99: 50 is the median, 75 the nearest
    /// quarter.
    pub rank: i64,
    /// Disparities whose safety differs by at most this, thousandths of the cell, count as equal:
    /// the one nearest to that percentile is reported.
    pub slack: i64,
    /// Least score of a known cell, thousandths of the log odds.
    pub least_score: i64,
    pub table: VerdictTable,
}

/// Computation of cells from a disparity map: the filling of gaps, and the decision.
#[derive(Clone, Debug)]
pub struct SafeChoice {
    pub decision: Decision,
    /// Ends of a gap whose disparities differ by more belong to two surfaces, bins.
    pub jump: i32,
    /// Part of the tolerance reserved for the matcher's own error, pixels.
    pub allowance_px: f64,
    /// Hash of the network that weighs disparities for gaps, for the table's
    /// [`network`](VerdictTable::network).
    pub network: Option<String>,
    /// The runs that table and network were fitted to.
    pub fitted: Vec<FittedTo>,
}

impl SafeChoice {
    /// What is wrong with its probabilities, if the table was fitted without the network, with
    /// another, or to another part of a cell.
    pub fn misfit(&self) -> Option<&'static str> {
        let Decision { rank, table, .. } = &self.decision;
        if self.network.as_deref() != table.network.as_deref() {
            Some(
                "no table= is given, so its probabilities are of a table that was fitted without \
                 this network: `svl train cells` makes one",
            )
        } else if *rank != table.rank {
            Some(
                "its probabilities are of a table for another rank: leave rank= out, or take \
                 target=near",
            )
        } else {
            None
        }
    }
}

/// The pixels of a cell, collected: each votes for its bin, or for several and for none.
#[derive(Clone, Debug)]
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
    texture: i64,
}

impl CellPixels {
    /// Counts over `bins` bins.
    pub fn new(bins: usize) -> Self {
        Self {
            counts: vec![0; bins + 1],
            votes: 0,
            none: 0,
            agreed: None,
            pixels: 0,
            seen: 0,
            cost: 0,
            texture: 0,
        }
    }

    /// Removes all pixels.
    pub fn clear(&mut self) {
        self.counts.fill(0);
        (self.votes, self.none, self.agreed) = (0, 0, None);
        (self.pixels, self.seen, self.cost, self.texture) = (0, 0, 0, 0);
    }

    /// Adds pixels of a row: their bins, their seen flags, and the sums of their costs and steps.
    /// Each votes for its bin, and supports it if it was seen.
    pub fn add(&mut self, bins: &[i16], seen: &[u8], cost: i64, texture: i64) {
        for (&bin, &seen) in bins.iter().zip(seen) {
            // Counted one index higher, so that prefix sums are counts of lower bins.
            self.counts[bin as usize + 1] += 1 + (u64::from(seen) << 32);
        }
        self.votes += bins.len() as i64;
        self.measure(seen, cost, texture);
    }

    /// Adds the measurements of pixels of a row that do not vote.
    pub fn measure(&mut self, seen: &[u8], cost: i64, texture: i64) {
        self.pixels += seen.len() as i64;
        self.seen += i64::from(seen.iter().map(|&seen| u32::from(seen)).sum::<u32>());
        self.cost += cost;
        self.texture += texture;
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

    /// Turns counts per bin into counts of lower bins.
    fn accumulate(&mut self) {
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

    /// The first bin that is at least the disparity of `percent` of the votes for any.
    fn percentile(&self, percent: i64) -> i64 {
        let reached =
            |&count: &u64| 100 * i64::from(count as u32) >= percent * (self.votes - self.none);
        self.counts[1..].partition_point(|count| !reached(count)) as i64
    }
}

impl Decision {
    /// Decides on the pixels, of which at least one votes; they are consumed.
    pub fn evidence(&self, cell: &mut CellPixels, tolerance: &Tolerance) -> CellEvidence {
        cell.accumulate();
        let (pixels, votes) = (cell.pixels, cell.votes);
        let bins = tolerance.bins();
        let all = |bin| cell.all(bin);
        let supporting = |bin| cell.supporting(bin);
        // Fraction of the cell that may be uncertain, on the side with less room. Half of the votes
        // for none count on either side.
        let rank = self.rank * votes - 50 * cell.none;
        let safe = |v: usize| {
            let [l, r] = tolerance.within(v);
            (rank - 100 * all(l)).min(100 * all(r) - rank)
        };
        let held = |v: usize| {
            let [l, r] = tolerance.within(v);
            supporting(r) - supporting(l)
        };
        let score = |v: usize| 4 * safe(v) + 100 * held(v);
        let best = (0..bins).map(score).max().unwrap_or_default();
        let target = cell.percentile(self.rank);
        let good = |v: &usize| 10 * (best - score(*v)) <= 4 * self.slack * votes;
        let report = (0..bins)
            .filter(good)
            .min_by_key(|&v| ((v as i64 - target).abs(), -(v as i64)))
            .unwrap_or_default();
        let report_bins = report as i64;
        let of_votes = |part: i64| match cell.agreed {
            Some(_) => 1000 * part / votes,
            None => CellEvidence::NOT_MEASURED,
        };
        CellEvidence {
            report: report_bins,
            target,
            features: [
                (10 * safe(report)).div_euclid(votes),
                1000 * held(report) / votes,
                1000 * cell.seen / pixels,
                1000 * (report_bins - target).abs() / tolerance.span(report),
                100 * cell.cost / pixels,
                25 * cell.texture / pixels,
                tolerance.span(report),
                of_votes(votes - cell.none),
                of_votes(cell.agreed.unwrap_or(0)),
            ],
        }
    }

    /// The cell of a grid. `min_valid` is the least fraction of seen pixels.
    pub fn cell(
        &self,
        pixels: &CellPixels,
        evidence: &CellEvidence,
        min_valid: f64,
        rig: Option<&Rig>,
    ) -> Cell {
        let score = self.table.score(evidence);
        let seen = evidence.features[Feature::Seen as usize];
        let known =
            seen as f64 >= 1000.0 * min_valid && score >= self.least_score && evidence.report > 0;
        let px = |bins: i64| bins as f32 / BINS_PER_PX as f32;
        let median_px = px(evidence.report);
        Cell {
            valid_share: pixels.seen as f64 / pixels.pixels.max(1) as f64,
            depth: known.then(|| CellDepth {
                median_px,
                p20_px: px(pixels.percentile(20)),
                p80_px: px(pixels.percentile(80)),
                distance_m: rig.and_then(|rig| rig.depth_m(f64::from(median_px))),
            }),
            probability: Some(1.0 / (1.0 + (-score as f64 / 1000.0).exp())),
            evidence: Some(*evidence),
            too_close: false,
        }
    }

    /// The score from which a cell is right with that probability, 0.5..1.
    pub fn least_score(confidence: f64) -> i64 {
        (1000.0 * (confidence / (1.0 - confidence)).ln() + 0.5).floor() as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn confidence_is_log_odds() {
        assert_eq!(Decision::least_score(0.75), 1099);
        assert_eq!(Decision::least_score(0.5), 0);
    }
}
