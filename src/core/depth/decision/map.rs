//! The safe choice for any disparity map.

use super::table::cell;
use super::{
    BINS_PER_PX, CellPixels, Feature, StepSum, Tolerance, VerdictTable, fill_empty_rows, fill_row,
};
use crate::depth::GridSettings;
use crate::stereo::{Cell, CellRule, DepthGrid, Gray, Plane, Rig};
use std::sync::LazyLock;

/// The table for maps of any algorithm: fitted to the arena, seeds 4 to 6 and 31 (docs/v5.md).
static TABLE: LazyLock<VerdictTable> = LazyLock::new(|| {
    let text = include_str!("any_map.json");
    VerdictTable::parse(text).expect("it is a table, as a test checks")
});

/// The values of v5's parameters.
const JUMP: i32 = 16;
const ALLOWANCE_PX: f64 = 0.25;

/// The disparities of a map in bins, gaps filled.
struct FilledMap {
    /// Meaningless if no pixel was seen.
    bins: Vec<i16>,
    /// 1 for pixels that have a disparity of their own, else 0.
    seen: Vec<u8>,
    /// True if any pixel was seen.
    sees: bool,
}

impl FilledMap {
    /// Fills a map; `jump` as in [`super::SafeChoice`]. Disparities below 0 become 0.
    fn new(disparity: &Plane<f32>, jump: i32) -> Self {
        let (width, height) = disparity.size();
        let bin = |px: f32| {
            if px.is_finite() {
                (px * BINS_PER_PX as f32).round().clamp(0.0, 32_000.0) as i16
            } else {
                0
            }
        };
        let own: Vec<_> = disparity.pixels().map(bin).collect();
        let is_seen = |d: f32| u8::from(d.is_finite());
        let seen: Vec<_> = disparity.pixels().map(is_seen).collect();
        let mut bins = vec![0; own.len()];
        for y in 0..height {
            let row = y * width..(y + 1) * width;
            fill_row(&own[row.clone()], &seen[row.clone()], jump, &mut bins[row]);
        }
        let sees = fill_empty_rows(&seen, width, &mut bins);
        Self { bins, seen, sees }
    }
}

/// The grid of a disparity map whose cells are known if they are safe to report: gaps are filled,
/// and a cell reports a disparity that is right by `rule` whatever the disparities of its uncertain
/// pixels (docs/v5.md).
///
/// A map has no matching costs, so they count as low. Disparities below 0 count as 0. `left` is the
/// left image, of the map's size.
pub fn safe_grid(
    disparity: &Plane<f32>,
    left: &Gray,
    settings: GridSettings,
    rule: CellRule,
    rig: Option<&Rig>,
) -> DepthGrid {
    let (width, height) = disparity.size();
    let map = FilledMap::new(disparity, JUMP);
    let most = map.bins.iter().copied().max().unwrap_or_default();
    let count = most as usize + 1;
    let tolerance = Tolerance::new(rule, rig, ALLOWANCE_PX, count);
    let mut pixels = CellPixels::new(count);
    let safe_cell = |place| {
        let (columns, rows) = settings.shape().pixels(place, (width, height));
        if !map.sees || columns.is_empty() || rows.is_empty() {
            return Cell::UNKNOWN;
        }
        pixels.clear();
        for y in rows {
            let row = y * width + columns.start..y * width + columns.end;
            let grey = &left.row(y)[columns.start.saturating_sub(1)..columns.end];
            let pairs = grey.iter().zip(&grey[1..]);
            let texture = StepSum::new(pairs.map(|(a, b)| 4 * u32::from(a.abs_diff(*b))));
            pixels.add(&map.bins[row.clone()], &map.seen[row], 0, texture);
        }
        pixels.count();
        let evidence = TABLE.evidence(&pixels, &tolerance);
        let seen = evidence.features[Feature::Seen as usize] as f64;
        let score = TABLE.score(&evidence);
        let is_known = score >= TABLE.least_score && seen >= 1000.0 * settings.min_valid;
        Cell {
            valid_share: pixels.valid_share(),
            ..cell(&evidence, pixels.percentiles(), (score, is_known), 0, rig)
        }
    };
    let cells = settings.shape().iter().map(safe_cell).collect();
    // There is one cell per element of the shape.
    DepthGrid::new(settings.shape(), cells).expect("a grid has at least one cell")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth;
    use crate::stereo::Reason;

    const SETTINGS: GridSettings = GridSettings {
        columns: 2,
        rows: 1,
        min_valid: 0.2,
        decision: depth::CellDecision::Safe,
    };
    const RULE: CellRule = CellRule::Disparity { tolerance_px: 2.0 };

    fn cells(disparity: impl Fn(usize, usize) -> f32) -> Vec<Option<f32>> {
        let left = Gray::from_fn(40, 20, |x, y| (x * 37 + y * 11) as u8).unwrap();
        let map = Plane::from_fn(40, 20, disparity).unwrap();
        let grid = depth::cells(&map, &left, SETTINGS, RULE, None);
        let px = |cell: &Cell| cell.depth.map(|depth| depth.median_px);
        grid.into_cells().iter().map(px).collect()
    }

    #[test]
    fn cells_of_one_surface_are_known_and_those_of_two_are_not() {
        // The left cell shows one surface, seen by half of its pixels; the right one shows two.
        let scene = |x: usize, y: usize| match x {
            0..20 if (x + y).is_multiple_of(2) => 10.0,
            0..20 => f32::INFINITY,
            20..30 => 10.0,
            _ => 30.0,
        };
        assert_eq!(cells(scene), [Some(10.0), None]);
        // The median would report both.
        let map = Plane::from_fn(40, 20, scene).unwrap();
        let medians = depth::grid(&map, SETTINGS, None);
        assert!(medians.iter().all(|(_, cell)| cell.depth.is_some()));
    }

    #[test]
    fn hidden_pixels_belong_to_the_farther_surface() {
        // Two fifths are near, and the unseen pixels next to them are far.
        let scene = |x: usize, _: usize| match x % 20 {
            0..6 => 30.0,
            6..13 => f32::INFINITY,
            _ => 10.0,
        };
        let known = cells(scene);
        assert!(
            known.iter().all(|px| px.is_none_or(|px| px < 12.0)),
            "{known:?}"
        );
    }

    #[test]
    fn nothing_seen_is_nothing_known() {
        assert_eq!(cells(|_, _| f32::INFINITY), [None, None]);
        assert_eq!(cells(|_, _| f32::NAN), [None, None]);
    }

    #[test]
    fn cells_with_plain_pixels_are_not_far() {
        // Black from column 12 on: more than a third of the left cell, all of the right one.
        let left = Gray::from_fn(40, 20, |x, y| match x {
            0..12 => (x * 37 + y * 11) as u8,
            _ => 0,
        });
        let map = Plane::from_fn(40, 20, |_, _| 0.0).unwrap();
        let grid = depth::cells(&map, &left.unwrap(), SETTINGS, RULE, None);
        for (_, cell) in grid.iter() {
            assert_eq!((cell.depth, cell.reason), (None, Some(Reason::Untextured)));
        }
    }

    #[test]
    fn infinity_is_far() {
        for px in [0.0, -3.0] {
            assert_eq!(cells(|_, _| px), [Some(0.0); 2]);
        }
    }
}
