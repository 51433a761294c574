//! Stress: pairs perturbed in one known way, at several levels.
//!
//! Each perturbation has a formula and a unit, and is a pure function of pair, level and seed. None
//! changes the left image's geometry, so that a truth of the left image stays exact.

mod chance;
mod geometry;
mod light;
mod optics;

use chance::Chance;
use std::fmt::{Display, Formatter};
use std::str::FromStr;
use svl_core::stereo::{Gray, StereoPair};
use svl_core::{Error, Result, joined};

/// An entry of [`STRESSES`].
pub struct StressKind {
    pub name: &'static str,
    /// Effect, in words.
    pub summary: &'static str,
    /// Unit of its levels.
    pub unit: &'static str,
    /// Grey values v, in the left (l) and the right (r) image, at a level L.
    pub formula: &'static str,
    /// Default levels, from mild to severe.
    pub levels: &'static [f64],
    /// Least and largest level.
    pub range: (f64, f64),
    effect: StressEffect,
}

/// Inputs and function of a perturbation.
enum StressEffect {
    /// The pair alone.
    Pair(fn(&mut [Gray; 2], f64, &mut Chance)),
    /// The right image of a pair some frames earlier.
    EarlierRight,
}

/// All perturbations. A new one is its function and one entry here.
pub const STRESSES: &[StressKind] = &[
    StressKind {
        name: "row_offset",
        summary: "the right image is lower than the left, as after a drift of the calibration",
        unit: "px",
        formula: "r'(x, y) = r(x, y - L), bilinear, the border repeated",
        levels: &[0.25, 0.5, 1.0, 2.0, 4.0],
        range: (-50.0, 50.0),
        effect: StressEffect::Pair(geometry::row_offset),
    },
    StressKind {
        name: "roll",
        summary: "the right camera is rotated about its optical axis, clockwise",
        unit: "°",
        formula: "r'(p) = r(c + R(-L) (p - c)) about the centre c, bilinear",
        levels: &[0.1, 0.25, 0.5, 1.0, 2.0],
        range: (-20.0, 20.0),
        effect: StressEffect::Pair(geometry::roll),
    },
    StressKind {
        name: "gain",
        summary: "the right camera has more gain",
        unit: "dB",
        formula: "r' = min(255, r 10^(L/20))",
        levels: &[0.5, 1.0, 2.0, 4.0, 8.0],
        range: (-40.0, 40.0),
        effect: StressEffect::Pair(light::gain),
    },
    StressKind {
        name: "exposure",
        summary: "the right camera exposes for a shorter time, with the shot noise of less light",
        unit: "stops",
        formula: "r' = r 2^-L + N(0, (1 - 2^-L) r 2^-L 255 / 9000)",
        levels: &[0.25, 0.5, 1.0, 2.0, 3.0],
        range: (0.0, 10.0),
        effect: StressEffect::Pair(light::exposure),
    },
    StressKind {
        name: "noise",
        summary: "Gaussian noise in both images",
        unit: "grey levels",
        formula: "v' = v + N(0, L²), independent",
        levels: &[2.0, 4.0, 8.0, 16.0, 32.0],
        range: (0.0, 128.0),
        effect: StressEffect::Pair(light::noise),
    },
    StressKind {
        name: "dark",
        summary: "less light on both cameras, at the same gain: darker images with less contrast",
        unit: "stops",
        formula: "v' = v 2^-L + N(0, (1 - 2^-L) v 2^-L 255 / 9000)",
        levels: &[0.5, 1.0, 2.0, 3.0, 4.0],
        range: (0.0, 10.0),
        effect: StressEffect::Pair(light::dark),
    },
    StressKind {
        name: "low_light",
        summary: "less light on both cameras, compensated by gain: shot and read noise remain",
        unit: "stops",
        formula: "e = v 2^-L 9000 / 255; v' = 2^L 255 / 9000 (e + N(0, e + 25²))",
        levels: &[1.0, 2.0, 3.0, 4.0, 5.0],
        range: (0.0, 12.0),
        effect: StressEffect::Pair(light::low_light),
    },
    StressKind {
        name: "glare",
        summary: "a lamp shines into the right camera, at a place that depends on the seed",
        unit: "grey levels",
        formula: "r' = r + L exp(-ρ² / 2), ρ the distance in quarters of the width",
        levels: &[25.0, 50.0, 100.0, 150.0, 200.0],
        range: (0.0, 1000.0),
        effect: StressEffect::Pair(light::glare),
    },
    StressKind {
        name: "defocus",
        summary: "the right image is out of focus",
        unit: "px",
        formula: "r' = r * G(L), a Gaussian of standard deviation L",
        levels: &[0.5, 1.0, 1.5, 2.0, 3.0],
        range: (0.0, 20.0),
        effect: StressEffect::Pair(optics::defocus),
    },
    StressKind {
        name: "defocus_both",
        summary: "both images are out of focus",
        unit: "px",
        formula: "v' = v * G(L), a Gaussian of standard deviation L",
        levels: &[0.5, 1.0, 1.5, 2.0, 3.0],
        range: (0.0, 20.0),
        effect: StressEffect::Pair(optics::defocus_both),
    },
    StressKind {
        name: "motion_blur",
        summary: "both cameras yaw during the exposure",
        unit: "px",
        formula: "v'(x, y) = mean of v(x + u, y), u from -L / 2 to L / 2",
        levels: &[2.0, 4.0, 8.0, 12.0, 16.0],
        range: (0.0, 200.0),
        effect: StressEffect::Pair(optics::motion_blur),
    },
    StressKind {
        name: "dirt",
        summary: "a dark, blurred speck on the right lens, at a place that depends on the seed",
        unit: "% of the width",
        formula: "r' = r (1 - 0.8 s), s = 1 inside the diameter L, soft over a fifth of it",
        levels: &[5.0, 10.0, 20.0, 30.0, 40.0],
        range: (0.0, 100.0),
        effect: StressEffect::Pair(optics::dirt),
    },
    StressKind {
        name: "drop",
        summary: "a drop of water on the right lens, at a place that depends on the seed",
        unit: "% of the width",
        formula: "r' = r * G(L / 40 of the width) inside the diameter L, soft over a fifth of it",
        levels: &[5.0, 10.0, 20.0, 30.0, 40.0],
        range: (0.0, 100.0),
        effect: StressEffect::Pair(optics::drop_of_water),
    },
    StressKind {
        name: "jpeg",
        summary: "both images are compressed as JPEG and back",
        unit: "compression, 100 less the quality",
        formula: "v' = decode(encode(v, quality 100 - L))",
        levels: &[10.0, 30.0, 50.0, 70.0, 90.0],
        range: (0.0, 99.0),
        effect: StressEffect::Pair(optics::jpeg),
    },
    StressKind {
        name: "skew",
        summary: "the right image is that of an earlier pair, as from unsynchronized cameras",
        unit: "scored pairs",
        formula: "r'(t) = r(t - L), t counts the pairs that --every leaves; those without an \
                  earlier one are left out",
        levels: &[1.0, 2.0, 3.0],
        range: (1.0, 100.0),
        effect: StressEffect::EarlierRight,
    },
];

