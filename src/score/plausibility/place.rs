//! The place and the moment of a truth: the images of a pair fit each other where it says, and not
//! clearly better where it would say as the depth of a camera elsewhere on the baseline, or where
//! the truth of another pair says.

use super::scale::sampled_places;
use std::collections::{BTreeMap, VecDeque};
use svl_core::doubt::{Doubt, Subject, TruthCure};
use svl_core::stereo::{
    Frame, Geometry, Gray, MapDensity, Plane, StereoPair, TruthKind, TruthOrigin,
};

/// Pixels of a truth that are looked at; of these, those whose surroundings are, and points that
/// are compared.
const LATTICE: f64 = 3000.0;
const MAX_TRIED: usize = 1500;
const MAX_POINTS: usize = 450;
const MIN_POINTS: u64 = 200;
/// Pairs that are compared: the first ones, as a run may be short, and then each a few after the
/// last.
const PAIRS: u64 = 24;
const FIRST_PAIRS: u64 = 8;
const EVERY: u64 = 5;
/// Places of a camera, quarters of the baseline to the right of the left one.
const QUARTERS: std::ops::RangeInclusive<i64> = -4..=6;
/// Offsets of disparities, pixels, which wrong principal points make.
const OFFSETS_PX: std::ops::RangeInclusive<i64> = -8..=8;
/// Time by which a truth may be of another pair.
const MOMENT_NS: u64 = 500_000_000;
/// Distance of a point from the edges of both images, and the least variance around it.
const MARGIN: usize = 4;
/// Pixels around a point, with it.
const PIXELS: f64 = 63.0;
const MIN_VARIANCE: f64 = 9.0;
/// Error of a point, of 63, below which images without noise say nothing: at the edges of what
/// hides it.
const MIN_ERROR: u64 = 3;
/// Another meaning is named if its errors are less than this fraction of those of the truth as
/// told, and in that fraction of the pairs whose errors differ by more than the last.
const MAX_RATIO: f64 = 0.88;
const MIN_BETTER: f64 = 0.8;
const DIFFERENT: f64 = 0.01;
/// Difference of ratios that tells no place from another.
const SAME_RATIO: f64 = 0.05;

/// Compares the images of the first pairs where their truth says that they match.
#[derive(Default)]
pub struct PlaceWatch {
    seen: u64,
    /// The truths within the time of a moment.
    truths: VecDeque<WatchedTruth>,
    /// Pairs for which later truths are still to come.
    pairs: VecDeque<WatchedPair>,
    compared: u64,
    errors: BTreeMap<Meaning, MeaningErrors>,
    baseline_m: Option<f64>,
    is_decided: bool,
}

/// Another meaning of a truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Meaning {
    /// It is that of a camera that number of quarters of the baseline to the right of the left one.
    Place(i64),
    /// It is that of a pair that number of pairs later.
    Moment(i64),
    /// Disparities are that number of pixels too small: no fault of place or moment.
    Offset(i64),
}

/// Sums of the errors of another meaning of the truth, and of the truth as told in these points.
#[derive(Default)]
struct MeaningErrors {
    own: u64,
    told: u64,
    /// Pairs in which it is clearly better or worse, and all.
    better: u64,
    worse: u64,
    pairs: u64,
    apart_s: f64,
}

struct WatchedTruth {
    number: u64,
    stamp_ns: u64,
    /// Disparities on the lattice.
    values: Vec<f32>,
}

struct WatchedPair {
    number: u64,
    stamp_ns: u64,
    images: StereoPair,
    points: Vec<WatchedPoint>,
}

/// A point that both images show by the truth as told.
struct WatchedPoint {
    /// Number of its place on the lattice.
    place: usize,
    at: (usize, usize),
    /// Surroundings of its left pixel.
    left: u64,
    /// Error of the truth as told.
    told: u64,
}

