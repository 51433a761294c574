//! Logs a frame and its estimates.

use crate::info::AlgorithmPath;
use crate::overlay::Overlay;
use crate::scale::Scale;
use crate::{CAMERA, EPOCH_NS, IMAGE, MAPS, RerunSink, picture, world};
use rerun::{AsComponents, Clear, Scalars, TextLog};
use svl_bench::sink::WorstSecond;
use svl_core::Result;
use svl_core::stereo::{DepthGrid, DisparityMap, Frame, Plane};
use svl_core::timing::Stage;
use svl_score::judge::{Judged, JudgedEstimate, METRICS, MetricSource as _};

impl RerunSink {
    /// Logs the camera: image, pose, projection, and the name of the scene.
    pub(crate) fn push_scene(&mut self, frame: &Frame, scale: &Scale) -> Result<()> {
        self.log(IMAGE, &picture::left(frame)?)?;
        let pose = frame.pose.unwrap_or_else(world::resting);
        let camera = frame.rig().map(|rig| world::pinhole(rig, frame, scale));
        match camera {
            Some(pinhole) => self.log(
                CAMERA,
                &[&world::transform(&pose) as &dyn AsComponents, &pinhole],
            )?,
            None => self.log(CAMERA, &Clear::flat())?,
        }
        if let (Some(from), Some(to)) = (&self.last_pose, &frame.pose) {
            self.log("world/trail", &world::step(from, to))?;
        }
        self.last_pose = frame.pose;
        Ok(())
    }

    /// Lists a frame by its name, or by its contents, so that a click leads to it.
    pub(crate) fn push_name(&self, judged: &Judged) -> Result<()> {
        let mut estimates = judged.estimates.iter();
        let shown = estimates.find_map(|scored| scored.checkpoints.first());
        let checkpoint = shown.and_then(|(i, _)| self.checkpoints.get(*i));
        let words = match (&judged.frame.name, checkpoint) {
            (Some(name), _) => name.as_str(),
            (None, Some(checkpoint)) => checkpoint,
            (None, None) => "all maps",
        };
        self.log("run/frames", &TextLog::new(words))
    }

    /// Lists the worst second at its worst pair, if this recording has it.
    pub(crate) fn push_worst(&self, worst: &WorstSecond) -> Result<()> {
        let run = (worst.seed, worst.run.clone().unwrap_or_default());
        let Some((_, start)) = self.starts.iter().find(|(own, _)| *own == run) else {
            return Ok(());
        };
        let now = start.after(worst.sequence, worst.stamp_ns);
        self.set_time(now, worst.stamp_ns >= EPOCH_NS);
        self.log(
            "run/frames",
            &TextLog::new(&*worst.words).with_level("WARN"),
        )
    }

    /// Logs the truth: its depth grid and, if the frame has maps, its depths.
    pub(crate) fn push_truth(&self, judged: &Judged, scale: &Scale) -> Result<()> {
        let (Some(truth), Some(cells)) = (&judged.frame.truth, &judged.true_cells) else {
            return self.log("truth", &Clear::recursive());
        };
        self.log_overlay("truth/overlay", cells.grid(), &judged.frame, scale)?;
        if self.has_maps {
            self.log_depth("truth/depth", &truth.disparity, &judged.frame, scale)
        } else {
            Ok(())
        }
    }

    /// Clears all maps and clouds, which must not remain next to later images.
    pub(crate) fn clear_maps(&self) -> Result<()> {
        for algorithm in &self.algorithms {
            let ssdpi = algorithm.extra.ssdpi.then_some("ssdpi");
            let maps = MAPS.into_iter().chain(ssdpi);
            maps.map(|map| algorithm.path(map))
                .try_for_each(|path| self.log(&path, &Clear::recursive()))?;
        }
        self.log("truth/depth", &Clear::recursive())
    }

