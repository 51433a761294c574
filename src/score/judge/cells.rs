//! Scores cells of the depth grid against the truth: right, wrong, unknown, obstacles.

use super::{AreaChoice, CellArea};
use svl_core::stereo::{Cell, CellDepth, CellRule, DepthGrid, Rig};

/// The score of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    Right,
    Wrong,
    /// The algorithm leaves the cell unknown, which is not wrong: the thesis's red dot.
    Unknown,
    /// The truth is unknown there, or its points do not determine the cell's median.
    NoTruth,
}

impl Verdict {
    pub fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Wrong => "wrong",
            Self::Unknown => "unknown",
            Self::NoTruth => "no-truth",
        }
    }

    pub fn from_name(name: &str) -> Option<Self> {
        let all = [Self::Right, Self::Wrong, Self::Unknown, Self::NoTruth];
        all.into_iter().find(|verdict| verdict.name() == name)
    }
}

/// The score of a cell, with its truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellJudgement {
    pub verdict: Verdict,
    /// True if it is right, or if the report agrees with a quarter of the cell and is nearer than
    /// its median.
    pub right_surface: bool,
    /// `None` if the median is unknown.
    pub area: Option<CellArea>,
    /// Median true disparity, pixels; `None` without truth.
    pub true_px: Option<f64>,
    /// True distance, metres; `None` without truth, without a rig, or at infinity.
    pub true_m: Option<f64>,
    /// By the nearest quarter; none if that is not known.
    pub near: NearJudgement,
    /// The number of the truth's points, if it is sparse; absent if it is dense or missing.
    pub points: Option<usize>,
}

/// The score of a cell by its nearest quarter that is not floor: what a robot would hit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NearJudgement {
    /// False if the truth does not determine that quarter: then all others are false, too.
    pub is_known: bool,
    /// A quarter of the cell is nearer than the rule's `obstacle_m`, and not floor.
    pub is_near: bool,
    /// Near, and reported farther than the rule's `clear_m`.
    pub missed: bool,
    /// Near, and reported as near, as too close or at most at `clear_m`.
    pub found: bool,
    /// Reported as near or nearer than `obstacle_m`, and nearly all of the cell is farther than
    /// `clear_m`.
    pub falsely: bool,
    /// Reported nearer than `obstacle_m`, and nothing but floor is nearer than `clear_m`.
    pub is_floor: bool,
}

impl CellJudgement {
    /// For a frame without truth.
    pub const NO_TRUTH: Self = Self {
        verdict: Verdict::NoTruth,
        right_surface: false,
        area: None,
        true_px: None,
        true_m: None,
        near: NearJudgement {
            is_known: false,
            is_near: false,
            missed: false,
            found: false,
            falsely: false,
            is_floor: false,
        },
        points: None,
    };
}

/// Counts over the cells of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CellTally {
    pub right: usize,
    pub wrong: usize,
    pub unknown: usize,
    /// Right and wrong ones, where a nearer surface may be reported, too.
    pub right_surface: usize,
    pub wrong_surface: usize,
    /// Cells whose nearest quarter is known.
    pub quarters: usize,
    /// Cells among them that are near, and of these those that are unknown, missed and found.
    pub near: usize,
    pub near_unknown: usize,
    pub missed: usize,
    pub found: usize,
    /// Cells reported as an obstacle that are nearly all clear, and those in which nothing but
    /// floor is not.
    pub falsely: usize,
    pub floor: usize,
}

impl CellTally {
    /// The number of cells with truth.
    pub fn scored(&self) -> usize {
        self.right + self.wrong + self.unknown
    }

