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
    /// Tolerances of the levels that are computed, finest first.
    pub tolerances: &'a [Tolerance],
    /// Greatest disparity of each, pixels of the level.
    pub ranges: &'a [i64],
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
        // The finest of equal ones.
        could.max_by_key(|&i| (levels[i].scores[1], std::cmp::Reverse(i)))
    }

    /// Judges the only level of a cell: true if it reports.
    pub fn reports_alone(&self, level: &mut LevelCell) -> bool {
        let is_narrow = |report| self.is_outside && self.is_narrow(0, report);
        let is_refused = self.report(level).is_some_and(is_narrow);
        if is_refused {
            level.verdict = LevelVerdict::Span;
        }
        !is_refused
    }

    fn is_narrow(&self, i: usize, report: i64) -> bool {
        self.tolerances[i].span(report as usize) < MIN_SPAN
    }

    fn verdict(&self, levels: &[LevelCell], i: usize) -> LevelVerdict {
        let Some(report) = self.report(&levels[i]) else {
            return match levels[i].evidence {
                Some(_) => LevelVerdict::Far,
                None => LevelVerdict::NoReport,
            };
        };
        let needs_span = levels[i].level > 0 || self.is_outside;
        if needs_span && self.is_narrow(i, report) {
            return LevelVerdict::Span;
        }
        // Not beyond 0.8 of the finer level's range, which it sees badly.
        let finer = i.checked_sub(1);
        let finer = finer.filter(|&finer| 5 * report <= 16 * self.ranges[finer]);
        if let Some(finer) = finer
            && let Some(other) = self.report(&levels[finer])
            && !self.agree(finer, other, report)
        {
            return LevelVerdict::Contradiction;
        }
        // Beyond 0.9 of its range this level is blind, unless it says what the next one sees too
        // coarsely to decide.
        let coarser = levels.get(i + 1).and_then(|coarser| self.report(coarser));
        if let Some(coarser) = coarser
            && 5 * coarser >= 18 * self.ranges[i]
            && !(self.is_narrow(i + 1, coarser) && self.agree(i, report, coarser))
        {
            return LevelVerdict::Range;
        }
        if levels[i].scores[1] < DECIDES {
            return LevelVerdict::Score;
        }
        LevelVerdict::Passed
    }

    /// The report of a level, bins, unless it is at infinity.
    fn report(&self, level: &LevelCell) -> Option<i64> {
        let report = level.evidence?.report;
        (self.beyond_infinity_px(report, level.level) > 0.0).then_some(report)
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
        let [coarse_first, coarse_last] = self.tolerances[finer + 1]
            .ends(coarse as usize)
            .map(i64::from);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::{CellEvidence, CellRule};

    /// Three levels of 1280 px, of f·B 57.6 px·m, with a range of 80 px at each.
    struct Case {
        rig: Rig,
        tolerances: Vec<Tolerance>,
    }

    impl Case {
        fn new() -> Self {
            let rig = Rig::new(1280.0, (640.0, 360.0), 0.045, 0.0).unwrap();
            let tolerance =
                |rig: Rig| Tolerance::new(CellRule::default(), Some(&rig), 0.25, 16 * 41);
            let rigs = [rig, rig.halved(), rig.halved().halved()];
            Self {
                rig,
                tolerances: rigs.map(tolerance).to_vec(),
            }
        }

        /// Judges levels with those reports, px of each, and scores; returns the verdicts and the
        /// level that is chosen.
        fn judge(&self, levels: [(f64, i64); 3]) -> ([LevelVerdict; 3], Option<usize>) {
            self.judge_with(levels, false)
        }

        fn judge_with(
            &self,
            levels: [(f64, i64); 3],
            is_outside: bool,
        ) -> ([LevelVerdict; 3], Option<usize>) {
            let rule = LevelRule {
                tolerances: &self.tolerances,
                ranges: &[80; 3],
                is_outside,
                rig: Some(&self.rig),
            };
            let mut number = 0..;
            let mut cells = levels.map(|(px, score)| LevelCell {
                level: number.next().unwrap(),
                evidence: (px >= 0.0).then(|| CellEvidence {
                    report: (8.0 * px) as i64,
                    ..CellEvidence::default()
                }),
                scores: [score; 2],
                ..LevelCell::NOTHING
            });
            let chosen = rule.choose(&mut cells);
            (cells.map(|cell| cell.verdict), chosen)
        }
    }

    const NONE: (f64, i64) = (-1.0, 0);
    use LevelVerdict::{Contradiction, NoReport, Passed, Range, Score, Span};

    #[test]
    fn the_finest_that_may_decide_decides() {
        let case = Case::new();
        let levels = [(40.0, 2197), (20.0, 9000), (10.0, 9000)];
        assert_eq!(case.judge(levels), ([Passed; 3], Some(0)));
        let levels = [(40.0, 2196), (20.0, 2197), (10.0, 9000)];
        assert_eq!(case.judge(levels), ([Score, Passed, Passed], Some(1)));
        let levels = [NONE, (20.0, 2196), (10.0, 2197)];
        assert_eq!(case.judge(levels), ([NoReport, Score, Passed], Some(2)));
        // The most probable if none may, the finest of equal ones.
        let levels = [(40.0, -9), (20.0, 100), (10.0, 100)];
        assert_eq!(case.judge(levels), ([Score; 3], Some(1)));
        assert_eq!(case.judge([NONE; 3]), ([NoReport; 3], None));
    }

    #[test]
    fn narrow_tolerances_do_not_decide_at_a_coarser_level() {
        let case = Case::new();
        // 20 % of 4 px are 13 bins of it on both sides, less the allowance.
        let levels = [(16.0, 0), (8.0, 3000), (4.0, 9000)];
        assert_eq!(case.judge(levels), ([Score, Passed, Span], Some(1)));
        let levels = [(4.0, 3000), NONE, NONE];
        assert_eq!(case.judge(levels).0[0], Passed);
        assert_eq!(
            case.judge_with(levels, true),
            ([Span, NoReport, NoReport], None)
        );
    }

    #[test]
    fn a_level_that_contradicts_the_finer_one_does_not_decide() {
        let case = Case::new();
        let levels = [(40.0, 0), (30.0, 9000), NONE];
        assert_eq!(case.judge(levels).0, [Score, Contradiction, NoReport]);
        // The next finer one is asked, whatever it may decide itself.
        let levels = [NONE, (40.0, 0), (10.0, 9000)];
        assert_eq!(
            case.judge(levels),
            ([NoReport, Score, Contradiction], Some(1))
        );
        // A finer one is blind beyond 0.8 of its range.
        let levels = [(30.0, 0), (32.5, 9000), NONE];
        assert_eq!(case.judge(levels), ([Score, Passed, NoReport], Some(1)));
    }

    #[test]
    fn things_that_are_nearer_than_the_range_are_seen_by_the_next_level() {
        let case = Case::new();
        let levels = [(30.0, 9000), (60.0, 9000), (30.0, 9000)];
        assert_eq!(case.judge(levels), ([Range, Passed, Passed], Some(1)));
        let levels = [(30.0, 9000), (60.0, 9000), (72.0, 9000)];
        assert_eq!(case.judge(levels), ([Range, Range, Passed], Some(2)));
        let levels = [(70.0, 9000), (35.0, 9000), NONE];
        assert_eq!(case.judge(levels).1, Some(0));
    }

    #[test]
    fn far_is_far_at_all_levels() {
        let case = Case::new();
        let chosen = |levels| case.judge(levels).1;
        assert_eq!(chosen([(0.0, 2197), NONE, (0.0, 0)]), Some(0));
        assert_eq!(chosen([(0.0, 2196), NONE, NONE]), None);
        assert_eq!(chosen([(0.0, 9000), (1.0, 0), NONE]), Some(0));
        // Something 2.5 px away at half the size.
        assert_eq!(case.judge([(0.0, 9000), (2.5, 0), NONE]).0[1], Span);
        assert_eq!(chosen([(0.0, 9000), (2.5, 0), NONE]), None);
    }
}
