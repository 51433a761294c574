//! The coarse grid of depths that an obstacle avoider uses (thesis, section 5.1).

use super::{Reason, Rig};
use crate::error::{Error, Result};

/// Columns and rows of a grid. Row `j` covers image rows `j·H/rows .. (j+1)·H/rows`, columns
/// likewise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridShape {
    pub columns: usize,
    pub rows: usize,
}

impl Default for GridShape {
    /// The thesis's 5 x 3.
    fn default() -> Self {
        Self {
            columns: 5,
            rows: 3,
        }
    }
}

impl GridShape {
    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.columns * self.rows
    }

    /// Pixels of cell (`column`, `row`) in an image of `width` x `height`: x range, y range.
    pub fn pixels(
        &self,
        (column, row): (usize, usize),
        (width, height): (usize, usize),
    ) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let x = column * width / self.columns..(column + 1) * width / self.columns;
        let y = row * height / self.rows..(row + 1) * height / self.rows;
        (x, y)
    }

    /// Cells in raster order.
    pub fn iter(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let Self { columns, rows } = *self;
        (0..rows).flat_map(move |row| (0..columns).map(move |column| (column, row)))
    }
}

/// Estimate for one cell of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Fraction of the cell's pixels that have a disparity, 0..=1.
    pub valid_share: f64,
    /// `None` if `valid_share` was too small.
    pub depth: Option<CellDepth>,
    /// True if a filter reports something nearer than the range of disparities; the depth is then
    /// that of the end of the range.
    pub too_close: bool,
    /// Probability that the cell is right, 0..=1, if the algorithm reports one.
    pub probability: Option<f64>,
    /// Why the algorithm leaves the cell unknown, if its pixels do not say so.
    pub reason: Option<Reason>,
    /// Evidence behind the probability, if svl's own decision computed it.
    pub evidence: Option<CellEvidence>,
    /// Probability that something is nearer than the rule's `obstacle_m`, of an unknown cell that
    /// is flagged.
    pub near: Option<f64>,
    /// The surface in front of `depth`, or in an unknown cell; of small cells of v5 alone.
    pub surface: Option<NearSurface>,
    /// Size of the image at which the cell was decided: 0 is that of the pair, each further level
    /// half of the one before; 0 for algorithms without levels.
    pub level: u8,
}

/// The nearer of two surfaces of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearSurface {
    /// Disparity, pixels of the pair.
    pub px: f32,
    /// Distance along the optical axis, metres.
    pub distance_m: f64,
    /// Probability that the cell has a surface at that distance, 0..=1.
    pub probability: f64,
}

/// Evidence on a cell, from which it is decided whether to report it ([`crate::depth::decision`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CellEvidence {
    /// The value to report, and the requested percentile, bins of 1/8 pixel.
    pub report: i64,
    pub target: i64,
    /// In the order of [`crate::depth::decision::Feature::ALL`]; [`CellEvidence::NOT_MEASURED`]
    /// for what the algorithm does not measure.
    pub features: [i64; CellEvidence::FEATURES],
    /// Pixels equal to their left neighbour, per mille: no feature of the fit.
    pub plain: i64,
}

impl CellEvidence {
    /// Number of features.
    pub const FEATURES: usize = 9;

    /// The value of a feature that was not measured: it exceeds no step.
    pub const NOT_MEASURED: i64 = i64::MIN;
}

/// The decision on a cell at one size of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LevelCell {
    /// Number of the size, as [`Cell::level`].
    pub level: u8,
    /// `None` if nothing was seen, or the cell has no pixels there.
    pub evidence: Option<CellEvidence>,
    /// 20th and 80th percentile of the disparities, bins of 1/8 pixel of that size.
    pub percentiles: [i64; 2],
    /// Log odds that the report is right, thousandths: by the pair alone, and with earlier pairs.
    pub scores: [i64; 2],
    /// Least score of a known cell.
    pub least_score: i64,
    pub verdict: LevelVerdict,
}

impl LevelCell {
    /// A level that says nothing.
    pub const NOTHING: Self = Self {
        level: 0,
        evidence: None,
        percentiles: [0; 2],
        scores: [i64::MIN; 2],
        least_score: i64::MAX,
        verdict: LevelVerdict::NoReport,
    };
}

/// Result of the tests that a size passes before it decides on a cell, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LevelVerdict {
    NoReport,
    /// The report is at infinity, which the finest level alone may say.
    Far,
    /// The tolerance of the report is narrower than the size can tell.
    Span,
    /// The next finer size reports something else.
    Contradiction,
    /// The next coarser size reports something that may be nearer than the range of this one.
    Range,
    /// The report is not probable enough.
    Score,
    /// It may decide, if no finer one may.
    Passed,
}

