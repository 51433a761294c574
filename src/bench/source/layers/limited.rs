//! Some of the pairs of another source: a range of its time, every n-th, or the first N.

use crate::source::frames::{Source, wraps};
use std::collections::BTreeSet;
use svl_core::stereo::Frame;
use svl_core::{Error, Result, counted};
use svl_score::losses::Losses;
use svl_score::scenario::PairRange;

/// Limit on the first pairs of a source: by time and by number.
pub struct FirstPairs {
    pub(crate) range: PairRange,
    pub(crate) frames: Option<u64>,
}

impl FirstPairs {
    /// The pairs before these seconds, from the first one on, and at most that many; `None` without
    /// a limit.
    pub fn new(to_s: Option<f64>, frames: Option<u64>) -> Option<Self> {
        let range = PairRange {
            to_s,
            ..PairRange::default()
        };
        (to_s.is_some() || frames.is_some()).then_some(Self { range, frames })
    }
}

/// The pairs of a source with one of these stamps: those that a run of live topics matched.
pub(crate) struct MatchedPairs<'a> {
    pub source: Box<dyn Source + 'a>,
    pub stamps_ns: BTreeSet<u64>,
}

impl Source for MatchedPairs<'_> {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        while let Some(frame) = self.source.next()? {
            if self.stamps_ns.contains(&frame.stamp_ns) {
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }

    fn pairs(&self) -> Option<u64> {
        None
    }
}

/// A source limited to a range of time, to every n-th pair in it, and to the first N of these.
/// Frames keep their sequence numbers and stamps.
pub struct Limited<'a> {
    source: Box<dyn Source + 'a>,
    every: u64,
    from_ns: u64,
    to_ns: Option<u64>,
    frames: Option<u64>,
    /// The first pair's stamp, once it was read.
    start_ns: Option<u64>,
    /// Pairs in the range that were read.
    in_range: u64,
    taken: u64,
    skipped: u64,
    clock: RangeClock,
}

/// A step between pairs that is longer than this, and many times the longest before, is a jump.
const STEP_NS: u64 = 1_000_000_000;
const STEPS: u64 = 10;

/// The stamps of the pairs that were read: a clock that jumps hides pairs from a range of time.
#[derive(Default)]
struct RangeClock {
    /// Stamp of the last pair, and the latest one.
    last_ns: Option<u64>,
    latest_ns: u64,
    longest_step_ns: u64,
    /// The first jump back: the pair, and its length.
    back: Option<(u64, u64)>,
    /// Pairs outside the range whose stamps are before an earlier pair's.
    hidden: u64,
    /// The pair behind the end of the range, if a jump led there: the pair, and its length.
    ahead: Option<(u64, u64)>,
    is_reported: bool,
}

impl RangeClock {
    /// True if the stamp is before that of an earlier pair.
    fn advance(&mut self, frame: &Frame) -> bool {
        let (stamp_ns, last_ns) = (frame.stamp_ns, self.last_ns.replace(frame.stamp_ns));
        let step_ns = stamp_ns.abs_diff(last_ns.unwrap_or(stamp_ns));
        if last_ns.is_some_and(|last_ns| stamp_ns < last_ns) {
            self.back.get_or_insert((frame.sequence, step_ns));
        }
        let is_jump = step_ns > STEPS * self.longest_step_ns.max(STEP_NS);
        self.ahead = is_jump.then_some((frame.sequence, step_ns));
        self.longest_step_ns = self.longest_step_ns.max(step_ns);
        let is_back = stamp_ns < self.latest_ns;
        self.latest_ns = self.latest_ns.max(stamp_ns);
        is_back
    }

    /// The pairs that a jump back hides, in words.
    fn hidden_words(&self) -> Option<String> {
        let (pair, ns) = self.back.filter(|_| self.hidden > 0)?;
        Some(format!(
            "the clock of its stamps jumps back by {:.3} s at pair {pair}, so {} later in the file \
             are outside the range of time, and left out; `svl info` lists the jumps",
            ns as f64 / 1e9,
            counted(self.hidden, "pair")
        ))
    }
}

impl<'a> Limited<'a> {
    pub fn new(source: Box<dyn Source + 'a>, range: PairRange, frames: Option<u64>) -> Self {
        let ns = |seconds: f64| (seconds * 1e9) as u64;
        Self {
            source,
            every: range.every.unwrap_or(1).max(1),
            from_ns: range.from_s.map_or(0, ns),
            to_ns: range.to_s.map(ns),
            frames,
            start_ns: None,
            in_range: 0,
            taken: 0,
            skipped: 0,
            clock: RangeClock::default(),
        }
    }

    /// True if an image with this stamp is in the range of time.
    fn has(&self, stamp_ns: u64) -> bool {
        let time_ns = stamp_ns.saturating_sub(self.start_ns.unwrap_or_default());
        time_ns >= self.from_ns && self.to_ns.is_none_or(|to_ns| time_ns < to_ns)
    }

