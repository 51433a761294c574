//! KITTI 2015: D1, the outliers by more than 3 px and more than 5 % of the truth, for background,
//! foreground and all; over several images, the pixels of all are pooled rather than averaging
//! fractions.

use super::kitti::{KittiMaps, stored};
use super::numbers::{NumberUnit, Numbers, percent};
use super::{ProtocolImage, scored_pixels};
use std::ops::Add;
use svl_core::{Error, Result};

/// Regions: background, foreground, all.
const REGIONS: usize = 3;
const ALL: usize = 2;

/// Outliers and scored pixels by region. Counts of images add up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlierCounts {
    as_is: [Share; REGIONS],
    dense: [Share; REGIONS],
    estimated: [Share; REGIONS],
    /// Pixels with a disparity after densifying.
    filled: usize,
    /// True if there is an object map, without which there is no background either.
    regions_known: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Share {
    outliers: usize,
    pixels: usize,
}

/// True if `|e| > 3 px` and `|e| > 5 %` of the truth. As the C++ kit of the server, this divides in
/// single precision, whose twentieth is above 0.05: an error of exactly 5 % counts. The Matlab kit
/// does not count it.
fn is_outlier(truth: f32, d: f32) -> bool {
    let error = (d - truth).abs();
    error > 3.0 && f64::from(error / truth.abs()) > 0.05
}

impl OutlierCounts {
    pub(super) fn from_image(image: &ProtocolImage) -> Result<Self> {
        let KittiMaps { sparse, dense } = KittiMaps::new(image);
        let none = [Share::default(); REGIONS];
        let regions_known = image.foreground.is_some();
        let mut counts = Self {
            as_is: none,
            dense: none,
            estimated: none,
            filled: 0,
            regions_known,
        };
        for (x, y, truth) in scored_pixels(image.truth, image.mask) {
            // Without an object map all pixels count as background, which is then not reported.
            let region = usize::from(
                image
                    .foreground
                    .is_some_and(|foreground| foreground.get(x, y)),
            );
            let (d, filled) = (sparse.get(x, y), dense.get(x, y));
            counts.filled += usize::from(filled.is_finite());
            // Each pixel counts in its region and in all.
            for region in [region, ALL] {
                counts.as_is[region].count(is_outlier(truth, stored(d)));
                counts.dense[region].count(is_outlier(truth, stored(filled)));
                if d.is_finite() {
                    counts.estimated[region].count(is_outlier(truth, d));
                }
            }
        }
        match counts.as_is[ALL].pixels {
            0 => Err(Error::Invalid(
                "no pixel within the mask has a truth: nothing to score".into(),
            )),
            _ => Ok(counts),
        }
    }

    pub(super) fn numbers(&self) -> Numbers {
        let mut numbers = Numbers::default();
        let d1 =
            |numbers: &mut Numbers, names: [&'static str; REGIONS], shares: [Share; REGIONS]| {
                for (region, (name, share)) in names.into_iter().zip(shares).enumerate() {
                    let known = self.regions_known || region == ALL;
                    numbers.add(
                        name,
                        NumberUnit::Percent,
                        percent(share.outliers, share.pixels).filter(|_| known),
                    );
                }
            };
        let pixels = self.as_is[ALL].pixels;
        d1(&mut numbers, ["d1_bg", "d1_fg", "d1_all"], self.as_is);
        numbers.add_share("density", self.estimated[ALL].pixels, pixels);
        let dense = ["d1_bg_dense", "d1_fg_dense", "d1_all_dense"];
        d1(&mut numbers, dense, self.dense);
        numbers.add_share("density_dense", self.filled, pixels);
        let estimated = ["d1_bg_est", "d1_fg_est", "d1_all_est"];
        d1(&mut numbers, estimated, self.estimated);
        numbers.add("pixels", NumberUnit::Count, Some(pixels as f64));
        numbers
    }
}

impl Share {
    fn count(&mut self, outlier: bool) {
        self.pixels += 1;
        self.outliers += usize::from(outlier);
    }
}

impl Add for Share {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            outliers: self.outliers + other.outliers,
            pixels: self.pixels + other.pixels,
        }
    }
}

impl Add for OutlierCounts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let sum = |a: [Share; REGIONS], b: [Share; REGIONS]| {
            std::array::from_fn(|region| a[region] + b[region])
        };
        Self {
            as_is: sum(self.as_is, other.as_is),
            dense: sum(self.dense, other.dense),
            estimated: sum(self.estimated, other.estimated),
            filled: self.filled + other.filled,
            regions_known: self.regions_known && other.regions_known,
        }
    }
}
