//! The cache of simulated runs in `recordings/`.

use super::recorder;
use super::source::{self, RECORDINGS};
use anyhow::{Context, bail};
use std::path::Path;
use std::time::Duration;
use svl::recording::RecordingFormat;
use svl::scenario::Scenario;
use svl::source::RecordingSource;

/// The run of an arena scenario with one seed, recorded first where the cache does not hold it.
///
/// Its file is named after everything that its pixels depend on, and gets that name only when it is
/// whole.
pub(crate) fn recording(
    scenario: &Scenario,
    seed: u64,
    quiet: bool,
) -> anyhow::Result<RecordingSource> {
    let opened = source::arena(scenario, seed)?;
    let key: String = opened
        .header
        .hash
        .iter()
        .flat_map(|hash| hash.chars())
        .take(12)
        .collect();
    let path = Path::new(RECORDINGS).join(format!("{}-{key}.mcap", opened.stem));
    if !path.exists() {
        source::make_recordings_folder()?;
        remove_abandoned();
        let partial = path.with_extension(format!("{}.partial", std::process::id()));
        match recorder::write(opened, &partial, RecordingFormat::default(), quiet) {
            Ok((outcome, Ok(()))) if !outcome.interrupted => {
                std::fs::rename(&partial, &path)
                    .with_context(|| format!("{}: cannot be named so", path.display()))?;
            }
            other => {
                // An unfinished entry of a cache is of no use to anyone.
                let _ = std::fs::remove_file(&partial);
                other?.1?;
                bail!("stopped by Ctrl-C while recording {}", path.display());
            }
        }
    }
    RecordingSource::open(&path).context("delete this file and it will be recorded anew")
}

/// Takes away what killed runs left behind; a living one writes about once a second.
fn remove_abandoned() {
    let entries = std::fs::read_dir(RECORDINGS)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path());
    for path in entries.filter(|path| path.extension().is_some_and(|e| e == "partial")) {
        let modified = path.metadata().and_then(|m| m.modified()).ok();
        if modified
            .and_then(|at| at.elapsed().ok())
            .is_some_and(|age| age > Duration::from_secs(60))
        {
            // Whether it goes away or not, nothing depends on it.
            let _ = std::fs::remove_file(path);
        }
    }
}
