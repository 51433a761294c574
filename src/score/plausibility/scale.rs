//! A constant factor between a truth and every algorithm of a run, the sign of a wrong unit, or an
//! offset, that of wrong principal points.
//!
//! Algorithms err in many ways, but the disparities of a truth are not a multiple of theirs. v5
//! leaves unknown what it is not sure of: a truth that denies most of its cells is doubtful, too.

use super::unit::{disparity_cure, near, other_kind, times, unit_cure, unit_of_files};
use crate::judge::{Judged, JudgedEstimate, Verdict};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use svl_core::doubt::{Compared, Doubt, MapCure, Subject, TruthCure, usual, usual_within};
use svl_core::matcher::Algorithm;
use svl_core::statistics::{nearest_rank, upper_median};
use svl_core::stereo::{Frame, Plane, RecordedMap, Truth, TruthOrigin};

/// Frames of a run that are compared, and pixels of each.
pub const SCALE_FRAMES: u64 = 20;
pub(super) const PIXELS: f64 = 2000.0;
/// Disparities below this say little about a factor, pixels.
pub(super) const MIN_PX: f64 = 4.0;
/// An algorithm with fewer pixels is not asked.
pub(super) const MIN_PIXELS: usize = 200;
/// A factor is constant if it is that of half of the pixels, within this fraction.
const CONSTANT: f64 = 0.1;
/// Median error of a truth as depths from which on it may have distances along the rays.
const MIN_RAY_ERROR: f64 = 0.02;
/// The quantity that is constant for depths that are disparities, which none is.
const OFFSET: (&str, [f64; 2]) = ("offset_px", [-0.5, 0.5]);
const PER_PX: (&str, [f64; 2]) = ("metres_per_px", [0.0; 2]);
/// Pairs of points of which the slope of a line is the median.
const SLOPES: usize = 40_000;
/// Factors of disparities in place of which an offset may be meant.
const OFFSET_FACTORS: RangeInclusive<f64> = 0.1..=10.0;
/// Difference of a measured factor from a usual one that is likely meant.
const LIKELY_UNIT: f64 = 0.06;
/// Median errors along a line: less says nothing, and more is no line.
const MIN_REST_PX: f64 = 0.25;
const MAX_REST_PX: f64 = 1.5;
/// Factors of this range are errors of algorithms.
pub(super) const USUAL: [f64; 2] = [1.0 / 1.5, 1.5];
/// The algorithm whose known cells are hardly ever wrong, and the fewest of them that tell.
const SURE: &str = "v5";
const MIN_CELLS: u64 = 20;

/// Compares the truth of a run's first frames with the estimates of its algorithms.
#[derive(Default)]
pub struct TruthScales {
    frames: u64,
    origin: TruthOrigin,
    algorithms: BTreeMap<String, Ratios>,
}

/// Both disparities of an algorithm's pixels.
#[derive(Default)]
pub struct Ratios {
    /// Disparity of the truth divided by that of the algorithm: the factor that its distances lack.
    factors: Vec<f64>,
    /// Distance of the truth divided by the disparity of the algorithm: constant for depths that
    /// are disparities.
    inverse: Vec<f64>,
    /// The factors, if the truth measures along the rays.
    along_rays: Vec<f64>,
    /// Both disparities, in excess of those of infinity, where the algorithm searches the truth's,
    /// and where it does not: by the truth, these are no matches.
    within: Vec<[f64; 2]>,
    beyond: Vec<[f64; 2]>,
    /// The greatest disparity that the algorithm searches, if it is known.
    max_px: Option<f64>,
    /// Pixels that are those of a recorded map, by its source.
    recorded: BTreeMap<String, usize>,
    right: u64,
    wrong: u64,
}

impl TruthScales {
    pub fn observe(&mut self, judged: &Judged) {
        if self.frames == SCALE_FRAMES || judged.estimates.is_empty() {
            return;
        }
        self.frames += u64::from(judged.frame.truth.is_some());
        for scored in &judged.estimates {
            let estimate = &scored.estimate;
            let map = estimate.disparity.disparity();
            if let Some(ratios) = self.compare(&judged.frame, &estimate.algorithm, map) {
                ratios.count(scored);
            }
        }
    }

