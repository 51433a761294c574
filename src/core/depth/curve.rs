//! Distance curve of the thesis: a polynomial of degree 5 fitted to measured distances and
//! disparities (annex B; section 5.1, figure 5.1).
//!
//! A target was moved from 130 cm towards the cameras and its disparity recorded. The robot used
//! the table of `polyfit(disparity, cm, 5)`.
//!
//! Departure from the thesis: no extrapolation. Outside its measurements a polynomial of degree 5
//! is arbitrary, but the thesis's table contains it for every disparity from 1 on.
//!
//! Even inside the range, where annex B's measurements are far apart, the curve oscillates: it
//! passes within 1.2 cm of most of them, but between 38 and 81 px it gives 15 cm at 50 px and 38 cm
//! at 70 px. The pinhole model does not oscillate.

use crate::error::{Error, Result};
use nalgebra::{SMatrix, SVector};

const COEFFICIENTS: usize = 6;

/// Points between two measurements at which the curve is evaluated.
const STEPS: u32 = 20;

/// Distance as a polynomial of degree 5 in disparity, within the measured disparities.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceCurve {
    /// Lowest power first, in disparities mapped to −1 ..= 1, where the fit is well conditioned.
    coefficients: SVector<f64, COEFFICIENTS>,
    first_px: f64,
    last_px: f64,
}

impl DistanceCurve {
    /// Table B.1 of the thesis: distance in centimetres and disparity in pixels, for its cameras.
    pub const TABLE_B1: [(f64, f64); 13] = [
        (130.0, 11.0),
        (120.0, 12.0),
        (110.0, 13.0),
        (100.0, 14.0),
        (90.0, 16.0),
        (80.0, 17.0),
        (70.0, 19.0),
        (60.0, 22.0),
        (50.0, 27.0),
        (40.0, 32.0),
        (30.0, 38.0),
        (20.0, 60.0),
        (16.0, 81.0),
    ];

    /// The polynomial with the least squared error over `(distance_cm, disparity_px)` pairs.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a number is not finite or fewer than six disparities are distinct.
    pub fn fit(pairs: &[(f64, f64)]) -> Result<Self> {
        if pairs
            .iter()
            .any(|(cm, px)| !cm.is_finite() || !px.is_finite())
        {
            return Err(Error::Invalid(
                "a distance curve needs finite distances and disparities".into(),
            ));
        }
        let mut distinct: Vec<f64> = pairs.iter().map(|&(_, px)| px).collect();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        let (&[first_px, ..], &[.., last_px]) = (&distinct[..], &distinct[..]) else {
            return Err(too_few(0));
        };
        if distinct.len() < COEFFICIENTS {
            return Err(too_few(distinct.len()));
        }
        let mut curve = Self {
            coefficients: SVector::zeros(),
            first_px,
            last_px,
        };
        let mut normal = SMatrix::<f64, COEFFICIENTS, COEFFICIENTS>::zeros();
        let mut right = SVector::<f64, COEFFICIENTS>::zeros();
        for &(cm, px) in pairs {
            let powers = curve.powers(px);
            normal += powers * powers.transpose();
            right += powers * cm;
        }
        curve.coefficients = normal
            .cholesky()
            .ok_or_else(|| too_few(distinct.len()))?
            .solve(&right);
        Ok(curve)
    }

    /// The curve of annex B.
    ///
    /// # Errors
    /// None in practice: the table has thirteen distinct disparities.
    pub fn annex_b() -> Result<Self> {
        Self::fit(&Self::TABLE_B1)
    }

    /// Distance in centimetres; `None` outside [`DistanceCurve::measured_px`].
    pub fn distance_cm(&self, disparity_px: f64) -> Option<f64> {
        let measured = self.measured_px().contains(&disparity_px);
        measured.then(|| self.powers(disparity_px).dot(&self.coefficients))
    }

    /// Coefficients for disparities in pixels, lowest power first, the reverse order of
    /// MATLAB's `polyfit`.
    pub fn coefficients(&self) -> [f64; COEFFICIENTS] {
        // t = slope·d + offset, expanded by Horner's rule.
        let slope = 2.0 / (self.last_px - self.first_px);
        let offset = -(self.first_px + self.last_px) / (self.last_px - self.first_px);
        self.coefficients
            .iter()
            .rev()
            .fold([0.0; COEFFICIENTS], |sum, coefficient| {
                let mut next = sum.map(|v| v * offset);
                (1..COEFFICIENTS).for_each(|power| next[power] += slope * sum[power - 1]);
                next[0] += coefficient;
                next
            })
    }

    /// `(disparity_px, distance_cm)` every half pixel, from the farthest measurement to the
    /// nearest.
    pub fn points(&self) -> Vec<(f64, f64)> {
        let steps = (2.0 * (self.last_px - self.first_px)) as usize;
        let px = (0..=steps).map(|i| self.first_px + 0.5 * i as f64);
        px.filter_map(|px| Some((px, self.distance_cm(px)?)))
            .collect()
    }

