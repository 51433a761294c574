//! The metric protocols of the stereo benchmarks, each with its kit's own quirks, so that the
//! numbers equal the kit's.
//!
//! Disparities are in pixels, `+∞` if invalid. All fractions are percentages; a number whose
//! denominator is 0 is `None`, never 0.

mod densify;
mod error_map;
mod errors;
mod eth3d;
mod kitti;
mod kitti12;
mod kitti15;
mod middlebury;
mod numbers;

pub use densify::densify;
pub use numbers::{Number, NumberUnit, Numbers};

use super::disparity::scored_pixels;
use std::str::FromStr;
use svl_core::stereo::{Plane, Visibility};
use svl_core::{Error, Result, did_you_mean};

/// A benchmark's metric protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// Middlebury v3, the program `evaldisp` of its SDK.
    Middeval3,
    /// Middlebury v2, the scenes of 2001 and 2003 with their masks nonocc, all and disc.
    MiddleburyV2,
    /// ETH3D low-resolution two-view, its program `two-view-evaluation`.
    Eth3d,
    /// KITTI 2012, its development kit.
    Kitti12,
    /// KITTI 2015, its development kit.
    Kitti15,
}

/// One image to score. Mask and foreground have the truth's size; so does the estimate, except for
/// [`Protocol::Middeval3`].
#[derive(Clone, Copy, Debug)]
pub struct ProtocolImage<'a> {
    pub estimate: &'a Plane<f32>,
    pub truth: &'a Plane<f32>,
    /// Restricts the score to visible pixels.
    pub mask: Option<&'a Plane<Visibility>>,
    /// Moving objects, for KITTI 2015.
    pub foreground: Option<&'a Plane<bool>>,
    /// Largest disparity of the estimate, to which Middlebury v3 clips.
    pub max_disparity: Option<f32>,
}

/// A protocol's score of one image.
#[derive(Clone, Debug)]
pub enum Score {
    /// Averaged over images.
    Image(Numbers),
    /// Counted over all pixels of all images.
    Pooled(kitti15::OutlierCounts),
}

impl Protocol {
    pub const ALL: [Self; 5] = [
        Self::Middeval3,
        Self::MiddleburyV2,
        Self::Eth3d,
        Self::Kitti12,
        Self::Kitti15,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Middeval3 => "middeval3",
            Self::MiddleburyV2 => "middlebury-v2",
            Self::Eth3d => "eth3d",
            Self::Kitti12 => "kitti12",
            Self::Kitti15 => "kitti15",
        }
    }

    /// The scenes of the benchmark with known truth, and their weights in its averages; empty if
    /// all images have the same.
    pub fn scenes(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Middeval3 => middlebury::TRAINING,
            Self::MiddleburyV2 | Self::Eth3d | Self::Kitti12 | Self::Kitti15 => &[],
        }
    }

    /// Scores one image.
    ///
    /// # Errors
    /// [`Error::Invalid`] for sizes that do not match, and if no pixel has a truth.
    pub fn score(self, image: &ProtocolImage) -> Result<Score> {
        image.check(self)?;
        match self {
            Self::Middeval3 => middlebury::v3(image).map(Score::Image),
            Self::MiddleburyV2 => middlebury::v2(image).map(Score::Image),
            Self::Eth3d => eth3d::numbers(image).map(Score::Image),
            Self::Kitti12 => kitti12::numbers(image).map(Score::Image),
            Self::Kitti15 => kitti15::OutlierCounts::from_image(image).map(Score::Pooled),
        }
    }

    /// The errors in KITTI's colours as interleaved RGB of the truth's size, from dark blue over
    /// white at the threshold (3 px or 5 %) to dark red; dimmed outside the mask, black without
    /// truth, grey without an estimate.
    ///
    /// KITTI's protocols draw like their kit: the densified map, each pixel over its eight
    /// neighbours.
    ///
    /// # Errors
    /// [`Error::Invalid`] for sizes that do not match.
    pub fn error_map(self, image: &ProtocolImage) -> Result<Vec<u8>> {
        image.check(self)?;
        let (width, height) = image.truth.size();
        let plain = |estimate: &dyn Fn(usize, usize) -> f32| {
            // At the truth's size, as the protocol samples the estimate.
            let estimate = Plane::from_fn(width, height, estimate)?;
            Ok::<_, Error>(error_map::plain(&ProtocolImage {
                estimate: &estimate,
                ..*image
            }))
        };
        let rgb = match self {
            Self::Middeval3 => {
                let scale = middlebury::scale(image)?;
                plain(&|x, y| middlebury::estimate(image, scale, x, y))?
            }
            Self::Eth3d => plain(&|x, y| eth3d::estimate(image, x, y))?,
            Self::MiddleburyV2 => error_map::plain(image),
            Self::Kitti12 | Self::Kitti15 => error_map::kitti(image),
        };
        Ok(rgb.pixels().flatten().collect())
    }
}

impl FromStr for Protocol {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL
            .into_iter()
            .find(|protocol| protocol.name() == name)
            .ok_or_else(|| {
                let names = Self::ALL.map(Self::name);
                let meant = did_you_mean(name, names);
                Error::Invalid(format!(
                    "unknown protocol '{name}'{meant}; there are {}",
                    names.join(", ")
                ))
            })
    }
}

impl Score {
    pub fn numbers(&self) -> Numbers {
        match self {
            Self::Image(numbers) => numbers.clone(),
            Self::Pooled(counts) => counts.numbers(),
        }
    }

    /// One protocol's numbers over several images with their weights: KITTI 2015 pools the pixels
    /// of all, the others average.
    pub fn over(scores: &[(f64, Self)]) -> Numbers {
        let pooled = scores.iter().filter_map(|(_, score)| match score {
            Self::Pooled(counts) => Some(counts),
            Self::Image(_) => None,
        });
        // All scores are from one protocol, so either all are pooled or none.
        match pooled.copied().reduce(|a, b| a + b) {
            Some(counts) => counts.numbers(),
            None => {
                let weighted = scores
                    .iter()
                    .map(|(weight, score)| (*weight, score.numbers()));
                Numbers::mean(&weighted.collect::<Vec<_>>())
            }
        }
    }
}

impl ProtocolImage<'_> {
    fn check(&self, protocol: Protocol) -> Result<()> {
        let (width, height) = self.truth.size();
        let differs = |what: &str, (w, h): (usize, usize)| {
            Err(Error::Invalid(format!(
                "the {what} is {w}x{h}, the truth {width}x{height}: they must be of one size"
            )))
        };
        // evaldisp enlarges estimates of a half or a quarter of the size.
        if protocol != Protocol::Middeval3 && self.estimate.size() != (width, height) {
            return differs("estimate", self.estimate.size());
        }
        match (self.mask.map(Plane::size), self.foreground.map(Plane::size)) {
            (Some(size), _) if size != (width, height) => differs("mask", size),
            (_, Some(size)) if size != (width, height) => differs("object map", size),
            _ => Ok(()),
        }
    }
}