impl PlaceWatch {
    /// Adds a pair; the doubt once enough pairs were compared.
    pub fn take_in(&mut self, frame: &Frame) -> Option<Doubt> {
        let truth = frame.truth.as_ref().filter(|_| !self.is_decided)?;
        let is_rectified = matches!(frame.geometry, Geometry::Rectified(_));
        if !is_rectified || truth.disparity.size() != frame.pair.size() {
            return None;
        }
        let (number, stamp_ns) = (self.seen, frame.stamp_ns);
        self.seen += 1;
        self.baseline_m = frame.rig().map(|rig| rig.baseline_m());
        let is_near = |other_ns: u64| (1..=MOMENT_NS).contains(&other_ns.abs_diff(stamp_ns));
        self.truths.retain(|other| is_near(other.stamp_ns));
        self.pairs.retain(|pair| is_near(pair.stamp_ns));
        let places = sampled_places(frame.pair.size(), LATTICE);
        let truth_here = WatchedTruth {
            number,
            stamp_ns,
            values: places.map(|(x, y)| truth.disparity.get(x, y)).collect(),
        };
        for pair in &self.pairs {
            pair.compare_moment(&mut self.errors, &truth_here);
        }
        // Pairs without enough points prolong the search to that number.
        let is_past = number >= PAIRS * EVERY || self.compared == PAIRS;
        let is_compared = number < FIRST_PAIRS || number.is_multiple_of(EVERY);
        if is_compared && !is_past {
            let pair = WatchedPair::new(frame, &truth_here, &truth.disparity);
            self.compared += u64::from(pair.points.len() as u64 >= MIN_POINTS);
            if !is_projected(&truth.kind) {
                pair.compare_places(&mut self.errors, &truth_here);
            }
            pair.compare_offsets(&mut self.errors, &truth_here);
            for other in &self.truths {
                pair.compare_moment(&mut self.errors, other);
            }
            self.pairs.push_back(pair);
        }
        self.truths.push_back(truth_here);
        let is_enough = is_past && self.pairs.is_empty();
        is_enough.then(|| self.decide()).flatten()
    }

    /// The doubt about the truths of all pairs so far, once.
    pub fn decide(&mut self) -> Option<Doubt> {
        if std::mem::replace(&mut self.is_decided, true) {
            return None;
        }
        let named = self.errors.iter().filter(|(_, sums)| {
            let differ = (sums.better + sums.worse) as f64;
            let is_better = sums.better > 0 && sums.better as f64 >= MIN_BETTER * differ;
            is_better && 2 * sums.pairs >= self.compared && sums.ratio() < MAX_RATIO
        });
        let named: Vec<_> = named.collect();
        let best = named
            .iter()
            .min_by(|a, b| a.1.ratio().total_cmp(&b.1.ratio()))?;
        // The right camera is likelier than one beside it.
        let is_right = |own: &(&Meaning, &MeaningErrors)| {
            *own.0 == Meaning::Place(4) && own.1.ratio() <= best.1.ratio() + SAME_RATIO
        };
        let is_place = matches!(best.0, Meaning::Place(_));
        let right = named.iter().find(|own| is_place && is_right(own));
        let (meaning, sums) = right.unwrap_or(best);
        let ratio = sums.ratio();
        let cure = match **meaning {
            Meaning::Offset(_) => return None,
            Meaning::Moment(_) => TruthCure::Moment {
                ratio,
                apart_s: sums.apart_s / sums.pairs as f64,
            },
            Meaning::Place(quarters) => {
                let baselines = quarters as f64 / 4.0;
                TruthCure::Place {
                    ratio,
                    baselines,
                    aside_m: self.baseline_m.map(|m| m * baselines),
                }
            }
        };
        Some(cure.doubt(Subject::Truth, "differences", ratio, [MAX_RATIO, f64::MAX]))
    }
}

impl MeaningErrors {
    fn ratio(&self) -> f64 {
        self.own as f64 / self.told as f64
    }

    /// Adds the errors of a pair in `count` points.
    fn add(&mut self, [own, told]: [u64; 2], count: u64, apart_s: f64) {
        let [own, told] = [own, told].map(|error| error.max(MIN_ERROR * count));
        let differs = own.abs_diff(told) as f64 > DIFFERENT * told as f64;
        self.better += u64::from(differs && own < told);
        self.worse += u64::from(differs && own > told);
        self.own += own;
        self.told += told;
        self.pairs += 1;
        self.apart_s += apart_s;
    }
}

