//! Clocks that cannot be right, each with its cure.

use super::measure::{ClockOffset, ComparedClock, TopicClock, UNIT_RATIO, WrongUnit};
use super::scan::{ClockRole, ClockScan, TopicScan};
use crate::cameras::topics::Selection;
use crate::pairs::steps::{FoundStep, OffsetBins, StepWatch};
use crate::stream::stamp_rule::{StampRule, StampUnit};
use std::collections::BTreeMap;
use svl_core::doubt::{ClockCure, ClockLag, CopyCure, Cure, Doubt, LogTimes, Subject};
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
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ClockFault {
    #[serde(flatten)]
    pub doubt: Doubt,
    /// True if no pair is made.
    pub denies_pairs: bool,
}

impl From<Doubt> for ClockFault {
    /// A fault with which pairs are made.
    fn from(doubt: Doubt) -> Self {
        Self {
            doubt,
            denies_pairs: false,
        }
    }
}

/// True for stamps that are no time in nanoseconds.
pub(crate) fn is_of_unit(doubt: &Doubt) -> bool {
    use ClockCure::{NoTime, Unit};
    matches!(doubt.cure, Cure::Clock(Unit { .. } | NoTime { .. }))
}

/// The clocks of the topics, to be checked against each other.
pub(crate) struct ClockCheck<'a> {
    clocks: &'a [TopicClock],
    selection: &'a Selection,
    images: &'a [String; 2],
    /// The clock of the right calibrations, if they have the stamps of the images.
    right_info: Option<&'a TopicClock>,
    log: LogTimes,
    /// The fault of the cameras' clocks against each other.
    between: Option<CameraFault>,
}

/// A fault of the clocks of the cameras against each other.
enum CameraFault {
    /// The right clock is off by a constant time.
    Offset,
    Step(FoundStep),
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
        let mut check = Self {
            clocks,
            selection,
            images: &scan.images,
            right_info: right_info.and_then(|info| clocks.iter().find(|clock| clock.topic == info)),
            log: LogTimes {
                max_skew_ms: (skew_ms * 1_000_000 > selection.max_skew_ns).then_some(skew_ms),
            },
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
            return Some(ClockFault {
                doubt: self.unit_doubt(clock, wrong),
                denies_pairs: self.images.contains(&clock.topic),
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
        let (log, limit_ns) = (self.log, MIN_OFFSET_NS.max(periods_ns));
        if is_off {
            let lag = lag(behind);
            return Some(
                offset(&clock.topic, limit_ns, ClockCure::Offset { lag, log }, lag).into(),
            );
        }
        let compared = clock.compared.as_ref()?;
        let limit_ns = limit_ns + compared.bin_noise_ns;
        let found = compared.bins.step(limit_ns)?;
        let step = found.against(Side::Right);
        let cure = ClockCure::Step { step, log };
        Some(found.doubt(clock.topic.clone(), limit_ns, cure).into())
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
        let lag = lag(ahead);
        let cure = ClockCure::LeftOffset {
            lag,
            others: others.iter().map(|clock| clock.topic.clone()).collect(),
            right: right.topic.clone(),
            right_ms: right.compared.as_ref()?.shift_ns as f64 / 1e6,
            log: self.log,
        };
        Some(ClockFault {
            doubt: offset(&self.images[0], self.right_limit_ns(right), cure, lag),
            denies_pairs: self.denies(),
        })
    }

    /// The slower one's period, of a topic and the left images.
    fn period_ns(&self, clock: &TopicClock) -> f64 {
        let both = [Some(clock), self.clock(&self.images[0])]
            .into_iter()
            .flatten();
        let periods = both.filter_map(|clock| Some(1e9 / clock.stamps_hz?.min(clock.log_hz?)));
        periods.fold(0.0, f64::max)
    }

    /// The fault of the cameras' clocks; `right`: that of the right images.
    fn between_fault(&self, right: &TopicClock) -> Option<ClockFault> {
        let compared = right.compared.as_ref()?;
        let doubt = match self.between.as_ref()? {
            CameraFault::Late => return None,
            CameraFault::Step(step) => {
                let limit_ns = self.step_limit_ns(right, compared);
                step.camera_doubt(self.images, limit_ns, self.log)
            }
            CameraFault::Offset => {
                let told_ns = self.selection.right_offset_ns.unwrap_or_default();
                let right_ms = compared.shift_ns.saturating_add(told_ns) as f64 / 1e6;
                let lag = lag(right.behind?);
                let cure = ClockCure::RightOffset { lag, right_ms };
                offset(&self.images[1], self.right_limit_ns(right), cure, lag)
            }
        };
        Some(ClockFault {
            doubt,
            denies_pairs: self.denies(),
        })
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
            log: self.log,
        })
    }

