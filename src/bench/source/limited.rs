//! Some of the pairs of another source: a range of its time, every n-th, or the first N.

use super::{Source, wraps};
use svl_core::stereo::{Frame, Losses};
use svl_core::{Error, Result};
use svl_score::scenario::PairRange;

/// A source limited to a range of its pairs, and to N of these. Frames keep their
/// sequence numbers and stamps.
pub struct Limited {
    source: Box<dyn Source>,
    every: u64,
    from_ns: u64,
    to_ns: Option<u64>,
    frames: Option<u64>,
    /// The first pair's stamp, once it was read.
    start_ns: Option<u64>,
    /// The result of reading ahead: a frame to give out next, or the error.
    ahead: Option<Result<Option<Frame>>>,
    /// Pairs in the range that were read.
    in_range: u64,
    taken: u64,
    skipped: u64,
    /// Stamp of the last pair that was read.
    last_ns: Option<u64>,
    has_jumped: bool,
}

/// Stamps that go back by more than this, or ahead by more than that, are of a clock that jumps.
const MAX_BACK_NS: u64 = 500_000_000;
const MAX_STEP_NS: u64 = 10_000_000_000;

impl Limited {
    pub fn new(source: Box<dyn Source>, range: PairRange, frames: Option<u64>) -> Self {
        let ns = |seconds: f64| (seconds * 1e9) as u64;
        Self {
            source,
            every: range.every.unwrap_or(1).max(1),
            from_ns: range.from_s.map_or(0, ns),
            to_ns: range.to_s.map(ns),
            frames,
            start_ns: None,
            ahead: None,
            in_range: 0,
            taken: 0,
            skipped: 0,
            last_ns: None,
            has_jumped: false,
        }
    }

    /// The first frame, read ahead; none if the source is empty. An error is left to
    /// [`Source::next`].
    pub fn first(&mut self) -> Option<&Frame> {
        if self.ahead.is_none() {
            self.ahead = Some(self.read());
        }
        self.ahead.as_ref()?.as_ref().ok()?.as_ref()
    }

    /// Stamp of the source's first pair, which may be before the range, once it was read.
    pub fn start_ns(&self) -> Option<u64> {
        self.start_ns
    }

    fn read(&mut self) -> Result<Option<Frame>> {
        if self.frames.is_some_and(|frames| self.taken >= frames) {
            return Ok(None);
        }
        while let Some(frame) = self.source.next()? {
            let start_ns = *self.start_ns.get_or_insert(frame.stamp_ns);
            self.warn_of_jump(&frame);
            let time_ns = frame.stamp_ns.saturating_sub(start_ns);
            if self.to_ns.is_some_and(|to_ns| time_ns >= to_ns) {
                return Ok(None);
            }
            // A range begins at the first pair.
            let is_before = self.is_timed() && frame.stamp_ns < start_ns;
            if time_ns >= self.from_ns && !is_before {
                self.in_range += 1;
                if (self.in_range - 1).is_multiple_of(self.every) {
                    self.taken += 1;
                    return Ok(Some(frame));
                }
            }
            self.skipped += 1;
        }
        let end_s = self.from_ns as f64 / 1e9;
        if self.start_ns.is_some() && self.in_range == 0 {
            let name = self.source.name();
            return Err(Error::Invalid(format!(
                "{name}: has no pair after {end_s} s"
            )));
        }
        Ok(None)
    }

    fn is_timed(&self) -> bool {
        self.from_ns > 0 || self.to_ns.is_some()
    }

    /// Warns once of a clock that jumps, as it moves pairs out of a range of time.
    fn warn_of_jump(&mut self, frame: &Frame) {
        let stamp_ns = frame.stamp_ns;
        let last_ns = self.last_ns.replace(stamp_ns).unwrap_or(stamp_ns);
        let is_jump = stamp_ns + MAX_BACK_NS < last_ns || stamp_ns > last_ns + MAX_STEP_NS;
        if is_jump && self.is_timed() && !std::mem::replace(&mut self.has_jumped, true) {
            tracing::warn!(
                "{}: its stamps jump by {:.3} s at pair {}: --from and --to count from the first \
                 pair's stamp, and pairs outside are left out; `svl info` lists the jumps",
                self.source.name(),
                stamp_ns.wrapping_sub(last_ns).cast_signed() as f64 / 1e9,
                frame.sequence
            );
        }
    }
}

