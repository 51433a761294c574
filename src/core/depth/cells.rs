//! The depth grid of a disparity map, by the scenario's cell decision.

use super::decision::safe_grid;
use super::grid::{CellDecision, GridSettings, grid};
use crate::stereo::{CellRule, DepthGrid, Gray, Plane, Rig};

/// The grid of a matcher's disparities, by the decision in the settings; `left` is the left image,
/// `rule` the one that scores cells.
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