    pub fn from_judgements<'a>(judgements: impl IntoIterator<Item = &'a CellJudgement>) -> Self {
        let mut tally = Self::default();
        for judgement in judgements {
            tally.add(judgement);
        }
        tally
    }

    fn add(&mut self, judgement: &CellJudgement) {
        let is_known = matches!(judgement.verdict, Verdict::Right | Verdict::Wrong);
        let near = judgement.near;
        for (count, is_so) in [
            (&mut self.right, judgement.verdict == Verdict::Right),
            (&mut self.wrong, judgement.verdict == Verdict::Wrong),
            (&mut self.unknown, judgement.verdict == Verdict::Unknown),
            (&mut self.right_surface, judgement.right_surface),
            (
                &mut self.wrong_surface,
                is_known && !judgement.right_surface,
            ),
            (&mut self.quarters, near.is_known),
            (&mut self.near, near.is_near),
            (
                &mut self.near_unknown,
                near.is_near && !near.missed && !near.found,
            ),
            (&mut self.missed, near.missed),
            (&mut self.found, near.found),
            (&mut self.falsely, near.falsely),
            (&mut self.floor, near.is_floor),
        ] {
            *count += usize::from(is_so);
        }
    }
}

/// Counts over the cells of a frame by their areas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellTallies([CellTally; AreaChoice::ALL.len()]);

impl CellTallies {
    pub fn new(judgements: &[CellJudgement]) -> Self {
        Self(AreaChoice::ALL.map(|choice| {
            CellTally::from_judgements(judgements.iter().filter(|cell| choice.has(cell.area)))
        }))
    }

    pub fn get(&self, choice: AreaChoice) -> &CellTally {
        &self.0[choice as usize]
    }
}

/// Scores every cell of `reported` against the true grid, which has the same shape, in raster
/// order.
pub fn judge_cells(truth: &DepthGrid, reported: &DepthGrid, rule: CellRule) -> Vec<CellJudgement> {
    debug_assert_eq!(truth.shape(), reported.shape());
    let pairs = truth.iter().zip(reported.iter());
    pairs
        .map(|((_, truth), (_, reported))| {
            let truth = truth.depth.as_ref();
            judge_cell(truth, claimed(reported, truth), rule)
        })
        .collect()
}

/// The report of a cell. A cell that is too close only claims to be nearer than the range of
/// disparities: if the truth is too, the truth counts as its report.
pub(super) fn claimed<'a>(
    reported: &'a Cell,
    truth: Option<&'a CellDepth>,
) -> Option<&'a CellDepth> {
    let report = reported.depth.as_ref()?;
    let nearer = truth.filter(|truth| reported.too_close && truth.median_px > report.median_px);
    Some(nearer.unwrap_or(report))
}

/// True if a report is right by the rule; an unknown cell is not. `None` if the rule finds no
/// truth, such as a distance at infinity.
pub fn is_right(truth: &CellDepth, reported: Option<&CellDepth>, rule: CellRule) -> Option<bool> {
    match judge_cell(Some(truth), reported, rule).verdict {
        Verdict::NoTruth => None,
        verdict => Some(verdict == Verdict::Right),
    }
}

/// One disparity for an entire cell.
pub fn depth_at(disparity_px: f32, rig: Option<&Rig>) -> CellDepth {
    CellDepth {
        median_px: disparity_px,
        p20_px: disparity_px,
        p80_px: disparity_px,
        distance_m: rig.and_then(|rig| rig.depth_m(f64::from(disparity_px))),
    }
}

/// True if the rule scores a cell with this truth: by distance, not at infinity.
pub(super) fn has_truth(truth: &CellDepth, rule: CellRule) -> bool {
    matches!(rule, CellRule::Disparity { .. }) || truth.distance_m.is_some()
}

/// True if a report is within the rule's tolerance of the truth. One without a distance claims
/// infinity, which is wrong.
pub(super) fn is_within(truth: &CellDepth, report: &CellDepth, rule: CellRule) -> bool {
    match rule {
        CellRule::Distance { .. } => {
            let distances = truth.distance_m.zip(report.distance_m);
            distances.is_some_and(|(z_true, z)| (z - z_true).abs() <= rule.tolerance_at_m(z_true))
        }
        CellRule::Disparity { tolerance_px } => {
            (f64::from(report.median_px) - f64::from(truth.median_px)).abs() <= tolerance_px
        }
    }
}

