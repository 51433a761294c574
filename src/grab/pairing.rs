//! Pairs the images of two cameras: by pulse, by nearest stamp, or by order of arrival.

use super::camera::Capture;
use std::collections::VecDeque;
use svl_core::stereo::Side;
use svl_files::pairing::{Nearest, WaitingStamps};

/// Rule by which two images are a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The same pulse triggered both.
    Trigger,
    /// They are each other's nearest in time, with a skew of at most `max_skew_ns`. An image may
    /// have to wait for the next of its camera, which may be nearer to its partner; it need not if
    /// the skew is below a quarter of the period, as images of one camera are at least half a
    /// period apart.
    Stamp { max_skew_ns: u64, period_ns: u64 },
    /// The n-th image of one and the n-th of the other, whatever they show (thesis, figure 4.2). At
    /// most [`ARRIVAL_BYTES`] wait for their partner.
    Arrival,
}

/// Images by [`Unpaired`] reason, in the order of [`Unpaired::ALL`].
pub type UnpairedCounts = [u64; Unpaired::ALL.len()];

/// Reason why an image is unpaired.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unpaired {
    /// The other camera missed that pulse, or the pulse is unknown.
    Missed,
    /// No image of the other camera was close enough in time.
    Skew,
    /// The other image was exposed with other settings.
    Settings,
    /// Timed out: the other camera fell too far behind.
    Overdue,
    /// The run ended before its partner arrived.
    Unfinished,
    /// Part of it was lost in transfer.
    Damaged,
    /// Taken before its settings took effect, or on a pulse that had timed out.
    Unready,
}

impl Unpaired {
    pub const ALL: [Unpaired; 7] = [
        Unpaired::Missed,
        Unpaired::Skew,
        Unpaired::Settings,
        Unpaired::Overdue,
        Unpaired::Unfinished,
        Unpaired::Damaged,
        Unpaired::Unready,
    ];

    /// True of images outside of the run: before both cameras were ready, and at its end.
    pub fn is_outside(self) -> bool {
        matches!(self, Unpaired::Unready | Unpaired::Unfinished)
    }

    /// Name in the metadata of recordings.
    pub fn name(self) -> &'static str {
        match self {
            Unpaired::Missed => "missed",
            Unpaired::Skew => "skew",
            Unpaired::Settings => "settings",
            Unpaired::Overdue => "overdue",
            Unpaired::Unfinished => "unfinished",
            Unpaired::Damaged => "damaged",
            Unpaired::Unready => "unready",
        }
    }

    /// Words to follow a number of images.
    pub fn words(self) -> &'static str {
        match self {
            Unpaired::Missed => "whose trigger the other camera missed",
            Unpaired::Skew => "too far apart in time",
            Unpaired::Settings => "exposed differently",
            Unpaired::Overdue => "timed out",
            Unpaired::Unfinished => "unfinished at the end",
            Unpaired::Damaged => "damaged on the way",
            Unpaired::Unready => "taken before the camera was ready",
        }
    }

    /// The remedy if this is the most frequent reason.
    pub(super) fn cure(self) -> &'static str {
        match self {
            Unpaired::Missed | Unpaired::Overdue => {
                "--trigger software or serial:DEVICE waits until both cameras are ready, a lower \
                 rate gives them time"
            }
            Unpaired::Skew => "trigger both with one --trigger, or allow more with --max-skew-ms",
            Unpaired::Damaged => "check the cables",
            Unpaired::Settings | Unpaired::Unfinished | Unpaired::Unready => {
                "try another --trigger"
            }
        }
    }
}

/// Limit on the images of one camera that wait for the other's.
pub const WAITING: usize = 16;
/// That limit in bytes for pairing by arrival, where one more image waits after every pulse that
/// one camera misses.
pub const ARRIVAL_BYTES: usize = 1 << 29;

/// Pairs images as they arrive; each camera's images arrive in the order of their exposure.
pub struct Pairing {
    rule: Rule,
    waiting: [VecDeque<Capture>; 2],
    /// Unpaired images so far.
    pub unpaired: UnpairedCounts,
}

/// Decision on the two images that have waited longest.
enum PairDecision {
    Pair,
    /// Undecided: the next image of this camera may be nearer.
    Wait(Side),
    Unpaired(Side, Unpaired),
}

impl Pairing {
    pub fn new(rule: Rule) -> Self {
        Self {
            rule,
            waiting: Default::default(),
            unpaired: UnpairedCounts::default(),
        }
    }