    /// Logs the estimate of one algorithm: overlay, maps, metrics.
    pub(crate) fn push_estimate(
        &self,
        algorithm: &AlgorithmPath,
        scored: &JudgedEstimate,
        frame: &Frame,
        scale: &Scale,
    ) -> Result<()> {
        let estimate = &scored.estimate;
        let map = &estimate.disparity;
        self.log_overlay(&algorithm.path("overlay"), &estimate.grid, frame, scale)?;
        if self.has_maps {
            self.push_maps(algorithm, map, frame, scale)?;
        }

        let millis = |time: std::time::Duration| Scalars::single(time.as_secs_f64() * 1e3);
        if let Some(times) = estimate.times {
            for stage in Stage::ALL {
                let path = algorithm.path(&format!("latency/{}", stage.name()));
                self.log(&path, &millis(times.get(stage)))?;
            }
            self.log(&algorithm.path("latency/total"), &millis(times.total()))?;
        }
        for metric in METRICS {
            let Some(plot) = metric.plot else { continue };
            let value = scored.metrics.get(metric.name);
            let shown = value.map(|value| Scalars::single(metric.plotted(value)));
            self.log_or_clear(&algorithm.path(plot), shown)?;
        }
        Ok(())
    }

    fn push_maps(
        &self,
        algorithm: &AlgorithmPath,
        map: &DisparityMap,
        frame: &Frame,
        scale: &Scale,
    ) -> Result<()> {
        self.log(
            &algorithm.path("disparity"),
            &picture::disparity(map.disparity()),
        )?;
        self.log(&algorithm.path("why"), &picture::why(map.why())?)?;
        match map.ssdpi() {
            Some(ssdpi) if self.is_listed => {
                self.log(&algorithm.path("ssdpi"), &picture::ssdpi(ssdpi))?;
            }
            Some(_) => self.log(&algorithm.path("ssdpi"), &Clear::flat())?,
            None => {}
        }
        // During tuning no view shows depths and clouds.
        if self.changes.is_some() {
            return Ok(());
        }
        self.log_depth(&algorithm.path("depth"), map.disparity(), frame, scale)?;
        let points = frame
            .rig()
            .map(|rig| picture::points(map.disparity(), rig, scale));
        self.log_or_clear(&algorithm.path("points"), points.transpose()?)
    }

    fn log_overlay(
        &self,
        path: &str,
        grid: &DepthGrid,
        frame: &Frame,
        scale: &Scale,
    ) -> Result<()> {
        let overlay = Overlay::new(grid, frame.pair.size(), scale, self.algorithms.len());
        let lines = &overlay.lines as &dyn AsComponents;
        self.log(path, &[lines, &overlay.medians, &overlay.unknown])?;
        self.log(&format!("{path}/percentiles"), &overlay.percentiles)?;
        self.log(&format!("{path}/cells"), &overlay.distances)
    }

    fn log_depth(
        &self,
        path: &str,
        disparity: &Plane<f32>,
        frame: &Frame,
        scale: &Scale,
    ) -> Result<()> {
        let Some(rig) = frame.rig() else {
            return self.log(path, &Clear::recursive());
        };
        self.log(path, &picture::depth(disparity, rig, scale))?;
        self.log(&format!("{path}/none"), &picture::no_depth(disparity, rig)?)
    }

    pub(crate) fn log(&self, path: &str, what: &(impl AsComponents + ?Sized)) -> Result<()> {
        self.stream
            .log(path, what)
            .map_err(|error| self.target.failed(error))
    }

    pub(crate) fn log_static(&self, path: &str, what: &impl AsComponents) -> Result<()> {
        self.stream
            .log_static(path, what)
            .map_err(|error| self.target.failed(error))
    }

    /// Without clearing, the viewer would keep showing the last value.
    fn log_or_clear(&self, path: &str, what: Option<impl AsComponents>) -> Result<()> {
        match what {
            Some(what) => self.log(path, &what),
            None => self.log(path, &Clear::flat()),
        }
    }
}
