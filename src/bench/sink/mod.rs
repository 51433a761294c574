//! Sinks: tables, checkpoints, pictures, viewer, recordings. [`Sinks::open`] builds them.

mod checkpoints;
mod collect;
mod live;
mod pictures;
#[cfg(feature = "ros2")]
mod publish;
mod recording;
mod table;
mod viewer;

pub use checkpoints::CheckpointSink;
pub use collect::{CollectSink, WatchSink};
pub use live::LiveTable;
pub(crate) use pictures::frame_shot;
pub use pictures::{PictureSink, ReportPictures};
pub use recording::RecordingSink;
pub(crate) use table::RunIdentity;
pub use table::TableSink;
pub use viewer::{
    BoardView, CellNote, RerunDetail, RerunTarget, RunInfo, StepView, Verdicts, Viewer,
};

use crate::report::{CheckpointRow, ResultLog, Row, Summary};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use svl_core::stereo::{Frame, Losses};
use svl_core::{Error, Result};
use svl_data::manifest::Manifest;
use svl_data::recording::{ResultOptions, StoredResults, Writer};
use svl_data::score::{Judge, Judged};

/// The run for Rerun in the folder of a report.
pub const REPORT_RUN: &str = "run.rrd";

/// Takes the frames of one run after the other.
pub trait Sink: Send {
    /// A run begins.
    ///
    /// # Errors
    /// As [`Sink::take`].
    fn begin_run(&mut self, _: &RunStart<'_>) -> Result<()> {
        Ok(())
    }

    /// Takes a frame with its scored estimates.
    ///
    /// # Errors
    /// The reason why it cannot be kept. Frames that were taken before stay readable.
    fn take(&mut self, judged: &Judged) -> Result<()>;

    /// Sets `needed` for the algorithms whose disparity maps it will show of a later frame. Asked
    /// for every frame in order, before any of them is taken, if results of an earlier run, which
    /// have no maps, replace matching.
    fn ask_for_maps(&mut self, _frame: &Frame, _shows_checkpoint: bool, _needed: &mut [bool]) {}

    /// Waits until its threads have done what it gave them: measured matching begins.
    ///
    /// # Errors
    /// As [`Sink::take`].
    fn settle(&mut self) -> Result<()> {
        Ok(())
    }

    /// The run is over, complete or not.
    ///
    /// # Errors
    /// As [`Sink::take`].
    fn end_run(&mut self, _: &RunEnd<'_>) -> Result<()> {
        Ok(())
    }

    /// Completes the output, after the last run.
    ///
    /// # Errors
    /// As [`Sink::take`].
    fn finish(self: Box<Self>) -> Result<()>;
}

/// Facts that hold for a whole run.
#[derive(Clone, Copy)]
pub struct RunStart<'a> {
    pub manifest: &'a Manifest,
    /// Results of an earlier part of the same run, which a measured run takes in place of matching.
    pub log: Option<&'a ResultLog>,
    /// Seed of the arena's run.
    pub seed: Option<u64>,
    pub judge: &'a Judge,
}

impl<'a> RunStart<'a> {
    /// A run that matches every pair.
    pub fn new(manifest: &'a Manifest, seed: Option<u64>, judge: &'a Judge) -> Self {
        Self {
            manifest,
            log: None,
            seed,
            judge,
        }
    }
}

/// The end of a run.
#[derive(Clone, Copy)]
pub struct RunEnd<'a> {
    /// Everything of the source that is in no frame.
    pub losses: &'a Losses,
    /// Reason why the run ended early.
    pub error: Option<&'a str>,
}

/// The outputs of a run.
#[derive(Default)]
pub struct SinkRequest<'a> {
    /// A file for the rows, `.csv` or `.parquet`.
    pub rows: Option<&'a Path>,
    /// A file for the cells, likewise.
    pub cells: Option<&'a Path>,
    /// Limit on the rows for the summary, the newest of a run without end; files have all.
    pub newest_rows: Option<usize>,
    /// A folder for all tables; the pictures of a report page are collected too.
    pub report: Option<&'a Path>,
    pub viewer: Option<ViewerRequest>,
    /// Live topics for the results of the first algorithm.
    pub publish: Option<PublishRequest<'a>>,
    /// A recording of the pairs and of every algorithm's disparities.
    pub recording: Option<Writer>,
    /// Results that the source has of its pairs, for the recording.
    pub stored: Option<StoredResults>,
}

/// The viewer of a run, with its options.
pub struct ViewerRequest {
    pub viewer: &'static dyn Viewer,
    pub target: RerunTarget,
    pub detail: RerunDetail,
    pub info: RunInfo,
}

/// Live topics for results.
pub struct PublishRequest<'a> {
    /// As `ros2:/PREFIX`.
    pub address: &'a str,
    pub options: ResultOptions,
}

