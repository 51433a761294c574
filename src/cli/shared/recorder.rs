//! Records a source: for `svl record`, and for the cache of simulated runs.

use super::progress::{Progress, listen_for_interrupt};
use super::source::{self, Opened};
use std::path::Path;
use svl::manifest::Manifest;
use svl::recording::{Format, GRABBER, SCENARIO, Writer};
use svl::run::{Lineup, Outcome, Pace, run as run_loop};
use svl::scenario::GridSettings;
use svl::sink::{RecordingSink, Sink};

/// Records all of a source into `path`, which does not exist yet.
pub(crate) fn write(
    mut opened: Opened,
    path: &Path,
    format: Format,
    quiet: bool,
) -> anyhow::Result<Outcome> {
    // From here on Ctrl-C leaves a whole file.
    listen_for_interrupt();
    let mut writer = Writer::create(path, &opened.header, format)?;
    let scenario = opened.header.scenario.as_deref().unwrap_or(&opened.stem);
    writer.identify(&Manifest::new(scenario, opened.scenario.as_deref(), &[])?)?;
    if let Some(text) = &opened.scenario {
        writer.attach(SCENARIO, "application/toml", text.as_bytes())?;
    }
    opened.recorded.attach(&mut writer)?;
    let mut sink = RecordingSink::new(writer);
    let mut progress = Progress::new(&opened.source.name(), opened.source.pairs(), quiet);
    let grid = GridSettings::default();
    let mut lineup = Lineup::new(&[])?;
    let ran = run_loop(
        &mut *opened.source,
        &mut lineup,
        grid,
        Pace::Asap,
        &mut [&mut sink],
        &mut progress,
    );
    progress.clear();
    source::tell_left_out(&*opened.source);
    // A grabber's counts are complete when it has ended.
    drop(opened.source);
    let remembered = opened.live.map_or(Ok(()), |live| {
        live.used(sink.pairs());
        let mut facts = live.get().facts();
        facts.extend(
            ran.as_ref()
                .err()
                .map(|error| ("error".to_owned(), error.to_string())),
        );
        sink.writer().remember(GRABBER, facts)
    });
    // What came before an error is kept: the file is completed first, the error told after.
    let finished = sink.finish();
    if ran.is_err() && sink.pairs() == 0 {
        // A file without a pair is of no use, and would stand in the way of the next attempt.
        let _ = std::fs::remove_file(path);
    }
    let outcome = ran?;
    remembered.and(finished)?;
    Ok(outcome)
}
