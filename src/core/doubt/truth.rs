//! Causes of truths and maps that cannot be right, beside the images or beside each other.

use super::unit::{TruthUnit, UnitCure, UnitOption, rounded};
use super::{Doubt, Subject};
use crate::joined;
use crate::stereo::{Plane, TruthOrigin};
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display, Formatter};

causes! {
    /// A cause of a truth that cannot be right.
    TruthCure:

    Negative { origin: TruthOrigin, median_px: f64 } => (
        "the truth ({origin}) is impossible: its disparities are negative, the median \
         {median_px:.1} px: the opposite sign, or left and right are swapped")
    /// Distances are too near or too far.
    Impossible {
        origin: TruthOrigin, median: Reading, near: Reading, width_px: usize,
        baseline: Option<Baseline>, unit: Option<UnitCure>
    } => (
        "the truth ({origin}) is impossible: its median disparity is {median} and its 90th \
         percentile {near}, which is impossible in images {width_px} px wide and at 1 mm to 10 \
         km{}",
        cures(baseline.as_ref(), unit.as_ref()))
    /// An algorithm whose cells are hardly ever wrong contradicts it.
    Denied { algorithm: String, wrong: u64, cells: u64 } => (
        "{wrong} of {cells} cells that {algorithm} knows in the first pairs are wrong by it; the \
         truth, a calibration or the times may not belong to the images: svl info shows their \
         measurements")
    /// It fits as the depths of a camera elsewhere on the baseline.
    Place { ratio: f64, baselines: f64, aside_m: Option<f64> } => (
        "as depths of {} it explains the images better, with {ratio:.2} of the differences: name \
         the left camera's depths with --truth, or correct frame_id or /tf_static and record again",
        place_words(*baselines, *aside_m))
    /// It fits the images of another pair.
    Moment { ratio: f64, apart_s: f64 } => (
        "it is {:.3} s {} the images: that of {} pairs explains them better, with {ratio:.2} of \
         the differences: correct its stamps and record again",
        apart_s.abs(),
        if *apart_s > 0.0 { "behind" } else { "ahead of" },
        if *apart_s > 0.0 { "later" } else { "earlier" })
    /// The largest level surface is not the floor that is told.
    Floor { told_m: f64, fitted_m: f64, tilt_deg: f64, is_level: bool } => (
        "the floor is not {} m below the camera by the truth, whose largest level surface is \
         {fitted_m:.3} m below it, tilted by {tilt_deg:.1}° to the named plane, which is not used: \
         {}",
        rounded(*told_m),
        if *is_level {
            format!("likely --camera-height {}", rounded((1e3 * fitted_m).round() / 1e3))
        } else {
            "correct the transform from base_footprint to the camera in /tf_static, or add it, for \
             a tilted camera"
                .to_owned()
        })
    OppositeSign { algorithms: Vec<String> } => (
        "its disparities have the opposite sign of those of every algorithm ({}): left and right \
         may be swapped",
        joined(algorithms))
    AlongRays { algorithms: Vec<String> } => (
        "its distances are those of every algorithm ({}) along the rays, longer beside the middle: \
         publish depths, along the axis",
        joined(algorithms))
    Unit { algorithms: Vec<String>, cure: UnitCure } => (
        "its distances are {} times those of every algorithm ({}); {cure}",
        rounded(1.0 / cure.factor), joined(algorithms))
    /// Disparities have an offset, and `factor` besides or instead.
    Offset { algorithms: Vec<String>, px: f64, factor: Option<f64>, is_either: bool } => (
        "its disparities are {}: the principal points of one camera are wrong, or the cameras are \
         not synchronized{}: --calib FILE",
        offset_words(&joined(algorithms), *px, *factor, *is_either),
        if factor.is_some() { ", or the unit, image size or baseline is wrong" } else { "" })
    /// Values are disparities, and read as depths.
    Disparities { algorithms: Vec<String>, option: Option<UnitOption> } => (
        "its values are proportional to the disparities of every algorithm ({}), not to distances; \
         {}",
        joined(algorithms), option.as_ref().map_or(
            "likely disparities, which a topic has as stereo_msgs/DisparityImage".to_owned(),
            UnitOption::to_string
        ))
}

