//! Matching of a pair: rectification, matcher, filters and cells, with memory for all of it.

use super::{Cells, ImageRef, Optics, RangedCell, RangerOptions};
use crate::doubt::check_size;
use crate::error::{Error, Result};
use crate::filter::Filters;
use crate::kernel::isa;
use crate::matcher::{Algorithm, MatchContext, MatchOutput, Matcher};
use crate::rectify::Rectifier;
use crate::stereo::{
    DisparityMap, Gray, GridShape, Intrinsics, Reason, RectifiedPair, Rig, StereoPair,
};

/// Limit of the columns and the rows of a grid, as in scenarios.
const MAX_CELLS: usize = 64;

pub(super) struct Engine {
    matcher: Box<dyn Matcher>,
    filters: Option<Filters>,
    rectifier: Option<Rectifier>,
    rig: Option<Rig>,
    /// Sizes of the images that the calibration is for.
    sizes: Option<[(usize, usize); 2]>,
    shape: GridShape,
    /// Number and stamp of the pair.
    sequence: u64,
    stamp_ns: Option<u64>,
    /// Left and right of the caller, and rectified ones: memory that the next pair uses again.
    raw: Option<[Gray; 2]>,
    rectified: Option<[Gray; 2]>,
    output: MatchOutput,
    pub(super) cells: Cells,
}

impl Engine {
    /// # Errors
    /// The errors of [`super::Ranger::open`].
    pub(super) fn new(
        algorithm: Algorithm,
        optics: Optics,
        options: &RangerOptions,
    ) -> Result<Self> {
        if !algorithm.spec().matches_images() {
            let name = algorithm.spec().name;
            return Err(Error::Invalid(format!("'{name}' does not match images")));
        }
        // Built with its filters once, as that checks whether they fit.
        algorithm.clone().filtered(&options.filters).build()?;
        let shape @ GridShape { columns, rows } = options.cells;
        if ![columns, rows].iter().all(|n| (1..=MAX_CELLS).contains(n)) {
            return Err(Error::Invalid(format!(
                "{columns} x {rows} cells: expected 1 to {MAX_CELLS} columns and rows"
            )));
        }
        let (mut rectifier, mut sizes) = (None, None);
        let rig = match optics {
            Optics::Unknown => None,
            Optics::Rectified(rig) => Some(rig),
            Optics::Calibrated(calibration) => {
                sizes = Some([calibration.left(), calibration.right()].map(Intrinsics::size));
                if calibration.is_rectified() {
                    calibration.rig()
                } else {
                    rectifier
                        .insert(Rectifier::new(&calibration)?)
                        .rig()
                        .copied()
                }
            }
        };
        Ok(Self {
            matcher: algorithm.build()?,
            filters: match &options.filters[..] {
                [] => None,
                models => Some(Filters::new(models, isa()?)?),
            },
            rectifier,
            rig,
            sizes,
            shape,
            sequence: 0,
            stamp_ns: None,
            raw: Some(pixels()?),
            rectified: Some(pixels()?),
            output: MatchOutput::new()?,
            cells: Cells::new(shape),
        })
    }

    /// Copies the caller's images, of the next pair.
    pub(super) fn load(&mut self, images: [ImageRef<'_>; 2], stamp_ns: Option<u64>) -> Result<()> {
        self.cells.clear();
        self.sequence += 1;
        self.stamp_ns = stamp_ns;
        let found = images.map(|image| image.size());
        let mut sizes = self.sizes.into_iter().flatten().zip(found);
        sizes.try_for_each(|(size, found)| check_size(size, found))?;
        let mut raw = match self.raw.take() {
            Some(raw) => raw,
            None => pixels()?,
        };
        let copied = images
            .iter()
            .zip(&mut raw)
            .try_for_each(|(image, out)| image.copy(out));
        self.raw = Some(raw);
        copied
    }

    /// Matches the loaded pair.
    pub(super) fn compute(&mut self) -> Result<()> {
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
        self.output.decide(context.grid, self.rig.as_ref())?;
        let Some(grid) = &mut self.output.grid else {
            return Ok(());
        };
        if let Some(filters) = &self.filters {
            filters.mark_cells(grid, self.rig.as_ref());
        }
        let map = &self.output.disparity;
        for (place, cell) in grid.iter() {
            // The pixels of a known cell need not be counted.
            let reason = match (cell.depth, cell.reason) {
                (Some(_), _) => Reason::Valid,
                (None, Some(reason)) => reason,
                (None, None) => map.cell_reason(self.shape, place, context.grid.min_valid),
            };
            let has_rig = self.rig.is_some();
            self.cells.push(RangedCell::new(cell, reason, has_rig));
        }
        Ok(())
    }

    /// Forgets the earlier pairs.
    pub(super) fn reset(&mut self) {
        self.matcher.reset();
    }

    pub(super) fn has_result(&self) -> bool {
        !self.cells.as_slice().is_empty()
    }

    pub(super) fn map(&self) -> &DisparityMap {
        &self.output.disparity
    }

    pub(super) fn rig(&self) -> Option<&Rig> {
        self.rig.as_ref()
    }
}

/// Two images of a pixel, to be resized.
fn pixels() -> Result<[Gray; 2]> {
    Ok([Gray::filled(1, 1, 0)?, Gray::filled(1, 1, 0)?])
}
