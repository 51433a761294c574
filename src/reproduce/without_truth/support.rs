//! The scores of one estimate that need no truth: how many of its known cells each supports.

use super::photometric::{Correlations, STEP};
use crate::error::Result;
use crate::score::{CellJudgement, Verdict, judge_cells};
use crate::stereo::{Cell, CellDepth, CellRule, DepthGrid, Estimate, Plane};

/// Largest speed of a robot or of what moves before it, metres per second.
const SPEED_M_S: f64 = 1.5;

/// Known cells of which half of the pixels with a disparity are supported, of every `step`-th
/// column and row.
fn supported_cells(
    estimate: &Estimate,
    step: usize,
    supports: impl Fn((usize, usize), f32) -> bool,
) -> usize {
    let disparity = estimate.disparity.disparity();
    let is_supported = |place| {
        let (columns, rows) = estimate.grid.shape().pixels(place, disparity.size());
        let looked_at = |range: std::ops::Range<usize>| range.filter(move |i| i % step == step / 2);
        let (mut pixels, mut supported) = (0, 0);
        for y in looked_at(rows) {
            for x in looked_at(columns.clone()) {
                let d = disparity.get(x, y);
                if d.is_finite() {
                    pixels += 1;
                    supported += usize::from(supports((x, y), d));
                }
            }
        }
        pixels > 0 && 2 * supported >= pixels
    };
    let known = estimate
        .grid
        .iter()
        .filter(|(_, cell)| cell.depth.is_some());
    known.filter(|(place, _)| is_supported(*place)).count()
}

pub(super) fn warped(estimate: &Estimate, correlations: &Correlations<'_>) -> usize {
    supported_cells(estimate, STEP, |at, d| correlations.warped(at, d))
}

pub(super) fn unrivalled(estimate: &Estimate, correlations: &Correlations<'_>) -> usize {
    supported_cells(estimate, STEP, |at, d| correlations.unrivalled(at, d))
}

/// `right`: the disparities of the right image by the same algorithm, `+∞` where there is none.
pub(super) fn left_right(estimate: &Estimate, right: &Plane<f32>) -> usize {
    supported_cells(estimate, 1, |(x, y), d| {
        let partner = (x as f32 - d).round();
        // An infinite disparity is not within 1 px.
        (0.0..right.width() as f32).contains(&partner)
            && (right.get(partner as usize, y) - d).abs() <= 1.0
    })
}

/// Cells known now and `seconds` ago whose distance changed no more than the rule's tolerance and
/// motion explain; nothing without distances.
pub(super) fn steady(
    now: &DepthGrid,
    before: &DepthGrid,
    seconds: f64,
    rule: CellRule,
) -> Option<usize> {
    let CellRule::Distance {
        tolerance_m,
        tolerance_percent,
        ..
    } = rule
    else {
        return None;
    };
    let distance = |depth: Option<CellDepth>| depth.and_then(|depth| depth.distance_m);
    let is_steady = |now: Option<CellDepth>, before: Option<CellDepth>| {
        distance(now)
            .zip(distance(before))
            .is_some_and(|(now, before)| {
                let tolerance = tolerance_m.max(tolerance_percent / 100.0 * before);
                (now - before).abs() <= tolerance + SPEED_M_S * seconds
            })
    };
    let cells = now.iter().zip(before.iter());
    Some(
        cells
            .filter(|((_, now), (_, before))| is_steady(now.depth, before.depth))
            .count(),
    )
}

