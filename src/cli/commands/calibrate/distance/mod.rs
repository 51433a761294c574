//! `svl calibrate distance`: fits distance to disparity from a target at known distances.

mod measurements;
mod report;

use crate::cli::shared::terminal::{print_value, style};
use crate::cli::shared::usage;
use anyhow::Context;
use clap::builder::NonEmptyStringValueParser;
use measurements::{Measuring, measurements};
use report::DistanceReport;
use std::path::{Path, PathBuf};
use svl::depth::GridSettings;
use svl::matcher::Algorithm;
use svl::outputs::{Outputs, distinct, write};
use svl::stereo::GridShape;

/// Fit distance to disparity, from a target at known distances
///
/// The thesis's annex B: a target is put at measured distances; its disparity is the median of the
/// cells that show it, at least three. The thesis's polynomial of degree 5 is fitted through these,
/// valid only between them, and the physical curve Z = a / (d + b), with its range of validity.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl calibrate distance scenarios/annex-b.csv       the thesis's table B.1
  svl calibrate distance 130cm=far.mcap 80cm=middle.mcap 30cm=near.mcap
  svl calibrate distance target.csv --figure curve.svg --table curve.csv
  svl calibrate distance 1.3m=a.mcap 0.8m=b.mcap 0.3m=c.mcap \\
      --algo v3 --target 1,1 2,1 3,1

A CSV has the columns distance_cm and disparity_px, or distance_cm and
recording (paths from the CSV's folder). In a recording the target does not
move, and its pairs must be rectified.")]
pub(super) struct Args {
    /// A CSV of measurements, or recordings of the target with its distance before each
    #[arg(
        required = true, value_name = "TABLE.csv|DISTANCE=RECORDING",
        value_parser = NonEmptyStringValueParser::new()
    )]
    measurements: Vec<String>,
    /// Algorithm that matches the recordings, as `svl algos` lists them
    #[arg(
        long, value_name = "ALGO", default_value = "v3", value_parser = usage::algorithm,
        help_heading = "Input"
    )]
    algo: Algorithm,
    /// Cells of the 5 x 3 grid that show the target [default: those that agree with the middle one,
    /// joined to it]
    #[arg(
        long, value_name = "COLUMN,ROW", num_args = 1.., value_parser = cell, help_heading = "Input"
    )]
    target: Vec<(usize, usize)>,
    /// Draw both curves with the measurements (figure 5.1)
    #[arg(
        long, value_name = "FIGURE.svg", value_parser = usage::ending(&["svg"]),
        help_heading = "Output"
    )]
    figure: Option<PathBuf>,
    /// Write the distance of every disparity
    #[arg(
        long, value_name = "TABLE.csv", value_parser = usage::ending(&["csv"]),
        help_heading = "Output"
    )]
    table: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    force: bool,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

fn cell(text: &str) -> Result<(usize, usize), String> {
    let GridShape { columns, rows } = GridSettings::default().shape();
    usage::two(text, ',')
        .filter(|(column, row)| *column < columns && *row < rows)
        .ok_or_else(|| {
            format!("expected COLUMN,ROW of {columns}x{rows} cells, counted from 0 at the top left")
        })
}

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let inputs = args
        .measurements
        .iter()
        .map(|text| Path::new(text.rsplit('=').next().unwrap_or(text)));
    distinct(inputs.clone())?;
    let outputs = [args.figure.as_deref(), args.table.as_deref()];
    let mut outputs = Outputs::claim(args.force, inputs, outputs.into_iter().flatten())?;
    let measuring = Measuring {
        algorithm: &args.algo,
        cells: &args.target,
        quiet,
    };
    let found = measurements(&args.measurements, &measuring)?;
    let report = DistanceReport::new(found).with_context(|| args.measurements.join(" "))?;
    outputs.begin()?;
    if let Some(path) = &args.figure {
        write(&outputs.place(path), report.figure()?)?;
    }
    if let Some(path) = &args.table {
        write(&outputs.place(path), report.csv()?)?;
    }
    outputs.commit()?;
    print_value(args.json, &report.json(), || report.text(style()))
}
