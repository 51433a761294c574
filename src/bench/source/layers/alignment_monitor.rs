//! Monitors a source's pairs for vertical misalignment, and for images that are no pair.

use crate::source::frames::{Source, wraps};
use std::ops::RangeInclusive;
use svl_core::doubt::{AlignmentCure, Doubt};
use svl_core::rectify::{AlignmentMeter, RectificationMeter};
use svl_core::stereo::{Frame, Geometry, Rig, StereoPair};
use svl_core::{Error, Result};
use svl_recording::{Selection, warn_of};

/// A source that measures a few of its pairs, and warns once if they are vertically misaligned, if
/// their images are turned, exchanged or one picture, or beyond the range that is searched.
pub struct AlignmentMonitor<'a> {
    source: Box<dyn Source + 'a>,
    alignment: PairAlignment,
    rig: Option<Rig>,
    /// Disparities that all algorithms search, as far as that matters.
    range: RangeInclusive<i32>,
    taken: u64,
    measured: u64,
    /// True once all is measured and said.
    is_over: bool,
}

/// One in this many pairs is measured, up to this many in all: enough for a result, at little cost.
/// Odd, as faults of every second pair are measured, too.
const EVERY: u64 = 7;
const MAX_MEASURED: u64 = 5;
/// The same while they have too few points for a result.
const MAX_TRIED: u64 = 20;

impl<'a> AlignmentMonitor<'a> {
    pub fn new(source: Box<dyn Source + 'a>, lowest_px: i32) -> Self {
        Self {
            source,
            alignment: PairAlignment::default(),
            rig: None,
            range: lowest_px..=i32::MAX,
            taken: 0,
            measured: 0,
            is_over: false,
        }
    }

    /// True if the next pair is measured: one of a few, and all until they have enough points.
    fn is_due(&self) -> bool {
        !self.is_over && (!self.alignment.meter.is_enough() || self.taken.is_multiple_of(EVERY))
    }

    fn measure(&mut self, frame: Option<&Frame>) {
        let due = self.is_due();
        self.taken += 1;
        let last = match frame {
            // Raw pairs that are recorded are misaligned until they are rectified.
            Some(frame) if due && frame.geometry != Geometry::Raw => {
                self.alignment.add(frame);
                self.measured += 1;
                let most = if self.alignment.meter.is_enough() {
                    MAX_MEASURED
                } else {
                    MAX_TRIED
                };
                self.measured >= most
            }
            Some(_) => false,
            None => !self.is_over,
        };
        self.is_over |= last;
        let is_next_due = self.is_due();
        self.alignment.keep(frame.filter(|_| is_next_due));
        self.rig = self.rig.or_else(|| frame?.rig().copied());
        if last {
            // That their rectification misaligns them is said.
            let is_said = self.source.rectification();
            let is_said = is_said.is_some_and(|meter| meter.doubt().is_some());
            let misaligned = self.alignment.doubt(&*self.source).filter(|_| !is_said);
            for doubt in self.doubt().into_iter().chain(misaligned) {
                warn_of(&self.source.name(), &doubt);
            }
        }
    }

    fn doubt(&self) -> Option<Doubt> {
        let meter = &self.alignment.meter;
        meter.doubt(self.rig.as_ref(), self.range.clone())
    }
}

/// Measures the alignment of pairs, and finds its cure.
#[derive(Default)]
pub struct PairAlignment {
    pub meter: AlignmentMeter,
    /// The same of the left images with the right ones of the pair after, and of that before.
    apart: [AlignmentMeter; 2],
    /// The pair before the next one that is added, and its time.
    before: Option<(StereoPair, u64)>,
    period_ns: u64,
}

impl PairAlignment {
    /// Adds a pair; if pairs are misaligned, its images with those of the one before, too.
    pub fn add(&mut self, frame: &Frame) {
        self.meter.add(&frame.pair);
        let Some((before, stamp_ns)) = self.before.take().filter(|_| self.is_off()) else {
            return;
        };
        self.period_ns = frame.stamp_ns.saturating_sub(stamp_ns);
        let both = [&before, &frame.pair];
        for (meter, [left, right]) in self.apart.iter_mut().zip([both, [both[1], both[0]]]) {
            let pair = StereoPair::new(left.left().clone(), right.right().clone());
            pair.iter().for_each(|pair| meter.add(pair));
        }
    }

    /// Keeps the pair before the next one that is added.
    pub fn keep(&mut self, frame: Option<&Frame>) {
        self.before = frame.map(|frame| (frame.pair.clone(), frame.stamp_ns));
    }

    /// True if the pairs are misaligned.
    pub fn is_off(&self) -> bool {
        self.meter.alignment().is_some_and(|found| found.is_off())
    }

