//! Disparity of a target at a known distance (thesis, annex B): "each measure is the median of the
//! values of at least three sectors where the target was present".

use svl_core::statistics::midpoint_median;
use svl_core::stereo::{Cell, DepthGrid, GridShape};
use svl_core::{Error, Result, counted};

/// Fewest cells that must show the target.
pub const MIN_CELLS: usize = 3;

/// Cells show one target if they differ by at most this, or by [`SHARE`] of the disparity.
const APART_PX: f64 = 1.0;
const SHARE: f64 = 0.03;

/// A measured target.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetMeasurement {
    /// Median of the cells' disparities.
    pub disparity_px: f64,
    /// The cells that show it, column and row.
    pub cells: Vec<(usize, usize)>,
    /// Largest difference of these cells' disparities.
    pub spread_px: f64,
}

impl TargetMeasurement {
    /// Measures the target in the grids of frames that all show it at one distance. The disparity
    /// of a cell is the median of its medians in the frames, and known if at least half of them
    /// have one.
    ///
    /// The target's cells are the given ones, or else those connected to the cell in the centre of
    /// the image that agree with it.
    ///
    /// # Errors
    /// [`Error::Invalid`] if fewer than three cells show it, or a given one has no disparity or is
    /// outside the grid.
    pub fn measure(grids: &[DepthGrid], named: &[(usize, usize)]) -> Result<Self> {
        let shape = grids
            .first()
            .map(DepthGrid::shape)
            .ok_or_else(|| Error::Invalid("no frames to measure in".into()))?;
        let known = |place: (usize, usize)| {
            let depth = |cell: &Cell| Some(f64::from(cell.depth?.median_px));
            let seen: Vec<f64> = grids
                .iter()
                .filter_map(|grid| depth(grid.cell(place.0, place.1)))
                .collect();
            midpoint_median(seen.iter().copied()).filter(|_| 2 * seen.len() >= grids.len())
        };
        let cells = if named.is_empty() {
            agreeing(shape, known)?
        } else {
            named.to_vec()
        };
        let mut disparities = Vec::new();
        for &(column, row) in &cells {
            if column >= shape.columns || row >= shape.rows {
                let GridShape { columns, rows } = shape;
                return Err(Error::Invalid(format!(
                    "there is no cell {column},{row}: the grid has {columns}x{rows}"
                )));
            }
            disparities.push(known((column, row)).ok_or_else(|| {
                Error::Invalid(format!(
                    "cell {column},{row} has no disparity in half of the frames; name others"
                ))
            })?);
        }
        if cells.len() < MIN_CELLS {
            return Err(Error::Invalid(format!(
                "the target is in {}, at least {MIN_CELLS} are needed: {}; use a larger one, or \
                 name its cells with --target",
                counted(cells.len() as u64, "cell"),
                cell_list(&cells)
            )));
        }
        let (least, most) = disparities
            .iter()
            .fold((f64::INFINITY, 0.0f64), |(a, b), &d| (a.min(d), b.max(d)));
        Ok(Self {
            disparity_px: midpoint_median(disparities).unwrap_or_default(),
            cells,
            spread_px: most - least,
        })
    }
}

/// `column,row` of each cell, for messages.
pub fn cell_list(cells: &[(usize, usize)]) -> String {
    cells
        .iter()
        .map(|(column, row)| format!("{column},{row}"))
        .collect::<Vec<_>>()
        .join(" ")
}

