//! Faults of clocks, in words, with their cures.

use super::measure::{ClockOffset, ComparedClock, TopicClock, WrongUnit};
use super::scan::{ClockRole, ClockScan, TopicScan};
use crate::cameras::topics::Selection;
use crate::pairs::steps::{ClockStep, OffsetBins, StepWatch};
use crate::stream::stamp_rule::{StampRule, StampUnit};
use std::collections::BTreeMap;
use std::fmt;
use svl_core::stereo::Side;

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
    pub(crate) is_of_unit: bool,
}

impl ClockFault {
    pub(crate) fn new(topic: &str, reason: String, denies_pairs: bool) -> Self {
        Self {
            topic: topic.to_owned(),
            reason,
            denies_pairs,
            is_of_unit: false,
        }
    }
}

impl fmt::Display for ClockFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.topic, self.reason)
    }
}

/// The clocks of the topics, to be checked against each other.
pub(crate) struct ClockCheck<'a> {
    clocks: &'a [TopicClock],
    selection: &'a Selection,
    images: &'a [String; 2],
    /// The clock of the right calibrations, if they have the stamps of the images.
    right_info: Option<&'a TopicClock>,
    /// The options that take log times for all stamps.
    by_log: String,
    /// The fault of the cameras' clocks against each other.
    between: Option<CameraFault>,
}

/// A fault of the clocks of the cameras against each other.
enum CameraFault {
    /// The right clock is off by a constant time.
    Offset,
    Step(ClockStep),
    /// None: the images of one come late from some time on.
    Late,
}

/// True if the right images, behind that log time, come late, and false if their stamps are of
/// another clock, by that shift; `None` if that is unknown.
pub(crate) type AreLate<'a> = &'a dyn Fn(i64, u64) -> Option<bool>;

impl<'a> ClockCheck<'a> {
    pub(crate) fn new(
        scan: &'a ClockScan,
        clocks: &'a [TopicClock],
        right_info: Option<&str>,
        selection: &'a Selection,
        are_late: AreLate<'_>,
    ) -> Self {
        let first = |topic: &str| scan.topics.get(topic).map(|topic| &topic.first[..]);
        let right = first(&scan.images[1]).and_then(<[_]>::first);
        let right_info = right_info.filter(|info| {
            let mut infos = first(info).into_iter().flatten();
            right.is_some_and(|right| infos.any(|info| info.stamp_ns == right.stamp_ns))
        });
        let skew_ns = scan.log_skew_ns().unwrap_or(0);
        // Some are later than the first ones.
        let skew_ms = (skew_ns + skew_ns / 4).div_ceil(1_000_000);
        let by_log = if skew_ms * 1_000_000 > selection.max_skew_ns {
            format!("`--stamps log --max-skew-ms {skew_ms}`")
        } else {
            "`--stamps log`".to_owned()
        };
        let mut check = Self {
            clocks,
            selection,
            images: &scan.images,
            right_info: right_info.and_then(|info| clocks.iter().find(|clock| clock.topic == info)),
            by_log,
            between: None,
        };
        check.between = check.camera_fault(are_late);
        check
    }

