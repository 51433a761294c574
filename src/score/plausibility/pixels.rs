//! Pixels of a truth that cannot be: disparities beyond the image, distances that no camera sees,
//! zeros in place of none.

use super::unit::{likely, unit_cure};
use serde::Serialize;
use svl_core::doubt::{Baseline, Doubt, Reading, Subject, TruthCure};
use svl_core::statistics::{nearest_rank, upper_median};
use svl_core::stereo::{Frame, Plane, Rig, Truth};

/// Distances that a truth may have, metres.
const MIN_M: f64 = 0.001;
const MAX_M: f64 = 10_000.0;
/// Distances that a median probably has, metres.
const LIKELY_M: std::ops::RangeInclusive<f64> = 0.1..=300.0;
/// Baselines above this are rare, metres.
const LONG_BASELINE_M: f64 = 1.0;
/// A truth is impossible as a whole if its 90th percentile is: if more than this fraction of its
/// pixels is too near, or less is possible. Of distances beyond the image's width, the median
/// decides.
const TENTH: f64 = 0.1;
/// A truth whose farthest point has a disparity above this does not reach infinity: its zeros are
/// no measurements, pixels.
const FARTHEST_PX: f64 = 0.5;
/// A whole is not decided by fewer pixels.
const MIN_PIXELS: u64 = 10;

/// Result of the check of a pair's truth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PixelCheck {
    /// Known pixels before the check.
    pub known: u64,
    /// Pixels that are impossible, and removed.
    pub removed: u64,
    /// The doubt, if all of it is impossible.
    pub refusal: Option<Doubt>,
}

/// Position of a disparity among the possible ones.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    TooNear,
    /// Matches outside the right image, at a distance that another sensor may have measured.
    Outside,
    Possible,
    Infinite,
    TooFar,
    BeyondInfinity,
}

/// Removes the impossible pixels of a frame's truth, and says if all of it is impossible.
pub fn remove_impossible(frame: &mut Frame) -> PixelCheck {
    let (rig, width) = (frame.rig().copied(), frame.pair.size().0);
    let Some(truth) = &mut frame.truth else {
        return PixelCheck::default();
    };
    let places = Places {
        width,
        rig: rig.as_ref(),
    };
    let counts = places.count(&truth.disparity);
    let mut check = PixelCheck {
        known: counts.known + counts.infinite,
        removed: counts.removed(),
        refusal: None,
    };
    if let Some(fault) = counts.fault() {
        check.refusal = Some(places.refusal(truth, fault));
    }
    if check.removed == 0 {
        return check;
    }
    truth.disparity = truth.disparity.map(|d| {
        let is_kept = match places.place(d.into()) {
            Place::Possible | Place::Outside => true,
            Place::Infinite => !counts.are_zeros_none(),
            Place::TooNear | Place::TooFar | Place::BeyondInfinity => false,
        };
        if is_kept { d } else { f32::INFINITY }
    });
    check
}

/// Pixels of a truth, by their place.
#[derive(Default)]
struct Counts {
    /// All but those at infinity.
    known: u64,
    near: u64,
    outside: u64,
    far: u64,
    beyond: u64,
    infinite: u64,
    /// Disparity of the farthest one that is not at infinity.
    farthest_px: Option<f64>,
}

/// The fault of a whole truth.
#[derive(Clone, Copy, PartialEq)]
enum TruthFault {
    TooNear,
    TooFar,
    Negative,
}

impl Counts {
    /// Zeros beside nothing but near points are no sky.
    fn are_zeros_none(&self) -> bool {
        self.farthest_px.is_some_and(|px| px >= FARTHEST_PX)
    }

    fn removed(&self) -> u64 {
        let zeros = if self.are_zeros_none() {
            self.infinite
        } else {
            0
        };
        self.near + self.far + self.beyond + zeros
    }

    fn fault(&self) -> Option<TruthFault> {
        let tenth = self.known as f64 * TENTH;
        let possible = self.known - self.far - self.beyond;
        if self.known < MIN_PIXELS {
            None
        } else if self.near as f64 > tenth || 2 * (self.near + self.outside) > self.known {
            Some(TruthFault::TooNear)
        } else if (possible as f64) >= tenth {
            None
        } else if self.beyond > self.far {
            Some(TruthFault::Negative)
        } else {
            Some(TruthFault::TooFar)
        }
    }
}