impl TruthCure {
    /// True if no pixel of the truth can be used.
    pub fn is_refusal(&self) -> bool {
        matches!(self, Self::Negative { .. } | Self::Impossible { .. })
    }
}

fn offset_words(algorithms: &str, px: f64, factor: Option<f64>, is_either: bool) -> String {
    let side = if px > 0.0 { "more" } else { "less" };
    let px = rounded((10.0 * px).round().abs() / 10.0);
    match (factor, is_either) {
        (Some(factor), true) => {
            format!("{factor:.2} times those of {algorithms}, or {px} px {side}")
        }
        (Some(factor), false) => {
            format!("{factor:.2} times those of {algorithms}, and {px} px {side}")
        }
        (None, _) => format!("{px} px {side} than those of {algorithms}"),
    }
}

fn place_words(baselines: f64, aside_m: Option<f64>) -> String {
    let side = if baselines > 0.0 { "right" } else { "left" };
    match aside_m {
        _ if baselines == 1.0 => "the right camera".to_owned(),
        Some(metres) => format!("a camera {:.3} m farther {side}", metres.abs()),
        None => format!(
            "a camera {} baselines farther {side}",
            rounded(baselines.abs())
        ),
    }
}

/// A disparity, and its distance if the rig is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    pub px: f64,
    pub metres: Option<f64>,
}

impl Display for Reading {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} px", rounded(self.px))?;
        match self.metres {
            Some(metres) => write!(f, " ({} m)", rounded(metres)),
            None => Ok(()),
        }
    }
}

/// A baseline that is likely of another unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Baseline {
    pub metres: f64,
    /// Units in a metre.
    pub per_metre: f64,
    /// Name of the unit.
    pub unit: String,
}

impl Display for Baseline {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "likely a baseline of {} m instead of {} m, written in {} where metres are expected: \
             --calib FILE",
            rounded(self.metres / self.per_metre),
            rounded(self.metres),
            self.unit
        )
    }
}

fn cures(baseline: Option<&Baseline>, unit: Option<&UnitCure>) -> String {
    match (baseline, unit) {
        (None, None) => String::new(),
        (Some(baseline), None) => format!("; {baseline}"),
        (None, Some(unit)) => format!("; {unit}"),
        (Some(baseline), Some(unit)) => format!("; {baseline}, or {unit}"),
    }
}

causes! {
    /// A cause of a map of disparities that cannot be right.
    MapCure:

    OppositeSign => (
        "its disparities are negative, of the opposite sign: multiply them by -1")
    Scaled { factor: f64 } => (
        "its disparities are {} times those of the truth: --estimate-scale is the factor of \
         integers (OpenCV's matchers: 16), floats have to be divided by it",
        rounded(*factor))
    Depths => (
        "its values are proportional to distances: depths, not disparities")
    RightView => (
        "it fits the truth as the map of the right view")
    /// It fits as files of another unit.
    Files { unit: TruthUnit } => (
        "its values fit as files:PATTERN,{unit}")
    Disparities => (
        "its distances are proportional to disparities: they are disparities, likely, which a \
         stereo_msgs/DisparityImage says")
    Unit { factor: f64, other: Compared, unit: Option<TruthUnit> } => (
        "its distances are {} times those of {other}; {}",
        rounded(*factor), unit_words(*factor, unit.as_ref()))
}

/// True if three of four values are such, and not all of one value, a code for unknown.
pub fn are_most(map: &Plane<f32>, is_such: impl Fn(f32) -> bool) -> bool {
    let known = || map.pixels().filter(|d| d.is_finite() && *d != 0.0);
    let such = || known().filter(|d| is_such(*d));
    let are_several = such()
        .next()
        .is_some_and(|first| such().any(|d| d != first));
    are_several && 4 * such().count() >= 3 * known().count()
}

/// The distances that a map is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Compared {
    Truth,
    TruthAndMatchers,
}

impl Display for Compared {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Truth => "the truth",
            Self::TruthAndMatchers => "the truth and of the matchers",
        })
    }
}

fn unit_words(factor: f64, unit: Option<&TruthUnit>) -> String {
    match unit {
        Some(unit) => format!("likely files:PATTERN,{unit}"),
        None if factor == 1000.0 => "likely in millimetres where floats are metres".to_owned(),
        None => "likely another unit, or its f or T is of another image size".to_owned(),
    }
}
