//! What a replay does: its source, its algorithms and its sinks.

use super::answer::{LIVE_ROWS, Replayed};
use super::verify::Earlier;
use super::{Args, NOT_TAKEN};
use crate::cli::shared::progress::Terminal;
use crate::cli::shared::terminal::print_error;
use crate::cli::shared::viewer::{RerunChoice, viewer};
use crate::cli::shared::{recordings, source};
use std::path::{Path, PathBuf};
use svl::Error;
use svl::console::Watch;
use svl::drive::Course;
use svl::grab::{GrabRequest, WhenFull};
use svl::manifest::Manifest;
use svl::matcher::Algorithm;
use svl::outputs::Outputs;
use svl::pass::{Matchers, run_through};
use svl::recording::{AlgorithmCells, ImageFormat, LEFT_FRAME, ResultOptions};
use svl::runs::{RECORDINGS, cached_run, open_recording};
use svl::scenario::Scenario;
use svl::score::{Judge, Judged};
use svl::sink::{
    CollectSink, Outbox, PassStart, PublishRequest, RerunDetail, RerunTarget, SinkRequest, Sinks,
    ViewedScene, ViewerRequest,
};
use svl::source::{Chain, Opened, PairRegister, Registration, Request, SourceKind};
use svl::train::with_filters;

/// A replay before its first pair.
pub(super) struct Plan<'a> {
    args: &'a Args,
    /// Name of the recording.
    name: String,
    outputs: Outputs,
    opened: Opened,
    /// The results of the earlier run to compare with.
    earlier: Option<Earlier>,
    algorithms: Vec<Algorithm>,
    matchers: Matchers,
    manifest: Manifest,
}

/// The cells of all results, pair by pair.
type CellsOutbox = Outbox<Vec<Vec<AlgorithmCells>>>;

impl<'a> Plan<'a> {
    /// Reads all that the arguments name and starts the programs. Files that are replaced are set
    /// aside.
    pub(super) fn new(args: &'a Args, terminal: &Terminal) -> anyhow::Result<Self> {
        if args.publish.is_some() && args.algo.len() > 1 {
            let wrong = "--publish is for the results of one algorithm; name one with --algo";
            return Err(Error::Usage(wrong.into()).into());
        }
        let mut outputs = claim(args)?;
        let name = match &args.recording {
            Some(name) => name.clone(),
            None => newest_or_arena(terminal)?.display().to_string(),
        };
        let mut opened = open(args, &name, &args.algo, terminal)?;
        let earlier = earlier(args, &name, &opened)?;
        let algorithms = match (&args.algo[..], &earlier) {
            ([], Some(earlier)) => earlier.algorithms()?,
            ([], None) => vec![Algorithm::default()],
            (named, _) => named.to_vec(),
        };
        // The maps of an earlier run's algorithms are known only now.
        if args.algo.is_empty() && algorithms.iter().any(|a| a.spec().is_recorded()) {
            opened = open(args, &name, &algorithms, terminal)?;
        }
        let described = described(args, &name, &algorithms)?;
        let algorithms = with_filters(algorithms, &args.filters.models()?);
        let matchers = Matchers::new(&algorithms)?;
        let registration = Registration {
            register: PairRegister::new(&algorithms)?,
            name: opened.source.name(),
            simulated: opened.header.simulated(),
        };
        let chain = opened.chain.clone();
        let opened = opened.over(Chain {
            matched: earlier.as_ref().and_then(Earlier::stamps_ns),
            register: Some(registration),
            ..Chain::default()
        })?;

        outputs.begin()?;
        let mut manifest = Manifest {
            bits: opened.header.bits,
            chain,
            description: Some(described.to_json()?),
            ..Manifest::new(opened.title(), &algorithms)?
        };
        manifest.set_rule(Judge::default().cells);
        manifest.times = Some(args.speed.times());
        manifest.runs = vec![opened.record(&opened.source.name(), Path::new(&name))];
        Ok(Self {
            args,
            name,
            outputs,
            opened,
            earlier,
            algorithms,
            matchers,
            manifest,
        })
    }

    /// Replays the pairs, and compares the results with the earlier ones. What came before an error
    /// is kept.
    pub(super) fn replay(mut self, terminal: &Terminal) -> anyhow::Result<Replayed> {
        let waits = !self.opened.is_live && !terminal.quiet;
        if let Some(prefix) = self.args.publish.as_deref().filter(|_| waits) {
            print_error(format_args!(
                "{prefix}: waits for subscribers, 10 s at most"
            ));
        }
        let mut sinks = self.sinks()?;
        let cells = self.collect_cells(&mut sinks);
        let title = self.opened.source.name();
        let mut judge = Judge::default();
        // Rows are known as those of live topics.
        if self.opened.is_live {
            judge.run.name.clone_from(&self.name);
        }
        let pairs = self.opened.source.pairs();
        let (outcome, ran) = run_through(
            &mut *self.opened.source,
            &mut self.matchers,
            &PassStart::new(&self.manifest, self.opened.header.seed, &judge),
            self.args.speed,
            sinks.as_mut_slice(),
            Watch::new(terminal, &format!("match {title}"), pairs, None),
        );
        // An interrupt is the end of a live source.
        let ran = ran.and(if self.opened.is_live {
            Ok(())
        } else {
            outcome.reached_end(pairs)
        });
        // All that came before an error is kept and reported: the sinks are finished first.
        let (rows, finished) = sinks.finish();
        let mut replayed = Replayed::new(
            (title, self.name),
            self.opened.is_live,
            outcome,
            (ran, finished),
            rows,
            self.args,
        );
        replayed.keep(self.outputs)?;
        if replayed.has_results() {
            self.matchers.complete(&mut self.manifest);
            replayed.summarize(&mut self.manifest)?;
            if let Some(earlier) = &self.earlier {
                let cells = cells.map(|cells| cells.take().concat()).unwrap_or_default();
                replayed.verify(earlier, &cells, &self.algorithms)?;
            }
        }
        Ok(replayed)
    }