impl Cell {
    /// A cell without any disparity.
    pub const UNKNOWN: Self = Self {
        valid_share: 0.0,
        depth: None,
        too_close: false,
        probability: None,
        reason: None,
        evidence: None,
        near: None,
        surface: None,
        level: 0,
    };

    /// Distance of the nearest of its surfaces, metres; `None` if nothing is known, or all is far.
    pub fn nearest_m(&self) -> Option<f64> {
        let distance_m = self.depth.and_then(|depth| depth.distance_m);
        let surface_m = self.surface.map(|surface| surface.distance_m);
        distance_m.into_iter().chain(surface_m).reduce(f64::min)
    }

    pub fn state(&self) -> CellState {
        match (self.depth, self.near) {
            (Some(_), _) if self.too_close => CellState::TooClose,
            (Some(depth), _) if depth.is_far() => CellState::Far,
            (Some(_), _) => CellState::Known,
            (None, Some(_)) => CellState::Near,
            (None, None) => CellState::Unknown,
        }
    }
}

/// State of a cell in a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CellState {
    Known,
    Unknown,
    /// Something is nearer than the range of disparities.
    TooClose,
    /// Something is nearer than the rule's `obstacle_m`, and the cell has no distance.
    Near,
    /// Known to be at infinity.
    Far,
}

impl CellState {
    const ALL: [Self; 5] = [
        Self::Known,
        Self::Unknown,
        Self::TooClose,
        Self::Near,
        Self::Far,
    ];

    /// Number in the Python interface; in C, far cells are known ones.
    #[doc(hidden)]
    pub fn code(self) -> u8 {
        match self {
            Self::Unknown => 0,
            Self::Known => 1,
            Self::TooClose => 2,
            Self::Near => 3,
            Self::Far => 4,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Known => "known",
            Self::Unknown => "unknown",
            Self::TooClose => "too_close",
            Self::Near => "near",
            Self::Far => "far",
        }
    }

    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.name() == name)
    }
}

/// The depth of a known cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellDepth {
    /// Median disparity, pixels.
    pub median_px: f32,
    /// 20th percentile of the disparities: a farther part of the cell.
    pub p20_px: f32,
    /// 80th percentile of the disparities: a nearer part of the cell.
    pub p80_px: f32,
    /// Disparity of what is at infinity, pixels ([`Rig::infinity_px`]); `None` without a rig.
    pub infinity_px: Option<f32>,
    /// Distance of the median; `None` without a rig, or at infinity.
    pub distance_m: Option<f64>,
}

impl CellDepth {
    /// By the 20th percentile, the median and the 80th percentile of the disparities, pixels.
    pub fn new([p20_px, median_px, p80_px]: [f32; 3], rig: Option<&Rig>) -> Self {
        Self {
            median_px,
            p20_px,
            p80_px,
            infinity_px: rig.map(Rig::infinity_px),
            distance_m: rig.and_then(|rig| rig.depth_m(median_px.into())),
        }
    }

    /// One disparity for an entire cell, pixels.
    pub fn at(px: f32, rig: Option<&Rig>) -> Self {
        Self::new([px; 3], rig)
    }

    /// True at infinity, and beyond; without a rig at 0 px alone.
    pub fn is_far(&self) -> bool {
        match self.infinity_px {
            Some(_) => self.distance_m.is_none(),
            None => self.median_px == 0.0,
        }
    }

    /// True at infinity, up to `px` nearer, and beyond. Without a rig nothing is beyond 0 px: the
    /// axes of the cameras may cross.
    pub fn is_far_within(&self, px: f64) -> bool {
        let shift = f64::from(self.median_px) - f64::from(self.infinity_px.unwrap_or(0.0));
        match self.infinity_px {
            Some(_) => shift <= px,
            None => shift.abs() <= px,
        }
    }
}

/// Depths of a grid of cells, in raster order.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthGrid {
    shape: GridShape,
    cells: Vec<Cell>,
    /// Decisions at each size, those of a cell one after the other, cells in raster order; empty
    /// for an algorithm without levels.
    levels: Vec<LevelCell>,
}

impl DepthGrid {
    /// # Errors
    /// [`Error::Invalid`] unless there is one cell per element of `shape`.
    pub fn new(shape: GridShape, cells: Vec<Cell>) -> Result<Self> {
        if shape.cells() != 0 && shape.cells() == cells.len() {
            let levels = Vec::new();
            Ok(Self {
                shape,
                cells,
                levels,
            })
        } else {
            Err(Error::Invalid(format!(
                "a grid of {}x{} needs that many cells, got {}",
                shape.columns,
                shape.rows,
                cells.len()
            )))
        }
    }

    /// The same grid with the decisions at each size, as many of each cell.
    #[must_use]
    pub(crate) fn with_levels(self, levels: Vec<LevelCell>) -> Self {
        Self { levels, ..self }
    }