    /// Adds the disparities of an algorithm on a frame, if this has a truth.
    pub fn compare(&mut self, frame: &Frame, label: &str, map: &Plane<f32>) -> Option<&mut Ratios> {
        let truth = frame.truth.as_ref()?;
        self.origin = truth.kind.origin.clone();
        let ratios = self.algorithms.entry(label.to_owned());
        let ratios = ratios.or_insert_with_key(|label| Ratios::new(label));
        ratios.add(frame, truth, map);
        Some(ratios)
    }

    /// What was measured of each algorithm that has enough pixels.
    pub fn measured(&self) -> MeasuredScales {
        let asked = self.algorithms.iter().filter(|own| own.1.is_asked());
        let scale = |ratios: &Ratios| AlgorithmScale {
            factor: ratios.factor(),
            inverse: constant(&ratios.inverse),
            along_rays: ratios.along_rays(),
            recorded: ratios.recorded(),
            line: ScaleLine::new(&ratios.within),
            right: ratios.right,
            wrong: ratios.wrong,
        };
        MeasuredScales {
            origin: self.origin.clone(),
            algorithms: asked
                .map(|(label, ratios)| (label.clone(), scale(ratios)))
                .collect(),
        }
    }
}

/// The constant factors between a truth and the algorithms of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredScales {
    pub origin: TruthOrigin,
    pub algorithms: BTreeMap<String, AlgorithmScale>,
}

/// The factors of an algorithm, where they are constant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AlgorithmScale {
    /// Disparity of the truth divided by that of the algorithm: the factor that its distances lack.
    factor: Option<f64>,
    /// Distance of the truth divided by the disparity of the algorithm: constant for depths that
    /// are disparities.
    inverse: Option<f64>,
    /// Median error of the truth as depths, where it fits clearly better as distances along the
    /// rays.
    along_rays: Option<f64>,
    /// Source of a map of others, which may have a wrong unit as a truth may.
    recorded: Option<String>,
    /// The line through both disparities; none where none rises.
    line: Option<ScaleLine>,
    /// Cells, of all areas.
    right: u64,
    wrong: u64,
}

/// The line through the disparities of a truth over those of an algorithm, and what of it explains
/// the truth: a factor, an offset, both together, or each alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct ScaleLine {
    /// Median error along it, pixels.
    rest_px: f64,
    /// True if the disparities are equal but for that.
    is_equal: bool,
    factor: Option<f64>,
    offset_px: Option<f64>,
    is_either: bool,
}

impl ScaleLine {
    /// The line through disparities of the truth and of an algorithm; `None` where none rises.
    fn new(points: &[[f64; 2]]) -> Option<Self> {
        if points.len() < MIN_PIXELS {
            return None;
        }
        let rest_px = |s: f64, o: f64| rest_px(points, s, o);
        let slope = slope(points)?;
        let offset_px = median(points, |[d, e]| d - slope * e);
        let least_px = rest_px(slope, offset_px);
        let base_px = least_px.max(MIN_REST_PX);
        let is_line = least_px <= MAX_REST_PX;
        let is_equal = is_line && rest_px(1.0, 0.0) <= 2.0 * base_px + 2.0 * MIN_REST_PX;
        let line = |factor, offset_px, is_either| Self {
            rest_px: least_px,
            is_equal,
            factor,
            offset_px,
            is_either,
        };
        if is_equal || !is_line {
            return Some(line(None, None, false));
        }
        let fits = |s, o| rest_px(s, o) <= 1.5 * base_px + MIN_REST_PX;
        let [factor, px] = [
            median(points, |[d, e]| d / e),
            median(points, |[d, e]| d - e),
        ];
        let is_factor = fits(factor, 0.0);
        // Units differ by that, and principal points do not.
        let is_unit = is_factor && !OFFSET_FACTORS.contains(&factor);
        Some(match (is_factor, fits(1.0, px) && !is_unit) {
            (false, false) => line(Some(slope), Some(offset_px), false),
            (is_factor, is_offset) => line(
                is_factor.then_some(factor),
                is_offset.then_some(px),
                is_factor && is_offset,
            ),
        })
    }
}

fn median(points: &[[f64; 2]], value: impl Fn([f64; 2]) -> f64) -> f64 {
    upper_median(points.iter().copied().map(value)).unwrap_or_default()
}

/// Median error of the disparities `e` of an algorithm where the truth has `s · e + o`.
fn rest_px(points: &[[f64; 2]], s: f64, o: f64) -> f64 {
    median(points, |[d, e]| ((d - o) / s - e).abs())
}