    /// The ranges of disparity in which it may be used: between adjacent measurements it stays
    /// between their distances, or exceeds them by at most the fraction `share`. `pairs` are those
    /// it was fitted to.
    pub fn usable_px(&self, pairs: &[(f64, f64)], share: f64) -> Vec<(f64, f64)> {
        let mut pairs = pairs.to_vec();
        pairs.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut usable: Vec<(f64, f64)> = Vec::new();
        for pair in pairs.windows(2) {
            let ((cm, from), (next_cm, to)) = (pair[0], pair[1]);
            let least = (1.0 - share) * cm.min(next_cm);
            let most = (1.0 + share) * cm.max(next_cm);
            let mut steps =
                (0..=STEPS).map(|i| from + (to - from) * f64::from(i) / f64::from(STEPS));
            let stays = |px: f64| {
                self.distance_cm(px.min(self.last_px))
                    .is_some_and(|cm| (least..=most).contains(&cm))
            };
            match usable.last_mut() {
                _ if !steps.all(stays) => {}
                Some(last) if last.1 == from => last.1 = to,
                _ => usable.push((from, to)),
            }
        }
        usable
    }

    /// The disparities between the farthest and the nearest measurement.
    pub fn measured_px(&self) -> std::ops::RangeInclusive<f64> {
        self.first_px..=self.last_px
    }

    fn powers(&self, disparity_px: f64) -> SVector<f64, COEFFICIENTS> {
        let t =
            (2.0 * disparity_px - self.first_px - self.last_px) / (self.last_px - self.first_px);
        SVector::from_fn(|power, _| t.powi(power as i32))
    }
}

fn too_few(distinct: usize) -> Error {
    Error::Invalid(format!(
        "a distance curve needs {COEFFICIENTS} well separated disparities, got {distinct}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exact_polynomial_is_recovered() {
        let polynomial = |d: f64| 3.0 - 2.0 * d + 0.5 * d * d - 0.01 * d.powi(5);
        let pairs: Vec<(f64, f64)> = (-4..=8)
            .map(|d| (polynomial(f64::from(d)), f64::from(d)))
            .collect();
        let curve = DistanceCurve::fit(&pairs).unwrap();
        for d in [-4.0, -1.5, 0.25, 7.9] {
            assert!(
                (curve.distance_cm(d).unwrap() - polynomial(d)).abs() < 1e-8,
                "{d}"
            );
        }
    }

    #[test]
    fn annex_b_is_what_polyfit_makes_of_it() {
        let curve = DistanceCurve::annex_b().unwrap();
        // numpy.polyfit(px, cm, 5)
        for (px, cm) in [
            (11.0, 130.5673),
            (20.0, 67.3588),
            (32.0, 40.1092),
            (50.0, 15.2899),
            (70.0, 37.9085),
        ] {
            assert!((curve.distance_cm(px).unwrap() - cm).abs() < 1e-4, "{px}");
        }
    }

    #[test]
    fn it_is_not_used_where_it_swings() {
        let curve = DistanceCurve::annex_b().unwrap();
        assert_eq!(
            curve.usable_px(&DistanceCurve::TABLE_B1, 0.1),
            [(11.0, 38.0)]
        );
        let line: Vec<(f64, f64)> = (1..=9)
            .map(|d| (100.0 - 10.0 * f64::from(d), f64::from(d)))
            .collect();
        assert_eq!(
            DistanceCurve::fit(&line).unwrap().usable_px(&line, 0.01),
            [(1.0, 9.0)]
        );
    }

    #[test]
    fn its_coefficients_are_polyfit_s() {
        let coefficients = DistanceCurve::annex_b().unwrap().coefficients();
        // numpy.polyfit(px, cm, 5), lowest power first.
        let numpy = [
            385.732_285_139_007_56,
            -38.780_893_577_920_71,
            1.851_699_265_287_580_8,
            -0.045_089_032_485_976_43,
            0.000_530_249_517_667_109_7,
            -2.363_444_039_795_328e-6,
        ];
        for (ours, numpy) in coefficients.iter().zip(numpy) {
            assert!((ours / numpy - 1.0).abs() < 1e-9, "{coefficients:?}");
        }
    }

    #[test]
    fn it_says_nothing_outside_what_was_measured() {
        let curve = DistanceCurve::annex_b().unwrap();
        assert_eq!(curve.measured_px(), 11.0..=81.0);
        assert!(curve.distance_cm(11.0).is_some() && curve.distance_cm(81.0).is_some());
        assert_eq!(curve.distance_cm(10.99), None);
        assert_eq!(curve.distance_cm(81.01), None);
        assert_eq!(curve.distance_cm(f64::NAN), None);
    }

    #[test]
    fn six_distinct_disparities_are_needed() {
        let five: Vec<(f64, f64)> = (0..20).map(|i| (1.0, f64::from(i % 5))).collect();
        assert!(
            DistanceCurve::fit(&five)
                .unwrap_err()
                .to_string()
                .contains("got 5")
        );
        assert!(DistanceCurve::fit(&[]).is_err());
        assert!(DistanceCurve::fit(&[(f64::NAN, 1.0)]).is_err());
    }
}