/// The possible disparities of a pair.
struct Places<'a> {
    width: usize,
    rig: Option<&'a Rig>,
}

impl Places<'_> {
    fn place(&self, disparity: f64) -> Place {
        if !disparity.is_finite() {
            return Place::Possible;
        }
        let Some(rig) = self.rig else {
            return match disparity {
                d if d >= self.width as f64 => Place::TooNear,
                d if d <= -(self.width as f64) => Place::BeyondInfinity,
                0.0 => Place::Infinite,
                _ => Place::Possible,
            };
        };
        if (disparity + rig.doffs_px()).abs() <= Rig::INFINITE_PX {
            return Place::Infinite;
        }
        match rig.depth_m(disparity) {
            None => Place::BeyondInfinity,
            Some(z) if z < MIN_M => Place::TooNear,
            Some(_) if disparity >= self.width as f64 => Place::Outside,
            Some(z) if z > MAX_M => Place::TooFar,
            Some(_) => Place::Possible,
        }
    }

    /// Disparity of a point at infinity.
    fn infinite_px(&self) -> f64 {
        self.rig.map_or(0.0, |rig| -rig.doffs_px())
    }

    fn count(&self, disparity: &Plane<f32>) -> Counts {
        let (mut counts, infinite_px) = (Counts::default(), self.infinite_px());
        let known = || disparity.pixels().filter(|d| d.is_finite());
        // A place is a range of disparities, but for zeros without a rig: if both ends are
        // possible, all are.
        let ends = known().fold([f32::INFINITY, f32::NEG_INFINITY], |[least, most], d| {
            [least.min(d), most.max(d)]
        });
        let has_ranges = self.rig.is_some() || ends[0] > 0.0;
        if has_ranges && ends.map(|d| self.place(d.into())) == [Place::Possible; 2] {
            counts.known = known().count() as u64;
            return counts;
        }
        for d in known() {
            let d = f64::from(d);
            match self.place(d) {
                Place::Infinite => {
                    counts.infinite += 1;
                    continue;
                }
                Place::TooNear => counts.near += 1,
                Place::Outside => counts.outside += 1,
                Place::TooFar => counts.far += 1,
                Place::BeyondInfinity => counts.beyond += 1,
                Place::Possible => {}
            }
            counts.known += 1;
            let px = (d - infinite_px).abs();
            counts.farthest_px = Some(counts.farthest_px.map_or(px, |least| least.min(px)));
        }
        counts
    }

    /// The median and the 90th percentile of an impossible truth, with the likely unit.
    fn refusal(&self, truth: &Truth, fault: TruthFault) -> Doubt {
        let known = truth.disparity.pixels().map(f64::from);
        let is_known = |d: &f64| d.is_finite() && self.place(*d) != Place::Infinite;
        let mut sorted: Vec<_> = known.filter(is_known).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = |share| nearest_rank(&sorted, share).unwrap_or_default();
        let [median, near] = [0.5, 1.0 - TENTH].map(at);
        let origin = &truth.kind.origin;
        let limit_px = |z, other| self.rig.map_or(other, |rig| rig.disparity_px(z));
        let width = self.width as f64;
        let usual = [limit_px(MAX_M, 0.0), limit_px(MIN_M, width).min(width)];
        let px = [median, near][usize::from(fault == TruthFault::TooNear)];
        let doubt = |cure: TruthCure| cure.doubt(Subject::Truth, "disparity_px", px, usual);
        if fault == TruthFault::Negative {
            return doubt(TruthCure::Negative {
                origin: origin.clone(),
                median_px: median,
            });
        }
        let metres = |d: f64| self.rig.and_then(|rig| rig.depth_m(d));
        let reading = |px| Reading {
            px,
            metres: metres(px),
        };
        let likely = likely(origin, fault == TruthFault::TooFar, |factor| {
            let scaled = |d: f64| (d - self.infinite_px()) / factor + self.infinite_px();
            let is_likely = match self.rig {
                Some(_) => metres(scaled(median)).is_some_and(|z| LIKELY_M.contains(&z)),
                None => scaled(median) > FARTHEST_PX,
            };
            is_likely && scaled(near) < 0.5 * self.width as f64
        });
        doubt(TruthCure::Impossible {
            origin: origin.clone(),
            median: reading(median),
            near: reading(near),
            width_px: self.width,
            baseline: self.baseline_cure(median, near),
            unit: likely.map(|factor| unit_cure(origin, factor)),
        })
    }

    /// The likely baseline, where that of the rig is long and the distances are usual.
    fn baseline_cure(&self, median_px: f64, near_px: f64) -> Option<Baseline> {
        let rig = self.rig.filter(|rig| rig.baseline_m() > LONG_BASELINE_M)?;
        let is_usual = |z: f64| LIKELY_M.contains(&z);
        rig.depth_m(median_px).filter(|z| is_usual(*z))?;
        let mut units = [(100.0, "centimetres"), (1000.0, "millimetres")].into_iter();
        let (per_metre, unit) =
            units.find(|(factor, _)| near_px / factor < 0.5 * self.width as f64)?;
        Some(Baseline {
            metres: rig.baseline_m(),
            per_metre,
            unit: unit.to_owned(),
        })
    }
}

