//! Live topics as what is scored: they are recorded first.

use super::Args;
use crate::cli::shared::progress::interrupted;
use crate::cli::shared::terminal::print_error;
use crate::cli::shared::{recordings, source, usage};
use std::path::Path;
use svl::counted;
use svl::losses::Missing;
use svl::outputs::Outputs;
use svl::recording::RecordingFormat;
use svl::report::REPORT;
use svl::scenario::{ScenarioKind, SourceOptions};
use svl::source::{Chain, FirstPairs, Request, SourceKind};

/// Live topics as recordings.
pub(super) struct LiveRecordings {
    /// The arguments with recordings in place of the live topics.
    pub(super) args: Args,
    /// Pairs that were lost on the way into the recordings.
    pub(super) lost: Missing,
}

/// Records live topics, each for the seconds of `--to`, one after the other; `None` if there are
/// none.
pub(super) fn recorded(args: &Args, quiet: bool) -> anyhow::Result<Option<LiveRecordings>> {
    let live = args.what.iter().find(|name| SourceKind::are_topics(name));
    // A scenario to print describes no live topics, and none are opened for it.
    let Some(live) = live.filter(|_| args.print_scenario.is_none()) else {
        return Ok(None);
    };
    let to_s = check(args, live)?;
    if let Some(folder) = &args.output {
        drop(Outputs::claim_folder(folder, &REPORT)?);
    }
    // The recording has rectified pairs of 8 bits.
    let mut remaining = args.source.clone();
    let recorded = SourceOptions {
        left: remaining.left.take(),
        right: remaining.right.take(),
        left_info: remaining.left_info.take(),
        right_info: remaining.right_info.take(),
        bits: remaining.bits.take(),
        max_skew_ms: remaining.max_skew_ms.take(),
        stamps: remaining.stamps.take(),
        right_offset_ms: remaining.right_offset_ms.take(),
        calib: remaining.calib.take(),
        alpha: remaining.alpha.take(),
        ..SourceOptions::default()
    };
    let mut what = args.what.clone();
    let mut lost = Missing::default();
    for name in what.iter_mut().filter(|name| SourceKind::are_topics(name)) {
        lost.add(record(name, &recorded, to_s, quiet)?);
    }
    // The pairs that were recorded are counted as they are scored.
    lost.pairs = 0;
    Ok(Some(LiveRecordings {
        args: Args {
            what,
            source: remaining,
            ..args.clone()
        },
        lost,
    }))
}

/// Checks the options for live topics, of which `live` is one; returns the seconds to record.
fn check(args: &Args, live: &str) -> anyhow::Result<f64> {
    let wrong = |why: &str| Err(usage::wrong(format!("{live}: {why}")));
    let source = &args.source;
    if source.truth.is_some() {
        return wrong("--truth is for recordings: record a bag that has the sensor's topic");
    }
    let Some(to_s) = source.to_s else {
        return wrong("live topics have no end; --to SECONDS records and scores that long");
    };
    if source.from_s.unwrap_or(0.0) >= to_s {
        return wrong("--to has to be after --from and the first pair");
    }
    if args.jobs.is_some() {
        return wrong("--jobs is for recordings: record the topics, and score that");
    }
    // The score would refuse them after the recording.
    if args.gate || args.drives.is_some() {
        return wrong("--gate and --drives are for scenarios");
    }
    source.refuse_others(&[ScenarioKind::Recording])?;
    source.refuse(&["fps", "side_by_side"], "is for folders and videos")?;
    let is_other = |name: &&String| !SourceKind::are_topics(name) && !Path::new(name).exists();
    if let Some(other) = args.what.iter().find(is_other) {
        return wrong(&format!(
            "beside live topics only recordings are scored, not '{other}'"
        ));
    }
    Ok(to_s)
}

/// Records that many seconds into a file, whose name replaces that of the topics.
fn record(
    name: &mut String,
    options: &SourceOptions,
    to_s: f64,
    quiet: bool,
) -> anyhow::Result<Missing> {
    let request = Request {
        options: options.clone(),
        live_s: Some(to_s),
        ..Request::new(name.as_str())
    };
    let opened = source::open(request, quiet)?;
    let path = recordings::free_name(&opened.stem)?;
    let opened = opened.over(Chain {
        take: FirstPairs::new(Some(to_s), None),
        ..Chain::default()
    })?;
    let (outcome, ran) = recordings::record(opened, &path, RecordingFormat::default(), quiet);
    ran?;
    *name = path.display().to_string();
    if !quiet {
        print_error(format_args!("{name}: {}", counted(outcome.frames, "pair")));
    }
    // Also while nothing arrives.
    if outcome.interrupted || interrupted() {
        anyhow::bail!("interrupted; {name} has the pairs so far, and `svl score {name}` scores it");
    }
    Ok(outcome.missing())
}