pub(super) fn judge_cell(
    truth: Option<&CellDepth>,
    reported: Option<&CellDepth>,
    rule: CellRule,
) -> CellJudgement {
    let verdict = match (truth.filter(|truth| has_truth(truth, rule)), reported) {
        (None, _) => Verdict::NoTruth,
        (Some(_), None) => Verdict::Unknown,
        (Some(truth), Some(report)) if is_within(truth, report, rule) => Verdict::Right,
        (Some(_), Some(_)) => Verdict::Wrong,
    };
    CellJudgement {
        verdict,
        right_surface: verdict == Verdict::Right,
        area: None,
        true_px: truth.map(|t| t.median_px.into()),
        true_m: truth.and_then(|t| t.distance_m),
        near: NearJudgement::default(),
        points: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reported(distance_m: f64) -> CellDepth {
        CellDepth {
            median_px: 10.0,
            p20_px: 10.0,
            p80_px: 10.0,
            distance_m: Some(distance_m),
        }
    }

    fn judged(true_m: f64, reported_m: f64) -> CellJudgement {
        judge_cell(
            Some(&reported(true_m)),
            Some(&reported(reported_m)),
            CellRule::default(),
        )
    }

    #[test]
    fn ten_centimetres_or_a_fifth() {
        assert_eq!(judged(0.30, 0.39).verdict, Verdict::Right);
        assert_eq!(judged(0.30, 0.41).verdict, Verdict::Wrong);
        assert_eq!(judged(2.00, 1.61).verdict, Verdict::Right);
        assert_eq!(judged(2.00, 2.41).verdict, Verdict::Wrong);
    }

    #[test]
    fn the_scenario_sets_tolerances_and_distances() {
        let rule = CellRule::Distance {
            tolerance_m: 0.02,
            tolerance_percent: 5.0,
            obstacle_m: 0.4,
            clear_m: 0.9,
            beyond_m: None,
        };
        let judged = |true_m, reported_m| {
            judge_cell(Some(&reported(true_m)), Some(&reported(reported_m)), rule)
        };
        assert_eq!(judged(0.30, 0.319).verdict, Verdict::Right);
        assert_eq!(judged(0.30, 0.321).verdict, Verdict::Wrong);
        assert_eq!(judged(2.00, 2.09).verdict, Verdict::Right);
        assert_eq!(judged(2.00, 2.11).verdict, Verdict::Wrong);
    }

    #[test]
    fn unknown_is_not_wrong_and_infinity_is() {
        let truth = reported(0.48);
        assert_eq!(
            judge_cell(Some(&truth), None, CellRule::default()).verdict,
            Verdict::Unknown
        );
        let infinity = CellDepth {
            distance_m: None,
            ..reported(1.0)
        };
        let judgement = judge_cell(Some(&truth), Some(&infinity), CellRule::default());
        assert_eq!(judgement.verdict, Verdict::Wrong);
        assert_eq!(
            judge_cell(None, Some(&reported(1.0)), CellRule::default()).verdict,
            Verdict::NoTruth
        );
    }

    #[test]
    fn disparity_rule() {
        let cell = |median_px| CellDepth {
            median_px,
            distance_m: None,
            ..reported(1.0)
        };
        let rule = CellRule::Disparity { tolerance_px: 2.0 };
        assert_eq!(
            judge_cell(Some(&cell(12.0)), Some(&cell(10.0)), rule).verdict,
            Verdict::Right
        );
        assert_eq!(
            judge_cell(Some(&cell(12.5)), Some(&cell(10.0)), rule).verdict,
            Verdict::Wrong
        );
        assert_eq!(
            judge_cell(Some(&cell(12.5)), Some(&cell(10.0)), CellRule::default()).verdict,
            Verdict::NoTruth
        );
    }
}
