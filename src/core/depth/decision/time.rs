//! A cell over time: a report that agrees with the cell's earlier ones is more probable, one that
//! contradicts them less.
//!
//! The state of a cell is its last report and the trust in it. Trust is made of scores of single
//! pairs alone, so it cannot feed itself.

use super::steps::{MAX_NUMBER, Steps, TableFault};
use serde::{Deserialize, Serialize};

/// Greatest trust, thousandths of log odds.
const MAX_TRUST: i64 = 14_000;

/// Time after which another report adds to the trust: pairs that follow faster repeat their errors.
const INDEPENDENT_NS: u64 = 400_000_000;

/// Pairs that follow each other by more have no common past.
const MAX_STEP_NS: u64 = 1_000_000_000;

/// True if a pair has the one before it as its past, by their stamps.
pub fn follows(before_ns: u64, now_ns: u64) -> bool {
    now_ns > before_ns && now_ns - before_ns <= MAX_STEP_NS
}

/// Scores that the past of a cell adds to that of a pair, thousandths of log odds, by trust.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeTable {
    /// Least score of a known cell that has a past.
    pub least_score: i64,
    /// The report agrees with the last one.
    pub agrees: Steps,
    /// It is farther.
    pub farther: Steps,
    /// It is nearer.
    pub nearer: Steps,
}

/// Relation of a report to the cell's last one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Past {
    /// There is no earlier report.
    None,
    /// The last report is within the tolerance of this one.
    Agrees,
    Farther,
    Nearer,
}

/// State of a cell after the pairs so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CellPast {
    /// Bin of the last report, 0 before the first.
    report: i64,
    /// Trust in it, `0..=MAX_TRUST`.
    pub trust: i64,
    /// Stamp of the pair that last added to the trust.
    added_ns: Option<u64>,
}

impl CellPast {
    /// Relation of a `report` above 0 to the last one, by the ends of its tolerance
    /// ([`super::Tolerance::ends`]).
    pub fn relation(&self, report: i64, [first, last]: [i32; 2]) -> Past {
        match self.report {
            0 => Past::None,
            before if (first.into()..=last.into()).contains(&before) => Past::Agrees,
            before if report < before => Past::Farther,
            _ => Past::Nearer,
        }
    }

    /// The state after a `report` above 0 in that relation, with its score by its pair alone. A
    /// pair without a stamp always adds to the trust.
    #[must_use]
    pub fn after(&self, past: Past, report: i64, score: i64, stamp_ns: Option<u64>) -> Self {
        let own = score.clamp(0, MAX_TRUST);
        if past != Past::Agrees {
            return Self {
                report,
                trust: own,
                added_ns: stamp_ns,
            };
        }
        let is_independent = match (self.added_ns, stamp_ns) {
            (Some(before), Some(now)) => now.saturating_sub(before) >= INDEPENDENT_NS,
            _ => true,
        };
        let (trust, added_ns) = if is_independent {
            let sum = self.trust - (self.trust >> 3) + own;
            (sum.min(MAX_TRUST), stamp_ns)
        } else {
            (self.trust.max(own), self.added_ns)
        };
        Self {
            report,
            trust,
            added_ns,
        }
    }
}

impl TimeTable {
    /// The score that a report in that relation gets from the trust in the last one.
    pub fn score(&self, past: Past, trust: i64) -> i64 {
        match past {
            Past::None => 0,
            Past::Agrees => self.agrees.score(trust),
            Past::Farther => self.farther.score(trust),
            Past::Nearer => self.nearer.score(trust),
        }
    }

    /// # Errors
    /// The fault, with its key: steps of agreement that fall, or others that rise.
    pub(super) fn validate(&self) -> Result<(), TableFault> {
        if self.least_score.unsigned_abs() > MAX_NUMBER.unsigned_abs() {
            return Err(TableFault::LeastScore);
        }
        for (key, steps, sign) in [
            ("time.agrees", &self.agrees, 1),
            ("time.farther", &self.farther, -1),
            ("time.nearer", &self.nearer, -1),
        ] {
            steps.validate(key)?;
            let scores = std::iter::once(0).chain(steps.0.iter().map(|(_, score)| sign * score));
            if !scores.is_sorted() {
                let wrong = if sign > 0 { "fall" } else { "rise" };
                return Err(TableFault::Scores(key, wrong));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trust_grows_by_reports_that_agree_and_are_apart() {
        // Right within 2 px: 16 bins.
        let ends = |report: i64| [report as i32 - 16, report as i32 + 16];
        let mut past = CellPast::default();
        let mut follow = |report, score, ms: u64| {
            let relation = past.relation(report, ends(report));
            past = past.after(relation, report, score, Some(ms * 1_000_000));
            (relation, past.trust)
        };
        assert_eq!(follow(100, 3000, 0), (Past::None, 3000));
        assert_eq!(
            follow(116, 4000, 100),
            (Past::Agrees, 4000),
            "too soon to add"
        );
        assert_eq!(follow(101, 2000, 400), (Past::Agrees, 5500));
        assert_eq!(follow(101, 20_000, 799), (Past::Agrees, 14_000), "at most");
        assert_eq!(
            follow(101, -500, 800),
            (Past::Agrees, 12_250),
            "no less than nothing"
        );
        assert_eq!(follow(200, 1000, 900), (Past::Nearer, 1000));
        assert_eq!(follow(183, -1, 1000), (Past::Farther, 0));
        // Without stamps each pair adds.
        let past = CellPast::default().after(Past::None, 100, 800, None);
        assert_eq!(past.after(Past::Agrees, 100, 800, None).trust, 1500);
    }
}