    fn unit_doubt(&self, clock: &TopicClock, wrong: WrongUnit) -> Doubt {
        let WrongUnit { unit, stamps_hz } = wrong;
        let log_hz = clock.log_hz.unwrap_or_default();
        let in_unit = |unit: &str, option: &str| ClockCure::Unit {
            unit: unit.to_owned(),
            option: option.to_owned(),
            stamps_hz,
            log_hz,
        };
        let cure = match unit {
            Some(StampUnit::Milliseconds) => in_unit("milliseconds", "ms"),
            Some(_) => in_unit("microseconds", "us"),
            None => ClockCure::NoTime {
                stamps_hz,
                log_hz,
                log: self.log,
            },
        };
        let subject = Subject::Topic(clock.topic.clone());
        cure.doubt(subject, "stamps_hz", stamps_hz, [0.0, UNIT_RATIO * log_hz])
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
                && named
                    .iter()
                    .all(|fault| !fault.doubt.subject.is_topic(&clock.topic))
                && median_ns.is_some_and(|median_ns| median_ns < -limit_ns)
        };
        let early: Vec<_> = self.clocks.iter().filter(is_early).collect();
        let topics = early.iter();
        let topics = topics.filter_map(|clock| Some((clock.topic.clone(), lag(clock.offset?))));
        let topics: Vec<_> = topics.collect();
        let (topic, lag) = topics.first()?.clone();
        let log = self.log;
        let cure = ClockCure::Early { topics, log };
        let mut doubt = offset(&topic, MIN_EARLY_NS as f64, cure, lag);
        // Every message is logged after its stamp.
        doubt.usual[1] = f64::MAX;
        Some(doubt.into())
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
    let (topic, cure) = match clocks.iter().find(is_beyond) {
        Some(clock) => (&clock.topic, ClockCure::BeyondAllTimes),
        None if rules.values().any(|rule| rule.has_unit()) => return None,
        None => (&scan.images[0], ClockCure::NoSuchUnit),
    };
    let subject = Subject::Topic(topic.clone());
    Some(ClockFault {
        doubt: cure.doubt(subject, "topics_of_the_unit", 0.0, [1.0, f64::MAX]),
        denies_pairs: true,
    })
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
            CopyCure::LeaveOut
        } else if topic.repeats_stamps() {
            // The copies of a pair have no partner.
            let lost = of_images.iter().sum::<usize>() - 2;
            let percent = (100 * lost).div_ceil(lost + 1) + 1;
            CopyCure::AllowLoss { percent }
        } else if of_images != [copies; 2] {
            let from = topic.first_new_ns().zip(topic.first.first());
            let from_ns = from.map_or(0, |((new_ns, _), first)| {
                new_ns.saturating_sub(first.stamp_ns)
            });
            let from_s = (from_ns > 0).then(|| from_ns as f64 / 1e9 - 0.001);
            CopyCure::Unequal { from_s, copies }
        } else if let [Some((left_ns, period_ns)), Some((right_ns, _))] = begins
            && let apart = left_ns.abs_diff(right_ns) % (copies as u64 * period_ns)
            && (period_ns / 2..copies as u64 * period_ns - period_ns / 2).contains(&apart)
        {
            CopyCure::Alternate
        } else {
            CopyCure::Every { copies }
        };
        let cure = ClockCure::Copies {
            copies,
            first: topic.first.len(),
            distinct: topic.runs.len(),
            cure,
        };
        let subject = Subject::Topic(name.clone());
        ClockFault::from(cure.doubt(subject, "copies", copies as f64, [1.0, 1.0]))
    });
    let mixed = scan.topics.iter().filter(|(_, topic)| is_used(topic));
    let mixed = mixed.filter_map(|(name, topic)| {
        let copies = topic.mixed_copies()?;
        let first = topic.runs.iter().sum::<usize>();
        let cure = ClockCure::SomeCopies { copies, first };
        let subject = Subject::Topic(name.clone());
        Some(
            cure.doubt(subject, "copies", copies as f64, [0.0, 0.0])
                .into(),
        )
    });
    faults.chain(mixed).collect()
}

fn lag(offset: ClockOffset) -> ClockLag {
    ClockLag {
        median_ns: offset.median_ns,
        spread_ns: offset.spread_ns,
    }
}

/// The doubt about a topic's clock that lags by more than a limit.
fn offset(topic: &str, limit_ns: f64, cure: ClockCure, lag: ClockLag) -> Doubt {
    let limit_s = limit_ns / 1e9;
    let (subject, lag_s) = (Subject::Topic(topic.to_owned()), lag.median_ns as f64 / 1e9);
    cure.doubt(subject, "clock_lag_s", lag_s, [-limit_s, limit_s])
}