impl PublishRequest<'_> {
    #[cfg(feature = "ros2")]
    fn sink(&self) -> Result<Box<dyn Sink>> {
        let sink = publish::PublishSink::new(self.address, self.options.clone())?;
        Ok(Box::new(sink))
    }

    #[cfg(not(feature = "ros2"))]
    fn sink(&self) -> Result<Box<dyn Sink>> {
        let Self {
            address,
            options: _,
        } = self;
        Err(crate::source::without_ros2(address))
    }
}

/// The sinks of one or several runs.
pub struct Sinks {
    sinks: Vec<Box<dyn Sink>>,
    /// Number of sinks that write tables; they come first.
    tables: usize,
    rows: Outbox<Vec<Row>>,
    checkpoints: Outbox<Vec<CheckpointRow>>,
    pictures: Outbox<ReportPictures>,
}

/// Results that the sinks collected over all runs.
#[derive(Default)]
pub struct RunResults {
    pub rows: Vec<Row>,
    pub checkpoints: Vec<CheckpointRow>,
    pub pictures: ReportPictures,
}

impl Sinks {
    /// Opens the sinks: the one place that builds them.
    ///
    /// # Errors
    /// A file that cannot be made, a viewer that does not answer.
    pub fn open(request: SinkRequest<'_>) -> Result<Self> {
        let rows = Outbox::default();
        let checkpoints = Outbox::default();
        let pictures = Outbox::default();
        let mut sinks: Vec<Box<dyn Sink>> = Vec::new();
        match request.report {
            None => {
                let table = TableSink::new(request.rows, request.cells, &rows)?;
                sinks.push(Box::new(table.with_newest(request.newest_rows)));
            }
            Some(folder) => {
                std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
                sinks.push(Box::new(TableSink::in_folder(folder, &rows)?));
                sinks.push(Box::new(CheckpointSink::in_folder(folder, &checkpoints)?));
                sinks.push(Box::new(PictureSink::new(&pictures)));
            }
        }
        let tables = match request.report {
            None => 1,
            Some(_) => 2,
        };
        if let Some(ViewerRequest {
            viewer,
            target,
            detail,
            info,
        }) = request.viewer
        {
            // It is finished after the tables, which then have the checkpoints' results.
            let (rows, checkpoints) = (rows.clone(), checkpoints.clone());
            let scenario = info.scenario.clone();
            let verdicts: Verdicts = Box::new(move || {
                let summary = rows.with(|rows| {
                    checkpoints.with(|checkpoints| Summary::from_rows(rows, checkpoints))
                });
                Some(summary.ok()?.verdicts_markdown(&scenario))
            });
            let verdicts = request.report.map(|_| verdicts);
            sinks.push(viewer.run(target, detail, &info, verdicts)?);
        }
        if let Some(publish) = &request.publish {
            sinks.push(publish.sink()?);
        }
        if let Some(writer) = request.recording {
            sinks.push(Box::new(RecordingSink::new(writer, request.stored)));
        }
        Ok(Self {
            sinks,
            tables,
            rows,
            checkpoints,
            pictures,
        })
    }

    /// Adds a sink of the caller's.
    pub fn push(&mut self, sink: impl Sink + 'static) {
        self.sinks.push(Box::new(sink));
    }

    /// For [`crate::run::run`].
    pub fn as_mut_slice(&mut self) -> &mut [Box<dyn Sink>] {
        &mut self.sinks
    }

    /// The sinks that write tables: pictures show no perturbed pairs.
    pub fn tables_mut(&mut self) -> &mut [Box<dyn Sink>] {
        &mut self.sinks[..self.tables]
    }

    /// The sinks alone, without what they collect.
    pub fn into_boxed(self) -> Vec<Box<dyn Sink>> {
        self.sinks
    }

    /// Finishes all sinks in their order, also after one that fails. The results hold also then.
    pub fn finish(self) -> (RunResults, Result<()>) {
        let finished = finish(self.sinks);
        let results = RunResults {
            rows: self.rows.take(),
            checkpoints: self.checkpoints.take(),
            pictures: self.pictures.take(),
        };
        (results, finished)
    }
}

/// Finishes all sinks in their order, also after one that fails.
///
/// # Errors
/// The first of them.
pub fn finish(sinks: Vec<Box<dyn Sink>>) -> Result<()> {
    sinks
        .into_iter()
        .map(Sink::finish)
        .fold(Ok(()), Result::and)
}

/// Results of a finished sink, for its maker and for the sinks that finish after it.
pub struct Outbox<T>(Arc<Mutex<T>>);

impl<T: Default> Default for Outbox<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T> Clone for Outbox<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Outbox<T> {
    /// Stores the value for all copies of the outbox.
    pub fn put(&self, value: T) {
        *self.lock() = value;
    }

    /// Looks at what was left; the default before the sink is finished.
    pub fn with<R>(&self, look: impl FnOnce(&T) -> R) -> R {
        look(&self.lock())
    }

    fn lock(&self) -> MutexGuard<'_, T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T: Default> Outbox<T> {
    /// Takes what was left.
    pub fn take(&self) -> T {
        std::mem::take(&mut *self.lock())
    }
}