impl WatchedPair {
    fn new(frame: &Frame, truth: &WatchedTruth, map: &Plane<f32>) -> Self {
        let images = frame.pair.clone();
        let places = sampled_places(images.size(), LATTICE).zip(&truth.values);
        let known = places.enumerate().filter(|(_, (_, d))| d.is_finite());
        let known = thinned(known.collect(), MAX_TRIED);
        let nearest_px = known.iter().map(|(_, (_, d))| **d).fold(0.0, f32::max);
        let point = |(place, (at, d)): (usize, ((usize, usize), &f32))| {
            let left = textured(images.left(), at, 0.0)?;
            let right = census(images.right(), at, -d)?;
            let told = (left ^ right).count_ones().into();
            is_seen(map, at, nearest_px).then_some(WatchedPoint {
                place,
                at,
                left,
                told,
            })
        };
        let points = known.into_iter().filter_map(point).collect();
        Self {
            number: truth.number,
            stamp_ns: truth.stamp_ns,
            points: thinned(points, MAX_POINTS),
            images,
        }
    }

    /// Adds the errors of its truth as that of cameras elsewhere.
    fn compare_places(&self, errors: &mut BTreeMap<Meaning, MeaningErrors>, truth: &WatchedTruth) {
        for quarters in QUARTERS.filter(|quarters| *quarters != 0) {
            let aside = quarters as f32 / 4.0;
            self.compare(errors, Meaning::Place(quarters), 0.0, |point| {
                let d = truth.values[point.place];
                let right = census(self.images.right(), point.at, (aside - 1.0) * d)?;
                Some(right ^ textured(self.images.left(), point.at, aside * d)?)
            });
        }
    }

    /// Adds the errors of its truth with other disparities of infinity.
    fn compare_offsets(&self, errors: &mut BTreeMap<Meaning, MeaningErrors>, truth: &WatchedTruth) {
        for px in OFFSETS_PX.filter(|px| *px != 0) {
            self.compare(errors, Meaning::Offset(px), 0.0, |point| {
                let d = truth.values[point.place] + px as f32;
                Some(point.left ^ census(self.images.right(), point.at, -d)?)
            });
        }
    }

    /// Adds the errors of the truth of another pair.
    fn compare_moment(&self, errors: &mut BTreeMap<Meaning, MeaningErrors>, truth: &WatchedTruth) {
        let later = truth.number.cast_signed() - self.number.cast_signed();
        let apart_ns = truth.stamp_ns.cast_signed() - self.stamp_ns.cast_signed();
        let (meaning, apart_s) = (Meaning::Moment(later), apart_ns as f64 / 1e9);
        self.compare(errors, meaning, apart_s, |point| {
            let d = truth.values.get(point.place)?;
            Some(point.left ^ census(self.images.right(), point.at, -d)?)
        });
    }

    /// Adds the errors of a meaning, if it has enough points.
    fn compare(
        &self,
        errors: &mut BTreeMap<Meaning, MeaningErrors>,
        meaning: Meaning,
        apart_s: f64,
        differences: impl Fn(&WatchedPoint) -> Option<u64>,
    ) {
        let (mut own, mut told, mut count) = (0, 0, 0);
        for point in &self.points {
            if let Some(bits) = differences(point) {
                own += u64::from(bits.count_ones());
                (told, count) = (told + point.told, count + 1);
            }
        }
        if count >= MIN_POINTS {
            let sums = errors.entry(meaning).or_default();
            sums.add([own, told], count, apart_s);
        }
    }
}

/// True for the points of a topic, which were moved into the left camera; files have its pixels.
fn is_projected(kind: &TruthKind) -> bool {
    let is_topic = matches!(&kind.origin, TruthOrigin::Sensor(name) if !name.contains('*'));
    is_topic && kind.density == MapDensity::Sparse
}

/// At most that number of the items, all over them.
fn thinned<T>(items: Vec<T>, most: usize) -> Vec<T> {
    let step = items.len().div_ceil(most).max(1);
    items.into_iter().step_by(step).collect()
}

