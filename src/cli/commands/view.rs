//! `svl view`: a recording or a run in the Rerun viewer.

use anyhow::{Context, bail};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;
use svl::recording::{Recording, only_file};
use svl::sink::{VIEWER_HINT, save_recording_layout};

/// Open a recording or a run in the Rerun viewer
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  svl view run.rrd\n  svl view recordings/arena.mcap")]
pub(crate) struct Args {
    /// A recording (.mcap) or a run (.rrd)
    file: PathBuf,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    // The viewer names a recording after the path it is given, and the layout must name the same.
    let file = only_file(&args.file)?
        .canonicalize()
        .map_err(|cause| svl::Error::io(&args.file, cause))?;
    match file.extension().and_then(|extension| extension.to_str()) {
        // A run carries its layout.
        Some("rrd") => view(&[&file]),
        Some("mcap") => {
            let folder = tempfile::tempdir().context("no folder for the layout")?;
            let layout = folder.path().join("layout.rbl");
            let topics: Vec<_> = Recording::open(&file)?
                .summary()?
                .topics
                .into_iter()
                .map(|topic| topic.name)
                .collect();
            if save_recording_layout(&file, &topics, &layout)? {
                view(&[&file, &layout])
            } else {
                view(&[&file])
            }
        }
        _ => bail!(
            "{}: neither a recording (.mcap) nor a run (.rrd)",
            args.file.display()
        ),
    }
}

/// Runs the viewer until its window is closed.
fn view(files: &[&Path]) -> anyhow::Result<()> {
    match Command::new("rerun").args(files).status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => bail!("the Rerun viewer ended with {status}"),
        Err(error) if error.kind() == ErrorKind::NotFound => {
            bail!("no program `rerun` on the PATH; {VIEWER_HINT}")
        }
        Err(error) => Err(error).context("rerun"),
    }
}