/// The cells 4-connected to the central one that have its disparity.
fn agreeing(
    shape: GridShape,
    known: impl Fn((usize, usize)) -> Option<f64>,
) -> Result<Vec<(usize, usize)>> {
    let middle = (shape.columns / 2, shape.rows / 2);
    let target = known(middle).ok_or_else(|| {
        let (column, row) = middle;
        Error::Invalid(format!(
            "the cell in the middle, {column},{row}, has no disparity: put the target there, or \
             name its cells with --target; is it nearer than the algorithm's max_disparity allows?"
        ))
    })?;
    let holds = |&place: &(usize, usize)| {
        known(place).is_some_and(|px| (px - target).abs() <= APART_PX.max(SHARE * target.abs()))
    };
    let mut cells = vec![middle];
    let mut next = 0;
    while next < cells.len() {
        let (column, row) = cells[next];
        let beside = [
            (column.wrapping_sub(1), row),
            (column + 1, row),
            (column, row.wrapping_sub(1)),
            (column, row + 1),
        ];
        let new = beside
            .into_iter()
            .filter(|(c, r)| *c < shape.columns && *r < shape.rows);
        let new: Vec<_> = new
            .filter(|place| !cells.contains(place))
            .filter(holds)
            .collect();
        cells.extend(new);
        next += 1;
    }
    cells.sort_unstable_by_key(|&(column, row)| (row, column));
    Ok(cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::CellDepth;

    /// A 5 x 3 grid of these medians, row by row; 0 is unknown.
    fn grid(medians: [f32; 15]) -> DepthGrid {
        let cell = |px: f32| Cell {
            valid_share: 0.5,
            depth: (px > 0.0).then(|| CellDepth::at(px, None)),
            ..Cell::UNKNOWN
        };
        DepthGrid::new(GridShape::default(), medians.map(cell).to_vec()).unwrap()
    }

    #[rustfmt::skip]
    const TARGET: [f32; 15] = [
        5.0, 20.4, 20.0,  5.0, 20.0,
        5.0,  0.0, 20.2, 19.6,  5.0,
        5.0,  5.0,  0.0,  5.0,  5.0,
    ];

    #[test]
    fn the_target_is_connected_to_the_middle_and_agrees_with_it() {
        let target = TargetMeasurement::measure(&[grid(TARGET)], &[]).unwrap();
        assert_eq!(target.cells, [(1, 0), (2, 0), (2, 1), (3, 1)]);
        assert!(
            (target.disparity_px - 20.2).abs() < 0.11 && (target.spread_px - 0.8).abs() < 1e-5,
            "{target:?}"
        );
    }

    #[test]
    fn cells_are_medians_of_frames_and_known_in_half_of_them() {
        let mut outlier = TARGET;
        outlier[7] = 40.0;
        let mut unknown = TARGET;
        unknown[8] = 0.0;
        let grids = [grid(TARGET), grid(outlier), grid(unknown)];
        assert_eq!(
            TargetMeasurement::measure(&grids, &[]).unwrap().cells.len(),
            4
        );
        assert_eq!(
            TargetMeasurement::measure(&[grid(TARGET), grid(unknown), grid(unknown)], &[])
                .unwrap()
                .cells
                .len(),
            3
        );
    }

    #[test]
    fn cells_may_be_named_and_are_checked() {
        let measure = |cells: &[(usize, usize)]| {
            TargetMeasurement::measure(&[grid(TARGET)], cells).map_err(|e| e.to_string())
        };
        assert_eq!(
            measure(&[(0, 0), (0, 1), (0, 2)]).unwrap().disparity_px,
            5.0
        );
        assert!(
            measure(&[(0, 0), (0, 1)])
                .unwrap_err()
                .contains("in 2 cells, at least 3")
        );
        assert!(
            measure(&[(5, 0), (0, 1), (0, 2)])
                .unwrap_err()
                .contains("no cell 5,0")
        );
        assert!(
            measure(&[(1, 1), (0, 1), (0, 2)])
                .unwrap_err()
                .contains("cell 1,1 has no disparity")
        );
        let mut empty = TARGET;
        empty[7] = 0.0;
        assert!(
            TargetMeasurement::measure(&[grid(empty)], &[])
                .unwrap_err()
                .to_string()
                .contains("max_disparity")
        );
        assert!(TargetMeasurement::measure(&[], &[]).is_err());
    }
}
