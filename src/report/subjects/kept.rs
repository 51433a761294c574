//! The rules of a report's scenario, and the cells that perturbed pairs keep of the unperturbed.

use crate::rows::held::Row;
use crate::rows::records::CellRow;
use svl_core::Result;
use svl_core::depth::GridSettings;
use svl_core::stereo::{Cell, CellRule, CellState, DepthGrid, GridShape};
use svl_score::judge::{Checkpoint, Verdict, judge_cells};
use svl_score::manifest::Manifest;
use svl_score::scenario::CellKeys;

/// The rules of the scenario by which its frames were scored.
pub(crate) struct ScoreRule {
    pub(crate) shape: GridShape,
    pub(crate) cells: CellRule,
    pub(crate) checkpoints: Vec<Checkpoint>,
}

/// The rule of a report's cells.
pub(crate) fn cell_rule(manifest: &Manifest) -> Result<CellRule> {
    let table: Option<CellKeys> = manifest.part("cells")?;
    Ok(table.unwrap_or_default().rule)
}

impl ScoreRule {
    pub(crate) fn new(manifest: &Manifest) -> Result<Self> {
        Ok(Self {
            shape: manifest
                .part::<GridSettings>("grid")?
                .unwrap_or_default()
                .shape(),
            cells: cell_rule(manifest)?,
            checkpoints: manifest.part("checkpoint")?.unwrap_or_default(),
        })
    }

    /// Sets the numbers of cells that perturbed pairs keep of the unperturbed ones, whose cells are
    /// `plain`, by the rule that compares with a truth.
    pub(crate) fn add_kept(
        &self,
        rows: &mut [Row],
        [plain, perturbed]: [&[CellRow]; 2],
        infinity_px: Option<f32>,
    ) {
        let rule = self.cells.for_rig(infinity_px.is_some());
        for row in rows {
            let grid = |cells| depth_grid(row, cells, self.shape, infinity_px);
            let Some((plain, perturbed)) = grid(plain).zip(grid(perturbed)) else {
                continue;
            };
            let cells = judge_cells(&plain, &perturbed, rule);
            let count = |verdict| cells.iter().filter(|cell| cell.verdict == verdict).count();
            for (name, verdict) in [
                ("same", Verdict::Right),
                ("changed", Verdict::Wrong),
                ("gone", Verdict::Unknown),
            ] {
                row.metrics.set(name, Some(count(verdict) as f64));
            }
        }
    }
}

/// The grid of a row's algorithm and pair; none unless all its cells are there.
fn depth_grid(
    row: &Row,
    rows: &[CellRow],
    shape: GridShape,
    infinity_px: Option<f32>,
) -> Option<DepthGrid> {
    let is_own = |cell: &&CellRow| cell.sequence == row.sequence && cell.algorithm == row.algorithm;
    let mut cells = vec![None; shape.cells()];
    for row in rows.iter().filter(is_own) {
        let (column, line) = (row.column as usize, row.row as usize);
        if column >= shape.columns || line >= shape.rows {
            return None;
        }
        cells[line * shape.columns + column] = Some(Cell {
            valid_share: row.valid_share,
            depth: row.depth(infinity_px),
            probability: row.probability,
            too_close: row.state == Some(CellState::TooClose),
            near: row.near_probability,
            level: row.level as u8,
            ..Cell::UNKNOWN
        });
    }
    let cells = cells.into_iter().collect::<Option<Vec<_>>>()?;
    DepthGrid::new(shape, cells).ok()
}
