//! The absolute errors of one image, from which all numbers except KITTI 2015's are computed.

use super::numbers::{NumberUnit, Numbers};
use svl_core::{Error, Result};

/// `|d − truth|` of the scored pixels with an estimate, ascending.
pub(super) struct Errors {
    sorted: Vec<f32>,
    pixels: usize,
}

impl Errors {
    /// From `(truth, estimate)` of each scored pixel, `+∞` for no estimate.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is none.
    pub(super) fn collect(judged: impl Iterator<Item = (f32, f32)>) -> Result<Self> {
        let mut pixels = 0;
        let estimated = judged
            .inspect(|_| pixels += 1)
            .filter(|(_, d)| d.is_finite());
        let mut sorted: Vec<f32> = estimated.map(|(truth, d)| (d - truth).abs()).collect();
        if pixels == 0 {
            return Err(Error::Invalid(
                "no pixel within the mask has a truth: nothing to score".into(),
            ));
        }
        sorted.sort_unstable_by(f32::total_cmp);
        Ok(Self { sorted, pixels })
    }

    /// Scored pixels.
    pub(super) fn pixels(&self) -> usize {
        self.pixels
    }

    /// Scored pixels with an estimate.
    pub(super) fn estimated(&self) -> usize {
        self.sorted.len()
    }

    /// Scored pixels without an estimate.
    pub(super) fn invalid(&self) -> usize {
        self.pixels - self.sorted.len()
    }

    /// Estimates that are off by more than `threshold_px`, strictly.
    pub(super) fn over(&self, threshold_px: f32) -> usize {
        // Sorted once, so each threshold is a binary search.
        self.sorted.len() - self.sorted.partition_point(|&error| error <= threshold_px)
    }

    /// Mean over the estimates, px.
    pub(super) fn mean(&self) -> Option<f64> {
        self.average(|error| error)
    }

    /// Root of the mean square over the estimates, px.
    pub(super) fn rms(&self) -> Option<f64> {
        self.average(|error| error * error).map(f64::sqrt)
    }

    fn average(&self, term: impl Fn(f64) -> f64) -> Option<f64> {
        let sum: f64 = self.sorted.iter().map(|&error| term(error.into())).sum();
        (!self.sorted.is_empty()).then(|| sum / self.sorted.len() as f64)
    }

    /// The table shared by Middlebury and ETH3D: `bad` in per cent by threshold, and A_q, the error
    /// of rank `rank(q · 100)` from 0.
    pub(super) fn table(
        &self,
        bad: impl Fn(f32) -> Option<f64>,
        rank: impl Fn(u8) -> usize,
    ) -> Numbers {
        let mut table = Numbers::default();
        for (name, threshold_px) in [
            ("bad0.5", 0.5),
            ("bad1.0", 1.0),
            ("bad2.0", 2.0),
            ("bad4.0", 4.0),
        ] {
            table.add(name, NumberUnit::Percent, bad(threshold_px));
        }
        table.add_share("invalid", self.invalid(), self.pixels);
        table.add_share("totbad2.0", self.over(2.0) + self.invalid(), self.pixels);
        table.add("avgerr", NumberUnit::Px, self.mean());
        table.add("rms", NumberUnit::Px, self.rms());
        for (name, q) in [("a50", 50), ("a90", 90), ("a95", 95), ("a99", 99)] {
            table.add(
                name,
                NumberUnit::Px,
                self.sorted.get(rank(q)).map(|&error| error.into()),
            );
        }
        table.add_share("coverage", self.estimated(), self.pixels);
        table.add("pixels", NumberUnit::Count, Some(self.pixels as f64));
        table
    }

    /// `⌊N · q⌋` of the `N` estimates.
    pub(super) fn rank(&self, q: u8) -> usize {
        self.sorted.len() * usize::from(q) / 100
    }
}
