//! Expectation of a cell, as measured or estimated by eye by a person.

use super::CheckpointFault;
use crate::judge::Verdict;
use svl_core::stereo::{Cell, CellRule};

/// A cell of a checkpoint and its expectation, `[[checkpoint.cell]]` of a scenario.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "CellTable", into = "CellTable")]
pub struct ExpectedCell {
    /// `[column, row]`, row 0 at the top.
    pub at: [usize; 2],
    pub expectation: CellExpectation,
}

/// Expectation of a cell.
///
/// | | right | wrong | missing |
/// |---|---|---|---|
/// | `distance_m` | reported within the tolerance | reported outside | unknown |
/// | `nearer_m` | reported nearer | reported there or beyond | unknown |
/// | `farther_m` | reported farther | reported there or nearer | unknown |
/// | `free` | unknown, or beyond the rule's `clear_m` | reported at `clear_m` or nearer | near |
///
/// A cell reported at infinity is farther than everything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CellExpectation {
    /// Something at that distance, metres. A single tolerance is used alone; of two the larger is
    /// used; without any, those of the cell rule.
    Distance {
        distance_m: f64,
        tolerance_m: Option<f64>,
        tolerance_percent: Option<f64>,
    },
    Nearer(f64),
    Farther(f64),
    Free,
}

#[derive(Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct CellTable {
    at: [usize; 2],
    distance_m: Option<f64>,
    tolerance_m: Option<f64>,
    tolerance_percent: Option<f64>,
    nearer_m: Option<f64>,
    farther_m: Option<f64>,
    free: Option<bool>,
}

impl TryFrom<CellTable> for ExpectedCell {
    type Error = CheckpointFault;

    fn try_from(table: CellTable) -> Result<Self, CheckpointFault> {
        let CellTable {
            at,
            tolerance_m,
            tolerance_percent,
            ..
        } = table;
        let [column, row] = at;
        let wrong = |what| Err(CheckpointFault::Cell(column, row, what));
        let found = [
            table
                .distance_m
                .map(|distance_m| CellExpectation::Distance {
                    distance_m,
                    tolerance_m,
                    tolerance_percent,
                }),
            table.nearer_m.map(CellExpectation::Nearer),
            table.farther_m.map(CellExpectation::Farther),
            table.free.map(|_| CellExpectation::Free),
        ];
        let mut found = found.into_iter().flatten();
        let (Some(expectation), None) = (found.next(), found.next()) else {
            return wrong("give exactly one of distance_m, nearer_m, farther_m and free");
        };
        if table.free == Some(false) {
            return wrong("free = false has no effect: give nearer_m or distance_m");
        }
        let tolerances = tolerance_m.is_some() || tolerance_percent.is_some();
        if tolerances && table.distance_m.is_none() {
            return wrong("a tolerance belongs to distance_m");
        }
        Ok(Self { at, expectation })
    }
}

impl From<ExpectedCell> for CellTable {
    fn from(cell: ExpectedCell) -> Self {
        let mut table = Self {
            at: cell.at,
            ..Self::default()
        };
        match cell.expectation {
            CellExpectation::Distance {
                distance_m,
                tolerance_m,
                tolerance_percent,
            } => {
                table.distance_m = Some(distance_m);
                table.tolerance_m = tolerance_m;
                table.tolerance_percent = tolerance_percent;
            }
            CellExpectation::Nearer(m) => table.nearer_m = Some(m),
            CellExpectation::Farther(m) => table.farther_m = Some(m),
            CellExpectation::Free => table.free = Some(true),
        }
        table
    }
}

impl ExpectedCell {
    pub(super) fn validate(&self) -> Result<(), CheckpointFault> {
        let [column, row] = self.at;
        let (limit_m, tolerances) = match self.expectation {
            CellExpectation::Distance {
                distance_m,
                tolerance_m,
                tolerance_percent,
            } => (distance_m, [tolerance_m, tolerance_percent]),
            CellExpectation::Nearer(m) | CellExpectation::Farther(m) => (m, [None; 2]),
            CellExpectation::Free => return Ok(()),
        };
        let mut numbers = tolerances.into_iter().flatten().chain([limit_m]);
        let what = "distances and tolerances must be positive numbers";
        let are_positive = numbers.all(|v| v.is_finite() && v > 0.0);
        let fault = CheckpointFault::Cell(column, row, what);
        are_positive.then_some(()).ok_or(fault)
    }

    /// The measured distance.
    pub fn distance_m(&self) -> Option<f64> {
        match self.expectation {
            CellExpectation::Distance { distance_m, .. } => Some(distance_m),
            _ => None,
        }
    }

    /// Right, wrong, or unknown if something must be seen: missing.
    pub fn judge(&self, reported: &Cell, rule: CellRule) -> Verdict {
        let Some(depth) = reported.depth else {
            return match self.expectation {
                // Something is near, but not known where.
                CellExpectation::Free if reported.near.is_none() => Verdict::Right,
                _ => Verdict::Unknown,
            };
        };
        let z = depth.distance_m.unwrap_or(f64::INFINITY);
        let right = match self.expectation {
            CellExpectation::Distance { distance_m, .. } => {
                (z - distance_m).abs() <= self.tolerance_m(distance_m, rule)
            }
            CellExpectation::Nearer(m) => z < m,
            CellExpectation::Farther(m) => z > m,
            CellExpectation::Free => z > rule.obstacle_and_clear_m().1,
        };
        if right {
            Verdict::Right
        } else {
            Verdict::Wrong
        }
    }

