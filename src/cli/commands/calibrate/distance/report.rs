//! Report of a distance calibration: both curves, their residuals, and their ranges of validity.

use super::measurements::Measurement;
use serde_json::{Value, json};
use std::fmt::{self, Write};
use svl::calibrate::distance::cell_list;
use svl::depth::{DistanceCurve, PinholeFit};
use svl::report::plot::distance_chart;
use svl::report::table::{NONE, Table, TerminalStyle};

/// Largest relative error of a valid distance; the arena's checkpoints tolerate twice as much.
const SHARE: f64 = 0.10;

/// A measurement whose weight is below this is reported as an outlier.
const MIN_INLIER_WEIGHT: f64 = 0.5;

pub(super) struct DistanceReport {
    measurements: Vec<Measurement>,
    pairs: Vec<(f64, f64)>,
    pinhole: PinholeFit,
    /// The curve, or the reason for its absence.
    polynomial: Result<DistanceCurve, String>,
}

impl DistanceReport {
    pub(super) fn new(measurements: Vec<Measurement>) -> anyhow::Result<Self> {
        let pairs = measurements.iter();
        let pairs: Vec<_> = pairs.map(|m| (m.distance_cm, m.disparity_px)).collect();
        let pinhole = PinholeFit::fit(&pairs)?;
        let polynomial = DistanceCurve::fit(&pairs).map_err(|e| e.to_string());
        Ok(Self {
            measurements,
            pairs,
            pinhole,
            polynomial,
        })
    }

    fn curve(&self) -> Option<&DistanceCurve> {
        self.polynomial.as_ref().ok()
    }

    /// Curve minus measurement, centimetres: of the polynomial and of the pinhole curve.
    fn residuals_cm(&self, (cm, px): (f64, f64)) -> [Option<f64>; 2] {
        let polynomial = self.curve().and_then(|curve| curve.distance_cm(px));
        [polynomial, self.pinhole.distance_cm(px)].map(|distance| Some(distance? - cm))
    }

