//! Matching of a pair: rectification, matcher, filters and cells, with memory for all of it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use svl_core::filter::{FilterModel, Filters};
use svl_core::kernel::isa;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, Matcher};
use svl_core::rectify::Rectifier;
use svl_core::stereo::{
    Cell, CellState, DisparityMap, Gray, GridShape, Reason, RectifiedPair, Rig, StereoPair,
};
use svl_core::{Error, Result};

/// Limit of the columns and the rows of a grid, as in scenarios.
const MAX_CELLS: u32 = 64;

/// An image of the caller, of which nothing was read yet.
pub struct Image {
    pixels: *const u8,
    width: usize,
    height: usize,
    stride: usize,
}

impl Image {
    /// # Errors
    /// [`Error::Invalid`] for a null pointer or rows that overlap.
    pub fn new(pixels: *const u8, width: usize, height: usize, stride: usize) -> Result<Self> {
        if pixels.is_null() {
            return Err(Error::Invalid("an image is a null pointer".into()));
        }
        if stride < width {
            return Err(Error::Invalid(format!(
                "stride {stride} is less than the width {width}"
            )));
        }
        Ok(Self {
            pixels,
            width,
            height,
            stride,
        })
    }

    /// Copies the image into `out`, which keeps its memory if it has the size.
    fn copy(&self, out: &mut Gray) -> Result<()> {
        if out.size() != (self.width, self.height) {
            *out = Gray::filled(self.width, self.height, 0)?;
        }
        for y in 0..self.height {
            // SAFETY: the caller of svl_match has `height` rows of `width` bytes, `stride` apart.
            let row =
                unsafe { std::slice::from_raw_parts(self.pixels.add(y * self.stride), self.width) };
            out.row_mut(y).copy_from_slice(row);
        }
        Ok(())
    }
}

/// `svl_cell`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct CCell {
    pub distance_m: f32,
    pub disparity_px: f32,
    pub probability: f32,
    pub valid_fraction: f32,
    pub state: u8,
    pub reason: u8,
    reserved: [u8; 2],
}

pub struct Engine {
    matcher: Box<dyn Matcher>,
    filters: Option<Filters>,
    rectifier: Option<Rectifier>,
    rig: Option<Rig>,
    shape: GridShape,
    /// Number and stamp of the pair.
    sequence: u64,
    stamp_ns: Option<u64>,
    /// Left and right of the caller, and rectified ones: memory that the next pair uses again.
    raw: Option<[Gray; 2]>,
    rectified: Option<[Gray; 2]>,
    output: MatchOutput,
    cells: Vec<CCell>,
}

impl Engine {
    /// # Errors
    /// [`Error`] of the algorithm's text, the calibration, a filter, or of an impossible grid.
    pub fn new(
        algorithm: Option<&str>,
        calibration: Option<PathBuf>,
        filters: &[PathBuf],
        rig: Option<Rig>,
        cells: Option<(u32, u32)>,
    ) -> Result<Self> {
        let algorithm: Algorithm =
            algorithm.map_or_else(|| Ok(Algorithm::default()), str::parse)?;
        if !algorithm.spec().matches_images() {
            let name = algorithm.spec().name;
            return Err(Error::Invalid(format!("'{name}' does not match images")));
        }
        let models = filters
            .iter()
            .map(|path| FilterModel::read(path).map(Arc::new))
            .collect::<Result<Vec<_>>>()?;
        // Built with its filters once, as that checks whether they fit.
        algorithm.clone().filtered(&models).build()?;
        let shape = match cells {
            None => GridShape::default(),
            Some((columns @ 1..=MAX_CELLS, rows @ 1..=MAX_CELLS)) => GridShape {
                columns: columns as usize,
                rows: rows as usize,
            },
            Some((columns, rows)) => {
                return Err(Error::Invalid(format!(
                    "{columns} x {rows} cells: expected 1 to {MAX_CELLS} columns and rows"
                )));
            }
        };
        let rectifier = calibration.as_deref().map(rectifier).transpose()?;
        if rectifier.is_some() && rig.is_some() {
            let words = "a calibration and a rig: the former contains a rig, set focal_px to 0";
            return Err(Error::Invalid(words.into()));
        }
        Ok(Self {
            matcher: algorithm.build()?,
            filters: match &models[..] {
                [] => None,
                models => Some(Filters::new(models, isa()?)?),
            },
            rig: rectifier.as_ref().map_or(rig, |r| r.rig().copied()),
            rectifier,
            shape,
            sequence: 0,
            stamp_ns: None,
            raw: None,
            rectified: None,
            output: MatchOutput::new()?,
            cells: Vec::with_capacity(shape.cells()),
        })
    }

