//! Scores cells of the depth grid against the truth: right, wrong, unknown, obstacles.

use super::{AreaChoice, CellArea};
use svl_core::stereo::{Cell, CellDepth, CellRule, DepthGrid};

/// The score of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    Right,
    Wrong,
    /// The algorithm leaves the cell unknown, which is not wrong: the thesis's red dot.
    Unknown,
    /// The truth is unknown there, or its points do not determine the cell's median.
    #[default]
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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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

impl CellJudgement {
    /// The error of the report that was scored, in tolerances of the rule; absent where report or
    /// truth is unknown or at infinity.
    pub fn error_in_tolerances(&self, reported: &Cell, rule: CellRule) -> Option<f64> {
        let report = reported.depth.as_ref()?;
        match rule {
            CellRule::Distance { .. } => {
                let true_m = self.true_m?;
                Some((report.distance_m? - true_m).abs() / rule.tolerance_at_m(true_m))
            }
            CellRule::Disparity { tolerance_px } => {
                Some((f64::from(report.median_px) - self.true_px?).abs() / tolerance_px)
            }
        }
    }
}

/// The score of a cell by its nearest quarter that is not floor: what a robot would hit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NearJudgement {
    /// False if the truth does not determine that quarter: then all others are false, too.
    pub is_known: bool,
    /// A quarter of the cell is nearer than the rule's `obstacle_m`, and not floor.
    pub is_near: bool,
    /// Near, and known to be farther than the rule's `clear_m`.
    pub missed: bool,
    /// Near, and reported near: as near, as too close or at most at `clear_m`.
    pub found: bool,
    /// Reported near, where that is right of nearly nothing in the cell.
    pub falsely: bool,
    /// Reported nearer than `obstacle_m`, and nothing but floor is nearer than `clear_m`.
    pub is_floor: bool,
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
    /// Cells reported near that are nearly all free, and those reported as an obstacle in which
    /// nothing but floor is not clear.
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
/// truth, such as a distance without a rig.
pub fn is_right(truth: &CellDepth, reported: Option<&CellDepth>, rule: CellRule) -> Option<bool> {
    match judge_cell(Some(truth), reported, rule).verdict {
        Verdict::NoTruth => None,
        verdict => Some(verdict == Verdict::Right),
    }
}

/// True if the rule scores a cell with this truth: not by distance without a rig.
pub(super) fn has_truth(truth: &CellDepth, rule: CellRule) -> bool {
    matches!(rule, CellRule::Disparity { .. }) || truth.distance_m.is_some() || truth.is_far()
}

/// True if a report is within the rule's tolerance of the truth; if one of them is at infinity, if
/// the other is as good as there ([`CellRule::far_px`]).
pub(super) fn is_within(truth: &CellDepth, report: &CellDepth, rule: CellRule) -> bool {
    match rule {
        _ if truth.is_far() => report.is_far_within(rule.far_px()),
        _ if report.is_far() => truth.is_far_within(rule.far_px()),
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
    use Verdict::{NoTruth, Right, Unknown, Wrong};
    use svl_core::stereo::Rig;

    /// One metre is 10 px, and infinity at `-doffs_px`.
    fn rig(doffs_px: f64) -> Rig {
        Rig::new(100.0, (0.0, 0.0), 0.1, doffs_px).unwrap()
    }

    fn at_m(distance_m: f64) -> CellDepth {
        CellDepth::at(rig(0.0).disparity_px(distance_m) as f32, Some(&rig(0.0)))
    }

    fn judged_by(rule: CellRule, true_m: f64, reported_m: f64) -> Verdict {
        judge_cell(Some(&at_m(true_m)), Some(&at_m(reported_m)), rule).verdict
    }

    #[test]
    fn ten_centimetres_or_a_fifth() {
        let judged = |true_m, reported_m| judged_by(CellRule::default(), true_m, reported_m);
        assert_eq!([0.39, 0.41].map(|m| judged(0.30, m)), [Right, Wrong]);
        assert_eq!([1.61, 2.41].map(|m| judged(2.00, m)), [Right, Wrong]);
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
        let judged = |true_m, reported_m| judged_by(rule, true_m, reported_m);
        assert_eq!([0.319, 0.321].map(|m| judged(0.30, m)), [Right, Wrong]);
        assert_eq!([2.09, 2.11].map(|m| judged(2.00, m)), [Right, Wrong]);
    }

    #[test]
    fn unknown_is_not_wrong() {
        let judged = |truth: Option<CellDepth>, report: Option<CellDepth>| {
            judge_cell(truth.as_ref(), report.as_ref(), CellRule::default()).verdict
        };
        assert_eq!(judged(Some(at_m(0.48)), None), Unknown);
        assert_eq!(judged(None, Some(at_m(1.0))), NoTruth);
    }

    #[test]
    fn disparity_rule() {
        let rule = CellRule::Disparity { tolerance_px: 2.0 };
        let judged = |true_px, px, rule| {
            let [truth, report] = [true_px, px].map(|px| CellDepth::at(px, None));
            judge_cell(Some(&truth), Some(&report), rule).verdict
        };
        let verdicts = [12.0, 12.5].map(|true_px| judged(true_px, 10.0, rule));
        assert_eq!(verdicts, [Right, Wrong]);
        assert_eq!(judged(12.5, 10.0, CellRule::default()), NoTruth);
    }

    /// All pairs of a true and a reported disparity in excess of infinity, by every kind of rule,
    /// with and without a rig, against the rule in words: far is right up to a pixel or the
    /// tolerance, and so is a report where the truth is far.
    #[test]
    fn far_is_right_up_to_a_pixel_or_the_tolerance() {
        let pixels = |tolerance_px| CellRule::Disparity { tolerance_px };
        let rigs = [Some(rig(0.0)), Some(rig(3.0)), Some(rig(-3.0))];
        let mut cases: Vec<_> = rigs.map(|rig| (rig, CellRule::default(), 1.0)).into();
        cases.extend([Some(rig(-3.0)), None].map(|rig| (rig, pixels(2.0), 2.0)));
        cases.push((None, pixels(0.5), 1.0));
        for (rig, rule, most_px) in cases {
            let doffs_px = rig.map_or(0.0, |rig| rig.doffs_px());
            let at = |shift_px: f64| CellDepth::at((shift_px - doffs_px) as f32, rig.as_ref());
            for (true_px, px) in (-8..=12).flat_map(|t| (-8..=12).map(move |r| (t, r))) {
                let [true_px, px] = [true_px, px].map(|quarters| f64::from(quarters) / 4.0);
                let judged = judge_cell(Some(&at(true_px)), Some(&at(px)), rule).verdict;
                let is_right = match rule {
                    // Without a rig nothing is beyond infinity.
                    _ if rig.is_none() && true_px == 0.0 => px.abs() <= most_px,
                    _ if rig.is_none() && px == 0.0 => true_px.abs() <= most_px,
                    _ if rig.is_some() && true_px <= 0.0 => px <= most_px,
                    _ if rig.is_some() && px <= 0.0 => true_px <= most_px,
                    // A fifth is more than 0.1 m here.
                    CellRule::Distance { .. } => (true_px / px - 1.0).abs() <= 0.2,
                    CellRule::Disparity { tolerance_px } => (px - true_px).abs() <= tolerance_px,
                };
                let expected = if is_right { Right } else { Wrong };
                assert_eq!(judged, expected, "{true_px} {px} {doffs_px} {rule:?}");
            }
        }
    }
}