    fn rms_cm(&self, which: usize) -> Option<f64> {
        let pairs = self.pairs.iter();
        let squares = pairs.map(|&pair| Some(self.residuals_cm(pair)[which]?.powi(2)));
        let squares: Option<Vec<f64>> = squares.collect();
        squares.map(|squares| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }

    /// `a` by the recordings' own calibration; `None` unless all recordings agree.
    fn focal_baseline(&self) -> Option<f64> {
        let factor = |m: &Measurement| m.seen.as_ref()?.focal_baseline_cm_px;
        let first = factor(self.measurements.first()?)?;
        let mut all = self.measurements.iter();
        all.all(|m| factor(m) == Some(first)).then_some(first)
    }

    /// Disparity ranges in which the polynomial is valid.
    fn usable_px(&self) -> Vec<(f64, f64)> {
        let usable = self
            .curve()
            .map(|curve| curve.usable_px(&self.pairs, SHARE));
        usable.unwrap_or_default()
    }

    /// The polynomial's distance; `None` outside its valid ranges.
    fn polynomial_cm(&self, px: f64) -> Option<f64> {
        let mut usable = self.usable_px().into_iter();
        let is_usable = usable.any(|(from, to)| (from..=to).contains(&px));
        self.curve().filter(|_| is_usable)?.distance_cm(px)
    }

    /// The farthest valid distance, and its disparity.
    fn farthest(&self) -> Option<(f64, f64)> {
        let farthest_cm = self.pinhole.farthest_cm(SHARE)?;
        Some((farthest_cm, self.pinhole.disparity_px(farthest_cm)))
    }

    fn table(&self) -> Table {
        let table = Table::new("", "distance, cm");
        let table = table.with_columns(["disparity, px", "degree 5, cm", "a/(d+b), cm"]);
        let mut table = table.with_texts(["cells", "apart, px", "fit"]);
        let signed =
            |residual: Option<f64>| residual.map_or(NONE.to_owned(), |cm| format!("{cm:+.1}"));
        let measurements = self.measurements.iter().zip(&self.pinhole.weights);
        for ((measurement, weight), &(cm, px)) in measurements.zip(&self.pairs) {
            let [polynomial, pinhole] = self.residuals_cm((cm, px)).map(signed);
            let seen = measurement.seen.as_ref();
            let cells = seen.map(|seen| cell_list(&seen.cells));
            let apart = seen.map(|seen| format!("{:.2}", seen.spread_px));
            let fit = if *weight < MIN_INLIER_WEIGHT {
                "outlier"
            } else {
                ""
            };
            let cells = [
                format!("{px:.2}"),
                polynomial,
                pinhole,
                cells.unwrap_or_default(),
                apart.unwrap_or_default(),
                fit.to_owned(),
            ];
            table.push(format!("{cm:.1}"), cells);
        }
        table.remove_empty_columns();
        table
    }

    fn polynomial_text(&self, curve: &DistanceCurve) -> String {
        let rms = self.rms_cm(0).unwrap_or_default();
        let (from, to) = curve.measured_px().into_inner();
        let usable = self.usable_px();
        let ranges = usable.iter();
        let ranges = ranges.map(|(from, to)| format!("{from:.1} to {to:.1} px"));
        let ranges = match &ranges.collect::<Vec<_>>()[..] {
            [] => "nowhere".to_owned(),
            ranges => ranges.join(", "),
        };
        let oscillates = if usable == [(from, to)] {
            ""
        } else {
            "; elsewhere it oscillates between the measurements"
        };
        format!(
            "degree 5: rms {rms:.1} cm, measured from {from:.1} to {to:.1} px\n  valid: \
             {ranges}{oscillates}\n"
        )
    }

    pub(super) fn text(&self, style: TerminalStyle) -> Result<String, fmt::Error> {
        let mut text = self.table().terminal(style);
        let pinhole = &self.pinhole;
        let (deviation_a, deviation_b) = pinhole.standard_deviations();
        match &self.polynomial {
            Ok(curve) => text += &self.polynomial_text(curve),
            Err(why) => writeln!(text, "degree 5: none, {why}")?,
        }
        let (a, b, noise) = (pinhole.a_cm_px, pinhole.b_px, pinhole.noise_px);
        let rms = self.rms_cm(1).map(|rms| format!("{rms:.1} cm"));
        let rms = rms.unwrap_or_else(|| "unknown".to_owned());
        writeln!(
            text,
            "a/(d+b): a = {a:.1} ± {deviation_a:.1} cm·px, b = {b:.2} ± {deviation_b:.2} px, \
             rms {rms}, {noise:.2} px"
        )?;
        let percent = 100.0 * SHARE;
        match self.farthest() {
            Some((cm, px)) => writeln!(
                text,
                "  valid: up to {cm:.0} cm ({px:.1} px), where a distance is known to \
                 {percent:.0} % in 95 of 100 cases"
            )?,
            None => writeln!(
                text,
                "  valid: nowhere, as no distance is known to {percent:.0} % in 95 of 100 cases"
            )?,
        }
        if let Some(f_b) = self.focal_baseline() {
            let off = 100.0 * (a / f_b - 1.0);
            writeln!(
                text,
                "  by the recordings' calibration f·B = {f_b:.1} cm·px: a is {off:+.2} % off"
            )?;
        }
        Ok(text)
    }

    pub(super) fn json(&self) -> Value {
        let measurement = |((measurement, weight), &pair): ((&Measurement, &f64), &(f64, f64))| {
            let [polynomial, pinhole] = self.residuals_cm(pair);
            let mut value = json!(measurement);
            value["polynomial_residual_cm"] = json!(polynomial);
            value["pinhole_residual_cm"] = json!(pinhole);
            value["pinhole_weight"] = json!(weight);
            value
        };
        let rows = self.measurements.iter().zip(&self.pinhole.weights);
        let rows = rows.zip(&self.pairs).map(measurement);
        let polynomial = self.polynomial.as_ref().map(|curve| {
            let (from_px, to_px) = curve.measured_px().into_inner();
            json!({
                "coefficients_cm": curve.coefficients(),
                "from_px": from_px,
                "to_px": to_px,
                "usable_px": self.usable_px(),
                "rms_cm": self.rms_cm(0),
            })
        });
        let (deviation_a, deviation_b) = self.pinhole.standard_deviations();
        json!({
            "measurements": rows.collect::<Vec<_>>(),
            "polynomial": polynomial.ok(),
            "pinhole": {
                "a_cm_px": self.pinhole.a_cm_px,
                "b_px": self.pinhole.b_px,
                "a_deviation_cm_px": deviation_a,
                "b_deviation_px": deviation_b,
                "noise_px": self.pinhole.noise_px,
                "rms_cm": self.rms_cm(1),
                "farthest_cm": self.farthest().map(|(cm, _)| cm),
                "from_px": self.farthest().map(|(_, px)| px),
                "known_to_share": SHARE,
            },
            "focal_baseline_cm_px": self.focal_baseline(),
        })
    }

    /// CSV of the distances of whole disparities, empty where a curve is not valid.
    pub(super) fn csv(&self) -> Result<String, fmt::Error> {
        let mut text = String::from("disparity_px,polynomial_cm,pinhole_cm,pinhole_deviation_cm\n");
        let largest = self.pairs.iter().map(|(_, px)| *px).fold(0.0, f64::max);
        // Without a valid distance no disparity is large enough.
        let farthest = self.farthest().map_or(f64::INFINITY, |(_, px)| px);
        let decimals = |cm: Option<f64>| cm.map(|cm| format!("{cm:.2}")).unwrap_or_default();
        for px in (1..=largest.ceil() as u32).map(f64::from) {
            let polynomial = self.polynomial_cm(px);
            let pinhole = self.pinhole.distance_cm(px).filter(|_| px >= farthest);
            let deviation = pinhole.and_then(|cm| Some(cm * self.pinhole.relative_deviation(px)?));
            let [polynomial, pinhole, deviation] = [polynomial, pinhole, deviation].map(decimals);
            writeln!(text, "{px},{polynomial},{pinhole},{deviation}")?;
        }
        Ok(text)
    }

    pub(super) fn figure(&self) -> anyhow::Result<String> {
        let largest = self.pairs.iter().map(|(_, px)| *px).fold(0.0, f64::max);
        let farthest = self.farthest().map_or(f64::INFINITY, |(_, px)| px);
        let steps = (1..=(2.0 * 1.1 * largest).ceil() as u32).map(|i| 0.5 * f64::from(i));
        let steps = steps.filter(|px| *px >= farthest);
        let pinhole = steps.filter_map(|px| Some((px, self.pinhole.distance_cm(px)?)));
        let polynomial = self.curve().map(DistanceCurve::points);
        let polynomial = polynomial.map(|points| ("degree 5".to_owned(), points));
        let mut curves: Vec<_> = polynomial.into_iter().collect();
        curves.push(("a/(d + b)".to_owned(), pinhole.collect()));
        let chart = distance_chart(curves, vec![("measured".into(), self.pairs.clone())]);
        Ok(chart.svg())
    }
}
