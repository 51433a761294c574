//! `svl tune`: turn the parameters of algorithms by hand, or let them be searched.

mod auto;
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
use svl::scenario::{Scenario, SourceOptions};
use svl::score::Judge;
use svl::sink::RerunTarget;
use svl::source::{PairRegister, Request, Source, SourceKind};
use svl::tune::{Constraint, Sampler, TunedSetting};
use tool::Tuner;
use worker::TuneWorker;

/// Tune algorithms on a source: by hand, or by a search
///
/// By hand: the parameters on the terminal, their effect on the frame in Rerun, and the metrics
/// over a sample of the source, compared with the first setting. With --auto a search tries many
/// settings.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl tune run.mcap --algo v3 --algo bm      Tab changes the algorithm
  svl tune arena --algo bm --rerun none
  svl tune v4l2:/dev/video0,/dev/video2
  svl tune run.mcap --scenario own.toml      its cells, rule and checkpoints
  svl tune arena --auto --algo bm --seeds 4..9 --test-seeds 41..43 -o b.toml
  svl tune mon.mcap tue.mcap --test wed.mcap --auto --algo v3 \\
    --vary texture_delta=2..6 --maximize right --subject-to 'wrong<=3%' \\
    --subject-to 'time<=1.2x' -o best.toml

Keys: up and down choose, left and right turn (with Shift ten times as far),
digits type a value, r resets, Tab changes the algorithm, space plays, comma
and full stop step, [ and ] go to the worst frames, a shows the setting that
is compared with, c compares with this one from now on, u and Ctrl-R undo and
redo, w writes, ? shows all.

An interrupted search writes the best setting so far; the same command with
--resume continues from its log, the .csv beside the output.")]
pub(crate) struct Args {
    /// A recording, a bag, a folder, a scene, the arena, a scenario, cameras, or live topics; with
    /// --auto also several recordings, but neither of the last two
    #[arg(
        required = true, value_name = "SOURCE", value_parser = SourceParser,
        hide_possible_values = true
    )]
    what: Vec<String>,
    /// Algorithm with its first setting, as NAME[:key=value,…]; repeatable [default: v5]
    #[arg(long, value_name = "ALGO", value_parser = usage::algorithm)]
    algo: Vec<Algorithm>,
    /// Take grid, cell rule and checkpoints from it
    #[arg(long, value_name = "S.toml")]
    scenario: Option<PathBuf>,
    #[command(flatten)]
    filters: FilterArgs,
    /// Rerun: spawn, URL, FILE.rrd, or none
    ///
    /// A new viewer, a running one, a file, or none [default: spawn, but none with --script].
    #[arg(long, value_name = "WHERE", conflicts_with = "auto")]
    rerun: Option<RerunChoice>,
    /// Take the keys from a file instead of a terminal, one token per key: characters, "text",
    /// enter, up, shift-left, tab, ctrl-r, wait (until all is done), screen (prints it), ...
    #[arg(long, value_name = "FILE", conflicts_with = "auto")]
    script: Option<PathBuf>,
    /// Scenario to write
    ///
    /// By hand the key w proposes it, with --auto the best setting is written there. A .md beside
    /// it lists what was tried.
    #[arg(short, long, value_name = "FILE.toml", value_parser = usage::ending(&["toml"]))]
    output: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    source: SourceOptions,
    #[command(flatten)]
    search: SearchArgs,
    #[command(flatten)]
    cameras: CameraArgs,
}

/// Options of the search.
#[derive(clap::Args)]
#[command(next_help_heading = "Search")]
struct SearchArgs {
    /// Search for the best setting
    #[arg(long, requires = "output")]
    auto: bool,
    /// Parameter to vary: NAME, NAME=FROM..TO, NAME=A/B
    ///
    /// May be given more than once [default: all that change the result, around their values].
    #[arg(long, value_name = "NAME", requires = "auto")]
    vary: Vec<String>,
    /// Metric to maximize [default: right, or unrivalled without truth]
    #[arg(
        long,
        value_name = "METRIC",
        requires = "auto",
        conflicts_with = "minimize"
    )]
    maximize: Option<String>,
    /// Metric to minimize
    #[arg(long, value_name = "METRIC", requires = "auto")]
    minimize: Option<String>,
    /// Bound that the best has to keep: METRIC<=X[%|x]
    ///
    /// As 'wrong<=3%', or as a multiple of what --algo has: 'time<=1.2x' [default: wrong, missed
    /// and blind <=1x, time<=1.5x].
    #[arg(long, value_name = "BOUND", requires = "auto")]
    subject_to: Vec<Constraint>,
    /// Recordings or a scenario to test the result on [default: some of the runs, held out]
    #[arg(long, value_name = "SOURCE", num_args = 1.., requires = "auto")]
    test: Vec<String>,
    /// Seeds of the arena to test the result on
    #[arg(
        long, value_name = "SEEDS", requires = "auto", conflicts_with = "test",
        value_parser = clap::value_parser!(svl::scenario::SeedList)
    )]
    test_seeds: Option<svl::scenario::SeedList>,
    /// Settings to try of each algorithm
    #[arg(
        long, value_name = "N", default_value_t = 120,
        value_parser = usage::within(4..=100_000usize)
    )]
    trials: usize,
    /// Pairs to search on, spread over all runs; few settings are run on all of them
    #[arg(
        long, value_name = "N", default_value_t = 252,
        value_parser = usage::within(8..=1_000_000usize)
    )]
    pairs: usize,
    /// Resume from the log of an earlier search
    #[arg(
        long,
        requires = "auto",
        conflicts_with = "force",
        help_heading = "Run"
    )]
    resume: bool,
    /// Print JSON
    #[arg(long, requires = "auto", help_heading = "Output")]
    json: bool,
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    if args.is_by_hand() {
        return by_hand(args, quiet);
    }
    auto::run(args, quiet)
}

