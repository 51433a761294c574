//! Faults of clocks, in words, with their cures.

use super::super::Selection;
use super::measure::{ClockOffset, TopicClock, WrongUnit};
use super::scan::{ClockRole, ClockScan, MIN_MESSAGES};
use crate::stamp_rule::StampUnit;
use std::fmt;

/// Least offset of a topic's clock, of that of the right images, and of stamps that are later than
/// their log times: of poses, which a localization dates ahead, and of all others.
const MIN_OFFSET_NS: f64 = 0.5e9;
const MIN_RIGHT_NS: f64 = 10e6;
const MIN_EARLY_POSE_NS: i64 = 2_000_000_000;
const MIN_EARLY_NS: i64 = 1_000_000;
/// The same in periods.
const OFFSET_PERIODS: f64 = 5.0;
const RIGHT_PERIODS: f64 = 0.75;

/// A clock that cannot be right.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct ClockFault {
    pub topic: String,
    /// The numbers that show it, and the cure.
    pub reason: String,
    /// True if no pair is made.
    pub denies_pairs: bool,
    /// True for stamps that are no time in nanoseconds.
    #[serde(skip)]
    pub(super) is_of_unit: bool,
}

impl fmt::Display for ClockFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.topic, self.reason)
    }
}

/// The clocks of the topics, to be checked against each other.
pub(super) struct ClockCheck<'a> {
    clocks: &'a [TopicClock],
    left: Option<&'a TopicClock>,
    right: &'a str,
    selection: &'a Selection,
    images: &'a [String; 2],
}

impl<'a> ClockCheck<'a> {
    pub(super) fn new(
        images: &'a [String; 2],
        clocks: &'a [TopicClock],
        selection: &'a Selection,
    ) -> Self {
        let [left, right] = images;
        Self {
            clocks,
            left: clocks.iter().find(|clock| clock.topic == *left),
            right,
            selection,
            images,
        }
    }

    pub(super) fn faults(&self) -> Vec<ClockFault> {
        let used = self.clocks.iter().filter(|clock| clock.matters);
        let mut faults: Vec<_> = used.filter_map(|clock| self.fault(clock)).collect();
        faults.extend(self.early(&faults));
        faults
    }

    fn fault(&self, clock: &TopicClock) -> Option<ClockFault> {
        let fault = |reason: String, denies_pairs: bool, is_of_unit: bool| ClockFault {
            topic: clock.topic.clone(),
            reason,
            denies_pairs,
            is_of_unit,
        };
        if let Some(wrong) = clock.wrong_unit {
            let is_image = self.images.contains(&clock.topic);
            return Some(fault(unit_words(clock, wrong), is_image, true));
        }
        let behind = clock.behind?;
        if clock.topic == self.right {
            let is_told = self.selection.right_offset_ns.is_some();
            let is_off = is_beyond(clock, MIN_RIGHT_NS, RIGHT_PERIODS * self.period_ns(clock));
            return is_off.then(|| {
                let shift_ns = clock.shift_ns.unwrap_or(behind.median_ns);
                fault(self.right_words(&behind, shift_ns), !is_told, false)
            });
        }
        let periods_ns = OFFSET_PERIODS * self.period_ns(clock);
        let is_off = is_beyond(clock, MIN_OFFSET_NS, periods_ns)
            && (clock.role != ClockRole::Pose || behind.median_ns > 0);
        is_off.then(|| {
            let words = behind_words(&behind);
            let cure = "correct its stamps, or `--stamps log` takes log times for all stamps";
            fault(
                format!("by the log times its clock is {words}: {cure}"),
                false,
                false,
            )
        })
    }

    /// The slower one's period, of a topic and the left images.
    fn period_ns(&self, clock: &TopicClock) -> f64 {
        let both = [Some(clock), self.left].into_iter().flatten();
        let periods = both.filter_map(|clock| Some(1e9 / clock.stamps_hz?.min(clock.log_hz?)));
        periods.fold(0.0, f64::max)
    }

    fn right_words(&self, behind: &ClockOffset, shift_ns: i64) -> String {
        let told = self.selection.right_offset_ns.unwrap_or_default();
        let right_ms = shift_ns.saturating_add(told) as f64 / 1e6;
        format!(
            "by the log times its clock is {}, and pairs by stamp are of different moments: \
             `--right-offset-ms {right_ms:.1}` corrects its stamps, 0 leaves them",
            behind_words(behind)
        )
    }