/// A perturbation at a level, written `row_offset=0.5`.
#[derive(Clone, Copy)]
pub struct Stress {
    kind: &'static StressKind,
    level: f64,
}

impl std::fmt::Debug for Stress {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{self}")
    }
}

impl PartialEq for Stress {
    fn eq(&self, other: &Self) -> bool {
        self.kind.name == other.kind.name && self.level == other.level
    }
}

impl Display for Stress {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.kind.name, self.level)
    }
}

impl FromStr for Stress {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (name, level) = text.split_once('=').unwrap_or((text, ""));
        let level = level.parse();
        let level = level.map_err(|_| Error::Usage(format!("'{text}': expected KIND=LEVEL")))?;
        Self::new(StressKind::find(name)?, level)
    }
}

impl StressKind {
    /// # Errors
    /// [`Error::Usage`] with the list of kinds.
    pub fn find(name: &str) -> Result<&'static Self> {
        let found = STRESSES.iter().find(|kind| kind.name == name);
        found.ok_or_else(|| {
            let names = joined(STRESSES.iter().map(|kind| kind.name));
            let expected = format!("expected one of {names}");
            Error::Usage(format!("stress '{name}': no such kind; {expected}"))
        })
    }
}

impl Stress {
    /// # Errors
    /// [`Error::Usage`] for a level out of range.
    pub fn new(kind: &'static StressKind, level: f64) -> Result<Self> {
        let (from, to) = kind.range;
        let is_whole = level.fract() == 0.0 || !matches!(kind.effect, StressEffect::EarlierRight);
        if !(from..=to).contains(&level) || !is_whole {
            let whole = match kind.effect {
                StressEffect::EarlierRight => "whole ",
                StressEffect::Pair(_) => "",
            };
            return Err(Error::Usage(format!(
                "stress {}={level}: expected {whole}{} within {from} ..= {to}",
                kind.name, kind.unit
            )));
        }
        Ok(Self { kind, level })
    }

