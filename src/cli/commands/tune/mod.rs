//! `svl tune`: turns the parameters of algorithms by hand.

mod shown;
mod tool;
mod worker;

use crate::cli::shared::filters::FilterArgs;
use crate::cli::shared::progress::Terminal;
use crate::cli::shared::source::{self, CameraArgs, SourceParser};
use crate::cli::shared::stepper::{Ended, FrameStore, Open, StepSession, Stepper, open_again};
use crate::cli::shared::terminal::print;
use crate::cli::shared::usage;
use crate::cli::shared::viewer::{RerunChoice, viewer};
use anyhow::{Context, bail};
use std::path::PathBuf;
use svl::matcher::Algorithm;
use svl::runs::{self, runs};
use svl::scenario::{Scenario, SourceOptions, is_of_witness};
use svl::score::Judge;
use svl::sink::RerunTarget;
use svl::source::{PairRegister, Request, Source, SourceKind};
use svl::tune::{Sampler, TunedSetting};
use tool::Tuner;
use worker::TuneWorker;

/// Tune algorithms on a source by hand
///
/// The parameters on the terminal, their effect on the frame in Rerun, and the metrics over a
/// sample of the source, compared with the first setting. A sweep of `svl score` tries many
/// settings.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl tune run.mcap --algo v3 --algo bm      Tab changes the algorithm
  svl tune arena --algo bm --rerun none
  svl tune v4l2:/dev/video0,/dev/video2
  svl tune run.mcap --scenario own.toml      its cells, rule and checkpoints

Keys: up and down choose, left and right turn (with Shift ten times as far),
digits type a value, r resets, Tab changes the algorithm, space plays, comma
and full stop step, [ and ] go to the worst frames, a shows the setting that
is compared with, c compares with this one from now on, u and Ctrl-R undo and
redo, w writes, ? shows all.")]
pub(crate) struct Args {
    /// A recording, a bag, a folder, a scene, the arena, a scenario, cameras, or live topics
    #[arg(value_name = "SOURCE", value_parser = SourceParser, hide_possible_values = true)]
    what: String,
    /// Algorithm with its first setting, as NAME[:key=value,…]; repeatable [default: v5]
    #[arg(long, value_name = "ALGO", value_parser = usage::algorithm, help_heading = "Input")]
    algo: Vec<Algorithm>,
    /// Take grid, cell rule and checkpoints from it
    #[arg(long, value_name = "S.toml", help_heading = "Input")]
    scenario: Option<PathBuf>,
    #[command(flatten)]
    filters: FilterArgs,
    /// Rerun: spawn, URL, FILE.rrd, or none
    ///
    /// A new viewer, a running one, a file, or none [default: spawn, but none with --script].
    #[arg(long, value_name = "WHERE", help_heading = "Output")]
    rerun: Option<RerunChoice>,
    /// Take the keys from a file instead of a terminal, one token per key: characters, "text",
    /// enter, up, shift-left, tab, ctrl-r, wait (until all is done), screen (prints it), ...
    #[arg(
        long,
        value_name = "FILE",
        help_heading = "Run",
        hide_short_help = true
    )]
    script: Option<PathBuf>,
    /// Scenario that the key w proposes to write; a .md beside it lists what was tried
    #[arg(
        short, long, value_name = "FILE.toml", value_parser = usage::ending(&["toml"]),
        help_heading = "Output"
    )]
    output: Option<PathBuf>,
    #[command(flatten)]
    source: SourceOptions,
    #[command(flatten)]
    cameras: CameraArgs,
}

/// Largest number of pairs of the sample.
const MAX_SAMPLE: usize = 64;

/// Largest memory of the sample, bytes.
const MAX_SAMPLE_BYTES: usize = 256 << 20;

/// The source that is tuned on.
struct Tuned<'a> {
    name: String,
    /// None for cameras, which no scenario can read.
    scenario: Option<Scenario>,
    judge: Judge,
    open: Open<'a>,
    is_live: bool,
}

impl Args {
    fn algorithms(&self) -> Vec<Algorithm> {
        match &self.algo[..] {
            [] => vec![Algorithm::default()],
            algorithms => algorithms.to_vec(),
        }
    }