    /// Stamps that are later than their log times: one fault for all topics that are not named.
    fn early(&self, named: &[ClockFault]) -> Option<ClockFault> {
        let is_early = |clock: &&TopicClock| {
            let limit_ns = match clock.role {
                ClockRole::Pose => MIN_EARLY_POSE_NS,
                _ => MIN_EARLY_NS,
            };
            let median_ns = clock.offset.map(|offset| offset.median_ns);
            clock.matters
                && named.iter().all(|fault| fault.topic != clock.topic)
                && median_ns.is_some_and(|median_ns| median_ns < -limit_ns)
        };
        let early: Vec<_> = self.clocks.iter().filter(is_early).collect();
        let words = early.iter().filter_map(|clock| {
            let offset = clock.offset?;
            Some(format!(
                "{} by {} s (median; spread {} s)",
                clock.topic,
                seconds(-offset.median_ns),
                seconds(offset.spread_ns)
            ))
        });
        let words = words.collect::<Vec<_>>().join(", ");
        let first = early.first()?;
        Some(ClockFault {
            topic: first.topic.clone(),
            reason: format!(
                "stamps are later than their log times, so that their clock is not the recorder's: \
                 {words}; `--stamps log` takes log times for all stamps"
            ),
            denies_pairs: false,
            is_of_unit: false,
        })
    }
}

/// True if the offset of a clock is larger than both limits, in either direction, and than chance
/// explains.
fn is_beyond(clock: &TopicClock, least_ns: f64, periods_ns: f64) -> bool {
    let limit_ns = least_ns.max(periods_ns).max(clock.noise_ns);
    clock.behind.is_some_and(|behind| {
        let median_ns = behind.median_ns.unsigned_abs() as f64;
        // A recorder that stalls makes some messages late.
        median_ns > limit_ns && behind.usual_ns as f64 > limit_ns / 2.0
    })
}

/// A unit that the user names, of stamps that are in none.
pub(super) fn unused_unit(scan: &ClockScan) -> ClockFault {
    ClockFault {
        topic: scan.images[0].clone(),
        reason: "--stamps names a unit that neither its stamps nor those of another topic have, \
                 by the log times of 10 messages or more: leave it out"
            .to_owned(),
        denies_pairs: true,
        is_of_unit: false,
    }
}

/// Images that come twice.
pub(super) fn copies(scan: &ClockScan) -> Vec<ClockFault> {
    let images = scan.images.iter().filter_map(|topic| {
        let found = scan.topics.get(topic)?;
        Some((topic, found, found.first.len() as u64))
    });
    let doubled = images.filter(|(_, topic, messages)| {
        // Half of them but for an incomplete one at either end; those of a camera at rest follow
        // each other.
        let half = messages / 2;
        *messages >= MIN_MESSAGES as u64
            && topic.copies == topic.lone_copies
            && (half.saturating_sub(1)..=half).contains(&topic.copies)
    });
    let doubled: Vec<_> = doubled.collect();
    let cure = match &doubled[..] {
        [_] => "copies without partners are lost, which `--allow-loss` allows",
        _ => "`--every 2` takes each once",
    };
    let faults = doubled
        .into_iter()
        .map(|(topic, found, messages)| ClockFault {
            topic: topic.clone(),
            reason: format!(
                "every image comes twice: of the first {messages}, {} are equal to the one before; \
             {cure}",
                found.copies
            ),
            denies_pairs: false,
            is_of_unit: false,
        });
    faults.collect()
}

fn seconds(ns: i64) -> String {
    format!("{:.3}", ns as f64 / 1e9)
}

fn behind_words(behind: &ClockOffset) -> String {
    let direction = if behind.median_ns > 0 {
        "behind"
    } else {
        "ahead of"
    };
    format!(
        "{} s {direction} that of the left images (median; spread {} s)",
        seconds(behind.median_ns.saturating_abs()),
        seconds(behind.spread_ns)
    )
}

fn unit_words(clock: &TopicClock, WrongUnit { unit, stamps_hz }: WrongUnit) -> String {
    let log_hz = clock.log_hz.unwrap_or_default();
    let rates =
        format!("{stamps_hz:.0} messages a second by its stamps, {log_hz:.1} by the log times");
    match unit {
        Some(StampUnit::Milliseconds) => format!(
            "{rates}: its stamps are milliseconds, written as nanoseconds; `--stamps ms` reads \
             them so"
        ),
        Some(_) => format!(
            "{rates}: its stamps are microseconds, written as nanoseconds; `--stamps us` reads \
             them so"
        ),
        None => format!(
            "{rates}: its stamps are no time, as those that count images; `--stamps log` takes log \
             times for all stamps"
        ),
    }
}
