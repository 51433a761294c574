//! Records a source into an MCAP file or a stream, and keeps a cache of simulated runs.

use crate::pass::{Matchers, Monitor, Outcome, Pace, run, run_through};
use crate::sink::{PairStreamSink, PassStart, RecordingSink, Sink, finish};
use crate::source::{AlignmentMonitor, Opened, RecordingSource, Source, open_arena};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};
use svl_core::{Error, Result};
use svl_recording::{Dialect, Header, Recording, RecordingFormat};
use svl_score::judge::Judge;
use svl_score::manifest::Manifest;
use svl_score::scenario::Scenario;

/// Records all of a source into `path`, which must not exist. A file without a pair is removed.
///
/// The outcome holds also for a run that failed; what came before the error is kept.
pub fn record(
    mut opened: Opened,
    path: &Path,
    format: RecordingFormat,
    monitor: &mut dyn Monitor,
) -> (Outcome, Result<()>) {
    let begun = Manifest::new(opened.title(), &[])
        .map(|manifest| Manifest {
            bits: opened.header.bits,
            chain: opened.chain.clone(),
            ..manifest
        })
        .and_then(|manifest| Ok((opened.writer(path, format, &manifest)?, manifest)));
    let (writer, manifest) = match begun {
        Ok(begun) => begun,
        Err(error) => return (Outcome::default(), Err(error)),
    };
    let judge = Judge::default();
    let start = PassStart::new(&manifest, opened.header.seed, &judge);
    // Only a bag gets them: of svl's own recordings `svl replay` makes new ones.
    let has_results =
        |recording: &&Recording| format.dialect == Dialect::Ros2 && recording.header().is_ok();
    let own = opened.recording.as_ref().filter(has_results);
    let stored = own.and_then(|recording| recording.stored_results().ok());
    let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(RecordingSink::new(writer, stored))];
    let (outcome, ran) = run(
        &mut AlignmentMonitor::new(Box::new(&mut *opened.source), 0),
        &mut Matchers::default(),
        &start,
        Pace::Asap,
        &mut sinks,
        monitor,
    );
    // The file is completed first, then the error is returned.
    let finished = finish(sinks);
    if ran.is_err() && outcome.frames == 0 {
        // A file without a pair is useless, and would block the next attempt.
        let _ = std::fs::remove_file(path);
    }
    (outcome, ran.and(finished))
}

/// Writes all pairs of a source as bytes, rectified and warned of as those that are scored.
///
/// The outcome holds also for a run that failed.
pub fn stream(
    mut opened: Opened,
    to: impl Write + Send + 'static,
    monitor: impl Monitor,
) -> (Outcome, Result<()>) {
    let manifest = match Manifest::new(opened.title(), &[]) {
        Ok(manifest) => manifest,
        Err(error) => return (Outcome::default(), Err(error)),
    };
    let judge = Judge::default();
    let start = PassStart::new(&manifest, opened.header.seed, &judge);
    let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(PairStreamSink::new(to))];
    run_through(
        &mut *opened.source,
        &mut Matchers::default(),
        &start,
        Pace::Asap,
        &mut sinks,
        monitor,
    )
}

/// Age from which an unfinished recording in the cache counts as abandoned: a living writer
/// modifies it about once a second.
const MIN_ABANDONED_AGE: Duration = Duration::from_secs(60);

/// The recording of an arena scenario with a seed in the cache `folder`, made first if the cache
/// does not have it.
///
/// The file is named after everything that its pixels depend on, and gets that name only when it is
/// complete.
///
/// # Errors
/// The errors of [`open_arena`] and [`record`]; [`Error::Format`] where the file with that name is
/// another recording; [`Error::Invalid`] when the monitor ends the run.
pub fn cached_run(
    folder: &Path,
    scenario: &Scenario,
    seed: u64,
    monitor: &mut dyn Monitor,
) -> Result<PathBuf> {
    let opened = open_arena(scenario, seed)?;
    let hash = opened.header.hash.as_deref().unwrap_or_default();
    let key: String = hash.chars().take(12).collect();
    let path = folder.join(format!("{}-{key}.mcap", opened.stem));
    remove_abandoned(folder);
    if path.exists() {
        check_header(&path, &opened.header)?;
    }
    match is_complete(&path, opened.source.pairs()) {
        Ok(true) => return Ok(path),
        Ok(false) if !path.exists() => {}
        found => {
            let reason = found.err().map_or("incomplete".into(), |e| e.to_string());
            tracing::warn!("{}: {reason}; recorded again", path.display());
            std::fs::remove_file(&path).map_err(|e| Error::io(&path, e))?;
        }
    }
    // Two programs may record the same run at once: each has a file of its own until it is done.
    let partial = path.with_extension(format!("{}.partial", std::process::id()));
    let (outcome, ran) = record(opened, &partial, RecordingFormat::default(), monitor);
    let stopped = || Error::Invalid(format!("stopped while recording {}", path.display()));
    let complete = ran.and_then(|()| {
        if outcome.interrupted {
            Err(stopped())
        } else {
            std::fs::rename(&partial, &path).map_err(|e| Error::io(&path, e))
        }
    });
    if complete.is_err() {
        let _ = std::fs::remove_file(&partial);
    }
    complete.map(|()| path)
}

/// Refuses a file that is not the recording that its name promises: it is neither scored nor
/// replaced.
fn check_header(path: &Path, expected: &Header) -> Result<()> {
    let cure = "move or remove it, and it is recorded again";
    let found = Recording::open(path).and_then(|recording| recording.header());
    let found = found.map_err(|error| Error::Invalid(format!("{error}; {cure}")))?;
    let seed = |header: &Header| {
        header
            .seed
            .map_or("no seed".into(), |seed| format!("seed {seed}"))
    };
    let scenario = expected.scenario.as_deref().unwrap_or_default();
    let is_of = match found.changes {
        Some(changes) => format!("changed pairs ({changes})"),
        None if found.seed != expected.seed => seed(&found),
        None if found.hash != expected.hash => "other parameters".to_owned(),
        None => return Ok(()),
    };
    let wanted = seed(expected);
    let reason = format!("is of {is_of}, not of '{scenario}' with {wanted}; {cure}");
    Err(Error::format(path, reason))
}

/// True if a recording has its summary, and all pairs by it. Damage before that is met in reading.
fn is_complete(path: &Path, pairs: Option<u64>) -> Result<bool> {
    Ok(path.exists() && RecordingSource::open(path)?.pairs() == pairs)
}

/// Removes what killed programs left behind. Nothing depends on whether that works.
fn remove_abandoned(folder: &Path) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries {
        let path = entry.path();
        let age = || {
            let modified = entry.metadata().ok()?.modified().ok()?;
            SystemTime::now().duration_since(modified).ok()
        };
        if path.extension().is_some_and(|e| e == "partial") && age() > Some(MIN_ABANDONED_AGE) {
            let _ = std::fs::remove_file(path);
        }
    }
}
