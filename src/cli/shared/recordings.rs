//! The folder `recordings/`: unnamed recordings, the newest of them, the cache of simulated runs.

use super::progress::{Terminal, listen_for_interrupt};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use svl::console::Watch;
use svl::outputs::make_folder;
use svl::pass::{Outcome, report_losses};
use svl::recording::RecordingFormat;
use svl::runs::RECORDINGS;
use svl::source::Opened;

/// Creates the folder. Returns `recordings/STEM-N.mcap` with the first number that is free.
pub(crate) fn free_name(stem: &str) -> anyhow::Result<PathBuf> {
    make_folder(Path::new(RECORDINGS))?;
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
    let name = opened.source.name();
    let mut watch = watch(&opened, quiet);
    let recorded = svl::record::record(opened, path, format, &mut watch);
    drop(watch);
    report_losses(&name, &recorded.0.losses);
    recorded
}

/// Writes the pairs of a source to standard output, as [`record`] does to a file. A reader that
/// went away has read enough.
pub(crate) fn stream(opened: Opened, quiet: bool) -> (Outcome, svl::Result<()>) {
    let watch = watch(&opened, quiet);
    let (outcome, ran) = svl::record::stream(opened, std::io::stdout(), watch);
    let ran = match ran {
        Err(svl::Error::Io { cause, .. }) if cause.kind() == ErrorKind::BrokenPipe => Ok(()),
        ran => ran,
    };
    (outcome, ran)
}

/// The progress of a recording. From here on Ctrl-C leaves whole pairs.
fn watch(opened: &Opened, quiet: bool) -> Watch {
    listen_for_interrupt();
    let work = format!("record {}", opened.source.name());
    Watch::new(&Terminal { quiet }, &work, opened.source.pairs(), None)
}
