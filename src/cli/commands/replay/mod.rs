//! `svl replay`: a recording through matchers.

mod answer;
mod plan;
mod verify;

use crate::cli::shared::filters::FilterArgs;
use crate::cli::shared::progress::{Terminal, listen_for_interrupt};
use crate::cli::shared::viewer::RerunChoice;
use crate::cli::shared::{source, usage};
use clap::builder::NonEmptyStringValueParser;
use plan::Plan;
use std::path::PathBuf;
use svl::matcher::Algorithm;
use svl::pass::Pace;
use svl::scenario::SourceOptions;

/// Replay a recording through algorithms
///
/// Every pair goes through every algorithm, in order, none is skipped; the same recording gives the
/// same results on any machine and any number of threads.
#[derive(clap::Args)]
#[command(mut_args(|arg| source::hidden(arg, NOT_TAKEN)))]
#[command(after_help = "\
Examples:
  svl replay     the newest of recordings/, or else the arena
  svl replay run.mcap --algo v3 --algo v3:max_disparity=64 --rows rows.csv
  svl replay raw.mcap --calib calibration.xml
      pairs of raw cameras, rectified on the fly
  svl replay BAG                                 the folder of a ROS 2 bag
  svl replay ros2: --publish ros2:/svl           live topics, until Ctrl-C
  svl replay run.mcap --rerun spawn              watch it in the Rerun viewer
  svl replay run.mcap --rerun run.rrd --speed 1  at the speed it was recorded
  svl replay run.mcap --algo v3 -o result.mcap
  svl replay result.mcap --verify                the same results again?
  svl replay run.mcap --verify=rows.csv
      against a table of rows, or the folder of a report")]
pub(crate) struct Args {
    /// Recording, or the folder of a ROS 2 bag [default: the newest]
    ///
    /// svl's or another program's, or live topics: ros2:[LEFT,RIGHT]. The newest is that of
    /// recordings/; if there is none, the arena is recorded first.
    #[arg(value_parser = NonEmptyStringValueParser::new())]
    recording: Option<String>,
    /// Algorithm, as NAME[:key=value,…]; repeatable [default: v5]
    ///
    /// `svl algos` lists them. With --verify the default is those of the earlier run.
    #[arg(long, value_name = "ALGO", value_parser = usage::algorithm, help_heading = "Input")]
    algo: Vec<Algorithm>,
    #[command(flatten)]
    filters: FilterArgs,
    #[command(flatten)]
    options: SourceOptions,
    /// asap, or X times the recorded speed
    #[arg(
        long, value_name = "asap|X", allow_negative_numbers = true, default_value = "asap",
        value_parser = pace, help_heading = "Run"
    )]
    speed: Pace,
    /// Write pairs, disparities and cells to a recording
    #[arg(
        short, long, value_name = "RESULT.mcap", value_parser = usage::ending(&["mcap"]),
        help_heading = "Output"
    )]
    output: Option<PathBuf>,
    /// Write one row per pair and algorithm
    #[arg(
        long, value_name = "FILE.csv|.parquet", value_parser = usage::ending(&["csv", "parquet"]),
        help_heading = "Output"
    )]
    rows: Option<PathBuf>,
    /// Write one row per pair, algorithm and cell
    #[arg(
        long, value_name = "FILE.csv|.parquet", value_parser = usage::ending(&["csv", "parquet"]),
        help_heading = "Output"
    )]
    cells: Option<PathBuf>,
    /// Rerun: spawn, URL, FILE.rrd, or none [default: none]
    ///
    /// A new viewer, a running one, a file, or none.
    #[arg(long, value_name = "WHERE", help_heading = "Output")]
    rerun: Option<RerunChoice>,
    /// Publish the results to ROS 2 topics below a prefix
    ///
    /// PREFIX/points, sensor_msgs/msg/PointCloud2 with a point and its probability per known cell;
    /// PREFIX/scan, sensor_msgs/msg/LaserScan; PREFIX/disparity, stereo_msgs/msg/DisparityImage;
    /// PREFIX/depth, sensor_msgs/msg/Image in metres; and /diagnostics once a second.
    #[arg(
        long, value_name = "ros2:/PREFIX", value_parser = publish_address, help_heading = "Output"
    )]
    publish: Option<String>,
    /// Publish a point and its grey value per pixel with a distance, in place of cells
    #[arg(
        long,
        requires = "publish",
        help_heading = "Output",
        hide_short_help = true
    )]
    dense: bool,
    /// Distance in the published scan of cells of state near, metres
    ///
    /// They have none of their own, and are unknown in the scan without this.
    #[arg(
        long, value_name = "M", requires = "publish", value_parser = usage::within(0.01..=100.0),
        help_heading = "Output", hide_short_help = true
    )]
    scan_near: Option<f64>,
    /// Compare the results with those of an earlier run
    ///
    /// By default with those in the recording itself.
    #[arg(
        long, value_name = "RESULT.mcap|ROWS.csv|REPORT", num_args = 0..=1, require_equals = true,
        help_heading = "Scoring"
    )]
    verify: Option<Option<PathBuf>>,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    force: bool,
}

/// Options that only scenarios accept.
pub(crate) const NOT_TAKEN: &[&str] = &["data", "scenes", "seeds"];

fn publish_address(text: &str) -> Result<String, String> {
    if text.starts_with("ros2:") {
        Ok(text.to_owned())
    } else {
        Err("expected ros2:/PREFIX".to_owned())
    }
}

fn pace(text: &str) -> Result<Pace, String> {
    if text == "asap" {
        return Ok(Pace::Asap);
    }
    let times = usage::within(0.001..=1000.0)(text);
    times
        .map(Pace::Times)
        .map_err(|why| format!("{why}, 2 being twice as fast, or 'asap'"))
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    // Before programs are started: svl has to end them after Ctrl-C.
    listen_for_interrupt();
    let terminal = Terminal { quiet };
    let replayed = Plan::new(args, &terminal)?.replay(&terminal)?;
    replayed.print(args)?;
    replayed.check(args)
}