    pub fn kind(&self) -> &'static StressKind {
        self.kind
    }

    pub fn level(&self) -> f64 {
        self.level
    }

    /// Number of frames by which the right image is earlier.
    pub fn earlier_frames(&self) -> usize {
        match self.kind.effect {
            StressEffect::EarlierRight => self.level as usize,
            StressEffect::Pair(_) => 0,
        }
    }

    /// The pair at that position of a run with that seed, perturbed.
    ///
    /// # Errors
    /// None: the images keep their size.
    pub fn apply(&self, pair: StereoPair, seed: u64, sequence: u64) -> Result<StereoPair> {
        let StressEffect::Pair(perturb) = self.kind.effect else {
            return Ok(pair);
        };
        let name = xxhash_rust::xxh3::xxh3_64(self.kind.name.as_bytes());
        let mut chance = Chance::new(name ^ seed.rotate_left(32), sequence);
        let mut images = pair.into_images();
        perturb(&mut images, self.level, &mut chance);
        let [left, right] = images;
        StereoPair::new(left, right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair() -> StereoPair {
        let mut random = fastrand::Rng::with_seed(7);
        let noise: Vec<u8> = (0..64 * 48).map(|_| random.u8(60..200)).collect();
        let left = Gray::from_vec(64, 48, noise).unwrap();
        StereoPair::new(left.clone(), left).unwrap()
    }

    #[test]
    fn every_kind_is_repeatable_and_changes_what_it_says() {
        for kind in STRESSES.iter().filter(|kind| kind.name != "skew") {
            let at = |level: f64| {
                let stress = Stress::new(kind, level).unwrap();
                stress.apply(pair(), 3, 5).unwrap()
            };
            let largest = *kind.levels.last().unwrap();
            assert_eq!(at(largest), at(largest), "{}", kind.name);
            assert_ne!(at(largest), pair(), "{}", kind.name);
            let mut levels = kind.levels.windows(2);
            assert!(levels.all(|pair| pair[0] < pair[1]), "{}", kind.name);
            // Only the right camera, unless the summary says both.
            let both = kind.summary.contains("both");
            assert_eq!(at(largest).left() != pair().left(), both, "{}", kind.name);
            // A mild level is closer to the original than a severe one.
            let distance = |level: f64| {
                let other = at(level);
                let pixels = other
                    .right()
                    .pixels()
                    .zip(pair().right().pixels().collect::<Vec<_>>());
                pixels.map(|(a, b)| u64::from(a.abs_diff(b))).sum::<u64>()
            };
            assert!(
                distance(kind.levels[0]) < distance(largest),
                "{}",
                kind.name
            );
        }
    }

    #[test]
    fn level_zero_changes_nothing() {
        for kind in STRESSES
            .iter()
            .filter(|kind| kind.range.0 <= 0.0 && kind.name != "jpeg")
        {
            let none = Stress::new(kind, 0.0).unwrap().apply(pair(), 3, 5).unwrap();
            if kind.name != "low_light" {
                assert_eq!(none, pair(), "{}", kind.name);
            }
        }
    }

    #[test]
    fn every_kind_is_documented() {
        let docs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/drive.md");
        // The published crate does not include docs/.
        let Ok(docs) = std::fs::read_to_string(docs) else {
            return;
        };
        for kind in STRESSES {
            assert!(docs.contains(&format!("`{}`", kind.name)), "{}", kind.name);
        }
    }

    #[test]
    fn a_whole_row_is_a_shift() {
        let shifted: Stress = "row_offset=2".parse().unwrap();
        let shifted = shifted.apply(pair(), 1, 1).unwrap();
        for y in 2..48 {
            assert_eq!(shifted.right().row(y), pair().right().row(y - 2));
        }
    }

    #[test]
    fn wrong_levels_are_named() {
        for (text, words) in [
            ("fog=1", "no such kind"),
            ("noise=-1", "expected grey levels within 0 ..= 128"),
            ("noise=x", "expected KIND=LEVEL"),
            ("skew=0.5", "expected whole scored pairs within 1 ..= 100"),
            ("skew=0", "expected whole scored pairs"),
            ("noise=NaN", "expected grey levels"),
        ] {
            let error = text.parse::<Stress>().unwrap_err().to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
