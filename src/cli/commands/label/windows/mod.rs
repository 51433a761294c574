//! `svl label windows`: the categorizer of the thesis (section 8.1.1).

mod tool;

use super::input::{LabelInput, stepper};
use crate::cli::shared::progress::Terminal;
use crate::cli::shared::stepper::{Ended, StepSession};
use crate::cli::shared::terminal::print;
use crate::cli::shared::{source, usage};
use anyhow::bail;
use std::path::{Path, PathBuf};
use svl::console::Watch;
use svl::counted;
use svl::filter::{FilterKind, FilterWindows};
use svl::fit::filter::{FrameLabels, true_label};
use svl::manifest::Manifest;
use svl::outputs::{Outputs, write};
use svl::pass::{Matchers, frames_through};
use svl::score::Judge;
use svl::sink::{CollectSink, PassStart};
use svl::source::Request;
use svl::stereo::GridShape;
use svl::train::TrainSettings;
use tool::Categorizer;

#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    input: LabelInput,
    /// Filter that the labels are for: floor or too-close
    #[arg(long, value_name = "NAME", help_heading = "Input")]
    kind: FilterKind,
    /// Label by the ground truth of a simulated source; windows of both kinds are skipped
    #[arg(long, help_heading = "Input")]
    from_truth: bool,
    /// Table to write or to go on with [default: beside the source, as run.floor.csv]
    #[arg(
        short, long, value_name = "FILE.csv", value_parser = usage::ending(&["csv"]),
        help_heading = "Output"
    )]
    output: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long, requires = "from_truth", help_heading = "Output")]
    force: bool,
    /// Range of disparities of too-close by truth, pixels
    #[arg(
        long, value_name = "PX", default_value_t = TrainSettings::RANGE_PX, help_heading = "Input",
        value_parser = usage::within(1.0..=10_000.0)
    )]
    max_disparity: f64,
    /// Take the keys from a file instead of a terminal, as `svl label checkpoints` does
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with = "from_truth",
        help_heading = "Run",
        hide_short_help = true
    )]
    script: Option<PathBuf>,
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let name = args.input.source.as_str();
    args.input.check()?;
    let beside = || FrameLabels::beside(Path::new(name), args.kind);
    let path = args.output.clone().unwrap_or_else(beside);
    let request = args.input.request();
    if args.from_truth {
        return from_truth(args, &request, &path, quiet);
    }
    // Before anything takes time.
    let session = StepSession::new(args.script.as_deref())?;
    let labels = if path.exists() {
        FrameLabels::read(&path, args.kind)?
    } else {
        FrameLabels::new(&path, args.kind)
    };
    let mut stepper = stepper(source::open(request.clone(), quiet)?.source, &request)?;
    let mut tool = Categorizer {
        labels,
        source: PathBuf::from(name),
        window: 0,
        done: Vec::new(),
    };
    tool.resume(&mut stepper)?;
    let ended = session.run(&mut stepper, &mut tool)?;
    print(&tool.said())?;
    match ended {
        Ended::Quit => Ok(()),
        Ended::Interrupted => bail!("stopped; the labels are kept: the same command resumes"),
    }
}

/// Labels every frame of a source by its truth.
fn from_truth(args: &Args, request: &Request<'_>, path: &Path, quiet: bool) -> anyhow::Result<()> {
    let mut outputs = Outputs::claim(args.force, [], [path])?;
    let mut opened = source::open(request.clone(), quiet)?;
    let (kind, range_px) = (args.kind, args.max_disparity);
    let frame_windows = CollectSink::new(move |judged| {
        let frame = &judged.frame;
        let side = kind.spec().features.window;
        let windows = FilterWindows::new(kind, side, frame.pair.size(), GridShape::default());
        let labels = windows.map(|windows| {
            let is_near = |&at: &[usize; 2]| {
                let truth = frame.truth.as_ref()?;
                true_label(kind, truth, at, side, range_px)
            };
            windows.corners.iter().map(is_near).collect::<Vec<_>>()
        });
        let is_known = frame.truth.as_ref().is_some_and(|t| t.surface.is_some());
        labels.map(|labels| {
            (
                frame.sequence,
                judged.pair_hash(),
                is_known.then_some(labels),
            )
        })
    });
    let (manifest, judge) = (Manifest::new("label", &[])?, Judge::default());
    let start = PassStart::new(&manifest, None, &judge);
    let title = opened.source.name();
    let watch = Watch::new(&Terminal { quiet }, &title, opened.source.pairs(), None);
    let mut none = Matchers::default();
    let collected = frames_through(&mut *opened.source, &mut none, &start, frame_windows, watch)?;
    let mut labels = FrameLabels::new(path, kind);
    let (mut known, mut both) = (false, 0);
    for frame_windows in collected {
        let (sequence, pair_hash, windows) = frame_windows?;
        let Some(windows) = windows else { continue };
        known = true;
        labels.tie(sequence, pair_hash);
        for (window, is) in windows.into_iter().enumerate() {
            labels.set(sequence, window, is);
            both += u64::from(is.is_none());
        }
    }
    let [yes, no] = labels.counts();
    let [is, is_not] = kind.spec().categories;
    let both = counted(both, "window");
    if yes + no == 0 {
        let source = &args.input.source;
        if known {
            bail!("{source}: all of its {both} show {is} and {is_not} alike");
        }
        bail!("{source}: only recordings of the arena have a truth that knows what is {is}");
    }
    outputs.begin()?;
    write(&outputs.place(path), labels.to_text())?;
    outputs.commit()?;
    let path = path.display();
    print(&format!(
        "{path}: {yes} {is}, {no} {is_not}; {both} of both skipped\n"
    ))
}