    fn is_timed(&self) -> bool {
        self.from_ns > 0 || self.to_ns.is_some()
    }

    /// Warns once of pairs that a clock that jumps hides.
    fn report(&mut self, is_at_end: bool) {
        if !self.is_timed() || std::mem::replace(&mut self.clock.is_reported, true) {
            return;
        }
        let name = self.source.name();
        if let Some(words) = self.clock.hidden_words() {
            tracing::warn!("{name}: {words}");
        }
        if let Some((pair, ns)) = self.clock.ahead.filter(|_| is_at_end) {
            let read = self.taken + self.skipped + 1;
            let all = self.source.pairs().filter(|all| *all > read);
            let behind = all.map(|all| format!(", with {} behind it", counted(all - read, "pair")));
            tracing::warn!(
                "{name}: the range of time ends at pair {pair}{}: its stamp is {:.3} s after that \
                 of the pair before, by a gap or a clock that jumps; `svl info` lists both",
                behind.unwrap_or_default(),
                ns as f64 / 1e9
            );
        }
    }
}

impl Source for Limited<'_> {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        if self.frames.is_some_and(|frames| self.taken >= frames) {
            return Ok(None);
        }
        if !self.is_timed() {
            let others = self.in_range.next_multiple_of(self.every) - self.in_range;
            let unread = self.source.skip(others)?;
            self.in_range += unread;
            self.skipped += unread;
        }
        while let Some(frame) = self.source.next()? {
            let start_ns = *self.start_ns.get_or_insert(frame.stamp_ns);
            let is_back = self.clock.advance(&frame);
            let time_ns = frame.stamp_ns.saturating_sub(start_ns);
            if self.to_ns.is_some_and(|to_ns| time_ns >= to_ns) {
                self.report(true);
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
            self.clock.hidden += u64::from(is_back && (is_before || time_ns < self.from_ns));
            self.skipped += 1;
        }
        let end_s = self.from_ns as f64 / 1e9;
        if self.start_ns.is_some() && self.in_range == 0 {
            let name = self.source.name();
            let hidden = self.clock.hidden_words();
            let hidden = hidden.map_or(String::new(), |words| format!(": {words}"));
            return Err(Error::Invalid(format!(
                "{name}: has no pair after {end_s} s{hidden}"
            )));
        }
        self.report(false);
        Ok(None)
    }

    fn start_ns(&self) -> Option<u64> {
        self.source.start_ns().or(self.start_ns)
    }

    /// Seeks unless a range of time is requested, which is only found by reading on.
    fn seek(&mut self, index: u64) -> Result<bool> {
        if self.is_timed() || self.frames.is_some() {
            return Ok(false);
        }
        let source_index = index * self.every;
        let sought = self.source.seek(source_index)?;
        if sought {
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

    /// Pairs and unpaired images outside the range are not losses.
    fn finish(&mut self, taken: u64) -> Losses {
        let mut losses = self.source.finish(taken + self.skipped);
        let all = losses.unpaired_ns.len();
        losses.unpaired_ns.retain(|&stamp_ns| self.has(stamp_ns));
        let inside = losses.unpaired_ns.len();
        // The count may be less than the stamps: partners of unreadable images are not in it.
        if inside < all {
            losses.unpaired = losses.unpaired.min(inside as u64);
        }
        losses.skipped += self.skipped;
        losses
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};
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
            // Images without partners were at 0.25, 1.25 and 1.75 s, and at 0.25 s the partner of
            // an unreadable one, which is not counted.
            Losses {
                unpaired: 3,
                unpaired_ns: [5_250_000_000, 5_250_000_000, 6_250_000_000, 6_750_000_000].to_vec(),
                unreadable: taken,
                ..Losses::default()
            }
        }
    }

    /// The same, of which no pair can be lost, with the number of those that were made.
    struct Made<'a>(u64, &'a AtomicU64);

    impl Source for Made<'_> {
        fn next(&mut self) -> Result<Option<Frame>> {
            self.1.fetch_add(1, Ordering::Relaxed);
            self.0 += 1;
            Steady(self.0 - 1).next()
        }

        fn skip(&mut self, pairs: u64) -> Result<u64> {
            let left_out = pairs.min(20_u64.saturating_sub(self.0));
            self.0 += left_out;
            Ok(left_out)
        }
    }

    #[test]
    fn pairs_that_are_left_out_are_not_made() {
        let (made, every) = (
            AtomicU64::new(0),
            PairRange {
                every: Some(8),
                ..PairRange::default()
            },
        );
        let mut source = Limited::new(Box::new(Made(0, &made)), every, None);
        let taken = std::iter::from_fn(|| source.next().unwrap()).map(|frame| frame.sequence);
        assert_eq!(taken.collect::<Vec<_>>(), [3, 11, 19]);
        // The last one is the end.
        assert_eq!(made.load(Ordering::Relaxed), 4);
        assert_eq!(source.finish(3).skipped, 17);
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
    fn it_knows_where_the_source_began() {
        let range = PairRange {
            from_s: Some(1.0),
            ..PairRange::default()
        };
        let mut source = Limited::new(Box::new(Steady(0)), range, None);
        assert_eq!(source.next().unwrap().unwrap().sequence, 13);
        assert_eq!(source.start_ns(), Some(5_000_000_000));
        assert_eq!(source.next().unwrap().unwrap().sequence, 14);
        assert_eq!(
            source.finish(2).unreadable,
            12,
            "ten were skipped on purpose"
        );
    }

    #[test]
    fn images_without_partners_outside_the_range_are_no_losses() {
        let unpaired = |from_s, to_s| {
            let range = PairRange {
                every: None,
                from_s,
                to_s,
            };
            let mut source = Limited::new(Box::new(Steady(0)), range, None);
            while source.next().unwrap().is_some() {}
            source.finish(0).unpaired
        };
        assert_eq!(unpaired(None, None), 3);
        assert_eq!(unpaired(Some(0.2), None), 3);
        assert_eq!(unpaired(Some(0.3), None), 2);
        assert_eq!(unpaired(Some(0.3), Some(1.7)), 1);
        // The partner cannot be told from a lost image: rather one too many than too few.
        assert_eq!(unpaired(None, Some(1.2)), 2);
        assert_eq!(unpaired(Some(1.8), None), 0);
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

    /// The stamps that are in a range, the pairs that a jump hides, and the jump at its end.
    fn in_range(
        stamps: &[u64],
        from_s: Option<f64>,
        to_s: Option<f64>,
    ) -> (Vec<u64>, Option<String>, Option<(u64, u64)>) {
        let range = PairRange {
            from_s,
            to_s,
            ..PairRange::default()
        };
        let source = Jumping(stamps.to_vec(), 0);
        let mut source = Limited::new(Box::new(source), range, None);
        let frames = std::iter::from_fn(|| source.next().unwrap());
        let stamps = frames.map(|frame| frame.stamp_ns / 100_000_000).collect();
        (stamps, source.clock.hidden_words(), source.clock.ahead)
    }

    #[test]
    fn pairs_that_a_jump_back_hides_are_counted() {
        let stamps = [100, 101, 102, 103, 50, 51, 52, 101, 102];
        let (taken, words, _) = in_range(&stamps, None, Some(0.25));
        assert_eq!(
            taken,
            [100, 101, 102],
            "the first pair beyond --to ends the range"
        );
        assert_eq!(words, None);
        let stamps = [100, 101, 50, 51, 52, 101, 102];
        let (taken, words, _) = in_range(&stamps, None, Some(0.25));
        assert_eq!(
            taken,
            [100, 101, 101, 102],
            "those before the first are in no range"
        );
        let words = words.unwrap();
        assert!(
            words
                .starts_with("the clock of its stamps jumps back by 5.100 s at pair 5, so 3 pairs"),
            "{words}"
        );
        let (taken, words, _) = in_range(&stamps, Some(0.1), None);
        assert_eq!((taken, words.is_some()), (vec![101, 101, 102], true));
        // Without a range of time, all are used.
        assert_eq!(in_range(&stamps, None, None).0, stamps);
        // Pairs before --from are not hidden by a jump.
        assert_eq!(in_range(&[100, 101, 102], Some(0.2), None).1, None);
    }

    #[test]
    fn a_range_that_a_jump_ahead_ends_says_so() {
        let (taken, _, ahead) = in_range(&[100, 101, 90_000, 90_001], None, Some(5.0));
        assert_eq!(
            (taken, ahead),
            (vec![100, 101], Some((5, 8_989_900_000_000)))
        );
        let (_, _, ahead) = in_range(&[100, 101, 102], None, Some(0.2));
        assert_eq!(ahead, None);
    }

    #[test]
    fn a_range_without_a_pair_names_the_jump() {
        let range = PairRange {
            from_s: Some(1.0),
            ..PairRange::default()
        };
        let source = Jumping(vec![100, 20, 21], 0);
        let error = Limited::new(Box::new(source), range, None).next();
        let error = error.unwrap_err().to_string();
        assert!(
            error.contains("after 1 s: the clock of its stamps jumps back by 8.000 s"),
            "{error}"
        );
    }

    #[test]
    fn a_range_behind_the_end_is_an_error_not_an_empty_run() {
        let range = PairRange {
            from_s: Some(60.0),
            ..PairRange::default()
        };
        let mut source = Limited::new(Box::new(Steady(0)), range, None);
        let error = source.next().unwrap_err().to_string();
        assert_eq!(error, "steady: has no pair after 60 s");
    }
}
