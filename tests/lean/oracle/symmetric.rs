//! Oracles of v1 and v2.

use super::{Pixel, back_checked, by_pixel, refine};
use svl_core::stereo::{DisparityMap, Gray, Reason, StereoPair};

#[derive(Clone, Debug)]
pub(crate) struct Symmetric {
    pub(crate) min: i32,
    pub(crate) max: i32,
    pub(crate) smoothing_sigma: f64,
    pub(crate) filter: Filter,
    pub(crate) symmetry_tolerance: i32,
    pub(crate) subpixel: bool,
    pub(crate) back_check: bool,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Filter {
    V1 {
        uniqueness: f64,
    },
    V2 {
        texture_threshold: f64,
        spread_threshold: f64,
    },
}

impl Symmetric {
    /// The algorithm as on the command line.
    pub(crate) fn text(&self) -> String {
        let Self {
            min,
            max,
            smoothing_sigma,
            filter,
            symmetry_tolerance,
            subpixel,
            back_check,
        } = self;
        let (name, filter) = match filter {
            Filter::V1 { uniqueness } => ("v1", format!("uniqueness={uniqueness}")),
            Filter::V2 {
                texture_threshold,
                spread_threshold,
            } => (
                "v2",
                format!(
                    "texture_threshold={texture_threshold},spread_threshold={spread_threshold}"
                ),
            ),
        };
        format!(
            "{name}:min_disparity={min},max_disparity={max},smoothing_sigma={smoothing_sigma},\
             {filter},symmetry_tolerance={symmetry_tolerance},subpixel={subpixel},\
             back_check={back_check}"
        )
    }

    pub(crate) fn compute(&self, pair: &StereoPair) -> DisparityMap {
        by_pixel(pair, self.smoothing_sigma, |left, right, x, y| {
            self.pixel(left, right, x, y)
        })
    }

    fn pixel(&self, left: &Gray, right: &Gray, x: i32, y: usize) -> Pixel {
        let inside = |x: i32| x - 4 >= 0 && x + 4 < left.width() as i32;
        let at = |image: &Gray, x: i32| i64::from(image.get(x as usize, y));
        let ssd = |x: i32, d: i32| {
            (-4..=4)
                .map(|i| (at(left, x + i) - at(right, x + i - d)).pow(2))
                .sum::<i64>()
        };
        let cost = |x: i32, d: i32| ssd(x, d) * (25 + 4 * i64::from(d.abs()));

        let admissible: Vec<i32> = (self.min..=self.max)
            .filter(|d| inside(x) && inside(x - d))
            .collect();
        if admissible.is_empty() {
            return Err((Reason::Border, DisparityMap::NO_SSDPI));
        }
        if let Filter::V2 {
            texture_threshold, ..
        } = self.filter
        {
            let window: Vec<i64> = (-4..=4).map(|i| at(left, x + i)).collect();
            let (sum, squares) = (
                window.iter().sum::<i64>(),
                window.iter().map(|p| p * p).sum::<i64>(),
            );
            if ((9 * squares - sum * sum) as f64) < (9.0 * texture_threshold).powi(2) {
                return Err((Reason::Untextured, DisparityMap::NO_SSDPI));
            }
        }
        let winner = admissible
            .iter()
            .copied()
            .min_by_key(|&d| (cost(x, d), d))
            .unwrap();
        let (least, ssdpi) = (cost(x, winner), ssd(x, winner) as u32);
        let ambiguous = match self.filter {
            Filter::V1 { uniqueness } => {
                let rival = admissible
                    .iter()
                    .filter(|&d| (d - winner).abs() > 1)
                    .map(|&d| cost(x, d))
                    .min();
                rival.is_some_and(|rival| {
                    1000 * (rival - least) < (10.0 * uniqueness).round() as i64 * least
                })
            }
            Filter::V2 {
                spread_threshold, ..
            } => {
                let weight = |d: i32| ((least as f64 + 25.0) / (cost(x, d) as f64 + 25.0)).powi(2);
                let sum: f64 = admissible.iter().map(|&d| weight(d)).sum();
                let mean = admissible
                    .iter()
                    .map(|&d| weight(d) * f64::from(d))
                    .sum::<f64>()
                    / sum;
                let squares = admissible
                    .iter()
                    .map(|&d| weight(d) * (f64::from(d) - mean).powi(2))
                    .sum::<f64>();
                (squares / sum).sqrt() >= spread_threshold
            }
        };
        if ambiguous {
            return Err((Reason::Ambiguous, ssdpi));
        }
        let u = x - winner;
        let right_winner = (self.min..=self.max)
            .filter(|d| inside(u + d))
            .min_by_key(|&d| (cost(u + d, d), d))
            .unwrap();
        if (right_winner - winner).abs() > self.symmetry_tolerance {
            return Err((Reason::Inconsistent, ssdpi));
        }
        let refined = if self.subpixel {
            refine(winner, &admissible, |d| ssd(x, d))
        } else {
            winner as f32
        };
        Ok((back_checked(refined, self.back_check), ssdpi))
    }
}