    /// The decisions on the cells in raster order at each size of the image, finest first; empty
    /// for an algorithm without levels.
    #[doc(hidden)]
    pub fn levels(&self) -> impl Iterator<Item = &[LevelCell]> {
        let levels = self.levels.len() / self.cells.len();
        self.levels.chunks_exact(levels.max(1))
    }

    pub fn shape(&self) -> GridShape {
        self.shape
    }

    /// Hash of the disparities and states of all cells, combined with another hash. Probabilities
    /// are excluded, as their last digits depend on the machine.
    pub fn hash(&self, other: u128) -> u128 {
        let mut hasher = xxhash_rust::xxh3::Xxh3Default::new();
        hasher.update(&other.to_le_bytes());
        for cell in &self.cells {
            let px = |d: CellDepth| [d.median_px, d.p20_px, d.p80_px];
            // No disparity is infinite.
            let none = match cell.near {
                Some(_) => f32::NEG_INFINITY,
                None => f32::INFINITY,
            };
            let px = cell.depth.map_or([none; 3], px);
            let surface = cell.surface.map(|surface| surface.px);
            let all = px.iter().chain(&surface);
            all.for_each(|px| hasher.update(&px.to_le_bytes()));
        }
        hasher.digest128()
    }

    /// The cells in raster order, mutable.
    pub fn cells_mut(&mut self) -> impl Iterator<Item = &mut Cell> {
        self.cells.iter_mut()
    }

    /// The cells in raster order.
    pub fn into_cells(self) -> Vec<Cell> {
        self.cells
    }

    /// The memory of the grid.
    pub(crate) fn into_parts(self) -> (Vec<Cell>, Vec<LevelCell>) {
        (self.cells, self.levels)
    }

    /// The cell at (`column`, `row`).
    pub fn cell(&self, column: usize, row: usize) -> &Cell {
        &self.cells[row * self.shape.columns + column]
    }

    /// Fraction of the cells that are known, 0..=1.
    pub fn known_share(&self) -> f64 {
        let known = self.cells.iter().filter(|cell| cell.depth.is_some());
        known.count() as f64 / self.cells.len() as f64
    }

    /// Cells in raster order with their (column, row).
    pub fn iter(&self) -> impl Iterator<Item = ((usize, usize), &Cell)> {
        self.shape.iter().zip(&self.cells)
    }
}

/// Rule by which a reported cell is scored against the truth, as in a scenario's `[cells]`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
#[serde(tag = "judge", rename_all = "lowercase", deny_unknown_fields)]
pub enum CellRule {
    /// Right when `|Z - Z_true| <= max(tolerance_m, tolerance_percent % of Z_true)`, at infinity
    /// by [`CellRule::far_px`]; needs a rig.
    Distance {
        #[serde(default = "CellRule::tolerance_m")]
        tolerance_m: f64,
        #[serde(default = "CellRule::tolerance_percent")]
        tolerance_percent: f64,
        /// Anything nearer is an obstacle.
        #[serde(default = "CellRule::obstacle_m")]
        obstacle_m: f64,
        /// Anything farther need not be avoided yet.
        #[serde(default = "CellRule::clear_m")]
        clear_m: f64,
        /// A cell whose median is farther is of the area beyond; there is none without it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        beyond_m: Option<f64>,
    },
    /// Right when `|d - d_true| <= tolerance_px`; for scenes without calibration. Sparse truth and
    /// single surfaces have the tolerance of [`CellRule::proportional_at`].
    Disparity { tolerance_px: f64 },
}

impl Default for CellRule {
    fn default() -> Self {
        Self::Distance {
            tolerance_m: Self::tolerance_m(),
            tolerance_percent: Self::tolerance_percent(),
            obstacle_m: Self::obstacle_m(),
            clear_m: Self::clear_m(),
            beyond_m: None,
        }
    }
}

impl CellRule {
    /// The least that [`CellRule::far_px`] is.
    const FAR_PX: f64 = 1.0;

    // Functions, as serde accepts nothing else as defaults.
    const fn tolerance_m() -> f64 {
        0.10
    }

    const fn tolerance_percent() -> f64 {
        20.0
    }

    const fn obstacle_m() -> f64 {
        0.5
    }

    const fn clear_m() -> f64 {
        0.75
    }

    /// The rule for a frame with or without a calibration: without distances, disparities are
    /// scored, within 2 px.
    #[must_use]
    pub fn for_rig(self, has_rig: bool) -> Self {
        match self {
            Self::Distance { .. } if !has_rig => Self::Disparity { tolerance_px: 2.0 },
            rule => rule,
        }
    }

    /// The rule in pixels of twice the size.
    #[must_use]
    pub(crate) fn halved(self) -> Self {
        match self {
            Self::Disparity { tolerance_px } => Self::Disparity {
                tolerance_px: tolerance_px / 2.0,
            },
            rule @ Self::Distance { .. } => rule,
        }
    }

