//! The size of the image that decides on a cell: the finest that may.
//!
//! Coarser sizes see nearer things and smooth noise away; finer ones tell distances apart that are
//! the same pixel to a coarser one.

use super::{BINS_PER_PX, Tolerance};
use crate::stereo::{LevelCell, LevelVerdict, Rig};

/// Score from which a level decides on a cell, 0.90, whatever the confidence: a cell that is known
/// at a higher confidence is known at a lower one, with the same report.
pub const DECIDES: i64 = 2197;

/// Least number of right bins of a report: a narrower tolerance is finer than the pixels of a
/// halved image, or of a small cell, can tell.
const MIN_SPAN: i64 = 14;

/// Disparity in excess of that of infinity up to which a report agrees with one at infinity, pixels
/// of the pair.
const FAR_PX: f64 = 2.0;

/// The levels of a pair, and what their reports are measured with.
pub struct LevelRule<'a> {
    /// Of each level that is computed, finest first.
    pub tolerances: Vec<&'a Tolerance>,
    /// Greatest disparity of each, pixels of the level.
    pub ranges: Vec<i64>,
    /// True if level 0 needs the least span, too: its cells are smaller than those of the fit, or
    /// its rule narrower.
    pub is_outside: bool,
    /// The rig of the pair.
    pub rig: Option<&'a Rig>,
}

impl LevelRule<'_> {
    /// Judges the levels of a cell and chooses one: the finest that may decide; of none, the first
    /// if it is far, else the most probable that passes all other tests. `None` if none does.
    pub fn choose(&self, levels: &mut [LevelCell]) -> Option<usize> {
        for i in 0..levels.len() {
            levels[i].verdict = self.verdict(levels, i);
        }
        let passed = |level: &LevelCell| level.verdict == LevelVerdict::Passed;
        if let Some(finest) = levels.iter().position(passed) {
            return Some(finest);
        }
        if self.is_far(levels) {
            return Some(0);
        }
        let could = (0..levels.len()).filter(|&i| levels[i].verdict == LevelVerdict::Score);
        // Of equal scores the finest.
        could.max_by_key(|&i| (levels[i].scores[1], std::cmp::Reverse(i)))
    }

    fn verdict(&self, levels: &[LevelCell], i: usize) -> LevelVerdict {
        let Some(report) = self.report(levels, i) else {
            return LevelVerdict::NoReport;
        };
        let own = &self.tolerances[i];
        let needs_span = levels[i].level > 0 || self.is_outside;
        if needs_span && own.span(report as usize) < MIN_SPAN {
            return LevelVerdict::Span;
        }
        // Not beyond 0.8 of the finer level's range, which it sees badly.
        let finer = i.checked_sub(1);
        let finer = finer.filter(|&finer| 5 * report <= 16 * self.ranges[finer]);
        if let Some(finer) = finer
            && let Some(other) = self.report(levels, finer)
            && !self.agree(finer, other, report)
        {
            return LevelVerdict::Contradiction;
        }
        // Beyond 0.9 of this level's range it is blind.
        let coarser = (i + 1 < levels.len()).then(|| self.report(levels, i + 1));
        if let Some(coarser) = coarser.flatten()
            && 5 * coarser >= 18 * self.ranges[i]
        {
            return LevelVerdict::Range;
        }
        if levels[i].scores[1] < DECIDES {
            return LevelVerdict::Score;
        }
        LevelVerdict::Passed
    }

    /// The report of a level, bins, unless it is at infinity.
    fn report(&self, levels: &[LevelCell], i: usize) -> Option<i64> {
        let report = levels[i].evidence?.report;
        (self.beyond_infinity_px(report, levels[i].level) > 0.0).then_some(report)
    }

    /// Disparity of a report in excess of that of infinity, pixels of the pair; without a rig
    /// infinity is at 0.
    fn beyond_infinity_px(&self, report: i64, level: u8) -> f64 {
        let px = (report << level) as f64 / f64::from(BINS_PER_PX);
        // A report of 0 stands for all that is farther than the range.
        if report == 0 {
            return 0.0;
        }
        let infinity_px = self.rig.map_or(0.0, |rig| rig.infinity_px().into());
        px - f64::max(infinity_px, 0.0) - Rig::INFINITE_PX
    }

    /// True if one of the reports of a finer level and the next is right where the other is.
    fn agree(&self, finer: usize, fine: i64, coarse: i64) -> bool {
        let [first, last] = self.tolerances[finer].ends(fine as usize).map(i64::from);
        let [coarse_first, coarse_last] =
            self.tolerances[finer + 1].ends(coarse as usize).map(i64::from);
        (first..=last).contains(&(2 * coarse))
            || (2 * coarse_first..=2 * coarse_last).contains(&fine)
    }

    /// True if the finest level reports infinity, and no other a thing that is not there.
    fn is_far(&self, levels: &[LevelCell]) -> bool {
        let [finest, coarser @ ..] = levels else {
            return false;
        };
        let is_near_infinity = |level: &LevelCell| {
            let report = level.evidence.map(|evidence| evidence.report);
            report.is_none_or(|report| self.beyond_infinity_px(report, level.level) <= FAR_PX)
        };
        let reports = finest.evidence.map(|evidence| evidence.report);
        reports.is_some_and(|report| self.beyond_infinity_px(report, finest.level) <= 0.0)
            && finest.scores[1] >= DECIDES
            && coarser.iter().all(is_near_infinity)
    }
}
