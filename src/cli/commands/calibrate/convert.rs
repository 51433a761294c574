//! `svl calibrate convert`: converts a calibration file to the format of another program.

use crate::cli::shared::terminal::{LAST_COLUMN, print, wrapped};
use crate::cli::shared::usage;
use anyhow::Context;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use svl::calibrate::files::{self, CalibrationFormat, FORMATS, FileUnit, Hints, LoadedCalibration};
use svl::outputs::{Outputs, distinct};
use svl::rectify::{Framing, bouguet};
use svl::stereo::{DistortionModel, Intrinsics, LengthUnit};

/// Write a calibration in the format of another program
///
/// Prints what it read, and what the new file cannot hold. Lengths become metres; a calibration in
/// squares of its board stays so until you name their size.
#[derive(clap::Args)]
#[command(after_help = after_help())]
pub(super) struct Args {
    /// Calibration to read: a file, two with a comma between, or the folder of the two
    #[arg(value_name = "A")]
    input: PathBuf,
    /// Calibration to write, likewise
    #[arg(value_name = "B")]
    output: PathBuf,
    /// Format of A [default: detected from its content]
    #[arg(long, value_name = "FORMAT", value_parser = files::format, help_heading = "Input")]
    from: Option<&'static CalibrationFormat>,
    /// Format of B [default: by its file extension; .yaml and .yml are opencv]
    #[arg(long, value_name = "FORMAT", value_parser = written, help_heading = "Output")]
    to: Option<&'static CalibrationFormat>,
    /// Unit of length of A, where A does not state it: m, cm, mm, squares, squares=SIDE_IN_METRES
    #[arg(long, help_heading = "Input")]
    unit: Option<FileUnit>,
    /// Width and height of A's images in pixels, where A does not state them
    #[arg(long, value_name = "WxH", value_parser = size, help_heading = "Input")]
    size: Option<(usize, usize)>,
    /// Distortion model of A, where A does not state it: plumb_bob, rational_polynomial, or
    /// equidistant for a file of cv2.fisheye
    #[arg(long, help_heading = "Input")]
    model: Option<DistortionModel>,
    /// Compute the rectification (Bouguet's method), for formats that need one and an A without or
    /// with another
    #[arg(long, help_heading = "Output")]
    rectify: bool,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    force: bool,
}

fn after_help() -> String {
    let mut text = "\
Examples:
  svl calibrate convert opencv.yml calibration.xml --unit squares=0.025
  svl calibrate convert calibration.xml left.yaml,right.yaml
  svl calibrate convert mav0 left.yaml,right.yaml --rectify
  svl calibrate convert calibration.xml calib.txt --to kitti

Formats, by the endings of their files:
"
    .to_owned();
    for format in FORMATS {
        let (name, title, endings) = (format.name, format.title, format.endings.join(", ."));
        let only = if format.is_written() {
            ""
        } else {
            ", read only"
        };
        text += &format!("  {name:<11} {title} (.{endings}{only}):\n");
        text += &wrapped("", 14, format.conventions, LAST_COLUMN);
    }
    text
}

fn written(name: &str) -> Result<&'static CalibrationFormat, String> {
    let format = files::format(name).map_err(|e| e.to_string())?;
    if format.is_written() {
        Ok(format)
    } else {
        Err(format!("{} is read only; choose another", format.title))
    }
}