/// Cells that the median of at least two of the `others` confirms.
///
/// # Errors
/// None: the median has a cell per place.
pub(super) fn agreed(own: &DepthGrid, others: &[&DepthGrid], rule: CellRule) -> Result<usize> {
    let shape = own.shape();
    let median = |(column, row)| {
        let depths = others
            .iter()
            .filter_map(|grid| grid.cell(column, row).depth);
        let mut depths: Vec<_> = depths.collect();
        depths.sort_by(|a, b| a.median_px.total_cmp(&b.median_px));
        Cell {
            probability: None,
            valid_share: 1.0,
            // The smaller disparity, hence the farther, of two in the middle.
            depth: (depths.len() >= 2).then(|| depths[(depths.len() - 1) / 2]),
        }
    };
    let medians = DepthGrid::new(shape, shape.iter().map(median).collect())?;
    let judged = judge_cells(&medians, own, rule);
    let is_right = |cell: &&CellJudgement| cell.verdict == Verdict::Right;
    Ok(judged.iter().filter(is_right).count())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth;
    use crate::stereo::{DisparityMap, GridShape, Rig};
    use crate::timing::StageTimes;

    const SHAPE: GridShape = GridShape {
        columns: 2,
        rows: 1,
    };

    /// Two cells of 4 x 2 pixels; the last pixels of a row may be missing.
    fn estimate(rows: [&[f32]; 2]) -> Estimate {
        let mut disparity = DisparityMap::new(8, 2).unwrap();
        for (mut row, values) in disparity.rows_mut().zip(rows) {
            for (x, &d) in values.iter().enumerate().filter(|(_, d)| d.is_finite()) {
                row.accept(x, d);
            }
        }
        Estimate {
            algorithm: "a".into(),
            grid: depth::grid(disparity.disparity(), SHAPE.into(), None),
            disparity,
            times: StageTimes::default(),
        }
    }

    const NONE: f32 = f32::INFINITY;

    /// Distances of two cells, nothing where unknown.
    fn grid(distances_m: [Option<f64>; 2]) -> DepthGrid {
        let rig = Rig::new(100.0, (0.0, 0.0), 0.1, 0.0).unwrap();
        let px = |m: Option<f64>| m.map_or(NONE, |m| rig.disparity_px(m) as f32);
        let plane = Plane::from_vec(2, 1, distances_m.map(px).to_vec()).unwrap();
        depth::grid(&plane, SHAPE.into(), Some(&rig))
    }

    #[test]
    fn half_of_the_pixels_with_a_disparity_support_a_cell() {
        // Left: 2 of 4 are supported; right: 1 of 3.
        let e = estimate([
            &[1.0, 1.0, NONE, NONE, 1.0, 2.0],
            &[2.0, 2.0, NONE, NONE, 2.0],
        ]);
        assert_eq!(supported_cells(&e, 1, |_, d| d == 1.0), 1);
        assert_eq!(supported_cells(&e, 1, |_, d| d == 2.0), 2);
        assert_eq!(supported_cells(&e, 1, |_, _| true), 2);
        // Of every second column and row only (1, 1), (3, 1), (5, 1), (7, 1).
        assert_eq!(supported_cells(&e, 2, |_, d| d == 2.0), 1);
    }

    #[test]
    fn silence_has_the_worst_score() {
        let silent = estimate([&[], &[]]);
        assert_eq!(supported_cells(&silent, 1, |_, _| true), 0);
        let right = Plane::filled(8, 2, 1.0).unwrap();
        assert_eq!(left_right(&silent, &right), 0);
        let (none, all) = (grid([None; 2]), grid([Some(1.0); 2]));
        let rule = CellRule::default();
        assert_eq!(steady(&none, &none, 0.1, rule), Some(0));
        assert_eq!(agreed(&none, &[&all, &all], rule).unwrap(), 0);
        assert_eq!(agreed(&none, &[&none, &none], rule).unwrap(), 0);
    }

    #[test]
    fn left_and_right_within_a_pixel() {
        let e = estimate([&[NONE, NONE, 2.0, 2.0], &[NONE, NONE, 2.0, 2.0]]);
        let right = |d| Plane::filled(8, 2, d).unwrap();
        assert_eq!(
            [3.0, 3.1, NONE].map(|d| left_right(&e, &right(d))),
            [1, 0, 0]
        );
        // Points outside the right image.
        let outside = estimate([&[2.0, 2.0], &[2.0, 2.0]]);
        assert_eq!(left_right(&outside, &right(2.0)), 0);
    }

    #[test]
    fn motion_explains_its_speed() {
        let before = grid([Some(0.4), Some(2.0)]);
        let count = |a, b| steady(&grid([a, b]), &before, 0.1, CellRule::default()).unwrap();
        // 10 cm and 15 cm of motion; 40 cm and 15 cm.
        assert_eq!(count(Some(0.64), Some(2.54)), 2);
        assert_eq!(count(Some(0.66), Some(2.54)), 1);
        assert_eq!(count(Some(0.66), Some(2.56)), 0);
        assert_eq!(count(None, Some(2.0)), 1);
        let px = CellRule::Disparity { tolerance_px: 2.0 };
        assert_eq!(steady(&before, &before, 0.1, px), None);
    }

    #[test]
    fn two_others_confirm_a_cell() {
        let own = grid([Some(1.0), Some(1.0)]);
        let count = |others: &[[Option<f64>; 2]]| {
            let others: Vec<_> = others.iter().map(|&distances| grid(distances)).collect();
            agreed(
                &own,
                &others.iter().collect::<Vec<_>>(),
                CellRule::default(),
            )
            .unwrap()
        };
        assert_eq!(count(&[[Some(1.0); 2]]), 0, "one is too few");
        assert_eq!(count(&[[Some(1.0), None], [Some(1.1), Some(1.0)]]), 1);
        // Medians 1.1 and 3.
        let three = [
            [Some(1.0), Some(3.0)],
            [Some(1.1), Some(3.0)],
            [Some(9.0), Some(1.0)],
        ];
        assert_eq!(count(&three), 1);
        // The farther of two.
        assert_eq!(count(&[[Some(1.0), Some(1.0)], [Some(2.0), Some(1.1)]]), 1);
    }
}