    fn tolerance_m(&self, distance_m: f64, rule: CellRule) -> f64 {
        let own = match self.expectation {
            CellExpectation::Distance {
                tolerance_m,
                tolerance_percent,
                ..
            } if tolerance_m.is_some() || tolerance_percent.is_some() => {
                Some((tolerance_m.unwrap_or(0.0), tolerance_percent.unwrap_or(0.0)))
            }
            _ => None,
        };
        let (metres, percent) = own.unwrap_or_else(|| rule.tolerances());
        (percent / 100.0 * distance_m).max(metres)
    }

    /// The expectation in words.
    pub fn words(&self, rule: CellRule) -> String {
        match self.expectation {
            CellExpectation::Distance { distance_m, .. } => {
                let tolerance_m = self.tolerance_m(distance_m, rule);
                format!("{distance_m} m ± {tolerance_m:.2} m")
            }
            CellExpectation::Nearer(m) => format!("something nearer than {m} m"),
            CellExpectation::Farther(m) => format!("something beyond {m} m"),
            CellExpectation::Free => {
                format!("nothing nearer than {} m", rule.obstacle_and_clear_m().1)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Verdict::{Right, Unknown, Wrong};
    use svl_core::stereo::{CellDepth, Rig};

    fn cell(toml: &str) -> svl_core::Result<ExpectedCell> {
        let cell = toml::from_str(&format!("at = [1, 0]\n{toml}"));
        let cell: ExpectedCell = cell.map_err(svl_core::Error::other)?;
        cell.validate().map_err(svl_core::Error::other)?;
        Ok(cell)
    }

    /// At 1.4 m, 0.6 m, at infinity, unknown.
    fn verdicts(toml: &str) -> [Verdict; 4] {
        let rig = Rig::new(14.0, (0.0, 0.0), 1.0, 0.0).unwrap();
        let at = |px| Some(CellDepth::at(px, Some(&rig)));
        let cell = cell(toml).unwrap();
        [at(10.0), at(23.4), at(0.0), None].map(|depth| {
            let reported = Cell {
                depth,
                ..Cell::UNKNOWN
            };
            cell.judge(&reported, CellRule::default())
        })
    }

    #[test]
    fn a_cell_with_something_near_is_not_free() {
        let near = Cell {
            near: Some(0.9),
            ..Cell::UNKNOWN
        };
        let judge = |toml, reported| cell(toml).unwrap().judge(reported, CellRule::default());
        assert_eq!(judge("free = true", &near), Unknown);
        assert_eq!(judge("free = true", &Cell::UNKNOWN), Right);
    }

    #[test]
    fn a_contradiction_is_wrong_and_an_unknown_is_missing() {
        let of_1_4_m = verdicts("distance_m = 1.25");
        assert_eq!(of_1_4_m, [Right, Wrong, Wrong, Unknown]);
        assert_eq!(verdicts("nearer_m = 1.0"), [Wrong, Right, Wrong, Unknown]);
        assert_eq!(verdicts("farther_m = 1.0"), [Right, Wrong, Right, Unknown]);
        assert_eq!(verdicts("free = true"), [Right, Wrong, Right, Right]);
        assert_eq!(verdicts("nearer_m = 1.4")[0], Wrong, "there, not nearer");
        assert_eq!(verdicts("farther_m = 1.4")[0], Wrong, "there, not farther");
    }

    #[test]
    fn a_tolerance_replaces_both_of_the_rule() {
        assert_eq!(verdicts("distance_m = 1.5\ntolerance_m = 0.05")[0], Wrong);
        assert_eq!(
            verdicts("distance_m = 1.5\ntolerance_percent = 5")[0],
            Wrong
        );
        let both = "distance_m = 1.5\ntolerance_m = 0.05\ntolerance_percent = 10";
        assert_eq!(verdicts(both)[0], Right);
        let words = |toml: &str| cell(toml).unwrap().words(CellRule::default());
        assert_eq!(words("distance_m = 1.5"), "1.5 m ± 0.30 m");
        assert_eq!(words("free = true"), "nothing nearer than 0.75 m");
    }

    #[test]
    fn nonsense_is_refused() {
        for (toml, words) in [
            ("", "cell [1, 0]: give exactly one of"),
            ("distance_m = 1\nfree = true", "exactly one of"),
            ("free = false", "no effect"),
            ("nearer_m = 1\ntolerance_m = 1", "belongs to distance_m"),
            ("distance_m = 0", "positive"),
            ("distance_m = 1\ntolerance_m = nan", "positive"),
            ("farther_m = inf", "positive"),
            ("farther = 1", "unknown field"),
        ] {
            let error = cell(toml).unwrap_err().to_string();
            assert!(error.contains(words), "{toml}: {error}");
        }
    }
}