fn size(text: &str) -> Result<(usize, usize), String> {
    let is_side = |side: usize| (1..=svl::stereo::MAX_SIDE).contains(&side);
    usage::two(text, 'x')
        .filter(|(width, height)| is_side(*width) && is_side(*height))
        .ok_or_else(|| "expected WIDTHxHEIGHT in pixels, as 640x480".into())
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let to = match args.to {
        Some(format) => format,
        None => files::written_as(&args.output).map_err(usage::wrong)?,
    };
    // Names and file extensions are usage errors; they come before anything is read.
    let outputs = files::outputs(&args.output, to).map_err(usage::wrong)?;
    let inputs = files::inputs(&args.input)?;
    let mut paths = inputs.iter().chain(&outputs);
    if paths.any(|path| path.as_os_str().is_empty()) {
        return Err(usage::wrong(
            "two files with a comma between are left.yaml,right.yaml: one has no name",
        ));
    }
    let endings = &["xml", "yaml", "yml", "txt"];
    for output in &outputs {
        usage::ends_in(output, endings)?;
    }
    let hints = Hints {
        format: args.from,
        unit: args.unit,
        size: args.size,
        model: args.model,
        ..Hints::default()
    };
    distinct(inputs.iter().map(PathBuf::as_path))?;
    let [read, to_write] = [&inputs, &outputs].map(|paths| paths.iter().map(PathBuf::as_path));
    let mut claimed = Outputs::claim(args.force, read, to_write)?;
    let mut found = files::read_with(&args.input, &hints)?;
    if args.rectify {
        let rectification = bouguet(&found.calibration, &Framing::default());
        let rectification = rectification.with_context(|| args.input.display().to_string())?;
        found.calibration = found.calibration.with_rectification(rectification);
    }
    print(&describe(&args.input, &found)?)?;
    claimed.begin()?;
    let place = |path: &Path| claimed.place(path);
    let left_out = files::write_as(&args.output, to, &found.calibration, place)?;
    claimed.commit()?;
    let (path, title, conventions) = (args.output.display(), to.title, to.conventions);
    let mut text = format!("{path}: written as {title}\n  {conventions}\n");
    for what in left_out {
        let why = "as the format has no place for it";
        writeln!(text, "  not written, {why}: {what}")?;
    }
    print(&text)
}

/// A calibration as text.
fn describe(path: &Path, found: &LoadedCalibration) -> Result<String, std::fmt::Error> {
    let (format, calibration) = (found.format, &found.calibration);
    let (path, title, conventions) = (path.display(), format.title, format.conventions);
    let mut text = format!("{path}: {title}\n  {conventions}\n");
    for (side, camera) in [("left", calibration.left()), ("right", calibration.right())] {
        writeln!(text, "  {side:<5} {}", camera_line(camera))?;
    }
    let unit = match calibration.unit() {
        LengthUnit::Metres => "m",
        LengthUnit::Squares => "squares of an unknown size",
    };
    let baseline = calibration.baseline();
    let rotated = calibration.right_from_left().rotation.angle().to_degrees();
    writeln!(
        text,
        "  baseline {baseline:.6} {unit}, cameras rotated by {rotated:.3}° to each other"
    )?;
    match calibration.rectification() {
        None => writeln!(text, "  no rectification")?,
        Some(rectification) => {
            let (rig, (width, height)) = (rectification.rig, rectification.size);
            let (focal, (cx, cy), doffs) = (rig.focal_px(), rig.center_px(), rig.doffs_px());
            writeln!(
                text,
                "  rectified {width}x{height}: focal length {focal:.3} px, centre ({cx:.3}, \
                 {cy:.3}), doffs {doffs:.3} px"
            )?;
        }
    }
    let doubts = found.doubts().map(|doubt| doubt.to_string());
    for note in found.notes().chain(doubts) {
        writeln!(text, "  note: {note}")?;
    }
    Ok(text)
}

fn camera_line(camera: &Intrinsics) -> String {
    let ((width, height), (fx, fy), (cx, cy)) =
        (camera.size(), camera.focal_px(), camera.center_px());
    let lens = camera.distortion();
    let coefficients = lens.coefficients().iter();
    let coefficients = coefficients.map(|c| format!(" {c:.5}")).collect::<String>();
    format!(
        "{width}x{height}, focal lengths {fx:.3} {fy:.3} px, centre ({cx:.3}, {cy:.3}), \
         {}{coefficients}",
        lens.model()
    )
}
