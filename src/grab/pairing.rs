//! Which two images are one pair.

use super::camera::{Capture, Side};
use std::collections::VecDeque;

/// What makes two images a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The same pulse fired both.
    Trigger,
    /// Their stamps are at most so far apart. Less than half a period makes it unambiguous.
    Stamp { max_skew_ns: u64 },
    /// The n-th of one and the n-th of the other, whatever they show: to see what goes wrong (thesis, figure 4.2).
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
}

impl Unpaired {
    pub const ALL: [Unpaired; 6] = [
        Unpaired::Missed,
        Unpaired::Skew,
        Unpaired::Settings,
        Unpaired::Overdue,
        Unpaired::Unfinished,
        Unpaired::Damaged,
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
        }
    }
}

/// Images of one camera that may wait for the other's.
pub const WAITING: usize = 16;

/// Pairs images as they come. Each camera's come in the order of their exposure.
pub struct Pairing {
    rule: Rule,
    waiting: [VecDeque<Capture>; 2],
    unpaired: [u64; Unpaired::ALL.len()],
}

impl Pairing {
    pub fn new(rule: Rule) -> Self {
        Self { rule, waiting: Default::default(), unpaired: [0; Unpaired::ALL.len()] }
    }

    /// Takes an image, and gives back the pair that it completes, left first.
    pub fn push(&mut self, side: Side, capture: Capture) -> Option<[Capture; 2]> {
        self.waiting[side as usize].push_back(capture);
        let pair = self.match_heads();
        if self.waiting[side as usize].len() > WAITING {
            self.give_up(side, Unpaired::Overdue);
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

    /// Gives up what still waits.
    pub fn finish(&mut self) {
        for side in Side::BOTH {
            while !self.waiting[side as usize].is_empty() {
                self.give_up(side, Unpaired::Unfinished);
            }
        }
    }

    fn match_heads(&mut self) -> Option<[Capture; 2]> {
        while let [Some(left), Some(right)] = [self.waiting[0].front(), self.waiting[1].front()] {
            let partnerless = match self.rule {
                Rule::Arrival => None,
                Rule::Trigger => by_trigger(left, right),
                Rule::Stamp { max_skew_ns } if left.stamp_ns.abs_diff(right.stamp_ns) > max_skew_ns => {
                    let earlier = if left.stamp_ns < right.stamp_ns { Side::Left } else { Side::Right };
                    Some((earlier, Unpaired::Skew))
                }
                Rule::Stamp { .. } => None,
            };
            match partnerless {
                Some((side, reason)) => self.give_up(side, reason),
                None if left.settings != right.settings => {
                    Side::BOTH.into_iter().for_each(|side| self.give_up(side, Unpaired::Settings));
                }
                None => return Some([self.waiting[0].pop_front()?, self.waiting[1].pop_front()?]),
            }
        }
        None
    }

    fn give_up(&mut self, side: Side, reason: Unpaired) {
        self.unpaired[reason as usize] += u64::from(self.waiting[side as usize].pop_front().is_some());
    }
}

/// Which of the two has no partner: the one of the earlier pulse, or of none that is known.
fn by_trigger(left: &Capture, right: &Capture) -> Option<(Side, Unpaired)> {
    let side = match (left.trigger_id, right.trigger_id) {
        (None, _) => Side::Left,
        (_, None) => Side::Right,
        (left, right) if left < right => Side::Left,
        (left, right) if right < left => Side::Right,
        _ => return None,
    };
    Some((side, Unpaired::Missed))
}