/// The slope of the truth's disparities over the others: the median of many pairs of points; 1 for
/// those of one distance, of which a factor and an offset are the same. `None` if it falls.
fn slope(points: &[[f64; 2]]) -> Option<f64> {
    let mut sorted: Vec<_> = points.iter().map(|point| point[1]).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let at = |share| nearest_rank(&sorted, share);
    let (range, middle) = (at(0.9)? - at(0.1)?, at(0.5)?);
    if range < (0.2 * middle).max(MIN_PX) {
        return Some(1.0);
    }
    let mut random = fastrand::Rng::with_seed(1);
    let slopes = (0..SLOPES).filter_map(|_| {
        let [a, b] = [0; 2].map(|_| points[random.usize(..points.len())]);
        let is_apart = (a[1] - b[1]).abs() > (0.25 * range).max(2.0);
        is_apart.then(|| (a[0] - b[0]) / (a[1] - b[1]))
    });
    upper_median(slopes).filter(|slope| *slope > 0.0)
}

impl MeasuredScales {
    /// The origin of the truth and the scale of one algorithm, if it has one.
    pub fn for_label(&self, label: &str) -> Option<(TruthOrigin, AlgorithmScale)> {
        let scale = self.algorithms.get(label)?;
        Some((self.origin.clone(), scale.clone()))
    }

    /// The doubts about the truth or recorded maps, with the likely unit.
    pub fn doubts(&self) -> Vec<Doubt> {
        let algorithms = self.algorithms.clone().into_iter();
        let (recorded, matched): (BTreeMap<_, _>, BTreeMap<_, _>) =
            algorithms.partition(|(_, scale)| scale.recorded.is_some());
        // The images tell which of the two is wrong.
        let others = if matched.is_empty() {
            &recorded
        } else {
            &matched
        };
        let by = |algorithms: &BTreeMap<String, AlgorithmScale>| Self {
            origin: self.origin.clone(),
            algorithms: algorithms.clone(),
        };
        let by_which = match self.origin {
            TruthOrigin::Exact if matched.is_empty() => Some(Compared::Truth),
            TruthOrigin::Exact | TruthOrigin::Sensor(_) | TruthOrigin::Board(_) => None,
        };
        let by_others = Some(by(others)).filter(|_| by_which.is_none());
        let is_sensor = matches!(self.origin, TruthOrigin::Sensor(_));
        let sure = || Self::denied(&matched).filter(|_| is_sensor);
        if let Some(doubt) = by_others.and_then(|scales| scales.truth_doubt().or_else(sure)) {
            let subject = if matched.is_empty() {
                Subject::TruthOrMaps
            } else {
                Subject::Truth
            };
            return vec![Doubt { subject, ..doubt }];
        }
        let maps = recorded
            .iter()
            .filter(|_| by_which.is_some() || !matched.is_empty());
        let others = by_which.unwrap_or(Compared::TruthAndMatchers);
        maps.filter_map(|(label, scale)| scale.map_doubt(label, others))
            .collect()
    }

    /// The doubt about a truth that denies most cells of an algorithm that is rarely wrong.
    fn denied(matched: &BTreeMap<String, AlgorithmScale>) -> Option<Doubt> {
        let is_sure = |label: &&String| label.split(':').next() == Some(SURE);
        let label = matched.keys().find(is_sure)?;
        let &AlgorithmScale { right, wrong, .. } = &matched[label];
        let cells = right + wrong;
        (wrong > right && cells >= MIN_CELLS).then(|| {
            let cure = TruthCure::Denied {
                algorithm: label.clone(),
                wrong,
                cells,
            };
            let usual = [0.0, cells as f64 / 2.0];
            cure.doubt(Subject::Truth, "wrong_cells", wrong as f64, usual)
        })
    }