    fn sinks(&self) -> anyhow::Result<Sinks> {
        let args = self.args;
        let frame_id = self.opened.header.frame_id.as_deref();
        let publish = args.publish.as_deref().map(|address| PublishRequest {
            address,
            losses: self.opened.losses.clone(),
            options: ResultOptions {
                camera_height_m: self.opened.header.camera_height_m,
                near_m: args.scan_near,
                dense: args.dense,
                ..ResultOptions::new(frame_id.unwrap_or(LEFT_FRAME))
            },
        });
        let viewer = self.rerun()?;
        let place = |path: Option<&PathBuf>| path.map(|path| self.outputs.place(path));
        let write = |path: PathBuf| self.opened.writer(&path, ImageFormat::Raw, &self.manifest);
        Ok(Sinks::open(SinkRequest {
            rows: place(args.rows.as_ref()).as_deref(),
            cells: place(args.cells.as_ref()).as_deref(),
            newest_rows: self.opened.is_live.then_some(LIVE_ROWS),
            viewer,
            publish,
            recording: place(args.output.as_ref()).map(write).transpose()?,
            ..SinkRequest::default()
        })?)
    }

    fn rerun(&self) -> svl::Result<Option<ViewerRequest>> {
        let Some(target) = rerun(self.args) else {
            return Ok(None);
        };
        let scenario = self.opened.scenario.as_deref();
        let scenario = scenario.and_then(|text| Scenario::parse(text, Path::new(&self.name)).ok());
        let seed = self.opened.header.seed;
        let wireframe = scenario.map_or_else(Vec::new, |scenario| match seed {
            // A course is drawn again, which takes as long as its proof.
            Some(seed) if scenario.kind() == "courses" => {
                let course = Course::for_scenario(&scenario, seed);
                course.map_or_else(|_| Vec::new(), |course| course.wireframe())
            }
            _ => scenario.wireframe(seed),
        });
        Ok(Some(ViewerRequest {
            viewer: viewer()?,
            target: target.placed(&self.outputs),
            detail: RerunDetail::Full,
            info: ViewedScene::new(&self.manifest, wireframe),
        }))
    }

    /// Collects the cells, if the earlier run has some to compare with.
    fn collect_cells(&self, sinks: &mut Sinks) -> Option<CellsOutbox> {
        if !self.earlier.as_ref().is_some_and(Earlier::has_cells) {
            return None;
        }
        let sink = CollectSink::new(|judged: &Judged| {
            let estimates = judged.estimates.iter().map(|scored| &scored.estimate);
            let cells = |estimate| AlgorithmCells::new(judged.frame.sequence, estimate);
            estimates.map(cells).collect::<Vec<_>>()
        });
        let outbox = sink.outbox();
        sinks.push(sink);
        Some(outbox)
    }
}

fn rerun(args: &Args) -> Option<&RerunTarget> {
    args.rerun.as_ref().and_then(RerunChoice::target)
}

/// The files that the replay writes.
fn claim(args: &Args) -> anyhow::Result<Outputs> {
    let inputs = args.recording.as_deref().map(source::inputs);
    let inputs = inputs.unwrap_or_default();
    let outputs = [
        args.output.as_deref(),
        args.rows.as_deref(),
        args.cells.as_deref(),
        rerun(args).and_then(RerunTarget::file),
    ];
    Ok(Outputs::claim(
        args.force,
        inputs.iter().map(PathBuf::as_path),
        outputs.into_iter().flatten(),
    )?)
}

fn open(
    args: &Args,
    name: &str,
    algorithms: &[Algorithm],
    terminal: &Terminal,
) -> anyhow::Result<Opened> {
    let options = &args.options;
    options.refuse(NOT_TAKEN, "is for scenarios; `svl score` accepts them")?;
    // A robot needs the newest pair: it takes the place of the one that waits.
    let newest = args.publish.is_some() && SourceKind::are_topics(name);
    let request = Request {
        options: options.clone(),
        grab: GrabRequest {
            queue: newest.then_some(1),
            when_full: newest.then_some(WhenFull::Replace),
            ..GrabRequest::default()
        },
        ..Request::new(name)
    };
    Ok(open_recording(&request.with_maps(algorithms), terminal)?)
}

/// The results that `--verify` compares with.
fn earlier(args: &Args, name: &str, opened: &Opened) -> anyhow::Result<Option<Earlier>> {
    let Some(path) = &args.verify else {
        return Ok(None);
    };
    let path = path.as_deref().unwrap_or(Path::new(name));
    let recording = opened.recording.as_ref();
    Earlier::read(path, name, recording, opened.header.seed).map(Some)
}

/// The scenario that the manifest describes.
fn described(args: &Args, name: &str, algorithms: &[Algorithm]) -> anyhow::Result<Scenario> {
    let scenario = Scenario {
        filters: args.filters.scenario_filters()?,
        ..Scenario::from_recordings(&[name.to_owned()], algorithms.to_vec())?
    };
    Ok(scenario.with(&args.options)?)
}

/// The newest recording, or else the arena, which is recorded first.
fn newest_or_arena(terminal: &Terminal) -> anyhow::Result<PathBuf> {
    if let Some(path) = recordings::newest() {
        return Ok(path);
    }
    if !terminal.quiet {
        print_error(format_args!(
            "no recording in {RECORDINGS}/: recording the arena first"
        ));
    }
    Ok(cached_run(&Scenario::arena()?, 1, terminal, None)?)
}
