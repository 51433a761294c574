//! Records a source: for `svl record`, and for the cache of simulated runs.

use super::progress::{Progress, listen_for_interrupt};
use super::runner::report_losses;
use super::source::Opened;
use std::path::Path;
use svl::manifest::Manifest;
use svl::recording::{RecordingFormat, SCENARIO, Writer};
use svl::run::{Matchers, Outcome, Pace, run};
use svl::score::Judge;
use svl::sink::{RunStart, SinkRequest, Sinks};

/// Records all of a source into `path`, which does not exist yet. The outcome holds also for a run
/// that failed.
pub(crate) fn write(
    mut opened: Opened,
    path: &Path,
    format: RecordingFormat,
    quiet: bool,
) -> anyhow::Result<(Outcome, svl::Result<()>)> {
    // From here on Ctrl-C leaves a whole file.
    listen_for_interrupt();
    let mut writer = Writer::create(path, &opened.header, format)?;
    let scenario = opened.header.scenario.as_deref().unwrap_or(&opened.stem);
    let manifest = Manifest::new(scenario, opened.scenario.as_deref(), &[])?;
    writer.identify(&manifest)?;
    if let Some(text) = &opened.scenario {
        writer.attach(SCENARIO, "application/toml", text.as_bytes())?;
    }
    opened.recorded.attach(&mut writer)?;
    let judge = Judge::default();
    let start = RunStart {
        manifest: &manifest,
        seed: opened.header.seed,
        judge: &judge,
    };
    let mut sinks = Sinks::open(SinkRequest {
        recording: Some(writer),
        ..SinkRequest::default()
    })?;
    let source = &mut *opened.source;
    let mut progress = Progress::new(&source.name(), source.pairs(), quiet);
    let mut matchers = Matchers::none();
    let (outcome, ran) = run(
        source,
        &mut matchers,
        &start,
        Pace::Asap,
        sinks.as_mut_slice(),
        &mut progress,
    );
    progress.clear();
    report_losses(&source.name(), &outcome.losses);
    // What came before an error is kept: the file is completed first, then the error is returned.
    let finished = sinks.finish().1;
    if ran.is_err() && outcome.frames == 0 {
        // A file without a pair is of no use, and would stand in the way of the next attempt.
        let _ = std::fs::remove_file(path);
    }
    Ok((outcome, ran.and(finished)))
}
