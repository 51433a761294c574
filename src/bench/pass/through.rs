//! Runs whose losses are reported.

use super::{Matchers, Monitor, Outcome, Pace, run};
use crate::sink::{CollectSink, PassStart, Sink, finish};
use crate::source::{Chain, Source};
use svl_core::{Error, Result, counted, interrupt};
use svl_recording::warn_of;
use svl_score::judge::Judged;
use svl_score::losses::{EndState, Ending, Incomplete, LossLimit, Losses, Missing};

/// Runs a source through the algorithms, watched by `monitor`, and warns of what is in no frame.
/// The outcome holds also for a pass that failed.
pub fn run_through(
    source: &mut dyn Source,
    matchers: &mut Matchers,
    start: &PassStart<'_>,
    pace: Pace,
    sinks: &mut [Box<dyn Sink>],
    mut monitor: impl Monitor,
) -> (Outcome, Result<()>) {
    let is_monitored = start.judge.run.stress.is_none();
    let chain = Chain::for_matching(is_monitored.then(|| matchers.lowest_px()));
    let mut source = match chain.over(Box::new(source)) {
        Ok(source) => source,
        Err(error) => return (Outcome::default(), Err(error)),
    };
    let ran = run(&mut *source, matchers, start, pace, sinks, &mut monitor);
    drop(monitor);
    // The error of a truncated recording suffices: its unpaired images are those at its end.
    if ran.1.is_ok() {
        report_losses(&source.name(), &ran.0.losses);
    }
    ran
}

/// Runs a source through the algorithms, and returns what the sink collects.
///
/// # Errors
/// The errors of the pass; [`Error::Invalid`] for one that was interrupted.
pub fn frames_through<T: Send + 'static>(
    source: &mut dyn Source,
    matchers: &mut Matchers,
    start: &PassStart<'_>,
    sink: CollectSink<T, impl FnMut(&Judged) -> T + Send + 'static>,
    monitor: impl Monitor,
) -> Result<Vec<T>> {
    let collected = sink.outbox();
    let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(sink)];
    let (outcome, ran) = run_through(source, matchers, start, Pace::Asap, &mut sinks, monitor);
    ran?;
    // Reports show it among their cautions.
    for doubt in outcome.scales.doubts() {
        warn_of(&source.name(), &doubt);
    }
    if outcome.interrupted {
        return Err(Error::Invalid("interrupted; nothing is written".to_owned()));
    }
    finish(sinks)?;
    Ok(collected.take())
}

/// The end of a pass: complete, unless `ran` is an error.
pub fn ending(ran: &Result<()>, missing: Missing, allowed: Option<LossLimit>) -> Ending {
    match ran {
        Ok(()) => Ending::new(missing, allowed),
        Err(why) => {
            let state = if interrupt::requested() {
                EndState::Incomplete
            } else {
                EndState::Failed
            };
            Ending::early(state, why.to_string(), missing)
        }
    }
}

/// Warns of all losses of a source.
pub fn report_losses(name: &str, losses: &Losses) {
    let warn = |n: u64, what: &str, why: &str| {
        if n > 0 {
            tracing::warn!("{name}: {} dropped: {why}", counted(n, what));
        }
    };
    warn(losses.unreadable, "pair", "cannot be read");
    warn(losses.dropped, "pair", "the queue was full");
    warn(losses.lost_images, "image", "lost on the network");
    for (topic, n) in &losses.broken {
        let messages = counted(*n, "message");
        tracing::warn!("{name}: {messages} of {topic} left out: cannot be read");
    }
    warn(
        losses.late,
        "image",
        "came too late for a partner, as the file is not in the order of its stamps; `mcap sort \
         FILE -o SORTED.mcap` makes a file with all pairs",
    );
    warn(losses.cut, "frame", "a video is damaged or cut off");
    warn(losses.unpaired, "image", "without a partner");
    if losses.outside > 0 {
        let images = counted(losses.outside, "image");
        tracing::info!("{name}: {images} outside the overlap of both cameras");
    }
    if losses.without_truth > 0 {
        let frames = counted(losses.without_truth, "pair");
        tracing::warn!("{name}: {frames} without a measurement of the truth: not scored");
    }
    for (run, pairs) in &losses.copies {
        let pairs = counted(*pairs, "pair");
        tracing::warn!("{name}: {pairs} dropped: copies of pairs of {run}, which are taken once");
    }
    if losses.jumped > 0 {
        // The user was warned of the first.
        let frames = counted(losses.jumped, "pair");
        tracing::info!(
            "{name}: {frames} with a measurement of another time that poses which jump cannot \
             move: not scored"
        );
    }
}

/// Fails for a pass that lost more than is allowed.
pub fn complete(ending: &Ending) -> Result<()> {
    match (ending.state, &ending.incomplete) {
        (EndState::Lossy, Some(missing)) => {
            let words = format!("{missing}; all else is kept");
            Err(Error::other(Incomplete(words)))
        }
        _ => Ok(()),
    }
}
