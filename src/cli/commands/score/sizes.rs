//! Sizes of the user's robot, without a scenario of its own: what is near, cells, tolerance.

use crate::cli::shared::usage;
use svl::scenario::{MAX_GRID, Scenario};
use svl::score::PieceConfig;
use svl::stereo::{CellRule, GridShape};

/// Least tolerance in metres where only one relative to the distance is given.
const MIN_TOLERANCE_M: f64 = 0.001;

/// In place of the scenario's.
#[derive(Clone, clap::Args)]
pub(super) struct SizeArgs {
    /// Distance of an obstacle, metres [default: the scenario's, else 0.5]
    ///
    /// Near obstacles are missed, found and false by it; beyond one and a half times as far nothing
    /// has to be avoided yet.
    #[arg(
        long, value_name = "M", value_parser = usage::within(0.01..=1000.0),
        help_heading = "Scoring"
    )]
    near: Option<f64>,
    /// Distance from which a cell is beyond, metres [default: the scenario's, else none]
    ///
    /// Such cells are no obstacles: their right and wrong ones are counted apart.
    #[arg(
        long, value_name = "M", value_parser = usage::within(0.01..=1000.0),
        help_heading = "Scoring"
    )]
    beyond: Option<f64>,
    /// Cells of the obstacle grid [default: the scenario's, else 5x3]
    #[arg(
        id = "shape", long = "cells", value_name = "COLUMNSxROWS", value_parser = shape,
        help_heading = "Scoring", hide_short_help = true
    )]
    cells: Option<GridShape>,
    /// Tolerance of a right cell: 5%, 0.1m, or both
    ///
    /// Per cent of the distance, metres, or both as 0.1m,5%, of which the larger counts [default:
    /// the scenario's, else 0.1m,20%].
    #[arg(
        long, value_name = "M|P%", value_parser = tolerance, help_heading = "Scoring",
        hide_short_help = true
    )]
    tolerance: Option<CellTolerance>,
    /// Width and height of a test piece that each recording approaches, metres: from where on is it
    /// always seen?
    ///
    /// The truth is dense, or a board on the piece: docs/reach.md
    #[arg(
        long, value_name = "WIDTHxHEIGHT", value_parser = piece, help_heading = "Scoring",
        hide_short_help = true
    )]
    piece: Option<[f64; 2]>,
}

/// Metres, and per cent of the distance: the larger counts.
#[derive(Clone, Copy)]
struct CellTolerance {
    metres: Option<f64>,
    percent: Option<f64>,
}

fn shape(text: &str) -> Result<GridShape, String> {
    let shape = usage::grid(text, MAX_GRID);
    shape.ok_or_else(|| format!("expected COLUMNSxROWS, as 8x4, each 1 to {MAX_GRID}"))
}

fn piece(text: &str) -> Result<[f64; 2], String> {
    let sides = text.split_once('x').map(|(width, height)| [width, height]);
    let sides = sides.map(|sides| sides.map(|side| side.trim().parse().ok()));
    match sides {
        Some([Some(width), Some(height)]) => Ok([width, height]),
        _ => Err("expected WIDTHxHEIGHT in metres, as 0.10x0.20".to_owned()),
    }
}

fn tolerance(text: &str) -> Result<CellTolerance, String> {
    let mut found = CellTolerance {
        metres: None,
        percent: None,
    };
    for part in text.split(',') {
        let (number, place) = match (part.strip_suffix('%'), part.strip_suffix('m')) {
            (Some(number), _) => (number, &mut found.percent),
            (_, Some(number)) => (number, &mut found.metres),
            _ => return Err(EXPECTED.to_owned()),
        };
        let number = number.parse().ok();
        let number = number.filter(|n: &f64| *n > 0.0 && *n < 10_000.0 && place.is_none());
        *place = Some(number.ok_or(EXPECTED)?);
    }
    Ok(found)
}

const EXPECTED: &str =
    "expected per cent of the distance as 5%, metres as 0.1m, or both as 0.1m,5%";

impl SizeArgs {
    /// Changes a scenario.
    pub(super) fn change(&self, scenario: &mut Scenario) -> anyhow::Result<()> {
        self.change_cells(scenario)?;
        let Some(size_m) = self.piece else {
            return Ok(());
        };
        if scenario.kind() == "arena" {
            return Err(usage::wrong(
                "--piece is of recordings: sizes_m of [piece] places pieces in the arena"
                    .to_owned(),
            ));
        }
        let piece = PieceConfig {
            sizes_m: vec![size_m],
            near_m: None,
        };
        let set = scenario.set_piece(piece);
        set.map_err(|e| usage::wrong(format!("--piece: {e}")))
    }

    fn change_cells(&self, scenario: &mut Scenario) -> anyhow::Result<()> {
        let name = &scenario.name;
        if let Some(shape) = self.cells {
            let own = scenario.grid.shape();
            if shape != own && !scenario.checkpoints.is_empty() {
                let (columns, rows) = (own.columns, own.rows);
                return Err(usage::wrong(format!(
                    "--cells: the checkpoints of '{name}' are of {columns}x{rows} cells; omit it"
                )));
            }
            (scenario.grid.columns, scenario.grid.rows) = (shape.columns, shape.rows);
        }
        let CellRule::Distance {
            tolerance_m,
            tolerance_percent,
            obstacle_m,
            clear_m,
            beyond_m,
        } = &mut scenario.cells
        else {
            return match (self.near, self.beyond, self.tolerance) {
                (None, None, None) => Ok(()),
                _ => Err(usage::wrong(format!(
                    "--near, --beyond and --tolerance: '{name}' scores disparities, in pixels"
                ))),
            };
        };
        if let Some(near_m) = self.near {
            // To the micrometre: reports show it.
            *clear_m = (*clear_m * near_m / *obstacle_m * 1e6).round() / 1e6;
            *obstacle_m = near_m;
        }
        if self.beyond.is_some() {
            *beyond_m = self.beyond;
        }
        let (obstacle_m, beyond_m) = (*obstacle_m, *beyond_m);
        if let Some(beyond_m) = beyond_m.filter(|beyond_m| *beyond_m <= obstacle_m) {
            return Err(usage::wrong(format!(
                "beyond is {beyond_m} m and near {obstacle_m} m: name a greater --beyond or a \
                 smaller --near"
            )));
        }
        if let Some(CellTolerance { metres, percent }) = self.tolerance {
            *tolerance_m = metres.unwrap_or(MIN_TOLERANCE_M);
            // The metres alone count then.
            *tolerance_percent = percent.unwrap_or(f64::EPSILON);
        }
        Ok(())
    }
}
