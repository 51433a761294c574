//! Pairs that somebody keeps an eye on.

use super::Source;
use crate::error::Result;
use crate::rectify::AlignmentMeter;
use crate::stereo::{Frame, Losses};

/// A source that looks at a few of its pairs, and warns once when their rows are apart.
pub struct Watched<'a> {
    source: &'a mut dyn Source,
    meter: AlignmentMeter,
    taken: u64,
    looks: u64,
}

/// Every so many pairs one is looked at, so many in all: enough to see something, few enough to
/// cost little.
const EVERY: u64 = 8;
const LOOKS: u64 = 5;

impl<'a> Watched<'a> {
    pub fn new(source: &'a mut dyn Source) -> Self {
        Self {
            source,
            meter: AlignmentMeter::new(),
            taken: 0,
            looks: 0,
        }
    }

    fn look(&mut self, frame: Option<&Frame>) {
        let due = self.taken.is_multiple_of(EVERY) && self.looks < LOOKS;
        self.taken += 1;
        let last = match frame {
            Some(frame) if due => {
                self.meter.add(&frame.pair);
                self.looks += 1;
                self.looks == LOOKS
            }
            Some(_) => false,
            None => std::mem::replace(&mut self.looks, LOOKS) < LOOKS,
        };
        if last && let Some(found) = self.meter.alignment().filter(|found| found.is_off()) {
            tracing::warn!(
                "{}: rows of left and right are {:.1} px apart (median of {} points in {} pairs), \
                 which costs matches: rectify with --calib; `svl calibrate check` says more",
                self.source.name(),
                found.median_abs_px,
                found.matches,
                found.pairs
            );
        }
    }
}

impl Source for Watched<'_> {
    fn name(&self) -> String {
        self.source.name()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let frame = self.source.next()?;
        self.look(frame.as_ref());
        Ok(frame)
    }

    fn pairs(&self) -> Option<u64> {
        self.source.pairs()
    }

    fn finish(&mut self, taken: u64) -> Losses {
        self.source.finish(taken)
    }
}
