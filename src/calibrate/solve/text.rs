//! A calibration as plain text for the terminal, at most 100 columns.

use super::solution::{Estimated, Solution};
use std::fmt::{Display, Formatter, Result};

impl Display for Estimated {
    /// As `533.42 ± 0.34`: two significant digits of the standard deviation, and as many decimals
    /// of the value.
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let Self { value, deviation } = self;
        // The cast saturates at 0.
        let digits = if *deviation > 0.0 {
            (1.0 - deviation.log10().floor()).min(9.0) as usize
        } else {
            9
        };
        f.pad(&format!("{value:.digits$} ± {deviation:.digits$}"))
    }
}

impl Solution {
    /// The symbol of [`Solution::unit`].
    pub fn unit_sign(&self) -> &'static str {
        if self.unit == "metres" {
            "m"
        } else {
            "squares"
        }
    }
}

impl Display for Solution {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let (columns, rows) = self.board;
        writeln!(
            f,
            "{} of {} views of the {columns}x{rows} board used",
            self.used(),
            self.views.len()
        )?;
        for (id, why) in self.refused() {
            writeln!(f, "  view {} refused: {why}", id + 1)?;
        }
        match self.outliers() {
            0 => {}
            1 => writeln!(f, "  1 corner refused as an outlier")?,
            outliers => writeln!(f, "  {outliers} corners refused as outliers")?,
        }
        self.cameras(f)?;
        self.place(f)?;
        self.table(f)?;
        let Self {
            rms_px,
            corner_deviation_px,
            epipolar,
            ..
        } = self;
        writeln!(
            f,
            "\nRMS of both images {rms_px:.3} px: {corner_deviation_px:.3} px of noise in x and \
             in y."
        )?;
        writeln!(
            f,
            "Vertical misalignment of rectified corners: mean {:.3} px, rms {:.3} px, maximum \
             {:.2} px.",
            epipolar.mean_px, epipolar.rms_px, epipolar.worst_px
        )?;
        writeln!(
            f,
            "± is one standard deviation, for independent errors of the corners."
        )
    }
}

impl Solution {
    fn cameras(&self, f: &mut Formatter<'_>) -> Result {
        writeln!(f, "\n{:14}{:>24}{:>24}", "", "left", "right")?;
        let parameters = self
            .left
            .parameters()
            .into_iter()
            .zip(self.right.parameters());
        for (i, ((name, left), (_, right))) in parameters.enumerate() {
            let unit = if i < 4 { ", px" } else { "" };
            writeln!(f, "{:14}{left:>24}{right:>24}", format!("{name}{unit}"))?;
        }
        let [left, right] = [&self.left, &self.right];
        writeln!(
            f,
            "{:14}{:>24.3}{:>24.3}",
            "RMS, px", left.rms_px, right.rms_px
        )?;
        writeln!(
            f,
            "{:14}{:>24.0}{:>24.0}",
            "coverage, %",
            100.0 * left.coverage,
            100.0 * right.coverage
        )
    }

    fn place(&self, f: &mut Formatter<'_>) -> Result {
        let unit = self.unit_sign();
        writeln!(f, "\n{:14}{:>24}{:>24}{:>24}", "R, T", "x", "y", "z")?;
        let [x, y, z] = self.rotation_deg;
        writeln!(f, "{:14}{x:>24}{y:>24}{z:>24}", "rotation, °")?;
        let [x, y, z] = self.translation;
        writeln!(f, "{:14}{x:>24}{y:>24}{z:>24}", format!("T, {unit}"))?;
        writeln!(f, "{:14}{:>24}", format!("|T|, {unit}"), self.baseline)
    }

    fn table(&self, f: &mut Formatter<'_>) -> Result {
        let heads = ["left RMS, px", "right RMS, px", "|Δy|, px"];
        let distance = format!("distance, {}", self.unit_sign());
        let [left, right, rows] = heads;
        writeln!(
            f,
            "\nview  {left:>14}{right:>15}{rows:>10}{distance:>19}{:>9}",
            "tilt, °"
        )?;
        for (id, fit) in self.fits() {
            let (left, right, rows) = (fit.rms_left_px, fit.rms_right_px, fit.epipolar_px);
            let (distance, tilt) = (fit.distance, fit.tilt_deg);
            writeln!(
                f,
                "{:4}  {left:>14.3}{right:>15.3}{rows:>10.3}{distance:>19.3}{tilt:>9.1}",
                id + 1
            )?;
        }
        let (left, right, rows) = (self.left.rms_px, self.right.rms_px, self.epipolar.mean_px);
        writeln!(f, "{:>4}  {left:>14.3}{right:>15.3}{rows:>10.3}", "all")
    }
}