    /// The doubt about the truth, with the likely unit.
    fn truth_doubt(&self) -> Option<Doubt> {
        let of_all = |value: fn(&AlgorithmScale) -> Option<f64>| {
            let constants = self.algorithms.values().map(value);
            let constants = constants.collect::<Option<Vec<_>>>()?;
            let median = constant(&constants)?;
            let is_constant = constants.iter().all(|value| is_near(*value, median));
            is_constant.then_some(median)
        };
        let algorithms: Vec<_> = self.algorithms.keys().cloned().collect();
        let doubt = |(name, usual), value, cure: TruthCure| {
            Some(cure.doubt(Subject::Truth, name, value, usual))
        };
        let scale = ("scale", USUAL);
        let lines = || self.algorithms.values().filter_map(|own| own.line);
        let line = lines().min_by(|a, b| a.rest_px.total_cmp(&b.rest_px));
        let line = line.filter(|_| !lines().any(|line| line.is_equal));
        // A wall alone does not tell them apart: a unit that is in use is likelier.
        let is_unit = |line: &ScaleLine| {
            let factor = line.factor.filter(|_| line.is_either);
            factor.is_some_and(|factor| usual_within(factor, LIKELY_UNIT).is_some())
        };
        let line = line.filter(|line| !is_unit(line));
        if let Some(ScaleLine {
            factor,
            offset_px: Some(px),
            is_either,
            ..
        }) = line
        {
            let has_offset = |own: &AlgorithmScale| own.line.is_some_and(|l| l.offset_px.is_some());
            let algorithms = self.algorithms.iter().filter(|(_, own)| has_offset(own));
            let algorithms = algorithms.map(|(label, _)| label.clone()).collect();
            let cure = TruthCure::Offset {
                algorithms,
                px,
                factor,
                is_either,
            };
            return doubt(OFFSET, px, cure);
        }
        match of_all(|scale| scale.factor) {
            Some(factor) if factor < 0.0 => {
                doubt(scale, factor, TruthCure::OppositeSign { algorithms })
            }
            Some(factor) if (USUAL[0]..=USUAL[1]).contains(&factor) => {
                let errors = self.algorithms.values().map(|own| own.along_rays);
                let errors = errors.collect::<Option<Vec<_>>>()?;
                let error = errors.into_iter().reduce(f64::min)?;
                let as_depths = ("error_as_depths", [0.0, MIN_RAY_ERROR]);
                let doubt = doubt(as_depths, error, TruthCure::AlongRays { algorithms });
                doubt.filter(|_| matches!(self.origin, TruthOrigin::Sensor(_)))
            }
            // Cells that are right deny it: beyond an algorithm's range its pixels are wrong.
            Some(_) if self.algorithms.values().any(|own| own.right > own.wrong) => None,
            Some(factor) => {
                let cure = unit_cure(&self.origin, usual(factor));
                doubt(scale, factor, TruthCure::Unit { algorithms, cure })
            }
            None => {
                let TruthOrigin::Sensor(name) = &self.origin else {
                    return None;
                };
                let per_px = of_all(|scale| scale.inverse)?;
                let option = disparity_cure(name, per_px)?;
                let cure = TruthCure::Disparities { algorithms, option };
                doubt(PER_PX, per_px, cure)
            }
        }
    }
}

impl AlgorithmScale {
    /// The doubt about a recorded map, where others agree with the truth.
    fn map_doubt(&self, label: &str, other: Compared) -> Option<Doubt> {
        let doubt = |(name, usual), value, cure: MapCure| {
            Some(cure.doubt(Subject::Map(label.to_owned()), name, value, usual))
        };
        let of_files = self.recorded.as_deref().and_then(unit_of_files);
        let Some(measured) = self.factor else {
            let step = self.inverse?;
            let unit = of_files.map(|unit| other_kind(unit, step));
            let cure = unit.map_or(MapCure::Disparities, |unit| MapCure::Files { unit });
            return doubt(PER_PX, step, cure);
        };
        let factor = usual(measured);
        if (USUAL[0]..=USUAL[1]).contains(&factor.abs()) {
            return None;
        }
        let unit = of_files.map(|unit| near(times(unit, 1.0 / measured)));
        let cure = MapCure::Unit {
            factor,
            other,
            unit,
        };
        doubt(("scale", USUAL), measured, cure)
    }
}

impl Ratios {
    fn new(label: &str) -> Self {
        let algorithm = label.parse().ok();
        let max_px = algorithm.and_then(|own: Algorithm| own.max_disparity());
        Self {
            max_px: max_px.map(f64::from),
            ..Self::default()
        }
    }

