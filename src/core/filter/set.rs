//! The filters of a run: their detections in a left image, applied to disparities and cells.

use super::{FilterKind, FilterModel, FilterWindows, Spectrum};
use crate::error::{Error, Result};
use crate::kernel::Isa;
use crate::stereo::{CellDepth, DepthGrid, DisparityMap, Gray, GridShape, Reason, Rig};
use std::sync::Arc;

/// A filter with its scratch memory.
pub struct CellFilter {
    model: Arc<FilterModel>,
    isa: Isa,
    spectrum: Spectrum,
    /// The windows of images of the last size and grid.
    windows: Option<((usize, usize), GridShape, FilterWindows)>,
    inputs: Vec<f32>,
    hidden: Vec<f32>,
    scores: Vec<f32>,
    /// Per cell in raster order.
    seen: Vec<bool>,
}

impl CellFilter {
    pub fn new(model: Arc<FilterModel>, isa: Isa) -> Self {
        Self {
            spectrum: Spectrum::new(model.features.window),
            isa,
            windows: None,
            inputs: Vec::new(),
            hidden: Vec::new(),
            scores: Vec::new(),
            seen: Vec::new(),
            model,
        }
    }

    /// The cells of the left image in which it detects its object, in raster order. Allocates
    /// nothing after the first image of a size.
    ///
    /// # Errors
    /// [`Error::Invalid`] for images smaller than its window.
    pub fn look(&mut self, left: &Gray, shape: GridShape) -> Result<&[bool]> {
        let features = self.model.features;
        let size = left.size();
        let windows = match &mut self.windows {
            Some((known_size, grid, windows)) if (*known_size, *grid) == (size, shape) => windows,
            windows => {
                let new = FilterWindows::new(self.model.kind, features.window, size, shape)?;
                &mut windows.insert((size, shape, new)).2
            }
        };
        let (corners, stride) = (&windows.corners, features.stride());
        self.inputs.resize(corners.len() * stride, 0.0);
        self.scores.resize(corners.len(), 0.0);
        for (&at, inputs) in corners.iter().zip(self.inputs.chunks_exact_mut(stride)) {
            self.spectrum.features(features, left, at, inputs);
        }
        let network = &self.model.network;
        network.scores(self.isa, &self.inputs, &mut self.hidden, &mut self.scores);
        let scores = &self.scores;
        let is_seen =
            |cell_windows: &Vec<usize>| cell_windows.iter().any(|&window| scores[window] > 0.0);
        self.seen.clear();
        self.seen.extend(windows.by_cell.iter().map(is_seen));
        Ok(&self.seen)
    }
}

/// The filters of a run, at most one of a kind.
pub struct Filters {
    floor: Option<CellFilter>,
    too_close: Option<CellFilter>,
}

impl Filters {
    /// # Errors
    /// [`Error::Usage`] for two of the same kind.
    pub fn new(models: &[Arc<FilterModel>], isa: Isa) -> Result<Self> {
        let only = |kind: FilterKind| {
            let mut candidates = models.iter().filter(|model| model.kind == kind);
            let first = candidates.next();
            match candidates.next() {
                Some(_) => Err(Error::Usage(format!("filter {kind}: named twice"))),
                None => Ok(first.map(|model| CellFilter::new(Arc::clone(model), isa))),
            }
        };
        Ok(Self {
            floor: only(FilterKind::Floor)?,
            too_close: only(FilterKind::TooClose)?,
        })
    }

    /// Runs the filters on a left image; the detections are applied to the estimates of that image.
    ///
    /// # Errors
    /// The errors of [`CellFilter::look`].
    pub fn look(&mut self, left: &Gray, shape: GridShape) -> Result<()> {
        let filters = [&mut self.floor, &mut self.too_close];
        let mut filters = filters.into_iter().flatten();
        filters.try_for_each(|filter| filter.look(left, shape).map(drop))
    }

    /// Removes the disparities of the floor.
    pub fn drop_floor(&self, map: &mut DisparityMap, shape: GridShape) {
        let Some(floor) = &self.floor else {
            return;
        };
        let size = map.size();
        for (place, _) in shape.iter().zip(&floor.seen).filter(|(_, seen)| **seen) {
            let (columns, rows) = shape.pixels(place, size);
            for mut row in map.rows_mut().skip(rows.start).take(rows.len()) {
                for x in columns.clone() {
                    if row.at(x).is_ok() {
                        row.reject(x, Reason::Floor);
                    }
                }
            }
        }
    }

