//! Depth grid of medians (thesis, section 5.1, figure 5.2).
//!
//! Departure from the thesis: percentiles are by nearest rank, so each is a measured disparity.

use crate::stereo::{Cell, CellDepth, DepthGrid, GridShape, Plane, Rig};

/// Least fraction of a cell's pixels that must have a disparity for the cell to be known (thesis,
/// section 5.3.1).
pub const MIN_VALID: f64 = 0.20;

/// Shape of the depth grid and the rule for a known cell.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GridSettings {
    pub columns: usize,
    pub rows: usize,
    /// Least fraction of a cell's pixels with a disparity, 0..=1.
    pub min_valid: f64,
    /// Value that cells report.
    pub decision: CellDecision,
}

/// Value that the cells of a disparity map report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CellDecision {
    /// The median of their disparities, as in the thesis.
    #[default]
    Median,
    /// The safe choice, with its probability ([`crate::depth::decision::safe_grid`]).
    Safe,
}

impl Default for GridSettings {
    /// The thesis's 5 x 3 cells and its fraction of pixels.
    fn default() -> Self {
        GridShape::default().into()
    }
}

impl From<GridShape> for GridSettings {
    /// That shape with the thesis's fraction of pixels.
    fn from(GridShape { columns, rows }: GridShape) -> Self {
        Self {
            columns,
            rows,
            min_valid: MIN_VALID,
            decision: CellDecision::Median,
        }
    }
}

impl GridSettings {
    pub fn shape(&self) -> GridShape {
        GridShape {
            columns: self.columns,
            rows: self.rows,
        }
    }
}

/// The grid of medians of a plane of disparities, from a matcher or the truth: per cell the median,
/// 20th and 80th percentile of the finite ones, and the distance of the median.
///
/// A cell is unknown if no pixel has a disparity, or a fraction below `min_valid`, 0..=1. Distances
/// are pinhole, `f·B / (d + doffs)`; without `rig` there are none.
///
/// # Panics
/// If `shape` has no cells.
pub fn grid(disparity: &Plane<f32>, settings: GridSettings, rig: Option<&Rig>) -> DepthGrid {
    grid_with(disparity, settings, rig, Vec::new(), &mut Vec::new())
}

/// Same as [`grid`], in the buffers `cells` and `keys`, whose content is overwritten.
pub(crate) fn grid_with(
    disparity: &Plane<f32>,
    settings: GridSettings,
    rig: Option<&Rig>,
    mut cells: Vec<Cell>,
    keys: &mut Vec<i32>,
) -> DepthGrid {
    let (shape, min_valid) = (settings.shape(), settings.min_valid);
    cells.clear();
    cells.extend(
        shape
            .iter()
            .map(|place| cell(disparity, shape, place, min_valid, rig, keys)),
    );
    // There is one cell per element of the shape.
    DepthGrid::new(shape, cells).expect("a grid has at least one cell")
}

/// Length of the keys that [`grid_with`] needs.
pub(crate) fn largest_cell((width, height): (usize, usize), shape: GridShape) -> usize {
    width.div_ceil(shape.columns) * height.div_ceil(shape.rows) + 1
}

fn cell(
    disparity: &Plane<f32>,
    shape: GridShape,
    place: (usize, usize),
    min_valid: f64,
    rig: Option<&Rig>,
    keys: &mut Vec<i32>,
) -> Cell {
    let (columns, rows) = shape.pixels(place, disparity.size());
    let pixels = columns.len() * rows.len();
    // Every pixel is written, and overwritten by the next unless it is finite: faster than a
    // branch.
    if keys.len() <= pixels {
        keys.resize(pixels + 1, 0);
    }
    let mut valid = 0;
    for y in rows {
        for &d in &disparity.row(y)[columns.clone()] {
            keys[valid] = key(d);
            valid += usize::from(d.is_finite());
        }
    }
    let valid_share = if pixels == 0 {
        0.0
    } else {
        valid as f64 / pixels as f64
    };
    let known = valid > 0 && valid_share >= min_valid;
    let depth = known.then(|| CellDepth::new(percentiles(&mut keys[..valid]), rig));
    Cell {
        valid_share,
        depth,
        ..Cell::UNKNOWN
    }
}

/// Integers in the order of the floats (that of [`f32::total_cmp`]), which are sorted faster.
fn key(value: f32) -> i32 {
    let bits = value.to_bits() as i32;
    bits ^ ((bits >> 31) as u32 >> 1) as i32
}

/// The float of a key; [`key`] leaves the sign bit, so it is its own inverse.
fn value(key: i32) -> f32 {
    f32::from_bits((key ^ ((key >> 31) as u32 >> 1) as i32) as u32)
}

