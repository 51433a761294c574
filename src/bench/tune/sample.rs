//! Frames spread over a source, kept in memory, and the runs of algorithms over them.

use crate::pass::{Matchers, Monitor, Pace, run};
use crate::sink::{PassStart, Sink};
use crate::source::{Chain, Source};
use std::sync::Arc;
use svl_core::stereo::Frame;
use svl_core::{Error, Result};

/// Frames that cannot be read, one after the other, after which a source is given up.
const MAX_UNREADABLE: u64 = 16;

/// Reads frames that are spread evenly over a source, a step at a time.
pub struct Sampler {
    source: Box<dyn Source>,
    /// Number of frames wanted, as far as there is memory for them.
    wanted: u64,
    limit_bytes: usize,
    /// Number of frames that the source has, where that is known.
    count: Option<u64>,
    /// Index of the frame that the source gives next.
    next: u64,
    /// One of this number is kept where the count is not known.
    stride: u64,
    /// The frames so far, in their order; all of them once [`Sampler::step`] returns false.
    pub frames: Vec<Arc<Frame>>,
    done: bool,
}

impl Sampler {
    /// At most `wanted` frames that take at most `limit_bytes`, but at least one.
    pub fn new(source: Box<dyn Source>, wanted: usize, limit_bytes: usize) -> Self {
        Self {
            count: source.pairs(),
            source,
            wanted: wanted.max(1) as u64,
            limit_bytes,
            next: 0,
            stride: 1,
            frames: Vec::new(),
            done: false,
        }
    }

    /// Reads a frame; false when there is nothing more to read. A frame that cannot be read is
    /// skipped.
    ///
    /// # Errors
    /// The error that ended the source early; the frames before it are kept.
    pub fn step(&mut self) -> Result<bool> {
        if self.done {
            return Ok(false);
        }
        let read = self.read();
        let is_first = self.frames.is_empty();
        match read {
            Ok(goes_on) => self.done = !goes_on,
            Err(error) => {
                let is_damaged = matches!(error, Error::Damaged { .. });
                self.done = is_damaged || is_first && self.next > MAX_UNREADABLE;
                if self.done && is_first {
                    return Err(error);
                }
            }
        }
        Ok(!self.done)
    }

    /// Reads on to the next of the frames that are wanted.
    fn read(&mut self) -> Result<bool> {
        let index = match self.count.map(|count| (count, self.wanted.min(count))) {
            None => Some(self.next.next_multiple_of(self.stride)),
            Some((count, wanted)) => {
                let mut spread = (0..wanted).map(|i| i * count / wanted);
                // The first of those that are still to come: others may not have been readable.
                spread.find(|index| *index >= self.next)
            }
        };
        let Some(index) = index else {
            return Ok(false);
        };
        if index > self.next && self.count.is_some() && self.source.seek(index)? {
            self.next = index;
        }
        let is_wanted = self.next == index;
        self.next += 1;
        let Some(frame) = self.source.next()? else {
            return Ok(false);
        };
        if is_wanted {
            self.keep(frame);
        }
        Ok(true)
    }

    /// Keeps a frame. When there are too many, every second one is dropped.
    fn keep(&mut self, frame: Frame) {
        if self.frames.is_empty() {
            let fits = self.limit_bytes / frame.memory_bytes().max(1);
            self.wanted = self.wanted.min(fits as u64).max(1);
        }
        self.frames.push(Arc::new(frame));
        if self.frames.len() as u64 > self.wanted {
            let frames = std::mem::take(&mut self.frames);
            self.frames = frames.into_iter().step_by(2).collect();
            self.stride *= 2;
        }
    }
}

/// Frames in memory as a source.
struct HeldFrames<'a>(std::slice::Iter<'a, Arc<Frame>>);

impl Source for HeldFrames<'_> {
    fn name(&self) -> String {
        "sample".into()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        Ok(self.0.next().map(|frame| Frame::clone(frame)))
    }

    fn pairs(&self) -> Option<u64> {
        Some(self.0.len() as u64)
    }
}

/// Runs frames through the algorithms into the sinks.
///
/// # Errors
/// The errors of [`run`].
pub fn evaluate(
    frames: &[Arc<Frame>],
    matchers: &mut Matchers,
    start: &PassStart<'_>,
    pace: Pace,
    sinks: &mut [Box<dyn Sink>],
    monitor: &mut dyn Monitor,
) -> Result<()> {
    let held = HeldFrames(frames.iter());
    let mut source = Chain::for_matching(None).over(Box::new(held))?;
    run(&mut *source, matchers, start, pace, sinks, monitor).1
}

/// `0..count`, so that the first of them are spread over all: by the bits of the index, mirrored.
pub fn spread_order(count: usize) -> Vec<usize> {
    let bits = count.next_power_of_two().ilog2();
    let mirrored = |i: usize| i.reverse_bits().unbounded_shr(usize::BITS - bits);
    let all = (0..count.next_power_of_two()).map(mirrored);
    all.filter(|i| *i < count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{Geometry, Gray, StereoPair};

    struct Numbered {
        next: u64,
        count: u64,
        seeks: bool,
        counted: bool,
    }

    impl Source for Numbered {
        fn name(&self) -> String {
            "numbered".into()
        }

        fn next(&mut self) -> Result<Option<Frame>> {
            let sequence = self.next;
            self.next += 1;
            if sequence >= self.count {
                return Ok(None);
            }
            if sequence == 7 {
                return Err(Error::Invalid("frame 7 is a cat".into()));
            }
            let image = Gray::filled(10, 10, 0)?;
            Ok(Some(Frame {
                sequence,
                ..Frame::new(StereoPair::new(image.clone(), image)?, Geometry::Raw)
            }))
        }

        fn pairs(&self) -> Option<u64> {
            self.counted.then_some(self.count)
        }

        fn seek(&mut self, index: u64) -> Result<bool> {
            self.next = if self.seeks { index } else { self.next };
            Ok(self.seeks)
        }
    }

    fn sampled(count: u64, seeks: bool, counted: bool, wanted: usize, limit: usize) -> Vec<u64> {
        let source = Box::new(Numbered {
            next: 0,
            count,
            seeks,
            counted,
        });
        let mut sampler = Sampler::new(source, wanted, limit);
        while sampler.step().unwrap() {}
        let frames = sampler.frames.iter();
        frames.map(|frame| frame.sequence).collect()
    }

    #[test]
    fn the_first_of_the_order_are_spread() {
        assert_eq!(spread_order(8), [0, 4, 2, 6, 1, 5, 3, 7]);
        assert_eq!(spread_order(5), [0, 4, 2, 1, 3]);
        assert_eq!(spread_order(1), [0]);
        assert!(spread_order(0).is_empty());
    }

    #[test]
    fn frames_are_spread_whatever_the_source_can() {
        for seeks in [true, false] {
            assert_eq!(sampled(40, seeks, true, 4, 10_000), [0, 10, 20, 30]);
            assert_eq!(sampled(3, seeks, true, 4, 10_000), [0, 1, 2]);
            // A frame that cannot be read is missing; memory limits the number.
            assert_eq!(sampled(14, seeks, true, 2, 10_000), [0]);
            assert_eq!(sampled(40, seeks, true, 4, 450), [0, 20]);
        }
        assert_eq!(sampled(40, false, false, 4, 10_000), [0, 16, 32]);
        assert!(sampled(0, false, false, 4, 10_000).is_empty());
    }
}