/// Least, middle and greatest of some values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    pub min: f64,
    pub median: f64,
    pub max: f64,
}

/// Collects the values of several pairs' truths.
#[derive(Default)]
pub struct TruthSpread {
    px: Option<(f64, f64)>,
    metres: Option<(f64, f64)>,
    /// Some of the values, for the medians.
    sampled_px: Vec<f64>,
    sampled_m: Vec<f64>,
}

impl TruthSpread {
    /// Values per pair that a median is made of.
    const SAMPLES: usize = 20_000;

    pub fn add(&mut self, frame: &Frame) {
        let Some(truth) = &frame.truth else { return };
        let known = || truth.disparity.pixels().filter(|d| d.is_finite());
        let step = known().count().div_ceil(Self::SAMPLES).max(1);
        let widen = |range: &mut Option<(f64, f64)>, value: f64| {
            let (min, max) = range.unwrap_or((value, value));
            *range = Some((min.min(value), max.max(value)));
        };
        for (i, d) in known().map(f64::from).enumerate() {
            let is_sampled = i % step == 0;
            widen(&mut self.px, d);
            self.sampled_px.extend(is_sampled.then_some(d));
            let rig = frame.rig();
            if let Some(z) = rig.and_then(|rig| rig.depth_m(d)).filter(|z| *z <= MAX_M) {
                widen(&mut self.metres, z);
                self.sampled_m.extend(is_sampled.then_some(z));
            }
        }
    }

