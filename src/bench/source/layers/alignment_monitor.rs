//! Monitors a source's pairs for vertical misalignment, and for images that are no pair.

use crate::source::frames::{Source, wraps};
use std::ops::RangeInclusive;
use svl_core::doubt::Doubt;
use svl_core::rectify::{AlignmentMeter, RectificationMeter};
use svl_core::stereo::{Frame, Geometry, Rig, StereoPair};
use svl_core::{Error, Result};
use svl_recording::Selection;
use svl_recording::warn_of;

/// A source that measures a few of its pairs, and warns once if they are vertically misaligned, if
/// their images are turned, exchanged or one picture, or beyond the range that is searched.
pub struct AlignmentMonitor<'a> {
    source: Box<dyn Source + 'a>,
    meter: AlignmentMeter,
    /// The same of the left images with the right ones of the pair after, and of that before.
    apart: [AlignmentMeter; 2],
    /// The pair before the next one that is measured, and its time.
    before: Option<(StereoPair, u64)>,
    period_ns: u64,
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
            meter: AlignmentMeter::new(),
            apart: Default::default(),
            before: None,
            period_ns: 0,
            rig: None,
            range: lowest_px..=i32::MAX,
            taken: 0,
            measured: 0,
            is_over: false,
        }
    }

    /// True if the next pair is measured: one of a few, and all until they have enough points.
    fn is_due(&self) -> bool {
        !self.is_over && (!self.meter.is_enough() || self.taken.is_multiple_of(EVERY))
    }

    fn measure(&mut self, frame: Option<&Frame>) {
        let due = self.is_due();
        self.taken += 1;
        let last = match frame {
            // Raw pairs that are recorded are misaligned until they are rectified.
            Some(frame) if due && frame.geometry != Geometry::Raw => {
                self.meter.add(&frame.pair);
                self.measure_apart(frame);
                self.measured += 1;
                let most = if self.meter.is_enough() {
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
        self.before = frame
            .filter(|_| is_next_due)
            .map(|frame| (frame.pair.clone(), frame.stamp_ns));
        self.rig = self.rig.or_else(|| frame?.rig().copied());
        if last && let Some(doubt) = self.doubt() {
            warn_of(&self.source.name(), &doubt);
        }
        // That their rectification misaligns them is said.
        let doubt = self
            .source
            .rectification()
            .and_then(RectificationMeter::doubt);
        if last
            && doubt.is_none()
            && let Some(found) = self.meter.alignment().filter(|found| found.is_off())
        {
            tracing::warn!(
                "{}: {}, which costs matches: {}; `svl calibrate check` shows more",
                self.source.name(),
                found.words(),
                self.one_apart()
                    .unwrap_or_else(|| misalignment_cure(&*self.source).to_owned())
            );
        }
    }

    fn doubt(&self) -> Option<Doubt> {
        self.meter.doubt(self.rig.as_ref(), self.range.clone())
    }

    /// Measures the images of this pair with those of the one before, if pairs are misaligned.
    fn measure_apart(&mut self, frame: &Frame) {
        let is_off = self.meter.alignment().is_some_and(|found| found.is_off());
        let Some((before, stamp_ns)) = self.before.take().filter(|_| is_off) else {
            return;
        };
        self.period_ns = frame.stamp_ns.saturating_sub(stamp_ns);
        let both = [&before, &frame.pair];
        for (meter, [left, right]) in self.apart.iter_mut().zip([both, [both[1], both[0]]]) {
            let pair = StereoPair::new(left.left().clone(), right.right().clone());
            pair.iter().for_each(|pair| meter.add(pair));
        }
    }

    /// The cure, if the left images are aligned with the right ones of a pair after or before.
    fn one_apart(&self) -> Option<String> {
        let which = self
            .apart
            .iter()
            .position(|apart| apart.is_better_than(&self.meter))?;
        let (which, sign) = [("after", "-"), ("before", "")][which];
        Some(format!(
            "with the right image of the pair {which} they are aligned, so the cameras are a pair \
             apart, which `--right-offset-ms {sign}{:.1}` corrects in a recording of another \
             program",
            self.period_ns as f64 / 1e6
        ))
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
    if monitor.meter.alignment().is_none() && monitor.doubt().is_none() {
        let points = monitor.meter.matches().len();
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

/// The cure for vertical misalignment of the pairs that a source gives.
pub fn misalignment_cure(source: &dyn Source) -> &'static str {
    match source.rectification().map(RectificationMeter::doubt) {
        None => "rectify with --calib FILE, or synchronize the cameras if it comes with motion",
        Some(None) => {
            "the calibration is not, or no longer, that of these cameras: calibrate again"
        }
        Some(Some(_)) => "--calib none uses the images as they are",
    }
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
            assert_eq!(monitor.meter.is_enough(), has_texture && measured > 0);
        }
    }
}