    /// The greatest true disparity in excess of that of infinity, pixels, for which a report of
    /// infinity is right: a pixel, or the rule's tolerance.
    pub fn far_px(&self) -> f64 {
        match *self {
            Self::Distance { .. } => Self::FAR_PX,
            Self::Disparity { tolerance_px } => tolerance_px.max(Self::FAR_PX),
        }
    }

    /// The rule with a tolerance of at least 5 % of a true disparity, if it scores disparities.
    #[must_use]
    pub fn proportional_at(self, true_px: f64) -> Self {
        match self {
            Self::Disparity { tolerance_px } => Self::Disparity {
                tolerance_px: tolerance_px.max(0.05 * true_px),
            },
            rule @ Self::Distance { .. } => rule,
        }
    }

    /// # Errors
    /// [`Error::Invalid`] if a number is not positive or 10,000 and more, or obstacles are not
    /// nearer than clear space and than what is beyond.
    pub fn validate(&self) -> Result<()> {
        let mut numbers = match *self {
            Self::Distance {
                tolerance_m,
                tolerance_percent,
                obstacle_m,
                clear_m,
                beyond_m: _,
            } => vec![
                ("tolerance_m", tolerance_m),
                ("tolerance_percent", tolerance_percent),
                ("obstacle_m", obstacle_m),
                ("clear_m", clear_m),
            ],
            Self::Disparity { tolerance_px } => vec![("tolerance_px", tolerance_px)],
        };
        numbers.extend(self.beyond_m().map(|beyond_m| ("beyond_m", beyond_m)));
        let is_possible = |value: f64| value > 0.0 && value < 10_000.0;
        if let Some((key, value)) = numbers.into_iter().find(|(_, value)| !is_possible(*value)) {
            return Err(Error::Invalid(format!(
                "cells.{key} = {value}: must be a positive number below 10000"
            )));
        }
        match *self {
            Self::Distance {
                obstacle_m,
                clear_m,
                ..
            } if obstacle_m >= clear_m => Err(Error::Invalid(format!(
                "cells.obstacle_m = {obstacle_m}: must be below cells.clear_m = {clear_m}"
            ))),
            Self::Distance {
                obstacle_m,
                beyond_m: Some(beyond_m),
                ..
            } if obstacle_m >= beyond_m => Err(Error::Invalid(format!(
                "cells.beyond_m = {beyond_m}: must be above cells.obstacle_m = {obstacle_m}"
            ))),
            _ => Ok(()),
        }
    }

    /// Tolerance in metres, and in per cent of the distance: the larger of the two counts.
    pub fn tolerances(&self) -> (f64, f64) {
        match *self {
            Self::Distance {
                tolerance_m,
                tolerance_percent,
                ..
            } => (tolerance_m, tolerance_percent),
            Self::Disparity { .. } => (Self::tolerance_m(), Self::tolerance_percent()),
        }
    }

    /// Tolerance at a distance, metres: centimetres for near things, a fraction of the distance for
    /// far ones.
    pub fn tolerance_at_m(&self, distance_m: f64) -> f64 {
        let (metres, percent) = self.tolerances();
        (percent / 100.0 * distance_m).max(metres)
    }

    /// Distances in metres: anything nearer than the first is an obstacle; anything beyond the
    /// second need not be avoided yet.
    pub fn obstacle_and_clear_m(&self) -> (f64, f64) {
        match *self {
            Self::Distance {
                obstacle_m,
                clear_m,
                ..
            } => (obstacle_m, clear_m),
            Self::Disparity { .. } => (Self::obstacle_m(), Self::clear_m()),
        }
    }

    /// The farthest truth, metres, of which a report at `clear_m` is right; none if all are.
    pub fn far_m(&self) -> Option<f64> {
        let ((_, clear_m), (metres, percent)) = (self.obstacle_and_clear_m(), self.tolerances());
        let far_m = (clear_m / (1.0 - percent / 100.0)).max(clear_m + metres);
        (percent < 100.0).then_some(far_m)
    }

    /// Distance in metres beyond which a cell is of the area beyond, if there is one.
    pub fn beyond_m(&self) -> Option<f64> {
        match *self {
            Self::Distance { beyond_m, .. } => beyond_m,
            Self::Disparity { .. } => None,
        }
    }

    /// The rule for a right cell, in words.
    pub fn right_words(&self) -> String {
        match self {
            Self::Distance {
                tolerance_m,
                tolerance_percent,
                ..
            } => format!(
                "within {tolerance_m} m or {tolerance_percent} % of the true distance, whichever \
                 is more"
            ),
            Self::Disparity { tolerance_px } => {
                format!("within {tolerance_px} px of the true disparity, or 5 % of a sparse one")
            }
        }
    }
}
