//! A calibration on the terminal, and the tables that its page shares with it.

use super::verdict::CalibrationVerdict;
use crate::show::table::model::Table;
use crate::show::table::terminal::{TerminalStyle, wrapped};
use svl_calibrate::{CameraEstimate, Estimated, Solution};

/// The findings, the parameters and the views.
pub fn terminal(solution: &Solution, style: TerminalStyle) -> String {
    let facts = facts(solution).into_iter();
    let mut lines: Vec<_> = facts
        .map(|(name, words)| format!("{name}: {words}"))
        .collect();
    let refused = solution.refused();
    lines.extend(refused.map(|(id, why)| format!("view {} refused: {why}", id + 1)));
    let lines = lines.iter().map(|line| wrapped(line, 2, style.width));
    let mut text: String = lines.collect();
    for table in [intrinsics(solution), extrinsics(solution), views(solution)] {
        text.push_str(&format!("\n{}", table.terminal(style)));
    }
    text + "\n± is one standard deviation, for independent errors of the corners.\n"
}

pub(crate) fn facts(solution: &Solution) -> Vec<(&'static str, String)> {
    let (columns, rows) = solution.board;
    let outliers = match solution.outliers() {
        0 => String::new(),
        1 => ", without 1 outlying corner".to_owned(),
        n => format!(", without {n} outlying corners"),
    };
    let views = format!(
        "{} of {} of the {columns}×{rows} board used{outliers}",
        solution.used(),
        solution.views.len()
    );
    let epipolar = solution.epipolar;
    let verdict = CalibrationVerdict::new(solution).words();
    vec![
        ("Verdict", verdict),
        ("Views", views),
        (
            "RMS",
            format!(
                "{:.3} px over both images: {:.3} px of noise in x and in y",
                solution.rms_px, solution.corner_deviation_px
            ),
        ),
        (
            "Vertical misalignment",
            format!(
                "|Δy| of rectified corners: mean {:.3} px, rms {:.3} px, maximum {:.2} px",
                epipolar.mean_px, epipolar.rms_px, epipolar.worst_px
            ),
        ),
        (
            "Baseline",
            format!("{} {}", solution.baseline, solution.unit_sign()),
        ),
    ]
}

pub(crate) fn intrinsics(solution: &Solution) -> Table {
    let mut table = Table::new("Cameras", "cameras").with_columns(["left", "right"]);
    let cameras = [&solution.left, &solution.right];
    let [left, right] = cameras.map(|camera| camera.parameters.0.iter());
    for (i, ((name, left), (_, right))) in left.zip(right).enumerate() {
        let unit = if i < 4 { ", px" } else { "" };
        table.push(
            format!("{name}{unit}"),
            [left, right].map(|e| e.to_string()),
        );
    }
    table.push(
        "RMS, px",
        cameras.map(|camera| format!("{:.3}", camera.rms_px)),
    );
    let coverage = |camera: &CameraEstimate| format!("{:.0}", 100.0 * camera.coverage);
    table.push("coverage, %", cameras.map(coverage));
    table
}

pub(crate) fn extrinsics(solution: &Solution) -> Table {
    let unit = solution.unit_sign();
    let mut table = Table::new("Right camera", "right camera").with_columns(["x", "y", "z"]);
    let words = |estimates: [Estimated; 3]| estimates.map(|e| e.to_string());
    table.push("R, °", words(solution.rotation_deg));
    table.push(format!("T, {unit}"), words(solution.translation));
    let length = [solution.baseline.to_string(), String::new(), String::new()];
    table.push(format!("|T|, {unit}"), length);
    table
}

fn views(solution: &Solution) -> Table {
    let distance = format!("distance, {}", solution.unit_sign());
    let table = Table::new("Views", "view").with_columns(["left RMS, px", "right RMS, px"]);
    let mut table = table.with_columns(["|Δy|, px", distance.as_str(), "tilt, °"]);
    for (id, fit) in solution.fits() {
        let numbers = [
            fit.rms_left_px,
            fit.rms_right_px,
            fit.epipolar_px,
            fit.distance,
        ];
        let numbers = numbers.map(|number| format!("{number:.3}")).into_iter();
        let tilt = format!("{:.1}", fit.tilt_deg);
        table.push((id + 1).to_string(), numbers.chain([tilt]));
    }
    let [left, right] = [&solution.left, &solution.right].map(|camera| camera.rms_px);
    let all = [left, right, solution.epipolar.mean_px].map(|number| format!("{number:.3}"));
    table.push("all", all.into_iter().chain([String::new(), String::new()]));
    table
}