/// The 20th, 50th and 80th percentile by nearest rank, `sorted[⌈p·n⌉ − 1]`, of at least one value;
/// the values are reordered.
fn percentiles(keys: &mut [i32]) -> [f32; 3] {
    let index = |percent: usize| (percent * keys.len()).div_ceil(100) - 1;
    let [low, middle, high] = [20, 50, 80].map(index);
    let (below, &mut median, above) = keys.select_nth_unstable(middle);
    let p20 = if low < middle {
        *below.select_nth_unstable(low).1
    } else {
        median
    };
    let p80 = if high > middle {
        *above.select_nth_unstable(high - middle - 1).1
    } else {
        median
    };
    [p20, median, p80].map(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(width: usize, height: usize, disparities: &[f32]) -> Plane<f32> {
        Plane::from_vec(width, height, disparities.to_vec()).unwrap()
    }

    #[test]
    fn percentiles_are_nearest_ranks() {
        let percentiles = |values: &[f32]| {
            percentiles(&mut values.iter().map(|&value| key(value)).collect::<Vec<_>>())
        };
        assert_eq!(percentiles(&[7.0]), [7.0, 7.0, 7.0]);
        // n = 4: ranks ⌈0.8⌉, 2, ⌈3.2⌉.
        assert_eq!(percentiles(&[40.0, 10.0, 30.0, 20.0]), [10.0, 20.0, 40.0]);
        // n = 5: ranks 1, ⌈2.5⌉, 4.
        assert_eq!(percentiles(&[5.0, 4.0, 3.0, 2.0, 1.0]), [1.0, 3.0, 4.0]);
        // n = 10: ranks 2, 5, 8.
        assert_eq!(
            percentiles(&[9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0]),
            [1.0, 4.0, 7.0]
        );
        assert_eq!(percentiles(&[3.0, 3.0, -2.0]), [-2.0, 3.0, 3.0]);
        assert_eq!(
            percentiles(&[-1.5, -0.0, 0.0, 1e-9, -1e9]),
            [-1e9, -0.0, 0.0]
        );
    }

    #[test]
    fn cells_are_known_from_the_share_on() {
        let none = f32::INFINITY;
        // Two cells of five pixels: one valid of five is exactly 0.20; none is unknown even if no
        // minimum is set.
        let disparities = plane(
            10,
            1,
            &[none, 12.0, none, none, none, none, none, none, none, none],
        );
        let shape = GridShape {
            columns: 2,
            rows: 1,
        };
        let grid_at = |min_valid| {
            grid(
                &disparities,
                GridSettings {
                    min_valid,
                    ..shape.into()
                },
                None,
            )
        };
        assert_eq!(grid_at(MIN_VALID).cell(0, 0).depth.unwrap().median_px, 12.0);
        assert_eq!(grid_at(MIN_VALID).cell(0, 0).valid_share, 0.2);
        assert_eq!(grid_at(0.21).cell(0, 0).depth, None);
        assert_eq!(grid_at(0.0).cell(1, 0).depth, None);
    }

    #[test]
    fn distance_is_pinhole() {
        let rig = Rig::new(300.0, (0.0, 0.0), 0.1, 2.0).unwrap();
        let grid_of = |d: f32| {
            grid(
                &plane(2, 1, &[d, d]),
                GridShape {
                    columns: 1,
                    rows: 1,
                }
                .into(),
                Some(&rig),
            )
        };
        // 300 · 0.1 / (10 + 2)
        assert_eq!(
            grid_of(10.0).cell(0, 0).depth.unwrap().distance_m,
            Some(2.5)
        );
        assert_eq!(grid_of(-2.0).cell(0, 0).depth.unwrap().distance_m, None);
    }

    #[test]
    fn cells_split_the_image_by_integer_division() {
        // 5 columns over 7 pixels: 0..1, 1..2, 2..4, 4..5, 5..7.
        let disparities = plane(7, 1, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        let grid = grid(
            &disparities,
            GridShape {
                columns: 5,
                rows: 1,
            }
            .into(),
            None,
        );
        let medians: Vec<f32> = grid
            .iter()
            .map(|(_, cell)| cell.depth.unwrap().median_px)
            .collect();
        assert_eq!(medians, [1.0, 2.0, 3.0, 5.0, 6.0]);
    }

    #[test]
    fn more_cells_than_pixels_leave_empty_cells_unknown() {
        let grid = grid(
            &plane(2, 1, &[4.0, 4.0]),
            GridShape {
                columns: 5,
                rows: 3,
            }
            .into(),
            None,
        );
        assert_eq!(
            grid.iter().filter(|(_, cell)| cell.depth.is_some()).count(),
            2
        );
    }
}