/// Largest number of pairs of the sample by hand.
const MAX_SAMPLE: usize = 64;

/// Largest memory of the sample, bytes.
const MAX_SAMPLE_BYTES: usize = 256 << 20;

/// The source that is tuned on, by hand.
struct Tuned<'a> {
    name: String,
    /// None for cameras, which no scenario can read.
    scenario: Option<Scenario>,
    judge: Judge,
    open: Open<'a>,
    is_live: bool,
}

impl Args {
    /// True without `--auto`: a person or a script turns the knobs.
    pub(crate) fn is_by_hand(&self) -> bool {
        !self.search.auto
    }

    fn algorithms(&self) -> anyhow::Result<Vec<Algorithm>> {
        Ok(match &self.algo[..] {
            [] => vec![Algorithm::default()],
            algorithms => algorithms.to_vec(),
        })
    }

    /// The scenario of sources, scored as `--scenario` describes.
    fn scenario_of(&self, what: &[String]) -> anyhow::Result<Scenario> {
        let scenario = runs::named(what)?;
        Ok(match &self.scenario {
            None => scenario,
            Some(path) => judged_by(scenario, Scenario::read(path)?),
        })
    }
}

/// The scenario with grid, cells and checkpoints of another.
fn judged_by(scenario: Scenario, other: Scenario) -> Scenario {
    Scenario {
        grid: other.grid,
        cells: other.cells,
        checkpoints: other.checkpoints,
        ..scenario
    }
}

fn by_hand(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let [name] = &args.what[..] else {
        return Err(usage::wrong(
            "several sources are searched with --auto; by hand name one",
        ));
    };
    // Before anything takes time.
    let session = StepSession::new(args.script.as_deref())?;
    let filters = args.filters.models()?;
    let algorithms = args.algorithms()?;
    let tuned = open(args, name, &algorithms, quiet)?;
    let (viewer, without) = destination(args)?;
    let settings = algorithms.into_iter().map(|algorithm| TunedSetting {
        algorithm: algorithm.filtered(&filters),
        grid: tuned.judge.grid,
        cells: tuned.judge.cells,
        filters: filters.clone(),
    });
    let settings: Vec<_> = settings.collect();
    let Tuned {
        name,
        scenario,
        judge,
        open,
        is_live,
    } = tuned;
    let (sampler, store) = if is_live {
        (None, FrameStore::live(open()?))
    } else {
        // The first one warns of what its algorithms were fitted to, from its first frame on.
        let store = FrameStore::new(Box::new(&open))?;
        let sampler = Sampler::new(open()?, MAX_SAMPLE, MAX_SAMPLE_BYTES);
        (Some(sampler), store)
    };
    let mut stepper = Stepper::new(&name, store)?;
    let mut settings = settings;
    for setting in &mut settings {
        // Without a rig disparities are scored, so the knobs are those of their rule.
        setting.cells = setting.cells.for_rig(stepper.frame().rig().is_some());
    }
    let has_truth = stepper.frame().truth.is_some();
    let judge = Judge {
        photometric: !has_truth,
        ..judge
    };
    let target = viewer.map(|target| (target, name.clone()));
    let worker = TuneWorker::begin(sampler, judge, target)?;
    let raw = stepper.frame().rectified().is_err().then(|| {
        "its pairs are raw, and taken as rectified: --calib names a calibration".to_owned()
    });
    if let Some(words) = raw.or(without) {
        stepper.say(words);
    }
    let files = args.filters.files(&filters);
    let mut tuner = Tuner::new(settings, worker, args.output.clone(), scenario, files);
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
fn open<'a>(
    args: &'a Args,
    name: &'a str,
    algorithms: &[Algorithm],
    quiet: bool,
) -> anyhow::Result<Tuned<'a>> {
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
    let mut scenario = args.scenario_of(&args.what)?;
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
    let run = run.registered(&scenario.name, &register, true);
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