impl Source for Limited {
    wraps!(source);

    fn next(&mut self) -> Result<Option<Frame>> {
        self.ahead.take().unwrap_or_else(|| self.read())
    }

    /// Seeks unless a range of time is requested, which is only found by reading on.
    fn seek(&mut self, index: u64) -> Result<bool> {
        if self.is_timed() || self.frames.is_some() {
            return Ok(false);
        }
        let source_index = index * self.every;
        let sought = self.source.seek(source_index)?;
        if sought {
            self.ahead = None;
            self.in_range = source_index;
        }
        Ok(sought)
    }

    fn pairs(&self) -> Option<u64> {
        // The number of pairs in a range of time is known only at its end.
        let timed = self.is_timed();
        let all = self.source.pairs().filter(|_| !timed);
        let all = all.map(|all| all.div_ceil(self.every));
        match (all, self.frames) {
            (Some(all), Some(frames)) => Some(all.min(frames)),
            (all, frames) if !timed => frames.or(all),
            _ => None,
        }
    }

    /// Pairs outside the range are not losses.
    fn finish(&mut self, taken: u64) -> Losses {
        let losses = self.source.finish(taken + self.skipped);
        Losses {
            skipped: losses.skipped + self.skipped,
            ..losses
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{Geometry, Gray, StereoPair};

    /// Ten pairs a second, from stamp 5 s and number 3 on; says in its losses how many were taken.
    struct Steady(u64);

    impl Source for Steady {
        fn name(&self) -> String {
            "steady".into()
        }

        fn next(&mut self) -> Result<Option<Frame>> {
            let n = self.0;
            self.0 += 1;
            let image = Gray::filled(2, 1, 0)?;
            Ok((n < 20).then(|| Frame {
                sequence: 3 + n,
                stamp_ns: 5_000_000_000 + 100_000_000 * n,
                ..Frame::new(
                    StereoPair::new(image.clone(), image).unwrap(),
                    Geometry::Rectified(None),
                )
            }))
        }

        fn pairs(&self) -> Option<u64> {
            Some(20)
        }

        fn seek(&mut self, index: u64) -> Result<bool> {
            self.0 = index;
            Ok(true)
        }

        fn finish(&mut self, taken: u64) -> Losses {
            Losses {
                unreadable: taken,
                ..Losses::default()
            }
        }
    }

    fn taken(range: (Option<u64>, Option<f64>, Option<f64>), frames: Option<u64>) -> Vec<u64> {
        let (every, from_s, to_s) = range;
        let range = PairRange {
            every,
            from_s,
            to_s,
        };
        let mut source = Limited::new(Box::new(Steady(0)), range, frames);
        std::iter::from_fn(|| source.next().unwrap())
            .map(|frame| frame.sequence)
            .collect()
    }

    #[test]
    fn a_range_begins_at_its_second_and_ends_before_the_other() {
        assert_eq!(taken((None, Some(0.5), Some(0.8)), None), [8, 9, 10]);
        assert_eq!(taken((Some(8), None, None), None), [3, 11, 19]);
        assert_eq!(taken((Some(2), Some(0.5), Some(1.0)), Some(2)), [8, 10]);
        assert_eq!(taken((None, None, Some(0.2)), None), [3, 4]);
    }

    #[test]
    fn it_looks_ahead_and_knows_where_the_source_began() {
        let range = PairRange {
            from_s: Some(1.0),
            ..PairRange::default()
        };
        let mut source = Limited::new(Box::new(Steady(0)), range, None);
        assert_eq!(source.first().unwrap().sequence, 13);
        assert_eq!(source.start_ns(), Some(5_000_000_000));
        assert_eq!(source.next().unwrap().unwrap().sequence, 13);
        assert_eq!(source.next().unwrap().unwrap().sequence, 14);
        assert_eq!(
            source.finish(2).unreadable,
            12,
            "ten were skipped on purpose"
        );
    }

    #[test]
    fn every_third_is_sought_by_its_own_index() {
        let limited = |every, to_s| {
            let range = PairRange {
                every,
                to_s,
                ..PairRange::default()
            };
            let mut source = Limited::new(Box::new(Steady(0)), range, None);
            source.first();
            let sought = source.seek(2).unwrap();
            let rest = std::iter::from_fn(|| source.next().unwrap());
            (sought, rest.map(|frame| frame.sequence).collect::<Vec<_>>())
        };
        assert_eq!(limited(Some(3), None), (true, vec![9, 12, 15, 18, 21]));
        // The end of a range is known by reading.
        assert_eq!(limited(None, Some(0.2)), (false, vec![3, 4]));
    }

    #[test]
    fn the_number_of_pairs_is_known_unless_a_range_of_time_is_read() {
        let pairs = |every, to_s, frames| {
            let range = PairRange {
                every,
                to_s,
                ..PairRange::default()
            };
            Limited::new(Box::new(Steady(0)), range, frames).pairs()
        };
        assert_eq!(pairs(Some(3), None, None), Some(7));
        assert_eq!(pairs(None, None, Some(5)), Some(5));
        assert_eq!(pairs(Some(2), None, Some(50)), Some(10));
        assert_eq!(pairs(None, Some(1.0), None), None);
    }

    /// Pairs with these stamps, in tenths of a second.
    struct Jumping(Vec<u64>, usize);

    impl Source for Jumping {
        fn name(&self) -> String {
            "jumping".into()
        }

        fn next(&mut self) -> Result<Option<Frame>> {
            let mut steady = Steady(self.1 as u64);
            let frame = steady.next()?;
            self.1 += 1;
            let stamp = self.0.get(self.1 - 1);
            Ok(stamp.zip(frame).map(|(stamp, frame)| Frame {
                stamp_ns: stamp * 100_000_000,
                ..frame
            }))
        }

        fn pairs(&self) -> Option<u64> {
            Some(self.0.len() as u64)
        }
    }

    /// The stamps that are in a range, and true if a jump was warned of.
    fn in_range(stamps: &[u64], from_s: Option<f64>, to_s: Option<f64>) -> (Vec<u64>, bool) {
        let range = PairRange {
            from_s,
            to_s,
            ..PairRange::default()
        };
        let source = Jumping(stamps.to_vec(), 0);
        let mut source = Limited::new(Box::new(source), range, None);
        let frames = std::iter::from_fn(|| source.next().unwrap());
        let stamps = frames.map(|frame| frame.stamp_ns / 100_000_000).collect();
        (stamps, source.has_jumped)
    }

    #[test]
    fn a_clock_that_jumps_is_warned_of() {
        let stamps = [100, 101, 102, 103, 50, 51, 52, 101, 102];
        let (taken, warned) = in_range(&stamps, None, Some(0.25));
        let first = [100, 101, 102];
        assert_eq!(taken, first, "the first pair beyond --to ends the range");
        assert!(!warned, "the jump is behind the range");
        let stamps = [100, 101, 50, 51, 52, 101, 102];
        let (taken, warned) = in_range(&stamps, None, Some(0.25));
        let later = [100, 101, 101, 102];
        assert_eq!(taken, later, "those before the first are in no range");
        assert!(warned);
        assert_eq!(
            in_range(&stamps, Some(0.1), None),
            (vec![101, 101, 102], true)
        );
        // Without a range of time, all are used.
        assert_eq!(in_range(&stamps, None, None), (stamps.to_vec(), false));
        // Pairs that are a little out of order are no jump.
        assert!(!in_range(&[100, 102, 101], None, Some(0.5)).1);
        let (taken, warned) = in_range(&[100, 101, 90_000, 90_001], None, Some(5.0));
        assert_eq!((taken, warned), (vec![100, 101], true));
    }

    #[test]
    fn a_range_behind_the_end_is_an_error_not_an_empty_run() {
        let range = PairRange {
            from_s: Some(60.0),
            ..PairRange::default()
        };
        let mut source = Limited::new(Box::new(Steady(0)), range, None);
        assert!(source.first().is_none());
        let error = source.next().unwrap_err().to_string();
        assert_eq!(error, "steady: has no pair after 60 s");
    }
}