    fn clock(&self, topic: &str) -> Option<&'a TopicClock> {
        self.clocks.iter().find(|clock| clock.topic == topic)
    }

    pub(crate) fn faults(&self) -> Vec<ClockFault> {
        let followers = self.followers();
        let is_named = |clock: &&TopicClock| {
            clock.matters
                && !followers
                    .iter()
                    .any(|follower| follower.topic == clock.topic)
        };
        let used = self.clocks.iter().filter(is_named);
        let mut faults: Vec<_> = used.filter_map(|clock| self.fault(clock)).collect();
        faults.extend(self.left_fault(&followers));
        faults.extend(self.early(&faults));
        faults
    }

    fn fault(&self, clock: &TopicClock) -> Option<ClockFault> {
        if let Some(wrong) = clock.wrong_unit {
            let is_image = self.images.contains(&clock.topic);
            let words = self.unit_words(clock, wrong);
            return Some(ClockFault {
                is_of_unit: true,
                ..ClockFault::new(&clock.topic, words, is_image)
            });
        }
        if clock.topic == self.images[1] && clock.compared.is_some() {
            return self.between_fault(clock);
        }
        let behind = clock.behind?;
        if self.is_as_right(behind) {
            return None;
        }
        let periods_ns = OFFSET_PERIODS * self.period_ns(clock);
        let is_off = is_beyond(clock, MIN_OFFSET_NS, periods_ns)
            && (clock.role != ClockRole::Pose || behind.median_ns > 0);
        let step = || {
            let compared = clock.compared.as_ref()?;
            let step = compared
                .bins
                .step(MIN_OFFSET_NS.max(periods_ns) + compared.bin_noise_ns)?;
            Some(step.words(Side::Right, "messages"))
        };
        let words = if is_off {
            format!("by the log times its clock is {}", behind_words(&behind))
        } else {
            step()?
        };
        let cure = format!(
            "correct its stamps, or {} takes log times for all stamps",
            self.by_log
        );
        Some(ClockFault::new(
            &clock.topic,
            format!("{words}: {cure}"),
            false,
        ))
    }

    /// True for an offset that is that of the right images, while these are found right: the left
    /// ones come late.
    fn is_as_right(&self, behind: ClockOffset) -> bool {
        let is_right = !matches!(
            self.between,
            Some(CameraFault::Offset | CameraFault::Step(_))
        );
        let right = self.clock(&self.images[1]).filter(|_| is_right);
        right.is_some_and(|right| {
            let limit_ns = self.right_limit_ns(right);
            let apart_ns = right
                .behind
                .map(|own| own.median_ns.abs_diff(behind.median_ns));
            apart_ns.is_some_and(|ns| ns as f64 <= limit_ns)
                && is_beyond(right, MIN_RIGHT_NS, limit_ns)
        })
    }

    /// True if a clock of the cameras permits no pair, as the user does not say otherwise.
    fn denies(&self) -> bool {
        self.selection.right_offset_ns.is_none()
    }

    fn right_limit_ns(&self, clock: &TopicClock) -> f64 {
        MIN_RIGHT_NS.max(RIGHT_PERIODS * self.period_ns(clock))
    }

    /// The fault of the cameras' clocks, if the right images do not come late: that their
    /// calibrations of the same stamps would not be.
    fn camera_fault(&self, are_late: AreLate<'_>) -> Option<CameraFault> {
        let clock = self.clock(&self.images[1])?;
        let right = clock.compared.as_ref()?;
        let infos = self.right_info.and_then(|info| info.compared.as_ref());
        let step_ns = self.step_limit_ns(clock, right);
        if let Some(step) = right.bins.step(step_ns) {
            let are_infos = infos.is_none_or(|infos| infos.bins.step(step_ns).is_some());
            let is_step = are_infos && are_late(step.shift_ns(), step.to.log_ns) != Some(true);
            let fault = if is_step {
                CameraFault::Step(step)
            } else {
                CameraFault::Late
            };
            return Some(fault);
        }
        let limit_ns = self.right_limit_ns(clock);
        let infos = self.right_info.and_then(|info| info.behind);
        let are_infos_off =
            infos.is_none_or(|behind| behind.median_ns.unsigned_abs() as f64 >= limit_ns / 2.0);
        // Images that come late are behind, never ahead.
        let is_ahead = clock.behind.is_some_and(|behind| behind.median_ns < 0);
        let is_off = is_beyond(clock, MIN_RIGHT_NS, limit_ns)
            && (is_ahead || are_infos_off)
            && !are_late(right.shift_ns, 0).unwrap_or(right.is_late);
        is_off.then_some(CameraFault::Offset)
    }

    /// The right images and the other topics whose clocks agree with theirs, not with that of the
    /// left ones; none if one agrees with that.
    fn followers(&self) -> Vec<&'a TopicClock> {
        let [left, right] = &self.images;
        let Some(right) = self.clock(right) else {
            return Vec::new();
        };
        let (Some(behind), Some(CameraFault::Offset)) = (right.behind, &self.between) else {
            return Vec::new();
        };
        let others = self.clocks.iter().filter(|clock| {
            let is_other = clock.topic != *left && clock.topic != right.topic;
            is_other && clock.role != ClockRole::Calibration && clock.behind.is_some()
        });
        let others: Vec<_> = others.collect();
        let limit_ns = self
            .right_limit_ns(right)
            .min(behind.median_ns.unsigned_abs() as f64 / 2.0);
        let agrees = |clock: &&TopicClock| {
            let median_ns = clock.behind.map_or(0, |other| other.median_ns);
            median_ns.abs_diff(behind.median_ns) as f64 <= limit_ns
        };
        if others.is_empty() || !others.iter().all(agrees) {
            return Vec::new();
        }
        others.into_iter().chain([right]).collect()
    }

    /// The fault of the left images, whose clock is the odd one out.
    fn left_fault(&self, followers: &[&TopicClock]) -> Option<ClockFault> {
        let (right, others) = followers.split_last()?;
        let behind = right.behind?;
        let ahead = ClockOffset {
            median_ns: behind.median_ns.saturating_neg(),
            ..behind
        };
        let others: Vec<_> = others.iter().map(|clock| clock.topic.as_str()).collect();
        let whose = format!("those of {} and {}", others.join(", "), right.topic);
        let right_ms = right.compared.as_ref()?.shift_ns as f64 / 1e6;
        let reason = format!(
            "by the log times its clock is {}, and pairs by stamp are of different moments: {} \
             takes log times for all stamps; `--right-offset-ms {right_ms:.1}` moves the right \
             stamps to this clock, for pairs alone; 0 leaves them",
            offset_words(&ahead, &whose),
            self.by_log
        );
        Some(ClockFault::new(&self.images[0], reason, self.denies()))
    }

    /// The slower one's period, of a topic and the left images.
    fn period_ns(&self, clock: &TopicClock) -> f64 {
        let both = [Some(clock), self.clock(&self.images[0])]
            .into_iter()
            .flatten();
        let periods = both.filter_map(|clock| Some(1e9 / clock.stamps_hz?.min(clock.log_hz?)));
        periods.fold(0.0, f64::max)
    }

    /// The fault of the cameras' clocks in words; `right`: that of the right images.
    fn between_fault(&self, right: &TopicClock) -> Option<ClockFault> {
        let (side, words) = match self.between.as_ref()? {
            CameraFault::Late => return None,
            CameraFault::Step(step) => (step.side, step.camera_words(&self.by_log)),
            CameraFault::Offset => {
                let told_ns = self.selection.right_offset_ns.unwrap_or_default();
                let shift_ns = right.compared.as_ref()?.shift_ns.saturating_add(told_ns);
                let words = format!(
                    "by the log times its clock is {}, and pairs by stamp are of different \
                     moments: `--right-offset-ms {:.1}` corrects its stamps; 0 leaves them, if its \
                     images come late",
                    behind_words(&right.behind?),
                    shift_ns as f64 / 1e6
                );
                (Side::Right, words)
            }
        };
        Some(ClockFault::new(
            &self.images[side as usize],
            words,
            self.denies(),
        ))
    }

    fn step_limit_ns(&self, clock: &TopicClock, right: &ComparedClock) -> f64 {
        self.right_limit_ns(clock) + right.bin_noise_ns
    }

    /// A watch for steps of the right clock behind what was looked at, if it is measured.
    pub(crate) fn watch(&self) -> Option<StepWatch> {
        let is_late = matches!(self.between, Some(CameraFault::Late));
        let is_watched = self.denies() && !is_late;
        let clock = self.clock(&self.images[1]).filter(|_| is_watched)?;
        let right = clock.compared.as_ref()?;
        Some(StepWatch {
            bins: OffsetBins::new(self.period_ns(clock)),
            usual_ns: right.bins.usual_ns()?,
            limit_ns: self.step_limit_ns(clock, right),
            shift_ns: right.shift_ns,
            latency_ns: MIN_RIGHT_NS + right.bin_noise_ns,
            begin_ns: None,
            cure: self.by_log.clone(),
        })
    }

    fn unit_words(&self, clock: &TopicClock, wrong: WrongUnit) -> String {
        let WrongUnit { unit, stamps_hz } = wrong;
        let log_hz = clock.log_hz.unwrap_or_default();
        let rates =
            format!("{stamps_hz:.0} messages a second by its stamps, {log_hz:.1} by the log times");
        let (unit, option) = match unit {
            Some(StampUnit::Milliseconds) => ("milliseconds", "ms"),
            Some(_) => ("microseconds", "us"),
            None => {
                return format!(
                    "{rates}: its stamps are no time, as those that count images; {} takes log \
                     times for all stamps",
                    self.by_log
                );
            }
        };
        format!(
            "{rates}: its stamps are {unit}, written as nanoseconds; `--stamps {option}` reads \
             them so"
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
        let reason = format!(
            "stamps are later than their log times, so that their clock is not the recorder's: \
             {words}; {} takes log times for all stamps",
            self.by_log
        );
        Some(ClockFault::new(&first.topic, reason, false))
    }
}

