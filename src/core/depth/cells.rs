//! The depth grid of a disparity map, by the decision that a scenario asks for.

use super::decision::safe_grid;
use super::grid::{CellDecision, GridSettings, grid};
use crate::stereo::{CellRule, DepthGrid, Gray, Plane, Rig};

/// The grid of a matcher's disparities, by the decision that the settings ask for; `left` is the
/// left image, and `rule` that by which cells are judged.
pub fn cells(
    disparity: &Plane<f32>,
    left: &Gray,
    settings: GridSettings,
    rule: CellRule,
    rig: Option<&Rig>,
) -> DepthGrid {
    match settings.decision {
        CellDecision::Median => grid(disparity, settings, rig),
        CellDecision::Safe => safe_grid(disparity, left, settings, rule, rig),
    }
}