/// True if nothing of a truth hides a pixel from the right camera.
fn is_seen(truth: &Plane<f32>, (x, y): (usize, usize), nearest_px: f32) -> bool {
    let row = &truth.row(y)[x..];
    let nearer = |px: &f32| px - row[0];
    // An occluder is nearer by as many pixels as it is farther right.
    let reach = nearer(&nearest_px).max(0.0) as usize + 2;
    let hides =
        |(right, px): (usize, &f32)| nearer(px) > 1.0 && (nearer(px) - right as f32).abs() <= 1.0;
    !row.iter().take(reach).enumerate().any(hides)
}

/// The column of a pixel that is shifted, if all around it is in the image.
fn column(image: &Gray, (x, y): (usize, usize), shift_px: f32) -> Option<usize> {
    let (width, height) = image.size();
    let column = (x as f32 + shift_px).round();
    let is_inside = (MARGIN..height.saturating_sub(MARGIN)).contains(&y)
        && (MARGIN as f32..width.saturating_sub(MARGIN) as f32).contains(&column);
    is_inside.then_some(column as usize)
}

/// A bit for each of the 9 × 7 pixels around a shifted one, whether it is darker.
fn census(image: &Gray, at: (usize, usize), shift_px: f32) -> Option<u64> {
    let x = column(image, at, shift_px)?;
    let (middle, mut bits) = (image.get(x, at.1), 0);
    for row in at.1 - 3..=at.1 + 3 {
        for &value in &image.row(row)[x - 4..=x + 4] {
            bits = bits << 1 | u64::from(value < middle);
        }
    }
    Some(bits)
}