/// True if the offset of a clock is larger than both limits, in either direction, and than chance
/// explains.
fn is_beyond(clock: &TopicClock, least_ns: f64, periods_ns: f64) -> bool {
    let limit_ns = least_ns.max(periods_ns).max(clock.noise_ns);
    clock.behind.is_some_and(|behind| {
        // A recorder that stalls makes some messages late, and batches make most.
        let median_ns = behind.median_ns.unsigned_abs() as f64;
        // A recorder that stalls makes some messages late.
        let floor_ns = clock
            .floor_ns
            .unwrap_or(0)
            .saturating_mul(behind.median_ns.signum());
        median_ns > limit_ns && behind.usual_ns.min(floor_ns) as f64 > limit_ns / 2.0
    })
}

/// A unit that the user names and no stamps have, or in which those of a topic are beyond all
/// times.
pub(crate) fn wrong_option(
    scan: &ClockScan,
    clocks: &[TopicClock],
    rules: &BTreeMap<String, StampRule>,
) -> Option<ClockFault> {
    let reading = |topic: &str| rules.get(topic).copied().unwrap_or_default();
    let is_beyond = |clock: &&TopicClock| {
        let rule = reading(&clock.topic);
        rule.has_unit() && !rule.is_log() && clock.stamps_hz.is_none()
    };
    let (topic, reason) = match clocks.iter().find(is_beyond) {
        Some(clock) => (
            &clock.topic,
            "in the unit that --stamps names its stamps are beyond the year 2554: leave it out",
        ),
        None if rules.values().any(|rule| rule.has_unit()) => return None,
        None => (
            &scan.images[0],
            "--stamps names a unit that neither its stamps nor those of another topic have, by the \
             log times of 10 messages or more: leave it out",
        ),
    };
    Some(ClockFault::new(topic, reason.to_owned(), true))
}

