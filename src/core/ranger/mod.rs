//! Distances from a stereo camera, as a robot needs them: two images in, the cells of a grid out.

mod cells;
mod engine;
mod image;
mod worker;

pub use cells::{Cells, RangedCell};
pub use image::{ImageFormat, ImageRef};

use crate::error::{Error, Result};
use crate::filter::FilterModel;
use crate::stereo::{DisparityMap, GridShape, Rig, StereoCalibration};
use engine::Engine;
use std::sync::Arc;
use worker::{PairWorker, Patience};

/// Most threads of a ranger.
const MAX_THREADS: usize = 1024;

/// The cameras, as far as they are known.
#[derive(Clone, Debug, Default)]
pub enum Optics {
    /// Rectified images of unknown cameras: cells have disparities and no distances.
    #[default]
    Unknown,
    /// Rectified images of that rig.
    Rectified(Rig),
    /// Images of calibrated cameras, which the ranger rectifies unless they are rectified already
    /// ([`StereoCalibration::is_rectified`]).
    Calibrated(Box<StereoCalibration>),
}

impl From<Rig> for Optics {
    fn from(rig: Rig) -> Self {
        Self::Rectified(rig)
    }
}

impl From<StereoCalibration> for Optics {
    fn from(calibration: StereoCalibration) -> Self {
        Self::Calibrated(Box::new(calibration))
    }
}

/// Settings of a [`Ranger`]; the defaults are the thesis's grid, no filters, a thread per core.
#[derive(Clone, Debug, Default)]
pub struct RangerOptions {
    /// Columns and rows of the cells, 1 to 64 each.
    pub cells: GridShape,
    /// At most one of a kind ([`FilterModel::read`]).
    pub filters: Vec<Arc<FilterModel>>,
    /// At most 1024; 0 is one per core.
    pub threads: usize,
}

/// A matcher with all that is around it: rectification, filters, cells, the memory of earlier
/// pairs, and threads.
///
/// The cells are those that the bench scores. Equal runs of pairs give equal bytes on every CPU,
/// instruction set and number of threads. Allocates nothing after the first pairs of a size.
///
/// ```
/// use svl_core::ranger::{Ranger, RangerOptions};
/// use svl_core::stereo::{CellState, Gray, Rig};
///
/// let rig = Rig::new(328.0, (160.0, 120.0), 0.044, 0.0)?;
/// let mut ranger = Ranger::open("v5:max_disparity=64", rig, &RangerOptions::default())?;
/// let wall = Gray::filled(320, 240, 90)?;
/// let cells = ranger.cells(&wall, &wall)?;
/// let grey = cells.at(2, 1);
/// assert_eq!(grey.state, CellState::Unknown, "a grey wall has no texture to match");
/// assert_eq!(grey.distance_m, None);
/// # Ok::<(), svl_core::Error>(())
/// ```
pub struct Ranger {
    /// None after a panic, and while the worker has it.
    engine: Option<Box<Engine>>,
    /// True if a caller went away while the worker had the engine.
    is_left: bool,
    worker: PairWorker,
}

impl Ranger {
    /// `algorithm` as on svl's command line: `v5:max_disparity=64`. `optics`: a [`Rig`], a
    /// [`StereoCalibration`], or [`Optics::Unknown`].
    ///
    /// # Errors
    /// The errors of the algorithm's text, of [`crate::rectify::Rectifier::new`] and of a filter
    /// that does not fit; [`Error::Invalid`] for an algorithm that matches no images, an impossible
    /// grid or number of threads.
    pub fn open(
        algorithm: &str,
        optics: impl Into<Optics>,
        options: &RangerOptions,
    ) -> Result<Self> {
        let engine = Engine::new(algorithm.parse()?, optics.into(), options)?;
        if options.threads > MAX_THREADS {
            return Err(Error::Invalid(format!(
                "{} threads: expected at most {MAX_THREADS}, or 0 for one per core",
                options.threads
            )));
        }
        Ok(Self {
            engine: Some(Box::new(engine)),
            is_left: false,
            worker: PairWorker::start(options.threads)?,
        })
    }

