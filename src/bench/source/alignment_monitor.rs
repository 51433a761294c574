//! Monitors a source's pairs for vertical misalignment, and for images that are no pair.

use super::{Source, wraps};
use svl_core::Result;
use svl_core::counted;
use svl_core::rectify::{AlignmentMeter, RectificationMeter};
use svl_core::stereo::Frame;

/// A source that measures a few of its pairs, and warns once if they are vertically misaligned, or
/// if their images are turned, exchanged or of one camera.
pub struct AlignmentMonitor<'a> {
    source: Box<dyn Source + 'a>,
    meter: AlignmentMeter,
    taken: u64,
    measured: u64,
}

/// One in this many pairs is measured, up to this many in all: enough for a result, at little cost.
const EVERY: u64 = 8;
const MAX_MEASURED: u64 = 5;

impl<'a> AlignmentMonitor<'a> {
    pub fn new(source: Box<dyn Source + 'a>) -> Self {
        Self {
            source,
            meter: AlignmentMeter::new(),
            taken: 0,
            measured: 0,
        }
    }

    fn measure(&mut self, frame: Option<&Frame>) {
        let due = self.taken.is_multiple_of(EVERY) && self.measured < MAX_MEASURED;
        self.taken += 1;
        let last = match frame {
            Some(frame) if due => {
                self.meter.add(&frame.pair);
                self.measured += 1;
                self.measured == MAX_MEASURED
            }
            Some(_) => false,
            None => std::mem::replace(&mut self.measured, MAX_MEASURED) < MAX_MEASURED,
        };
        if last && let Some(doubt) = self.meter.doubt() {
            tracing::warn!("{}: {doubt}", self.source.name());
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
                "{}: vertical misalignment of {:.1} px (median of {} points in {}), which \
                 costs matches: {}; `svl calibrate check` shows more",
                self.source.name(),
                found.median_abs_px,
                found.matches,
                counted(found.pairs as u64, "pair"),
                misalignment_cure(&*self.source)
            );
        }
    }
}

/// The cure for vertical misalignment of the pairs that a source gives.
pub fn misalignment_cure(source: &dyn Source) -> &'static str {
    match source.rectification().map(RectificationMeter::doubt) {
        None => "rectify with --calib FILE",
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