/// Messages that come several times.
pub(crate) fn copies(scan: &ClockScan) -> Vec<ClockFault> {
    let is_used =
        |topic: &TopicScan| matches!(topic.role, ClockRole::Image | ClockRole::Measurement);
    let topics = scan.topics.iter().filter(|(_, topic)| is_used(topic));
    let copied = topics.filter_map(|(name, topic)| Some((name, topic, topic.copies()?)));
    let cameras = scan.images.each_ref().map(|topic| scan.topics.get(topic));
    let begins = cameras.map(|camera| camera?.first_new_ns());
    let faults = copied.map(|(name, topic, copies)| {
        let of_images = cameras.map(|camera| camera.and_then(TopicScan::copies).unwrap_or(1));
        let cure = if !scan.images.contains(name) {
            "leave it out as a truth, or keep the first of each: a copy is as old as that"
                .to_owned()
        } else if topic.repeats_stamps() {
            // The copies of a pair have no partner.
            let lost = of_images.iter().sum::<usize>() - 2;
            let percent = (100 * lost).div_ceil(lost + 1) + 1;
            format!("copies without partners are lost, which `--allow-loss {percent}%` allows")
        } else if of_images != [copies; 2] {
            let from = topic.first_new_ns().zip(topic.first.first());
            let from_ns = from.map_or(0, |((new_ns, _), first)| {
                new_ns.saturating_sub(first.stamp_ns)
            });
            let from = format!("--from {:.3} ", from_ns as f64 / 1e9 - 0.001);
            let from = if from_ns > 0 { &from } else { "" };
            format!(
                "with a copy, a pair is of different moments: `{from}--every {copies}` leaves \
                 those out"
            )
        } else if let [Some((left_ns, period_ns)), Some((right_ns, _))] = begins
            && let apart = left_ns.abs_diff(right_ns) % (copies as u64 * period_ns)
            && (period_ns / 2..copies as u64 * period_ns - period_ns / 2).contains(&apart)
        {
            "those of the two cameras alternate, so that no pair is of one moment: record again \
             without the node that repeats them"
                .to_owned()
        } else {
            format!("`--every {copies}` takes each once")
        };
        let times = match copies {
            2 => "twice".to_owned(),
            more => format!("{more} times"),
        };
        let reason = format!(
            "every message comes {times}: the first {} are {} and copies of them; {cure}",
            topic.first.len(),
            topic.runs.len()
        );
        ClockFault::new(name, reason, false)
    });
    let mixed = scan.topics.iter().filter(|(_, topic)| is_used(topic));
    let mixed = mixed.filter_map(|(name, topic)| {
        let copied = topic.mixed_copies()?;
        let reason = format!(
            "{copied} of the first {} messages are copies of the one before, with stamps of their \
             own: a copy is older than it says; record again without the node that repeats them",
            topic.runs.iter().sum::<usize>()
        );
        Some(ClockFault::new(name, reason, false))
    });
    faults.chain(mixed).collect()
}

fn seconds(ns: i64) -> String {
    format!("{:.3}", ns as f64 / 1e9)
}

fn behind_words(behind: &ClockOffset) -> String {
    offset_words(behind, "that of the left images")
}

/// `whose`: the clock that it is compared with.
fn offset_words(behind: &ClockOffset, whose: &str) -> String {
    let direction = if behind.median_ns > 0 {
        "behind"
    } else {
        "ahead of"
    };
    format!(
        "{} s {direction} {whose} (median; spread {} s)",
        seconds(behind.median_ns.saturating_abs()),
        seconds(behind.spread_ns)
    )
}
