//! Runs with a progress bar, and what is reported of them.

use super::progress::{Progress, interrupted};
use svl::counted;
use svl::losses::{LossLimit, Missing, RunEnding, RunState};
use svl::run::{Matchers, Outcome, Pace, run};
use svl::sink::{RunStart, Sink};
use svl::source::{AlignmentMonitor, AssumeRectified, Source};
use svl::stereo::Losses;

/// Runs a source through the algorithms, with that progress bar, and warns of what is in no frame.
/// The outcome holds also for a run that failed.
pub(crate) fn run_through(
    source: &mut dyn Source,
    matchers: &mut Matchers,
    start: &RunStart<'_>,
    pace: Pace,
    sinks: &mut [Box<dyn Sink>],
    mut progress: Progress,
) -> (Outcome, svl::Result<()>) {
    let mut source = AssumeRectified::new(source);
    let mut run = |source: &mut dyn Source| {
        let ran = run(source, matchers, start, pace, sinks, &mut progress);
        (ran, source.name())
    };
    let (ran, name) = match start.judge.run.stress {
        None => run(&mut AlignmentMonitor::new(&mut source)),
        // What is out of line there was made so.
        Some(_) => run(&mut source),
    };
    progress.clear();
    // The error of a truncated recording says enough: what it has no partner for is its end.
    if ran.1.is_ok() {
        report_losses(&name, &ran.0.losses);
    }
    ran
}

/// How a run ended that went through its sources unless `ran` is why it did not.
pub(crate) fn ending(
    ran: Result<(), String>,
    missing: Missing,
    allowed: Option<LossLimit>,
) -> RunEnding {
    match ran {
        Ok(()) => RunEnding::new(missing, allowed),
        Err(why) => {
            let state = match interrupted() {
                true => RunState::Interrupted,
                false => RunState::Failed,
            };
            RunEnding::early(state, why, missing)
        }
    }
}

/// Warns of everything of a source that is in no frame.
pub(crate) fn report_losses(name: &str, losses: &Losses) {
    let warn = |n: u64, what: &str, why: &str| {
        if n > 0 {
            tracing::warn!("{name}: {} dropped: {why}", counted(n, what));
        }
    };
    warn(losses.unreadable, "pair", "cannot be read");
    warn(
        losses.late,
        "image",
        "came too late for a partner, as the file is not in the order of its stamps; `mcap sort \
         FILE -o SORTED.mcap` makes a file with all pairs",
    );
    warn(
        losses.cut,
        "frame",
        "behind the end of a video that is cut off",
    );
    warn(losses.unpaired, "image", "without a partner");
    if losses.outside > 0 {
        let images = counted(losses.outside, "image");
        tracing::info!("{name}: {images} outside the overlap of both cameras");
    }
    if losses.without_truth > 0 {
        let frames = counted(losses.without_truth, "pair");
        tracing::warn!("{name}: {frames} without a measurement of the truth: not scored");
    }
}

/// Fails for a run that lost more than is allowed.
pub(crate) fn complete(ending: &RunEnding) -> anyhow::Result<()> {
    match (ending.state, &ending.incomplete) {
        (RunState::Lossy, Some(missing)) => {
            let words = format!("{missing}; all else is kept");
            Err(svl::Error::Incomplete(words).into())
        }
        _ => Ok(()),
    }
}
