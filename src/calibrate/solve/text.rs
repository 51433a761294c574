//! A calibration on the terminal: plain text, aligned, at most 100 columns.

use super::solution::{Camera, Estimate, Solution};
use std::fmt::{Display, Formatter, Result};

impl Display for Solution {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let unit = if self.unit == "metres" { "m" } else { "squares" };
        writeln!(
            f,
            "{} of {} views of the {}x{} board used",
            self.used(),
            self.views.len(),
            self.board.0,
            self.board.1
        )?;
        for (id, why) in self.refused() {
            writeln!(f, "  view {} refused: {why}", id + 1)?;
        }
        if self.outliers() > 0 {
            writeln!(f, "  {} single corners refused as outliers", self.outliers())?;
        }
        writeln!(f, "\n{:12} {:>24}  {:>24}", "", "left", "right")?;
        let lenses = self.left.parameters().into_iter().zip(self.right.parameters());
        for (i, ((name, left), (_, right))) in lenses.enumerate() {
            let (name, digits) = if i < 4 { (format!("{name}, px"), 2) } else { (name.to_owned(), 5) };
            writeln!(f, "{name:12} {:>24}  {:>24}", number(left, digits), number(right, digits))?;
        }
        let both = |value: fn(&Camera) -> String| (value(&self.left), value(&self.right));
        let rows = [
            ("RMS, px", both(|camera| format!("{:.3}", camera.rms_px))),
            ("coverage, %", both(|camera| format!("{:.0}", 100.0 * camera.coverage))),
        ];
        for (name, (left, right)) in rows {
            writeln!(f, "{name:12} {left:>24}  {right:>24}")?;
        }
        writeln!(f, "\nX_right = R X_left + T  {:>14}  {:>24}  {:>24}", "x", "y", "z")?;
        let row = |f: &mut Formatter<'_>, name: String, values: [Estimate; 3], digits| {
            let [x, y, z] = values.map(|value| number(value, digits));
            writeln!(f, "{name:14} {x:>23}  {y:>24}  {z:>24}")
        };
        row(f, "rotation, °".to_owned(), self.rotation_deg, 4)?;
        row(f, format!("T, {unit}"), self.translation, 5)?;
        writeln!(f, "{:14} {:>23}", format!("|T|, {unit}"), number(self.baseline, 5))?;
        writeln!(f, "\n{:>5} {:>9} {:>9} {:>8} {:>10} {:>7}", "view", "left", "right", "|Δy|", "distance", "tilt")?;
        writeln!(f, "{:>5} {:>9} {:>9} {:>8} {:>10} {:>7}", "", "RMS, px", "RMS, px", "px", unit, "°")?;
        for (id, fit) in self.fits() {
            let (left, right, rows) = (fit.rms_left_px, fit.rms_right_px, fit.epipolar_px);
            writeln!(
                f,
                "{:>5} {left:>9.3} {right:>9.3} {rows:>8.3} {:>10.3} {:>7.1}",
                id + 1,
                fit.distance,
                fit.tilt_deg
            )?;
        }
        writeln!(f, "  all {:>9.3} {:>9.3} {:>8.3}", self.left.rms_px, self.right.rms_px, self.epipolar.mean_px)?;
        writeln!(
            f,
            "\nRMS of both images {:.3} px; a corner is sure to {:.3} px in x and y",
            self.rms_px, self.corner_deviation_px
        )?;
        writeln!(
            f,
            "rows of rectified corners: |Δy| {:.3} px in the mean, {:.3} px rms, {:.2} px at most",
            self.epipolar.mean_px, self.epipolar.rms_px, self.epipolar.worst_px
        )?;
        writeln!(f, "± is one standard deviation, if corners err independently of each other")
    }
}

/// A number with its standard deviation.
fn number(Estimate { value, deviation }: Estimate, digits: usize) -> String {
    format!("{value:.digits$} ± {deviation:.digits$}")
}
