//! The wait of live pairs for their calibrations, which ROS publishes after the images.

use super::stamp_order::PairImages;

/// Longest wait; pairs of a faster camera wait for one period.
const MAX_WAIT_NS: u64 = 200_000_000;
/// Number of pairs with unchanged calibrations after which pairs do not wait: a change then takes
/// effect with the next pair.
const SETTLED_PAIRS: u32 = 10;

/// Lets a live pair wait for the calibrations of its stamps.
#[derive(Default)]
pub(crate) struct CalibrationWait {
    /// Now, by a clock that never jumps.
    now_ns: u64,
    waiting: Option<WaitingPair>,
    /// Stamp of the last left image, and its distance from the one before it.
    last_ns: Option<u64>,
    period_ns: Option<u64>,
    /// Pairs since the calibrations changed.
    unchanged: u32,
    ended: bool,
}

/// A pair, and the time since which it waits.
pub(crate) struct WaitingPair {
    pub(crate) images: PairImages,
    since_ns: u64,
}

impl CalibrationWait {
    pub(crate) fn set_now(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    /// The pair that waits, or the next one.
    pub(crate) fn next(&mut self, pop: impl FnOnce() -> Option<PairImages>) -> Option<WaitingPair> {
        let since_ns = self.now_ns;
        let next = || pop().map(|images| WaitingPair { images, since_ns });
        self.waiting.take().or_else(next)
    }

    /// The images, unless they wait on. `are_there`: true if both calibrations are.
    pub(crate) fn release(&mut self, pair: WaitingPair, are_there: bool) -> Option<PairImages> {
        let limit_ns = self.period_ns.unwrap_or(MAX_WAIT_NS).min(MAX_WAIT_NS);
        let waits = !are_there
            && !self.ended
            && self.unchanged < SETTLED_PAIRS
            && self.now_ns.saturating_sub(pair.since_ns) < limit_ns;
        if waits {
            self.waiting = Some(pair);
            return None;
        }
        let stamp_ns = pair.images[0].0;
        let last_ns = self.last_ns.replace(stamp_ns);
        let period_ns = last_ns.and_then(|last| stamp_ns.checked_sub(last));
        self.period_ns = period_ns.filter(|&period| period > 0).or(self.period_ns);
        Some(pair.images)
    }

    /// Counts a pair.
    pub(crate) fn count(&mut self, is_changed: bool) {
        let unchanged = self.unchanged.saturating_add(1);
        self.unchanged = if is_changed { 0 } else { unchanged };
    }

    /// Ends the source: no calibration comes any more.
    pub(crate) fn end(&mut self) {
        self.ended = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::MessageError;

    const MS: u64 = 1_000_000;

    fn pair(stamp_ns: u64) -> PairImages {
        [(), ()].map(|()| (stamp_ns, Err(MessageError::Missing(""))))
    }

    /// Milliseconds until a pair is released that never gets its calibrations.
    fn waited_ms(wait: &mut CalibrationWait, stamp_ns: u64) -> u64 {
        let began_ns = wait.now_ns;
        let mut next = Some(pair(stamp_ns));
        loop {
            let waiting = wait.next(|| next.take()).unwrap();
            if wait.release(waiting, false).is_some() {
                wait.count(false);
                return (wait.now_ns - began_ns) / MS;
            }
            wait.set_now(wait.now_ns + MS);
        }
    }

    #[test]
    fn pairs_wait_for_a_period_until_calibrations_are_settled() {
        let mut wait = CalibrationWait::default();
        let waited: Vec<_> = (0..12).map(|i| waited_ms(&mut wait, 33 * MS * i)).collect();
        // The period is known from the third pair on, and ten pairs are enough.
        assert_eq!(waited[..3], [200, 200, 33]);
        assert_eq!(waited[9..], [33, 0, 0]);
        wait.count(true);
        assert_eq!(waited_ms(&mut wait, 33 * MS * 12), 33, "after a change");
        let mut slow = CalibrationWait::default();
        let waited: Vec<_> = (0..4)
            .map(|i| waited_ms(&mut slow, 1000 * MS * i))
            .collect();
        assert_eq!(waited, [200; 4]);
        wait.end();
        wait.count(true);
        assert_eq!(waited_ms(&mut wait, 33 * MS * 13), 0);
    }

    #[test]
    fn a_pair_whose_calibrations_are_there_does_not_wait() {
        let mut wait = CalibrationWait::default();
        let waiting = wait.next(|| Some(pair(7))).unwrap();
        assert!(wait.release(waiting, false).is_none());
        let waiting = wait.next(|| panic!("one waits")).unwrap();
        assert!(wait.release(waiting, true).is_some());
    }
}
