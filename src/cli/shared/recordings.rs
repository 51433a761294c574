//! The folder `recordings/`: unnamed recordings, the newest of them, the cache of simulated runs.

use super::live::LiveTable;
use super::outputs::make_folder;
use super::progress::{Progress, interrupted, listen_for_interrupt};
use super::runner::report_losses;
use anyhow::bail;
use std::path::{Path, PathBuf};
use svl::recording::RecordingFormat;
use svl::run::Outcome;
use svl::scenario::{Scenario, ScenarioSource};
use svl::source::Opened;

pub(crate) const RECORDINGS: &str = "recordings";

/// Creates the folder. Returns `recordings/STEM-N.mcap` with the first number that is free.
pub(crate) fn free_name(stem: &str) -> anyhow::Result<PathBuf> {
    create()?;
    let name = |n: u32| Path::new(RECORDINGS).join(format!("{stem}-{n}.mcap"));
    let free = (1..).map(name).find(|path| !path.exists());
    Ok(free.unwrap_or_else(|| name(0)))
}

/// The newest recording, if there is one.
pub(crate) fn newest() -> Option<PathBuf> {
    let entries = std::fs::read_dir(RECORDINGS).ok()?.flatten();
    let paths = entries.map(|entry| entry.path());
    let recordings = paths.filter(|path| path.extension().is_some_and(|e| e == "mcap"));
    recordings.max_by_key(|path| path.metadata().and_then(|m| m.modified()).ok())
}

/// Records a source, with a progress bar, and warns of what is in no frame. The outcome holds also
/// for a run that failed.
pub(crate) fn record(
    opened: Opened,
    path: &Path,
    format: RecordingFormat,
    quiet: bool,
) -> (Outcome, svl::Result<()>) {
    // From here on Ctrl-C leaves an intact file.
    listen_for_interrupt();
    let name = opened.source.name();
    let mut progress = Progress::new(&name, opened.source.pairs(), quiet);
    let recorded = svl::record::record(opened, path, format, &mut progress);
    progress.clear();
    report_losses(&name, &recorded.0.losses);
    recorded
}

/// The recording of an arena scenario with a seed, made first where the cache does not hold it.
pub(crate) fn cached_run(
    scenario: &Scenario,
    seed: u64,
    quiet: bool,
    table: Option<&LiveTable>,
) -> anyhow::Result<PathBuf> {
    create()?;
    let pairs = match &scenario.source {
        ScenarioSource::Arena { config, .. } => Some(config.frames),
        _ => None,
    };
    let name = format!("arena, seed {seed}");
    let mut progress = Progress::with_table(&name, pairs, quiet, table);
    let cached = svl::record::cached_run(Path::new(RECORDINGS), scenario, seed, &mut progress);
    progress.clear();
    if interrupted() {
        bail!("interrupted while recording the arena");
    }
    Ok(cached?)
}

fn create() -> svl::Result<()> {
    make_folder(Path::new(RECORDINGS))
}
