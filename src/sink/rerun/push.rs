//! What a frame and its estimates become.

use super::info::Algorithm;
use super::overlay::{self, Overlay};
use super::scale::Scale;
use super::{CAMERA, IMAGE, RerunSink, picture, world};
use crate::error::Result;
use crate::stereo::{Cell, DepthGrid, Estimate, Frame, GridShape, Plane};
use crate::timing::Stage;
use ::rerun::{AsComponents, Clear, Scalars, TextLog};

impl RerunSink {
    /// The camera: its image, its place, its name for the frame.
    pub(super) fn push_scene(&mut self, frame: &Frame, scale: &Scale) -> Result<()> {
        self.log(IMAGE, &picture::gray(frame.pair.left()))?;
        let pose = frame.pose.unwrap_or_else(world::resting);
        let camera = frame.rig.as_ref().map(|rig| world::pinhole(rig, frame, scale));
        match camera {
            Some(pinhole) => self.log(CAMERA, &[&world::transform(&pose) as &dyn AsComponents, &pinhole])?,
            None => self.log(CAMERA, &Clear::flat())?,
        }
        if let (Some(from), Some(to)) = (&self.last_pose, &frame.pose) {
            self.log("world/trail", &world::step(from, to))?;
        }
        self.last_pose = frame.pose;
        if let Some(name) = &frame.name {
            self.log("run/frames", &TextLog::new(name.as_str()))?;
        }
        Ok(())
    }

    /// Draws the truth and gives its grid.
    pub(super) fn push_truth(&self, frame: &Frame, scale: &Scale, shape: GridShape) -> Result<Option<DepthGrid>> {
        let Some(truth) = &frame.truth else {
            self.log("truth", &Clear::recursive())?;
            return Ok(None);
        };
        let grid = overlay::true_grid(&truth.disparity, frame.rig.as_ref(), shape);
        self.log_overlay("truth/overlay", &grid, frame, scale)?;
        self.log_depth("truth/depth", &truth.disparity, frame, scale)?;
        Ok(Some(grid))
    }

    /// Everything of an algorithm.
    pub(super) fn push_estimate(
        &self,
        algorithm: &Algorithm,
        estimate: &Estimate,
        frame: &Frame,
        scale: &Scale,
        truth: Option<&DepthGrid>,
    ) -> Result<()> {
        let map = &estimate.disparity;
        self.log_overlay(&algorithm.path("overlay"), &estimate.grid, frame, scale)?;
        self.log(&algorithm.path("disparity"), &picture::disparity(map.disparity(), scale))?;
        self.log(&algorithm.path("why"), &picture::why(map.why()))?;
        self.log(&algorithm.path("ssdpi"), &picture::ssdpi(map.ssdpi()))?;
        self.log_depth(&algorithm.path("depth"), map.disparity(), frame, scale)?;
        let points = frame.rig.as_ref().map(|rig| world::points(map, frame.pair.left(), rig, scale));
        self.log_or_clear(&algorithm.path("points"), points)?;

        let millis = |time: std::time::Duration| Scalars::single(time.as_secs_f64() * 1e3);
        for stage in Stage::ALL {
            self.log(&algorithm.path(&format!("latency/{}", stage.name())), &millis(estimate.times.get(stage)))?;
        }
        self.log(&algorithm.path("latency/total"), &millis(estimate.times.total()))?;
        self.log(&algorithm.path("coverage"), &Scalars::single(100.0 * map.coverage()))?;
        let wrong = truth.and_then(|truth| wrong_cells(truth, &estimate.grid));
        self.log_or_clear(&algorithm.path("wrong_cells"), wrong.map(|n| Scalars::single(n as f64)))
    }

    fn log_overlay(&self, path: &str, grid: &DepthGrid, frame: &Frame, scale: &Scale) -> Result<()> {
        let Overlay { medians, unknown, lines, percentiles } = Overlay::new(grid, frame.pair.size(), scale);
        self.log(path, &[&lines as &dyn AsComponents, &medians, &unknown])?;
        self.log(&format!("{path}/percentiles"), &percentiles)
    }

    fn log_depth(&self, path: &str, disparity: &Plane<f32>, frame: &Frame, scale: &Scale) -> Result<()> {
        let depth = frame.rig.as_ref().map(|rig| picture::depth(disparity, rig, scale));
        self.log_or_clear(path, depth.as_ref().map(|(depth, mask)| [depth as &dyn AsComponents, mask]))
    }

    pub(super) fn log(&self, path: &str, what: &(impl AsComponents + ?Sized)) -> Result<()> {
        self.stream.log(path, what).map_err(|error| self.target.failed(error))
    }

    pub(super) fn log_static(&self, path: &str, what: &impl AsComponents) -> Result<()> {
        self.stream.log_static(path, what).map_err(|error| self.target.failed(error))
    }

    /// Without the clearing, the viewer would go on showing the last that there was.
    fn log_or_clear(&self, path: &str, what: Option<impl AsComponents>) -> Result<()> {
        match what {
            Some(what) => self.log(path, &what),
            None => self.log(path, &Clear::flat()),
        }
    }
}

/// Number of cells whose distance is off by more than 0.10 m and 20 % of the true one; a cell that either does not know
/// is not wrong. Nothing where no cell can be compared.
fn wrong_cells(truth: &DepthGrid, estimate: &DepthGrid) -> Option<usize> {
    if truth.shape() != estimate.shape() {
        return None;
    }
    let distance = |cell: &Cell| cell.depth.and_then(|depth| depth.distance_m);
    let pairs = truth.iter().zip(estimate.iter());
    let known: Vec<_> = pairs.filter_map(|((_, t), (_, e))| Some((distance(t)?, distance(e)))).collect();
    let wrong = |&&(z, reported): &&(f64, Option<f64>)| reported.is_some_and(|r| (r - z).abs() > (0.2 * z).max(0.1));
    (!known.is_empty()).then(|| known.iter().filter(wrong).count())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::CellDepth;

    #[test]
    fn a_cell_is_wrong_beyond_a_fifth_and_10_cm() {
        let grid = |distances: [Option<f64>; 4]| {
            let depth = |z| CellDepth { median_px: 1.0, p20_px: 1.0, p80_px: 1.0, distance_m: Some(z) };
            let cells = distances.map(|z| Cell { valid_share: 1.0, depth: z.map(depth) });
            DepthGrid::new(GridShape { columns: 4, rows: 1 }, cells.into()).unwrap()
        };
        let truth = grid([Some(0.3), Some(2.0), Some(2.0), None]);
        assert_eq!(wrong_cells(&truth, &grid([Some(0.39), Some(2.5), None, Some(1.0)])), Some(1));
        assert_eq!(wrong_cells(&grid([None; 4]), &truth), None);
    }
}
