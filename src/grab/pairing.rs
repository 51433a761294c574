//! Which two images are one pair.

use super::camera::{Capture, Side};
use crate::pairing::{Nearest, Waiting};
use std::collections::VecDeque;

/// What makes two images a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The same pulse fired both.
    Trigger,
    /// No other image is nearer in time to either, and they are at most so far apart. An image may
    /// have to wait for the next of its camera, which may be nearer to its partner; not when they
    /// are less than a quarter of the period apart, as a camera's images are at least half of it
    /// apart.
    Stamp { max_skew_ns: u64, period_ns: u64 },
    /// The n-th of one and the n-th of the other, whatever they show: to see what goes wrong
    /// (thesis, figure 4.2). Images wait for their n-th partner up to [`ARRIVAL_BYTES`] of them.
    Arrival,
}

/// Why an image is in no pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unpaired {
    /// The other camera missed that trigger, or nobody knows which it was.
    Missed,
    /// No image of the other camera was near enough in time.
    Skew,
    /// The other image was exposed with other settings.
    Settings,
    /// The other camera fell so far behind that this was given up.
    Overdue,
    /// The run ended before its partner came.
    Unfinished,
    /// Part of it was lost on its way from the camera.
    Damaged,
    /// The camera took it before its settings were in force, or of a pulse that had been given up.
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

    /// For a person, after a number.
    pub fn words(self) -> &'static str {
        match self {
            Unpaired::Missed => "whose trigger the other camera missed",
            Unpaired::Skew => "too far apart in time",
            Unpaired::Settings => "exposed differently",
            Unpaired::Overdue => "given up waiting",
            Unpaired::Unfinished => "unfinished at the end",
            Unpaired::Damaged => "damaged on the way",
            Unpaired::Unready => "taken before the camera was ready",
        }
    }

    /// What helps when there are no others.
    pub(super) fn cure(self) -> &'static str {
        match self {
            Unpaired::Missed | Unpaired::Overdue => {
                "--trigger software or serial:DEVICE waits until both cameras are ready, a lower \
                 rate gives them time"
            }
            Unpaired::Skew => "fire both with one --trigger, or allow more with --max-skew-ms",
            Unpaired::Damaged => "check the cables",
            Unpaired::Settings | Unpaired::Unfinished | Unpaired::Unready => {
                "try another --trigger"
            }
        }
    }
}

/// Images of one camera that may wait for the other's.
pub const WAITING: usize = 16;
/// Of images that are paired in the order of arrival, more wait with every pulse that one camera
/// misses.
pub const ARRIVAL_BYTES: usize = 1 << 29;

/// Pairs images as they come. Each camera's come in the order of their exposure.
pub struct Pairing {
    rule: Rule,
    waiting: [VecDeque<Capture>; 2],
    unpaired: [u64; Unpaired::ALL.len()],
}

/// What becomes of the two images that have waited longest.
enum Verdict {
    Pair,
    /// Not yet known: the next image of this camera may be nearer.
    Wait(Side),
    Partnerless(Side, Unpaired),
}

impl Pairing {
    pub fn new(rule: Rule) -> Self {
        Self {
            rule,
            waiting: Default::default(),
            unpaired: [0; Unpaired::ALL.len()],
        }
    }

    /// Takes an image, left or right; [`Pairing::pair`] has the pairs that it completes.
    pub fn push(&mut self, side: Side, capture: Capture) {
        let (width, height) = capture.image.size();
        let most = match self.rule {
            Rule::Arrival => WAITING.max(ARRIVAL_BYTES / (width * height)),
            _ => WAITING,
        };
        let queue = &mut self.waiting[side as usize];
        queue.push_back(capture);
        // Who has the next pairs at once leaves at most one camera's images waiting, and one of the
        // other's.
        if queue.len() > most {
            self.give_up(side, Unpaired::Overdue);
        }
    }

    /// The next pair that there is, left first. To be asked until there is none.
    pub fn pair(&mut self) -> Option<[Capture; 2]> {
        self.pair_heads(false)
    }

    /// As [`Pairing::pair`] when no more images come; what then still waits is given up.
    pub fn finish(&mut self) -> Option<[Capture; 2]> {
        let pair = self.pair_heads(true);
        if pair.is_none() {
            for side in Side::BOTH {
                while !self.waiting[side as usize].is_empty() {
                    self.give_up(side, Unpaired::Unfinished);
                }
            }
        }
        pair
    }

    /// Counts an image that is not to be in any pair.
    pub(super) fn leave_out(&mut self, reason: Unpaired) {
        self.unpaired[reason as usize] += 1;
    }

    /// Images without a partner so far, by reason.
    pub fn unpaired(&self) -> [u64; Unpaired::ALL.len()] {
        self.unpaired
    }

    fn pair_heads(&mut self, ended: bool) -> Option<[Capture; 2]> {
        while let [Some(left), Some(right)] = [self.waiting[0].front(), self.waiting[1].front()] {
            let verdict = match self.rule {
                Rule::Arrival => Verdict::Pair,
                Rule::Trigger => by_trigger(left, right),
                Rule::Stamp {
                    max_skew_ns,
                    period_ns,
                } => self.by_stamp(left, right, max_skew_ns, period_ns),
            };
            match verdict {
                Verdict::Wait(side)
                    if !ended && self.waiting[side.other() as usize].len() < WAITING =>
                {
                    return None;
                }
                Verdict::Partnerless(side, reason) => self.give_up(side, reason),
                _ if left.ordered != right.ordered => {
                    Side::BOTH
                        .into_iter()
                        .for_each(|side| self.give_up(side, Unpaired::Settings));
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
    ) -> Verdict {
        let (earlier, earliest_ns, other_ns) = match left.stamp_ns < right.stamp_ns {
            true => (Side::Left, left.stamp_ns, right.stamp_ns),
            false => (Side::Right, right.stamp_ns, left.stamp_ns),
        };
        let next = self.waiting[earlier as usize].get(1);
        let waiting = Waiting {
            earliest_ns,
            next_ns: next.map(|capture| capture.stamp_ns),
            other_ns,
        };
        match waiting.nearest(max_skew_ns, period_ns / 4) {
            Nearest::TooFar | Nearest::Overtaken => Verdict::Partnerless(earlier, Unpaired::Skew),
            Nearest::Unknown => Verdict::Wait(earlier),
            Nearest::Pair => Verdict::Pair,
        }
    }

    fn give_up(&mut self, side: Side, reason: Unpaired) {
        self.unpaired[reason as usize] +=
            u64::from(self.waiting[side as usize].pop_front().is_some());
    }
}

/// Which of the two has no partner: the one of the earlier pulse, or of none that is known.
fn by_trigger(left: &Capture, right: &Capture) -> Verdict {
    let side = match (left.trigger_id, right.trigger_id) {
        (None, _) => Side::Left,
        (_, None) => Side::Right,
        (left, right) if left < right => Side::Left,
        (left, right) if right < left => Side::Right,
        _ => return Verdict::Pair,
    };
    Verdict::Partnerless(side, Unpaired::Missed)
}