    /// Marks floor cells as unknown, if an algorithm computed the grid itself, and marks cells that
    /// are too close: such a cell reports the disparity at the end of the range, or its own nearer
    /// one.
    pub fn mark_cells(&self, grid: &mut DepthGrid, rig: Option<&Rig>) {
        let floor = self.floor.as_ref().map(|floor| &floor.seen);
        for (cell, _) in grid
            .cells_mut()
            .zip(floor.into_iter().flatten())
            .filter(|(_, seen)| **seen)
        {
            (cell.depth, cell.surface) = (None, None);
            // It belonged to the removed report.
            cell.probability = None;
        }
        let Some(too_close) = &self.too_close else {
            return;
        };
        let range_px = too_close.model.range_px.unwrap_or_default() as f32;
        let depth = CellDepth::at(range_px, rig);
        for (cell, _) in grid
            .cells_mut()
            .zip(&too_close.seen)
            .filter(|(_, seen)| **seen)
        {
            if cell.depth.is_none_or(|known| known.median_px < range_px) {
                cell.depth = Some(depth);
                cell.too_close = true;
                // It belonged to the replaced report.
                cell.probability = None;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Features, Network, Scaling};
    use super::*;
    use crate::depth::{self, GridSettings};
    use std::collections::BTreeMap;

    /// A filter that detects windows whose mean grey value exceeds 100.
    fn bright(kind: FilterKind, window: usize) -> Arc<FilterModel> {
        let features = Features {
            window,
            scaling: Scaling::Amplitude,
        };
        let mut weights = vec![0.0; features.count()];
        weights[0] = 0.01;
        let network = Network::new(features.count(), &weights, vec![-1.0], vec![1.0], 0.0);
        Arc::new(FilterModel {
            kind,
            features,
            network: network.unwrap(),
            range_px: (kind == FilterKind::TooClose).then_some(30.0),
            facts: BTreeMap::new(),
        })
    }

    /// Disparities of 10 px, and an image that is bright in the right half.
    fn scene() -> (Gray, DisparityMap) {
        let left = Gray::from_fn(100, 60, |x, _| if x < 50 { 50 } else { 150 }).unwrap();
        let mut map = DisparityMap::new(100, 60).unwrap();
        for mut row in map.rows_mut() {
            (0..100).for_each(|x| row.accept(x, 10.0));
        }
        (left, map)
    }

    #[test]
    fn the_floor_is_dropped_and_what_is_too_close_marked() {
        let (left, mut map) = scene();
        let settings = GridSettings::default();
        let shape = settings.shape();
        let models = [
            bright(FilterKind::Floor, 8),
            bright(FilterKind::TooClose, 16),
        ];
        let mut filters = Filters::new(&models[..1], Isa::BASELINE).unwrap();
        filters.look(&left, shape).unwrap();
        filters.drop_floor(&mut map, shape);
        assert_eq!(
            (map.at(59, 3), map.at(60, 3)),
            (Ok(10.0), Err(Reason::Floor))
        );
        let known = |grid: &DepthGrid| {
            grid.iter()
                .map(|(_, c)| c.depth.is_some())
                .collect::<Vec<_>>()
        };
        let mut grid = depth::grid(map.disparity(), settings, None);
        let row = [true, true, true, false, false];
        assert_eq!(known(&grid), [row, row, row].concat());
        // The same holds for an algorithm's own grid.
        let (left, map) = scene();
        grid = depth::grid(map.disparity(), settings, None);
        grid.cells_mut()
            .for_each(|cell| cell.probability = Some(0.9));
        filters.mark_cells(&mut grid, None);
        let certain = |column| grid.cell(column, 0).probability;
        assert_eq!((certain(2), certain(3)), (Some(0.9), None));
        assert_eq!(known(&grid), [row, row, row].concat());

        let mut filters = Filters::new(&models, Isa::BASELINE).unwrap();
        filters.look(&left, shape).unwrap();
        let rig = Rig::new(300.0, (50.0, 30.0), 0.1, 0.0).unwrap();
        let mut grid = depth::grid(map.disparity(), settings, Some(&rig));
        filters.mark_cells(&mut grid, Some(&rig));
        // The right window covers the columns 50 to 90.
        let close: Vec<_> = grid
            .iter()
            .take(5)
            .map(|(_, cell)| cell.too_close)
            .collect();
        assert_eq!(close, [false, false, true, true, true]);
        let depth = grid.cell(4, 1).depth.unwrap();
        assert_eq!((depth.median_px, depth.distance_m), (30.0, Some(1.0)));
        assert!(Filters::new(&[models[0].clone(), models[0].clone()], Isa::BASELINE).is_err());
        let small = Gray::filled(12, 12, 0).unwrap();
        assert!(filters.look(&small, shape).is_err());
    }
}