    /// Disparities in pixels, and distances up to 10 km in metres.
    pub fn spreads(&self) -> [Option<Spread>; 2] {
        let spread = |range: Option<(f64, f64)>, sampled: &[f64]| {
            let (min, max) = range?;
            let median = upper_median(sampled.iter().copied())?;
            Some(Spread { min, median, max })
        };
        [
            spread(self.px, &self.sampled_px),
            spread(self.metres, &self.sampled_m),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::TruthOrigin;
    use svl_core::stereo::{Geometry, Gray, MapDensity, StereoPair};

    /// 40 pixels wide, with a focal length of 50 px and a baseline of 0.1 m.
    fn frame(disparities: &[f32], has_rig: bool) -> Frame {
        let (width, height) = (40, disparities.len().div_ceil(40));
        let mut values = disparities.to_vec();
        values.resize(width * height, f32::INFINITY);
        let image = Gray::filled(width, height, 0).unwrap();
        let rig = has_rig.then(|| Rig::new(50.0, (20.0, 12.0), 0.1, 0.0).unwrap());
        let disparity = Plane::from_vec(width, height, values).unwrap();
        Frame {
            truth: Some(Truth::measured(
                disparity,
                MapDensity::Dense,
                TruthOrigin::Sensor("d/*.png".to_owned()),
            )),
            ..Frame::new(
                StereoPair::new(image.clone(), image).unwrap(),
                Geometry::Rectified(rig),
            )
        }
    }

    fn checked(disparities: &[f32], has_rig: bool) -> (PixelCheck, Vec<f32>) {
        let mut frame = frame(disparities, has_rig);
        let check = remove_impossible(&mut frame);
        let refusal = &check.refusal;
        assert!(refusal.iter().all(Doubt::is_unusual), "{refusal:?}");
        let left = frame.truth.unwrap().disparity;
        (check, left.pixels().take(disparities.len()).collect())
    }

    #[test]
    fn single_impossible_pixels_are_removed() {
        let mut values = vec![5.0; 40];
        // Half a millimetre away; beyond infinity; 33 km away; one that another sensor may see.
        values[..4].copy_from_slice(&[9000.0, -1.0, 1.5e-4, 41.0]);
        let (check, left) = checked(&values, true);
        assert_eq!((check.known, check.removed, check.refusal), (40, 3, None));
        assert!(left[..3].iter().all(|d| d.is_infinite()));
        assert_eq!(left[3..5], [41.0, 5.0]);
        // Without a rig, a negative disparity may be one of a cropped image.
        let (check, left) = checked(&values, false);
        // Matches outside the right image are impossible.
        assert_eq!((check.removed, left[1], left[3]), (2, -1.0, f32::INFINITY));
    }

    #[test]
    fn zeros_are_none_where_nothing_is_far() {
        let mut values = vec![5.0; 40];
        values[0] = 0.0;
        for has_rig in [true, false] {
            let (check, left) = checked(&values, has_rig);
            assert_eq!((check.removed, left[0]), (1, f32::INFINITY));
        }
        // A plain that reaches the horizon has a sky.
        values[1] = 0.1;
        let (check, left) = checked(&values, true);
        assert_eq!((check.removed, left[0]), (0, 0.0));
        assert_eq!(checked(&[0.0; 40], true).0.removed, 0);
    }

    #[test]
    fn a_truth_of_another_unit_is_refused_with_the_likely_one() {
        let refusal = |d: f32| {
            checked(&[d; 40], true)
                .0
                .refusal
                .map_or(String::new(), |doubt| doubt.to_string())
        };
        // 1.6 m, read as millimetres of a file in metres.
        let words = refusal(3.125 * 1000.0);
        for part in [
            "median disparity is 3125 px (0.0016 m)",
            "40 px wide",
            "likely --truth 'd/*.png:unit=1', or the baseline is in millimetres",
        ] {
            assert!(words.contains(part), "{words}");
        }
        let words = refusal(5.0 / 20_000.0);
        assert!(words.contains("(20000 m)"), "{words}");
        assert!(
            words.contains("likely --truth 'd/*.png:unit=0.000001', or "),
            "{words}"
        );
        assert!(refusal(-3.0).contains("opposite sign"));
        let mut some_near = vec![5.0; 40];
        some_near[..6].fill(9000.0);
        let near = checked(&some_near, true).0.refusal.unwrap();
        assert_eq!((near.value, near.usual[1]), (9000.0, 40.0));
        assert_eq!(refusal(39.0) + &refusal(0.01), "");
        // A sky of more than half of the image, as some renderers write it.
        let mut values = vec![5.0 / 65_504.0; 40];
        values[..10].fill(5.0);
        let (check, _) = checked(&values, true);
        assert_eq!((check.removed, check.refusal), (30, None));
    }

    #[test]
    fn a_long_baseline_is_doubted_before_a_usual_truth() {
        let rig = Rig::new(50.0, (20.0, 12.0), 4.4, 0.0).unwrap();
        let mut frame = frame(&[110.0; 40], true);
        frame.geometry = Geometry::Rectified(Some(rig));
        let words = remove_impossible(&mut frame).refusal.unwrap().to_string();
        let likely = "likely a baseline of 0.044 m instead of 4.4 m, written in centimetres";
        assert!(words.contains(likely), "{words}");
    }

    #[test]
    fn the_spread_is_that_of_all_pairs() {
        let mut spread = TruthSpread::default();
        assert_eq!(spread.spreads(), [None, None]);
        spread.add(&frame(&[1.0, 2.0, 4.0], true));
        spread.add(&frame(&[5.0, 10.0], true));
        let [px, metres] = spread.spreads().map(Option::unwrap);
        assert_eq!([px.min, px.median, px.max], [1.0, 4.0, 10.0]);
        assert_eq!([metres.min, metres.median, metres.max], [0.5, 1.25, 5.0]);
    }
}