    fn add(&mut self, frame: &Frame, truth: &Truth, map: &Plane<f32>) {
        let (width, height) = truth.disparity.size();
        if map.size() != (width, height) {
            return;
        }
        let maps = frame.maps.iter();
        let maps = maps.filter(|map| map.disparity.size() == (width, height));
        let maps: Vec<_> = maps.collect();
        let doffs_px = frame.rig().map_or(0.0, |rig| rig.doffs_px());
        for (x, y) in sampled_places((width, height), PIXELS) {
            let [true_px, px] = [truth.disparity.get(x, y), map.get(x, y)].map(f64::from);
            let same = |map: &&&RecordedMap| f64::from(map.disparity.get(x, y)) == px;
            let recorded = maps.iter().filter(same);
            let other_px = recorded.clone().next().map_or(px, |_| true_px);
            let least_px = px.max(other_px);
            if !true_px.is_finite() || !px.is_finite() || least_px < MIN_PX || px <= 0.0 {
                continue;
            }
            for map in recorded {
                *self.recorded.entry(map.source.clone()).or_default() += 1;
            }
            let factor = (true_px + doffs_px) / (px + doffs_px);
            self.factors.push(factor);
            let is_within = self.max_px.is_none_or(|max_px| true_px <= max_px);
            let points = if is_within {
                &mut self.within
            } else {
                &mut self.beyond
            };
            points.push([true_px + doffs_px, px + doffs_px]);
            self.along_rays.extend(frame.rig().map(|rig| {
                let (cx, cy) = rig.center_px();
                let f = rig.focal_px();
                let (u, v) = ((x as f64 - cx) / f, (y as f64 - cy) / f);
                factor * (1.0 + u * u + v * v).sqrt()
            }));
            let distance_m = frame.rig().and_then(|rig| rig.depth_m(true_px));
            self.inverse.extend(distance_m.map(|z| z / px));
        }
    }

    fn count(&mut self, scored: &JudgedEstimate) {
        for cell in scored.cells.iter().flatten() {
            self.right += u64::from(cell.verdict == Verdict::Right);
            self.wrong += u64::from(cell.verdict == Verdict::Wrong);
        }
    }

    /// The constant factor. Where the truth is beyond what the algorithm searches, as by a wrong
    /// unit, it has to be a usual one and to explain it clearly better than an offset, at which
    /// repeated patterns match.
    fn factor(&self) -> Option<f64> {
        let is_better = |factor: f64| {
            let px = median(&self.beyond, |[d, e]| d - e);
            let offset_px = rest_px(&self.beyond, 1.0, px);
            usual_within(factor, LIKELY_UNIT).is_some()
                && offset_px > MAX_REST_PX
                && rest_px(&self.beyond, factor, 0.0) < 0.5 * offset_px
        };
        let is_beyond = self.beyond.len() > self.within.len();
        constant(&self.factors).filter(|factor| !is_beyond || is_better(*factor))
    }

    /// Source of the map whose pixels are most of these.
    fn recorded(&self) -> Option<String> {
        let (source, pixels) = self.recorded.iter().max_by_key(|(_, pixels)| **pixels)?;
        (2 * pixels > self.factors.len()).then(|| source.clone())
    }

    /// See [`AlgorithmScale::along_rays`].
    fn along_rays(&self) -> Option<f64> {
        let error = |factors: &[f64]| upper_median(factors.iter().map(|f| (f - 1.0).abs()));
        let (depths, rays) = error(&self.factors).zip(error(&self.along_rays))?;
        (depths > MIN_RAY_ERROR && rays < 0.5 * depths).then_some(depths)
    }

    /// True for an algorithm with enough pixels that did not see the truth.
    fn is_asked(&self) -> bool {
        let copied = self.factors.iter().filter(|factor| **factor == 1.0);
        self.factors.len() >= MIN_PIXELS && 2 * copied.count() < self.factors.len()
    }
}

/// Places all over an image, row by row: about `pixels` of them.
pub fn sampled_places(
    (width, height): (usize, usize),
    pixels: f64,
) -> impl Iterator<Item = (usize, usize)> {
    let step = ((width * height) as f64 / pixels).sqrt().ceil().max(1.0) as usize;
    let rows = (step / 2..height).step_by(step);
    rows.flat_map(move |y| (step / 2..width).step_by(step).map(move |x| (x, y)))
}

/// The median, if half of the values are near it.
pub(super) fn constant(values: &[f64]) -> Option<f64> {
    let median = upper_median(values.iter().copied())?;
    let near = values.iter().filter(|value| is_near(**value, median));
    (median != 0.0 && 2 * near.count() >= values.len()).then_some(median)
}

fn is_near(value: f64, median: f64) -> bool {
    (value / median - 1.0).abs() <= CONSTANT
}

#[cfg(test)]
mod tests;
