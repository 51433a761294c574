//! Scores that need no truth: cells that the images, or the other algorithms, support.
//!
//! docs/method.md has the outcome of their test against truth.

use super::photometric::Correlations;
use super::{CellJudgement, Verdict, judge_cells};
use svl_core::stereo::{Cell, CellRule, DepthGrid, Estimate};

/// Number of known cells in which half of the pixels with a disparity are supported, sampled in
/// every `step`-th column and row.
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

/// Number of known cells whose disparities have no rival.
pub(super) fn unrivalled_cells(estimate: &Estimate, correlations: &Correlations<'_>) -> usize {
    let supports = |at, d| correlations.unrivalled(at, d);
    supported_cells(estimate, Correlations::STEP, supports)
}

/// Number of cells that are right by the rule with the median of the `others` that know them, at
/// least two, instead of the truth.
pub fn agreed_cells(own: &DepthGrid, others: &[&DepthGrid], rule: CellRule) -> usize {
    let shape = own.shape();
    let median = |(column, row)| {
        let depths = others
            .iter()
            .filter_map(|grid| grid.cell(column, row).depth);
        let mut depths: Vec<_> = depths.collect();
        depths.sort_by(|a, b| a.median_px.total_cmp(&b.median_px));
        Cell {
            valid_share: 1.0,
            // The smaller disparity, hence the farther, of the two middle ones.
            depth: (depths.len() >= 2).then(|| depths[(depths.len() - 1) / 2]),
            ..Cell::UNKNOWN
        }
    };
    let medians = DepthGrid::new(shape, shape.iter().map(median).collect());
    // There is one cell per element of the shape.
    let medians = medians.expect("a grid has at least one cell");
    let judged = judge_cells(&medians, own, rule);
    let is_right = |cell: &&CellJudgement| cell.verdict == Verdict::Right;
    judged.iter().filter(is_right).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth;
    use svl_core::stereo::{DisparityMap, GridShape, Plane, Rig};

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
            times: None,
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
    fn half_of_the_pixels_with_a_disparity_support_a_cell() {
        // Left: 2 of 4 are supported; right: 1 of 3.
        let e = estimate([
            &[1.0, 1.0, NONE, NONE, 1.0, 2.0],
            &[2.0, 2.0, NONE, NONE, 2.0],
        ]);
        assert_eq!(supported_cells(&e, 1, |_, d| d == 1.0), 1);
        assert_eq!(supported_cells(&e, 1, |_, d| d == 2.0), 2);
        assert_eq!(supported_cells(&e, 1, |_, _| true), 2);
        // From every second column and row only (1, 1), (3, 1), (5, 1), (7, 1).
        assert_eq!(supported_cells(&e, 2, |_, d| d == 2.0), 1);
    }

    #[test]
    fn silence_has_the_worst_score() {
        let silent = estimate([&[], &[]]);
        assert_eq!(supported_cells(&silent, 1, |_, _| true), 0);
        let (none, all) = (grid([None; 2]), grid([Some(1.0); 2]));
        let agreed = |others| agreed_cells(&none, others, CellRule::default());
        assert_eq!((agreed(&[&all, &all]), agreed(&[&none, &none])), (0, 0));
    }

    #[test]
    fn two_others_confirm_a_cell() {
        let own = grid([Some(1.0), Some(1.0)]);
        let count = |others: &[[Option<f64>; 2]]| {
            let others: Vec<_> = others.iter().map(|&distances| grid(distances)).collect();
            agreed_cells(
                &own,
                &others.iter().collect::<Vec<_>>(),
                CellRule::default(),
            )
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