    /// The doubt about the pairs that a source gives, if they are misaligned: that about their
    /// rectification, if it is the cause.
    pub fn doubt(&self, source: &dyn Source) -> Option<Doubt> {
        let found = self.meter.alignment()?;
        let is_aligned = |apart: &AlignmentMeter| apart.is_better_than(&self.meter);
        let ms = self.period_ns as f64 / 1e6;
        let cure = match (
            self.apart.iter().position(is_aligned),
            source.rectification(),
        ) {
            (Some(which), _) => AlignmentCure::PairApart {
                right_ms: [-ms, ms][which],
            },
            (None, Some(_)) => AlignmentCure::Calibrate,
            (None, None) => AlignmentCure::Rectify,
        };
        let by_rectifying = source.rectification().and_then(RectificationMeter::doubt);
        by_rectifying.or_else(|| found.doubt(cure))
    }
}

/// The one pair of a source, with warnings of all that is off in it. `range`: the disparities that
/// are searched.
///
/// # Errors
/// The errors of the source.
pub fn only_pair(source: Box<dyn Source>, range: RangeInclusive<i32>) -> Result<Frame> {
    let mut monitor = AlignmentMonitor {
        range,
        ..AlignmentMonitor::new(source, 0)
    };
    let frame = monitor.next()?;
    let frame = frame.ok_or_else(|| Error::Invalid("there is no pair".to_owned()))?;
    monitor.next()?;
    let name = monitor.name();
    let meter = &monitor.alignment.meter;
    if meter.alignment().is_none() && monitor.doubt().is_none() {
        let points = meter.matches.len();
        tracing::warn!("{name}: alignment not measured ({points} points)");
    }
    let skew_ns = frame.exposure.skew_ns.unwrap_or_default();
    if skew_ns.unsigned_abs() > Selection::MAX_SKEW_NS {
        tracing::warn!(
            "{name}: the stamps in their names are {:.1} ms apart, so that what moves is matched \
             wrong: name images of one moment",
            skew_ns as f64 / 1e6
        );
    }
    Ok(frame)
}

impl Source for AlignmentMonitor<'_> {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        let frame = self.source.next()?;
        self.measure(frame.as_ref());
        Ok(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::frames::FromFn;
    use svl_core::stereo::Gray;

    #[test]
    fn cameras_a_pair_apart_are_named_with_the_offset_that_cures_them() {
        // Each pair is shifted vertically against the one before.
        let image = |x: usize, y: usize| {
            let mixed = ((((x / 9) << 32) | (y / 9)) as u64).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            ((mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB) >> 56) as u8
        };
        for (apart, right_ms) in [(0, None), (1, Some(100.0)), (-1, Some(-100.0))] {
            let mut alignment = PairAlignment::default();
            for i in 1..6_i32 {
                let moved = |d: usize, i: i32| {
                    let down = 6 * i as usize;
                    Gray::from_fn(320, 240, |x, y| image(x + d, y + down)).unwrap()
                };
                let pair = StereoPair::new(moved(0, i), moved(8, i + apart)).unwrap();
                let frame = Frame {
                    stamp_ns: i as u64 * 100_000_000,
                    ..Frame::new(pair, Geometry::Rectified(None))
                };
                alignment.add(&frame);
                alignment.keep(Some(&frame));
            }
            let doubt = alignment.doubt(&*pairs(true, Geometry::Rectified(None)));
            assert_eq!(doubt.is_some(), right_ms.is_some(), "{apart}");
            let (Some(doubt), Some(right_ms)) = (doubt, right_ms) else {
                continue;
            };
            assert!((doubt.value - 6.0).abs() < 0.2 && doubt.is_unusual());
            let cure = AlignmentCure::PairApart { right_ms };
            let json = serde_json::to_value(&doubt.cure).unwrap();
            assert_eq!(json["cure"], serde_json::to_value(cure).unwrap());
            let option = format!("`--right-offset-ms {right_ms:.1}`");
            assert!(doubt.to_string().contains(&option), "{doubt}");
        }
    }

    /// Pairs without texture, or of squares.
    fn pairs(has_texture: bool, geometry: Geometry) -> Box<dyn Source> {
        let mut taken = 0;
        Box::new(FromFn(move || {
            let mixed = |x: usize, y: usize| {
                let mixed = (((x / 9) << 32) | (y / 9)) as u64;
                let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
                ((mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB) >> 56) as u8
            };
            let grey = |x, y| if has_texture { mixed(x, y) } else { 90 };
            let image = |d: usize| Gray::from_fn(320, 240, |x, y| grey(x + d, y));
            taken += 1;
            let pair = StereoPair::new(image(0)?, image(8)?)?;
            Ok((taken <= 60).then(|| Frame::new(pair, geometry)))
        }))
    }

    #[test]
    fn pairs_are_measured_until_they_have_points_enough() {
        let rectified = Geometry::Rectified(None);
        for (has_texture, geometry, measured) in [
            (true, rectified, MAX_MEASURED),
            (false, rectified, MAX_TRIED),
            (true, Geometry::Raw, 0),
        ] {
            let mut monitor = AlignmentMonitor::new(pairs(has_texture, geometry), 0);
            while monitor.next().unwrap().is_some() {}
            assert_eq!(monitor.measured, measured);
            assert_eq!(
                monitor.alignment.meter.is_enough(),
                has_texture && measured > 0
            );
        }
    }
}