    /// Adds an image; [`Pairing::pair`] returns the pairs that it completes.
    pub fn push(&mut self, side: Side, capture: Capture) {
        let (width, height) = capture.image.size();
        // In order of arrival, images wait only because the other camera missed pulses, which this
        // rule is meant to show: so it gets more room.
        let most = match self.rule {
            Rule::Arrival => WAITING.max(ARRIVAL_BYTES / (width * height)),
            _ => WAITING,
        };
        let queue = &mut self.waiting[side as usize];
        queue.push_back(capture);
        // If the caller takes pairs after each push, images of one camera wait and at most one of
        // the other, so only this queue can become too long.
        if queue.len() > most {
            self.drop_first(side, Unpaired::Overdue);
        }
    }

    /// The next complete pair, left first. Call it until it returns `None`.
    pub fn pair(&mut self) -> Option<[Capture; 2]> {
        self.pair_heads(false)
    }

    /// [`Pairing::pair`] once no more images arrive; images still waiting are unpaired.
    pub fn finish(&mut self) -> Option<[Capture; 2]> {
        let pair = self.pair_heads(true);
        if pair.is_none() {
            for side in Side::BOTH {
                while !self.waiting[side as usize].is_empty() {
                    self.drop_first(side, Unpaired::Unfinished);
                }
            }
        }
        pair
    }

    /// Counts an image that is excluded from pairing.
    pub(super) fn discard(&mut self, reason: Unpaired) {
        self.unpaired[reason as usize] += 1;
    }

    fn pair_heads(&mut self, ended: bool) -> Option<[Capture; 2]> {
        while let [Some(left), Some(right)] = [self.waiting[0].front(), self.waiting[1].front()] {
            let verdict = match self.rule {
                Rule::Arrival => PairDecision::Pair,
                Rule::Trigger => by_trigger(left, right),
                Rule::Stamp {
                    max_skew_ns,
                    period_ns,
                } => self.by_stamp(left, right, max_skew_ns, period_ns),
            };
            match verdict {
                PairDecision::Wait(side)
                    if !ended && self.waiting[side.other() as usize].len() < WAITING =>
                {
                    return None;
                }
                PairDecision::Unpaired(side, reason) => self.drop_first(side, reason),
                // Both from one pulse but across a change of settings: matching needs equal
                // brightness.
                _ if left.ordered != right.ordered => {
                    Side::BOTH
                        .into_iter()
                        .for_each(|side| self.drop_first(side, Unpaired::Settings));
                }
                _ => return Some([self.waiting[0].pop_front()?, self.waiting[1].pop_front()?]),
            }
        }
        None
    }

    fn by_stamp(
        &self,
        left: &Capture,
        right: &Capture,
        max_skew_ns: u64,
        period_ns: u64,
    ) -> PairDecision {
        let (earlier, earliest_ns, other_ns) = if left.stamp_ns < right.stamp_ns {
            (Side::Left, left.stamp_ns, right.stamp_ns)
        } else {
            (Side::Right, right.stamp_ns, left.stamp_ns)
        };
        let next = self.waiting[earlier as usize].get(1);
        let waiting = WaitingStamps {
            earliest_ns,
            next_ns: next.map(|capture| capture.stamp_ns),
            other_ns,
        };
        match waiting.nearest(max_skew_ns, period_ns / 4) {
            Nearest::TooFar | Nearest::Overtaken => PairDecision::Unpaired(earlier, Unpaired::Skew),
            Nearest::Unknown => PairDecision::Wait(earlier),
            Nearest::Pair => PairDecision::Pair,
        }
    }

    fn drop_first(&mut self, side: Side, reason: Unpaired) {
        self.unpaired[reason as usize] +=
            u64::from(self.waiting[side as usize].pop_front().is_some());
    }
}

/// By pulse: the image of the earlier pulse has no partner, and neither does one whose pulse is
/// unknown.
fn by_trigger(left: &Capture, right: &Capture) -> PairDecision {
    let side = match (left.trigger_id, right.trigger_id) {
        (None, _) => Side::Left,
        (_, None) => Side::Right,
        (left, right) if left < right => Side::Left,
        (left, right) if right < left => Side::Right,
        _ => return PairDecision::Pair,
    };
    PairDecision::Unpaired(side, Unpaired::Missed)
}
