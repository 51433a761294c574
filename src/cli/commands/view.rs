//! `svl view`: a recording, a run or the runs of a report in the Rerun viewer.

use crate::cli::shared::progress::{interrupted, listen_for_interrupt};
use crate::cli::shared::terminal::print;
use crate::cli::shared::viewer::viewer;
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::Duration;
use svl::recording::{Recording, Selection, only_file};
use svl::report::results_so_far;
use svl::sink::report_runs;

/// Open a recording or a run in the Rerun viewer
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl view reports/arena
  svl view run.rrd --web     in the browser (over ssh: ports 9090 and 9876)
  svl view recordings/arena.mcap")]
pub(crate) struct Args {
    /// A recording (.mcap), a run (.rrd), or the folder of a report
    file: PathBuf,
    /// Serve the viewer to a browser, until Ctrl-C
    #[arg(long, help_heading = "Output")]
    web: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let runs = report_runs(&args.file);
    if !runs.is_empty() {
        if let Some(worst) = results_so_far(&args.file).ok().and_then(|own| own.worst) {
            print(&format!("{}\n", worst.words))?;
        }
        // The runs of all sessions: together they are one recording.
        let runs: Vec<_> = runs.iter().map(PathBuf::as_path).collect();
        return view(&runs, args.web);
    }
    let (named, shown) = (&args.file, args.file.display());
    if named.join("report.json").exists() && only_file(named).is_err() {
        let cure = "score again without --rerun none";
        bail!("{shown}: this report has no run for Rerun (run-1.rrd); {cure}");
    }
    // The viewer names a recording after the path it is given, and the layout must name the same.
    let file = only_file(named)?.canonicalize();
    let file = file.map_err(|cause| svl::Error::io(named, cause))?;
    match file.extension().and_then(|extension| extension.to_str()) {
        // A run carries its layout.
        Some("rrd") => view(&[&file], args.web),
        Some("mcap") => {
            let folder = tempfile::tempdir().context("no folder for the layout")?;
            let layout = folder.path().join("layout.rbl");
            let summary = Recording::open(&file)?.summary(&Selection::default())?;
            let topics: Vec<_> = summary.topics.into_iter().map(|topic| topic.name).collect();
            if viewer()?.save_layout(&file, &topics, &layout)? {
                view(&[&file, &layout], args.web)
            } else {
                view(&[&file], args.web)
            }
        }
        _ => bail!(
            "{shown}: neither a recording (.mcap), a run (.rrd) nor the folder of a report with one"
        ),
    }
}

/// Interval at which signals are looked for.
const GLANCE: Duration = Duration::from_millis(50);

/// Runs the viewer until its window is closed, or svl is told to end.
fn view(files: &[&Path], web: bool) -> anyhow::Result<()> {
    viewer()?.find_program()?;
    // Not to the whole network.
    let served: &[&str] = if web {
        &["--web-viewer", "--bind", "127.0.0.1"]
    } else {
        &[]
    };
    listen_for_interrupt();
    let mut command = Command::new("rerun");
    command.args(served).args(files);
    // That of pip starts another program.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    let mut program = command.spawn().context("rerun")?;
    let status = loop {
        if let Some(status) = program.try_wait()? {
            break status;
        }
        if interrupted() {
            end(&mut program)?;
            return Ok(());
        }
        std::thread::sleep(GLANCE);
    };
    if !status.success() {
        bail!("the Rerun viewer ended with {status}");
    }
    Ok(())
}

/// Ends the viewer with everything it started, so that its ports are free.
fn end(program: &mut Child) -> anyhow::Result<()> {
    #[cfg(unix)]
    {
        use rustix::process::{Pid, Signal, kill_process_group};
        if let Some(group) = Pid::from_raw(program.id().cast_signed()) {
            let _ = kill_process_group(group, Signal::TERM);
        }
    }
    #[cfg(not(unix))]
    program.kill()?;
    program.wait()?;
    Ok(())
}
