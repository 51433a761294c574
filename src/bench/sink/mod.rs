//! Sinks: tables, checkpoints, pictures, viewer, recordings. [`Sinks::open`] builds them.

mod collect;
mod pair_stream;
mod pictures;
#[cfg(feature = "ros2")]
mod publish;
mod recording;
mod running_table;
mod table;
mod units;
mod viewer;

pub use collect::{CollectSink, WatchSink};
pub use pair_stream::PairStreamSink;
pub(crate) use pictures::{frame_shot, left_image};
pub use recording::RecordingSink;
pub use running_table::RunningTable;
pub use svl_report::ResultsSoFar;
pub use svl_report::html::WorstSecond;
pub(crate) use table::RowIdentity;
pub use table::TableSink;
pub use units::{SeenPairs, UnitSink};
pub use viewer::{
    BoardView, CellNote, RerunDetail, RerunTarget, StepView, Verdicts, ViewedScene, Viewer,
};

use parking_lot::Mutex;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use svl_core::Result;
use svl_recording::{ResultOptions, Writer};
use svl_report::units::{ReportPlan, Units};
use svl_report::{Row, results_so_far};
use svl_score::judge::{Judge, Judged};
use svl_score::losses::Losses;
use svl_score::manifest::Manifest;

/// The runs for Rerun in the folder of a report, a file per session, in their order.
pub fn report_runs(folder: &Path) -> Vec<PathBuf> {
    let numbers = 1..;
    let paths = numbers.map(|n: u64| report_run(folder, n));
    paths.take_while(|path| path.exists()).collect()
}

/// The file for the passes of the next session.
pub fn next_report_run(folder: &Path) -> PathBuf {
    report_run(folder, report_runs(folder).len() as u64 + 1)
}

fn report_run(folder: &Path, number: u64) -> PathBuf {
    folder.join(format!("run-{number}.rrd"))
}

/// Takes the frames of one pass after the other.
pub trait Sink: Send {
    /// A pass begins.
    ///
    /// # Errors
    /// The errors of [`Sink::take`].
    fn begin_pass(&mut self, _: &PassStart<'_>) -> Result<()> {
        Ok(())
    }

    /// Takes a frame with its scored estimates.
    ///
    /// # Errors
    /// The reason why it cannot be kept. Frames that were taken before stay readable.
    fn take(&mut self, judged: &Judged) -> Result<()>;

    /// Waits until its threads have done what it gave them: measured matching begins.
    ///
    /// # Errors
    /// The errors of [`Sink::take`].
    fn settle(&mut self) -> Result<()> {
        Ok(())
    }

    /// The pass is over, complete or not.
    ///
    /// # Errors
    /// The errors of [`Sink::take`].
    fn end_pass(&mut self, _: &PassEnd<'_>) -> Result<()> {
        Ok(())
    }

    /// Completes the output, after the last pass.
    ///
    /// # Errors
    /// The errors of [`Sink::take`].
    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// The results of a pass that are asked for.
pub trait Wanted: Sync {
    /// True for the result of an algorithm of the pair at `place`, counted from 0. Where results
    /// depend on all earlier pairs, all of a pass are asked for, or none.
    fn wants(&self, place: u64, algorithm: &str) -> bool;
}

/// Facts that hold for a whole pass.
#[derive(Clone, Copy)]
pub struct PassStart<'a> {
    pub manifest: &'a Manifest,
    /// The results that are asked for, if not all are.
    pub wanted: Option<&'a dyn Wanted>,
    /// Seed of the arena's pass.
    pub seed: Option<u64>,
    /// Number of pairs of the pass, or more, if that is known and asked for.
    pub pairs: Option<u64>,
    pub judge: &'a Judge,
}

impl<'a> PassStart<'a> {
    /// A pass that matches every pair.
    pub fn new(manifest: &'a Manifest, seed: Option<u64>, judge: &'a Judge) -> Self {
        Self {
            manifest,
            wanted: None,
            seed,
            pairs: None,
            judge,
        }
    }
}

/// The end of a pass.
#[derive(Clone, Copy)]
pub struct PassEnd<'a> {
    /// Everything of the source that is in no frame.
    pub losses: &'a Losses,
    /// Reason why the pass ended early.
    pub error: Option<&'a str>,
}

/// The outputs of a pass.
#[derive(Default)]
pub struct SinkRequest<'a> {
    /// A file for the rows, `.csv` or `.parquet`.
    pub rows: Option<&'a Path>,
    /// A file for the cells, likewise.
    pub cells: Option<&'a Path>,
    /// Limit on the rows for the summary, the newest of a pass without end; files have all.
    pub newest_rows: Option<usize>,
    /// The folder of a report, for its units.
    pub report: Option<UnitRequest<'a>>,
    pub viewer: Option<ViewerRequest>,
    /// Live topics for the results of the first algorithm.
    pub publish: Option<PublishRequest<'a>>,
    /// A recording of the pairs and of every algorithm's disparities.
    pub recording: Option<Writer>,
}

