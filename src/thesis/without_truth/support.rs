//! Scores used only in the study: number of known cells of an estimate that each supports.

use svl_core::stereo::{CellDepth, CellRule, DepthGrid, Estimate, Plane};
use svl_data::score::{Correlations, supported_cells};

/// Least ZNCC of a match: the texture's variance is then 2.3 times the noise's.
const MATCH: f32 = 0.7;

/// Largest speed of a robot or of anything moving in front of it, metres per second.
const SPEED_M_S: f64 = 1.5;

pub(super) fn warped(estimate: &Estimate, correlations: &Correlations<'_>) -> usize {
    let supports = |at, d| correlations.best(at, d) >= MATCH;
    supported_cells(estimate, Correlations::STEP, supports)
}

/// `right`: the disparities of the right image from the same algorithm, `+∞` for invalid pixels.
pub(super) fn left_right(estimate: &Estimate, right: &Plane<f32>) -> usize {
    supported_cells(estimate, 1, |(x, y), d| {
        let partner = (x as f32 - d).round();
        // An infinite disparity is not within 1 px.
        (0.0..right.width() as f32).contains(&partner)
            && (right.get(partner as usize, y) - d).abs() <= 1.0
    })
}

/// Cells known now and `seconds` ago whose distance changed no more than the rule's tolerance and
/// motion explain; `None` without distances.
pub(super) fn steady(
    now: &DepthGrid,
    before: &DepthGrid,
    seconds: f64,
    rule: CellRule,
) -> Option<usize> {
    let CellRule::Distance { .. } = rule else {
        return None;
    };
    let distance = |depth: Option<CellDepth>| depth.and_then(|depth| depth.distance_m);
    let is_steady = |now: Option<CellDepth>, before: Option<CellDepth>| {
        distance(now)
            .zip(distance(before))
            .is_some_and(|(now, before)| {
                (now - before).abs() <= rule.tolerance_at_m(before) + SPEED_M_S * seconds
            })
    };
    let cells = now.iter().zip(before.iter());
    let steady = cells.filter(|((_, now), (_, before))| is_steady(now.depth, before.depth));
    Some(steady.count())
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth;
    use svl_core::stereo::{DisparityMap, GridShape, Rig};
    use svl_core::timing::StageTimes;

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
            own_grid: false,
            unfiltered: None,
            range_px: None,
            times: StageTimes::default(),
        }
    }

    const NONE: f32 = f32::INFINITY;

    /// Distances of two cells, `None` if unknown.
    fn grid(distances_m: [Option<f64>; 2]) -> DepthGrid {
        let rig = Rig::new(100.0, (0.0, 0.0), 0.1, 0.0).unwrap();
        let px = |m: Option<f64>| m.map_or(NONE, |m| rig.disparity_px(m) as f32);
        let plane = Plane::from_vec(2, 1, distances_m.map(px).to_vec()).unwrap();
        depth::grid(&plane, SHAPE.into(), Some(&rig))
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
    fn silence_has_the_worst_score() {
        let right = Plane::filled(8, 2, 1.0).unwrap();
        assert_eq!(left_right(&estimate([&[], &[]]), &right), 0);
        let none = grid([None; 2]);
        assert_eq!(steady(&none, &none, 0.1, CellRule::default()), Some(0));
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
}