    /// The scenario of the source, scored as `--scenario` describes.
    fn scenario(&self) -> anyhow::Result<Scenario> {
        let scenario = runs::named(std::slice::from_ref(&self.what))?;
        let Some(path) = &self.scenario else {
            return Ok(scenario);
        };
        let other = Scenario::read(path)?;
        Ok(Scenario {
            grid: other.grid,
            cells: other.cells,
            checkpoints: other.checkpoints,
            ..scenario
        })
    }
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    // Before anything takes time.
    let session = StepSession::new(args.script.as_deref())?;
    let filters = args.filters.models()?;
    let algorithms = args.algorithms();
    let tuned = open(args, &algorithms, quiet)?;
    let (viewer, without) = destination(args)?;
    let (name, open) = (tuned.name, tuned.open);
    let (sampler, store) = if tuned.is_live {
        (None, FrameStore::live(open()?))
    } else {
        // The first one warns of what its algorithms were fitted to, from its first frame on.
        let store = FrameStore::new(Box::new(&open))?;
        let sampler = Sampler::new(open()?, MAX_SAMPLE, MAX_SAMPLE_BYTES);
        (Some(sampler), store)
    };
    let mut stepper = Stepper::new(&name, store)?;
    let frame = &stepper.frame;
    let settings = algorithms.into_iter().map(|algorithm| TunedSetting {
        algorithm: algorithm.filtered(&filters),
        grid: tuned.judge.grid,
        // Without a rig disparities are scored, so the knobs are those of their rule.
        cells: tuned.judge.cells.for_rig(frame.rig().is_some()),
        filters: filters.clone(),
    });
    let settings: Vec<_> = settings.collect();
    let raw = frame.rectified().is_err().then(|| {
        "its pairs are raw, and taken as rectified: --calib names a calibration".to_owned()
    });
    let is_witness = settings
        .iter()
        .any(|own| is_of_witness(own.algorithm.spec().name));
    let unranked = (frame.truth.is_none() && is_witness).then(|| {
        "errors of v5 are not estimated, as it is the witness: a board in view (--truth \
         board:9x6) gives numbers"
            .to_owned()
    });
    let target = viewer.map(|target| (target, name.clone()));
    let worker = TuneWorker::begin(sampler, tuned.judge, target)?;
    if let Some(words) = raw.or(without).or(unranked) {
        stepper.say(words);
    }
    let files = args.filters.files(&filters);
    let mut tuner = Tuner::new(settings, worker, args.output.clone(), tuned.scenario, files);
    let ended = session.run(&mut stepper, &mut tuner)?;
    print(&tuner.farewell())?;
    match ended {
        Ended::Quit => Ok(()),
        Ended::Interrupted if args.script.is_some() => Ok(()),
        Ended::Interrupted => bail!("stopped"),
    }
}

/// Opens what is tuned on; of a scenario of several runs the first. Warns of pairs that the
/// algorithms were fitted to.
fn open<'a>(args: &'a Args, algorithms: &[Algorithm], quiet: bool) -> anyhow::Result<Tuned<'a>> {
    let name = args.what.as_str();
    let kind = SourceKind::without_files(name);
    if let Some(kind) = kind.filter(|kind| !kind.is_scored()) {
        let mut request = Request::new(name);
        request.options.clone_from(&args.source);
        request.seed = args.source.seeds.as_ref().map(|list| list.seeds()[0]);
        args.cameras.fill(&mut request);
        let judge = match &args.scenario {
            Some(path) => Scenario::read(path)?.judge(),
            None => Judge::default(),
        };
        let first = source::open(request.clone(), quiet)?.source;
        let again = move || Ok(source::open(request.clone(), true)?.source);
        return Ok(Tuned {
            name: name.to_owned(),
            scenario: None,
            judge,
            open: open_again(first, again),
            is_live: kind.is_live(),
        });
    }
    let mut scenario = args.scenario()?;
    runs::change(std::slice::from_mut(&mut scenario), &args.source, name)?;
    scenario.algorithms = algorithms.to_vec();
    let open_first = {
        let scenario = scenario.clone();
        move |quiet: bool| -> anyhow::Result<_> {
            let terminal = &Terminal { quiet };
            let mut runs = runs(&scenario, terminal)?.into_iter();
            let run = runs.next().context("no run")?;
            Ok(run.open(&scenario, terminal, None)?)
        }
    };
    let (run, judge) = open_first(quiet)?;
    let title = run.name();
    let register = PairRegister::new(algorithms)?;
    let run = run.registered(&scenario.name, &register)?;
    let again = move || Ok(Box::new(open_first(true)?.0) as Box<dyn Source>);
    Ok(Tuned {
        name: title,
        scenario: Some(scenario),
        judge,
        open: open_again(Box::new(run), again),
        is_live: false,
    })
}

/// Target of the pictures, or the reason why they go nowhere.
fn destination(args: &Args) -> anyhow::Result<(Option<RerunTarget>, Option<String>)> {
    match &args.rerun {
        Some(choice) => Ok((choice.target().cloned(), None)),
        None if args.script.is_some() => Ok((None, None)),
        None => Ok(match viewer().and_then(|viewer| viewer.find()) {
            Ok(()) => (Some(RerunTarget::Spawn), None),
            Err(error) => (None, Some(format!("without pictures: {error}"))),
        }),
    }
}