    /// The cells of a pair without a time stamp. Algorithms with a memory (v5) take it for the next
    /// one after the last.
    ///
    /// # Errors
    /// [`Error::PairSize`], [`Error::Dimensions`]; [`Error::Invalid`] for images of another size
    /// than the calibration's, and after a fork; [`Error::Panicked`].
    pub fn cells<'a>(
        &mut self,
        left: impl Into<ImageRef<'a>>,
        right: impl Into<ImageRef<'a>>,
    ) -> Result<&Cells> {
        self.run([left.into(), right.into()], None, None)
    }

    /// Same as [`Ranger::cells`], of a pair exposed at `stamp_ns` of any clock. Algorithms with a
    /// memory forget earlier pairs if more than a second has passed or the clock does not rise.
    ///
    /// # Errors
    /// The errors of [`Ranger::cells`].
    pub fn cells_at<'a>(
        &mut self,
        left: impl Into<ImageRef<'a>>,
        right: impl Into<ImageRef<'a>>,
        stamp_ns: u64,
    ) -> Result<&Cells> {
        self.run([left.into(), right.into()], Some(stamp_ns), None)
    }

    /// Same as [`Ranger::cells_at`], with a stamp or without, as long as `is_waiting`, which is
    /// asked every 50 ms. A pair that is not waited for is one of the earlier pairs.
    ///
    /// # Errors
    /// The errors of [`Ranger::cells`]; [`Error::Interrupted`].
    pub fn cells_while<'a>(
        &mut self,
        left: impl Into<ImageRef<'a>>,
        right: impl Into<ImageRef<'a>>,
        stamp_ns: Option<u64>,
        mut is_waiting: impl FnMut() -> bool,
    ) -> Result<&Cells> {
        self.run([left.into(), right.into()], stamp_ns, Some(&mut is_waiting))
    }

    fn run(
        &mut self,
        images: [ImageRef<'_>; 2],
        stamp_ns: Option<u64>,
        mut is_waiting: Patience<'_, '_>,
    ) -> Result<&Cells> {
        if self.worker.is_forked() {
            let cure = "open one in each process";
            let what = "this ranger was opened before a fork, which copies no threads";
            return Err(Error::Invalid(format!("{what}; {cure}")));
        }
        // A pair that was not waited for has no caller.
        let _ = self.take_back(is_waiting.as_deref_mut())?;
        let engine = self.engine.as_mut().ok_or(Error::Panicked)?;
        engine.load(images, stamp_ns)?;
        if let Some(engine) = self.engine.take() {
            self.worker.begin(engine);
            self.is_left = true;
        }
        let result = self.take_back(is_waiting)?;
        let engine = self.engine.as_ref().ok_or(Error::Panicked)?;
        result.map(|()| &engine.cells)
    }

    /// Waits for an engine that the worker has.
    fn take_back(&mut self, is_waiting: Patience<'_, '_>) -> Result<Result<()>> {
        if !self.is_left {
            return Ok(Ok(()));
        }
        let done = self.worker.end(is_waiting);
        self.is_left = matches!(done, Err(Error::Interrupted));
        let (engine, result) = done?;
        self.engine = Some(engine);
        Ok(result)
    }

    /// The cells of the last pair; `None` before the first, and if the last one failed.
    pub fn last_cells(&self) -> Option<&Cells> {
        let engine = self.engine.as_ref()?;
        engine.has_result().then_some(&engine.cells)
    }

    /// The disparity map of the last pair, of the size of rectified images; `None` as of
    /// [`Ranger::last_cells`]. v5 decides cells by more than this map.
    pub fn disparity(&self) -> Option<&DisparityMap> {
        let engine = self.engine.as_ref()?;
        engine.has_result().then(|| engine.map())
    }

    /// The rig of rectified images, if it is known in metres.
    pub fn rig(&self) -> Option<&Rig> {
        self.engine.as_ref()?.rig()
    }

    /// Forgets the earlier pairs: the next one is the first of another scene.
    pub fn reset(&mut self) {
        // After a panic there is no engine to reset.
        let _ = self.take_back(None);
        if let Some(engine) = &mut self.engine {
            engine.reset();
        }
    }
}