    /// Copies the caller's images, of the next pair.
    pub fn load(&mut self, left: Image, right: Image, stamp_ns: Option<u64>) -> Result<()> {
        self.cells.clear();
        self.sequence += 1;
        self.stamp_ns = stamp_ns;
        let [raw_left, raw_right] = match &mut self.raw {
            Some(raw) => raw,
            none => none.insert(pixels()?),
        };
        left.copy(raw_left)?;
        right.copy(raw_right)
    }

    /// Matches the loaded pair.
    pub fn compute(&mut self) -> Result<()> {
        let Some([left, right]) = self.raw.take() else {
            return Ok(());
        };
        let raw = StereoPair::new(left, right)?;
        let result = self.rectify_and_compute(&raw);
        self.raw = Some(raw.into_images());
        result
    }

    fn rectify_and_compute(&mut self, raw: &StereoPair) -> Result<()> {
        let Some(rectifier) = &self.rectifier else {
            return self.compute_rectified(raw);
        };
        let [mut left, mut right] = match self.rectified.take() {
            Some(images) => images,
            None => pixels()?,
        };
        rectifier.apply(raw, &mut left, &mut right)?;
        let pair = StereoPair::new(left, right)?;
        let result = self.compute_rectified(&pair);
        self.rectified = Some(pair.into_images());
        result
    }

    fn compute_rectified(&mut self, pair: &StereoPair) -> Result<()> {
        let context = MatchContext {
            sequence: self.sequence,
            stamp_ns: self.stamp_ns,
            rig: self.rig,
            grid: self.shape.into(),
            ..MatchContext::default()
        };
        self.output.begin();
        self.matcher
            .compute(RectifiedPair::assume(pair), &context, &mut self.output)?;
        if let Some(filters) = &mut self.filters {
            filters.look(pair.left(), self.shape)?;
            filters.drop_floor(&mut self.output.disparity, self.shape);
        }
        self.output.decide(context.grid, self.rig.as_ref());
        let Some(grid) = &mut self.output.grid else {
            return Ok(());
        };
        if let Some(filters) = &self.filters {
            filters.mark_cells(grid, self.rig.as_ref());
        }
        for (place, cell) in grid.iter() {
            let map = &self.output.disparity;
            let reason = match cell.depth {
                Some(_) => Reason::Valid,
                None => map.cell_reason(self.shape, place, context.grid.min_valid),
            };
            self.cells
                .push(CCell::new(cell, reason, self.rig.is_some()));
        }
        Ok(())
    }

    /// Forgets the earlier pairs.
    pub fn reset(&mut self) {
        self.matcher.reset();
    }

    pub fn has_result(&self) -> bool {
        !self.cells.is_empty()
    }

    pub fn cells(&self) -> &[CCell] {
        &self.cells
    }

    pub fn shape(&self) -> GridShape {
        self.shape
    }

    pub fn map(&self) -> &DisparityMap {
        &self.output.disparity
    }
}

impl CCell {
    fn new(cell: &Cell, reason: Reason, has_rig: bool) -> Self {
        let known = cell.depth.as_ref();
        let infinity = if has_rig { f32::INFINITY } else { f32::NAN };
        Self {
            distance_m: known.map_or(f32::NAN, |depth| {
                depth.distance_m.map_or(infinity, |m| m as f32)
            }),
            disparity_px: known.map_or(f32::NAN, |depth| depth.median_px),
            probability: cell
                .near
                .or(cell.probability)
                .map_or(f32::NAN, |p| p as f32),
            valid_fraction: cell.valid_share as f32,
            state: match cell.state() {
                CellState::Unknown => 0,
                CellState::Known => 1,
                CellState::TooClose => 2,
                CellState::Near => 3,
            },
            reason: reason as u8,
            reserved: [0; 2],
        }
    }
}

/// Two images of a pixel, to be resized.
fn pixels() -> Result<[Gray; 2]> {
    Ok([Gray::filled(1, 1, 0)?, Gray::filled(1, 1, 0)?])
}

fn rectifier(path: &Path) -> Result<Rectifier> {
    Rectifier::new(&svl_calibrate::files::read(path)?)
}