/// The units of a report, for a session.
pub struct UnitRequest<'a> {
    pub folder: &'a Path,
    pub plan: &'a ReportPlan,
    pub session: &'a str,
    /// The pairs of the pass under way.
    pub pairs: &'a SeenPairs,
}

/// The viewer of a pass, with its options.
pub struct ViewerRequest {
    pub viewer: &'static dyn Viewer,
    pub target: RerunTarget,
    pub detail: RerunDetail,
    pub info: ViewedScene,
}

/// Live topics for results.
pub struct PublishRequest<'a> {
    /// The topics' prefix as `ros2:/PREFIX`.
    pub address: &'a str,
    pub options: ResultOptions,
    /// Losses so far of live topics; none of a recording, whose first pair waits for subscribers.
    pub losses: Option<Arc<Mutex<Losses>>>,
}

impl PublishRequest<'_> {
    #[cfg(feature = "ros2")]
    fn sink(self) -> Result<Box<dyn Sink>> {
        Ok(Box::new(publish::PublishSink::new(self)?))
    }

    #[cfg(not(feature = "ros2"))]
    fn sink(self) -> Result<Box<dyn Sink>> {
        Err(crate::source::without_ros2(self.address))
    }
}

/// The sinks of one or several passes.
pub struct Sinks {
    sinks: Vec<Box<dyn Sink>>,
    rows: Outbox<Vec<Row>>,
}

impl Sinks {
    /// Opens the sinks. The first writes tables.
    ///
    /// # Errors
    /// A file that cannot be made, a viewer that does not answer.
    pub fn open(request: SinkRequest<'_>) -> Result<Self> {
        let rows = Outbox::default();
        let mut sinks: Vec<Box<dyn Sink>> = Vec::new();
        match &request.report {
            None => {
                let mut table = TableSink::new(request.rows, request.cells, &rows)?;
                table.newest = request.newest_rows;
                sinks.push(Box::new(table));
            }
            Some(report) => {
                let units = Units::for_report(report.folder);
                let (plan, session) = (report.plan, report.session);
                sinks.push(Box::new(UnitSink::new(&units, plan, session, report.pairs)));
            }
        }
        if let Some(own) = request.viewer {
            // It is finished after the units are sealed.
            let verdicts = request.report.map(|report| {
                let folder = report.folder.to_owned();
                Box::new(move || results_so_far(&folder).ok()) as Verdicts
            });
            let has_report = verdicts.is_some();
            let sink = own
                .viewer
                .run(own.target, own.detail, &own.info, verdicts)?;
            sinks.push(if has_report {
                Box::new(MatchedSink(sink))
            } else {
                sink
            });
        }
        if let Some(publish) = request.publish {
            sinks.push(publish.sink()?);
        }
        if let Some(writer) = request.recording {
            sinks.push(Box::new(RecordingSink::new(writer, None)));
        }
        Ok(Self { sinks, rows })
    }

    /// Adds a sink of the caller's.
    pub fn push(&mut self, sink: impl Sink + 'static) {
        self.sinks.push(Box::new(sink));
    }

    /// For [`crate::pass::run`].
    pub fn as_mut_slice(&mut self) -> &mut [Box<dyn Sink>] {
        &mut self.sinks
    }

    /// The sink that writes tables: pictures show no perturbed pairs.
    pub fn tables_mut(&mut self) -> &mut [Box<dyn Sink>] {
        &mut self.sinks[..1]
    }

    /// Finishes all sinks in their order, also after one that fails. The rows, of passes without a
    /// report, hold also then.
    pub fn finish(self) -> (Vec<Row>, Result<()>) {
        let finished = finish(self.sinks);
        (self.rows.take(), finished)
    }
}

/// A sink that takes the frames with results of this session.
struct MatchedSink(Box<dyn Sink>);

impl Sink for MatchedSink {
    fn begin_pass(&mut self, start: &PassStart<'_>) -> Result<()> {
        self.0.begin_pass(start)
    }

    fn take(&mut self, judged: &Judged) -> Result<()> {
        if judged.estimates.is_empty() {
            Ok(())
        } else {
            self.0.take(judged)
        }
    }

    fn settle(&mut self) -> Result<()> {
        self.0.settle()
    }

    fn end_pass(&mut self, end: &PassEnd<'_>) -> Result<()> {
        self.0.end_pass(end)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.0.finish()
    }
}

/// Finishes all sinks in their order, also after one that fails.
///
/// # Errors
/// The first of them.
pub fn finish(sinks: Vec<Box<dyn Sink>>) -> Result<()> {
    let finished = sinks.into_iter().map(Sink::finish);
    finished.fold(Ok(()), Result::and)
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
        *self.0.lock() = value;
    }
}

impl<T: Default> Outbox<T> {
    /// Takes what was left.
    pub fn take(&self) -> T {
        std::mem::take(&mut *self.0.lock())
    }
}
