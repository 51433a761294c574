//! Cameras and truths that are stuck: what they give repeats, while the images change.

use svl_core::doubt::{Doubt, PairCure, Repeated, Subject};
use svl_core::stereo::{Frame, Plane};
use svl_score::plausibility::sampled_places;

/// Pixels that are compared, and known ones of a truth at least.
const PIXELS: f64 = 2000.0;
const MIN_KNOWN: usize = 20;
/// Pairs in a row with equal pixels, beside images that change by that many grey levels in the
/// mean: noise changes them less.
const MIN_PAIRS: u64 = 10;
const MIN_CHANGE: f32 = 8.0;
/// Fraction of a truth's pixels that has its farthest distance, if that is a sensor's limit.
const MIN_FARTHEST: f64 = 0.05;

/// Watches for the parts of the pairs that repeat.
#[derive(Default)]
pub(crate) struct RepeatWatch {
    begin_ns: Option<u64>,
    /// Left images, right images, truths, and their farthest distances.
    runs: [Run; 4],
    /// The parts that were told.
    told: [bool; 4],
}

/// Pairs in a row with equal pixels.
#[derive(Default)]
struct Run {
    pixels: Vec<f32>,
    /// The image of the first pair that changes as well, and the time of that pair.
    other: Vec<f32>,
    since_ns: u64,
    pairs: u64,
}

impl RepeatWatch {
    /// Adds a pair; a part that repeats since some pairs, each once.
    pub(crate) fn take_in(&mut self, frame: &Frame) -> Option<Doubt> {
        let begin_ns = *self.begin_ns.get_or_insert(frame.stamp_ns);
        let images = [frame.pair.left(), frame.pair.right()];
        let [left, right] = images.map(|image| sampled(image, f32::from));
        let truth = frame.truth.as_ref();
        let truth = truth.map(|truth| sampled(&truth.disparity, |px| px));
        let truth = truth.filter(|px| known(px).count() > MIN_KNOWN);
        let farthest = truth.as_deref().and_then(farthest).map(|px| vec![px]);
        let parts = [
            (Some(left.clone()), &right),
            (Some(right.clone()), &left),
            (truth, &left),
            (farthest, &left),
        ];
        let mut stuck = None;
        for ((part, run), (pixels, other)) in
            Repeated::ALL.into_iter().zip(&mut self.runs).zip(parts)
        {
            let Some(pixels) = pixels else { continue };
            if run.pixels != pixels {
                let (other, since_ns, pairs) = (other.clone(), frame.stamp_ns, 0);
                *run = Run {
                    pixels,
                    other,
                    since_ns,
                    pairs,
                };
            }
            run.pairs += 1;
            let is_stuck = run.pairs >= MIN_PAIRS && is_changed(&run.other, other);
            let is_stuck = is_stuck && !self.told[part as usize];
            stuck = stuck.or(is_stuck.then_some((part, run.since_ns, run.pairs)));
        }
        let (part, since_ns, pairs) = stuck?;
        self.told[part as usize] = true;
        // The farthest distance of a truth that repeats does, too.
        self.told[Repeated::Farthest as usize] |= part == Repeated::Truth;
        let cure = PairCure::Repeated {
            part,
            pairs: MIN_PAIRS,
            seconds: since_ns.saturating_sub(begin_ns) as f64 / 1e9,
        };
        let usual = [1.0, MIN_PAIRS as f64 - 1.0];
        Some(cure.doubt(Subject::Pairs, "equal_pairs", pairs as f64, usual))
    }
}

/// Some pixels, all over a plane.
fn sampled<T: Copy>(plane: &Plane<T>, value: impl Fn(T) -> f32) -> Vec<f32> {
    let places = sampled_places(plane.size(), PIXELS);
    places.map(|(x, y)| value(plane.get(x, y))).collect()
}

fn known(disparities: &[f32]) -> impl Iterator<Item = f32> {
    disparities.iter().copied().filter(|px| px.is_finite())
}

/// The farthest disparity, if many pixels have it.
fn farthest(disparities: &[f32]) -> Option<f32> {
    let least = known(disparities).reduce(f32::min)?;
    let count = known(disparities).filter(|px| *px == least).count();
    (count as f64 > MIN_FARTHEST * known(disparities).count() as f64).then_some(least)
}

fn is_changed(before: &[f32], now: &[f32]) -> bool {
    let apart: f32 = before.iter().zip(now).map(|(a, b)| (a - b).abs()).sum();
    apart > MIN_CHANGE * before.len() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{Geometry, Gray, StereoPair, Truth};

    /// Words about 20 pairs, whose parts are those of the pair with the number that `chosen` gives.
    fn said(chosen: impl Fn(usize, u64) -> u64, limit: f32) -> String {
        let mut watch = RepeatWatch::default();
        let mut said = Vec::new();
        for i in 0..20 {
            let image = |part, scale| {
                let number = chosen(part, i) as usize;
                Gray::from_fn(40, 30, |x, y| {
                    (scale * (x * 7 + y * 13 + 31 * number)) as u8
                })
            };
            let pair = StereoPair::new(image(0, 1).unwrap(), image(1, 3).unwrap()).unwrap();
            let number = chosen(2, i) as usize;
            let px = |x: usize, y: usize| ((x + y + number) as f32).max(limit);
            let truth = Plane::from_fn(40, 30, px).unwrap();
            let frame = Frame {
                stamp_ns: i * 100_000_000,
                truth: Some(Truth::exact(truth, None)),
                ..Frame::new(pair, Geometry::Rectified(None))
            };
            said.extend(watch.take_in(&frame).map(|doubt| doubt.to_string()));
        }
        said.join(", ")
    }

    #[test]
    fn a_part_that_repeats_while_images_change_is_named_once() {
        let stuck =
            |which: usize, from| said(|part, i| if part == which { i.min(from) } else { i }, 0.0);
        assert_eq!(said(|_, i| i, 0.0), "");
        for (which, words) in [(0, "left images"), (1, "right images"), (2, "truth")] {
            let words = format!("the {words} ");
            let named = stuck(which, 5);
            assert_eq!(named.matches("the same").count(), 1, "{named}");
            assert!(
                named.starts_with(&words) && named.contains("`--to 0.500`"),
                "{named}"
            );
            assert!(stuck(which, 0).ends_with("record again"));
            assert_eq!(stuck(which, 12), "", "too few");
        }
        // A robot that stands.
        assert_eq!(said(|_, i| i.min(3), 0.0), "");
        let limit = said(|_, i| i, 35.0);
        assert!(limit.contains("the limit of a sensor"), "{limit}");
        // It hides no camera that is stuck.
        let both = said(|part, i| if part == 1 { i.min(5) } else { i }, 35.0);
        assert!(
            both.contains("the limit of a sensor") && both.contains("right images"),
            "{both}"
        );
    }
}