/// The same, where there is texture.
fn textured(image: &Gray, at: (usize, usize), shift_px: f32) -> Option<u64> {
    let x = column(image, at, shift_px)?;
    let (mut sum, mut squares) = (0, 0);
    for row in at.1 - 3..=at.1 + 3 {
        for value in &image.row(row)[x - 4..=x + 4] {
            sum += u32::from(*value);
            squares += u32::from(*value) * u32::from(*value);
        }
    }
    let mean = f64::from(sum) / PIXELS;
    let is_textured = f64::from(squares) / PIXELS - mean * mean > MIN_VARIANCE;
    is_textured.then(|| census(image, at, shift_px))?
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{Rig, Truth};

    const SIZE: (usize, usize) = (160, 60);

    /// Pairs at 20 Hz.
    #[derive(Clone, Copy, Debug, Default)]
    struct Scene {
        /// Pixels by which what is near moves from pair to pair.
        speed: i64,
        /// Every so manyth pixel of the right images is another.
        noise: usize,
        /// The truth is that of so many pairs later, and of a camera aside.
        later: i64,
        aside: f64,
        /// It knows only every so manyth pixel, as points.
        every: usize,
        /// Error of all disparities.
        offset_px: f32,
        are_pillars: bool,
    }

    /// Grey levels of a pattern that repeats nowhere.
    fn pattern(x: f64, y: usize, seed: u64) -> u8 {
        let x = (x.round() as i64).cast_unsigned();
        let mixed = (x ^ seed << 20).wrapping_mul(0x9E37_79B9_7F4A_7C15)
            ^ (y as u64).wrapping_mul(0xD1B5_4A32_D192_ED03);
        ((mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 56) as u8
    }

    impl Scene {
        /// Disparity at a column that a camera so far aside sees in the pair with that number: of
        /// hills, or of pillars before a wall.
        fn px(self, x: f64, aside: f64, number: i64) -> f64 {
            let moved = (self.speed * number) as f64;
            if self.are_pillars {
                let block = |x: f64| ((x.round() - moved) / 17.0).floor();
                let is_near = pattern(block(x + 16.0 * aside), 0, 7) < 100;
                return if is_near { 16.0 } else { 8.0 };
            }
            let hills = |x: f64| 10.0 + 6.0 * ((x - moved) / 15.0).sin();
            // The column of the left image that shows it.
            let left = (0..20).fold(x, |left, _| x + aside * hills(left));
            hills(left)
        }

        fn frame(self, number: i64) -> Frame {
            let left = Gray::from_fn(SIZE.0, SIZE.1, |x, y| pattern(x as f64, y, 1));
            let right = Gray::from_fn(SIZE.0, SIZE.1, |x, y| {
                let is_noise = self.noise > 0 && (7 * x + 13 * y).is_multiple_of(self.noise);
                let d = self.px(x as f64, 1.0, number);
                pattern(x as f64 + d, y, 1 + u64::from(is_noise))
            });
            let truth = Plane::from_fn(SIZE.0, SIZE.1, |x, y| {
                let is_known = (x + 3 * y).is_multiple_of(self.every.max(1));
                let px = self.px(x as f64, self.aside, number + self.later);
                if is_known { px as f32 } else { f32::INFINITY }
            });
            let mut truth = Truth::exact(truth.unwrap(), None);
            truth.disparity = truth.disparity.map(|d| d + self.offset_px);
            if self.every > 1 {
                truth.kind = TruthKind {
                    density: MapDensity::Sparse,
                    origin: TruthOrigin::Sensor("/points".to_owned()),
                };
            }
            let rig = Rig::new(100.0, (80.0, 60.0), 0.1, 0.0).unwrap();
            Frame {
                stamp_ns: 1_000_000_000 + 50_000_000 * number.cast_unsigned(),
                truth: Some(truth),
                ..Frame::new(
                    StereoPair::new(left.unwrap(), right.unwrap()).unwrap(),
                    Geometry::Rectified(Some(rig)),
                )
            }
        }

        fn named(self) -> Option<TruthCure> {
            let mut watch = PlaceWatch::default();
            for number in 0..16 {
                assert_eq!(watch.take_in(&self.frame(number)), None, "too early");
            }

            let doubt = watch.decide()?;
            assert!(doubt.value < doubt.usual[0] && watch.decide().is_none());
            match doubt.cure {
                svl_core::doubt::Cure::Truth(cure) => Some(cure),
                cure => panic!("{cure}"),
            }
        }
    }

    #[test]
    fn a_truth_that_is_right_is_not_doubted() {
        for (speed, noise) in [(0, 0), (0, 2), (1, 997), (5, 0), (8, 5)] {
            for (every, are_pillars) in [(1, false), (1, true), (2, true)] {
                let scene = Scene {
                    speed,
                    noise,
                    every,
                    are_pillars,
                    ..Scene::default()
                };
                assert_eq!(scene.named(), None, "{scene:?}");
            }
        }
    }

    #[test]
    fn a_truth_of_another_moment_is_named_with_its_time() {
        for (later, every) in [(2, 1), (-2, 1), (2, 2)] {
            let scene = Scene {
                speed: 8,
                noise: 23,
                later,
                every,
                ..Scene::default()
            };
            let Some(TruthCure::Moment { apart_s, .. }) = scene.named() else {
                panic!("no doubt");
            };
            // A truth seen later is ahead: that of earlier pairs explains the images.
            assert!((apart_s + 0.05 * later as f64).abs() < 1e-6, "{apart_s}");
        }
    }

    #[test]
    fn a_truth_of_another_camera_is_named_with_its_place() {
        for aside in [1.0, -1.0, 0.5] {
            let scene = Scene {
                noise: 23,
                aside,
                ..Scene::default()
            };
            let Some(TruthCure::Place { aside_m, .. }) = scene.named() else {
                panic!("no doubt");
            };
            assert!(
                (aside_m.unwrap() - 0.1 * aside).abs() < 1e-6,
                "{aside_m:?} {aside}"
            );
        }
        // Points were moved into the left camera.
        let points = Scene {
            aside: 1.0,
            every: 3,
            ..Scene::default()
        };
        assert_eq!(points.named(), None);
    }

    #[test]
    fn an_offset_is_no_fault_of_place_or_moment() {
        for offset_px in [4.0, -3.0] {
            let scene = Scene {
                speed: 3,
                noise: 23,
                offset_px,
                ..Scene::default()
            };
            assert_eq!(scene.named(), None, "{offset_px}");
        }
    }

    #[test]
    fn differences_of_images_without_noise_say_nothing() {
        let mut sums = MeaningErrors::default();
        sums.add([0, 800], 300, 0.0);
        assert_eq!((sums.ratio(), sums.better), (1.0, 0));
        sums.add([0, 3000], 300, 0.0);
        assert_eq!((sums.own, sums.told, sums.better), (1800, 3900, 1));
    }
}
