//! Rates and offsets of the topics' clocks.

use super::scan::{ClockRole, ClockScan, MIN_MESSAGES, TopicScan};
use crate::pairs::steps::{OffsetBins, TimedMessage};
use crate::stream::stamp_rule::{StampReading, StampRule, StampUnit};
use std::collections::BTreeMap;
use svl_core::nanoseconds;
use svl_core::statistics::nearest_rank;

const LOG_IS_STAMP: &str = "log times are stamps";
/// A stamp and a log time that differ by no more are equal: one of them went through a
/// floating-point number.
const MAX_ROUNDING_NS: u64 = 1_000;
/// Greatest difference of two cameras' usual latencies.
const MAX_LATENCY_NS: u64 = 100_000_000;
/// Log times that are that much faster than the stamps are those of a script.
const BURST: f64 = 3.0;
/// Offsets are compared if the log times of both topics run alike against their stamps.
const MAX_SPEED_RATIO: f64 = 1.5;
/// From the fifth to the 95th percentile of a normal distribution, in widths of its middle half.
const MIDDLE_HALVES: f64 = 2.44;
/// Seconds above this are those since 1970.
const MIN_EPOCH_S: u64 = 100_000_000;
/// Greatest rate of a sensor by its stamps, and the ratio of a higher one to that by log times from
/// which on it is refused.
const MAX_RATE_HZ: f64 = 500.0;
pub(crate) const UNIT_RATIO: f64 = 100.0;
/// Largest difference of a ratio from that of a unit.
const UNIT_TOLERANCE: f64 = 0.2;
/// Longer than the step that nine tenths do not exceed, times this, is a pause.
const PAUSE_STEPS: u64 = 3;
/// Log time around a message in which offsets are compared, and the same in periods.
const WINDOW_NS: f64 = 0.25e9;
const WINDOW_PERIODS: f64 = 2.5;

/// The clock of a topic.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TopicClock {
    pub topic: String,
    pub role: ClockRole,
    /// Messages that were looked at.
    pub messages: u64,
    /// Messages per second by their stamps and by their log times; `None` if either does not
    /// advance.
    pub stamps_hz: Option<f64>,
    pub log_hz: Option<f64>,
    /// Log time minus stamp.
    pub offset: Option<ClockOffset>,
    /// The offset less that of the left images at equal log times: positive for a clock that is
    /// behind.
    pub behind: Option<ClockOffset>,
    /// The reason why the clock is not measured.
    pub not_measured: Option<&'static str>,
    /// False for calibrations that are all equal: their stamps do not matter.
    #[serde(skip)]
    pub(crate) matters: bool,
    #[serde(skip)]
    pub(crate) wrong_unit: Option<WrongUnit>,
    /// Largest part of `behind` that random latencies explain, nanoseconds.
    #[serde(skip)]
    pub(crate) noise_ns: f64,
    /// `behind` by the least delays: messages that come in batches are late, not their clock.
    #[serde(skip)]
    pub(crate) floor_ns: Option<i64>,
    /// More about the clocks of the right images, their calibrations and measurements.
    #[serde(skip)]
    pub(crate) compared: Option<ComparedClock>,
}

/// The clock of a topic against that of the left images.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ComparedClock {
    /// The shift of its stamps by which the images are of one moment, nanoseconds.
    pub(crate) shift_ns: i64,
    /// True if the first images of both have the same stamp, but were logged that far apart; or if
    /// one camera begins later, and a usual latency and the equal stamps of all explain the rest.
    pub(crate) is_late: bool,
    /// Part of the difference of two bins that random latencies, and log times of another speed
    /// than that of the stamps, explain.
    pub(crate) bin_noise_ns: f64,
    pub(crate) bins: OffsetBins,
}

/// Stamps that are too fast to be nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WrongUnit {
    /// `None` if they count something.
    pub(crate) unit: Option<StampUnit>,
    /// Their rate; within a second if only the part below it is too fast.
    pub(crate) stamps_hz: f64,
}

/// An offset of clocks, nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct ClockOffset {
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub median_ns: i64,
    /// From the fifth to the 95th percentile.
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub spread_ns: i64,
    /// The same of random ones, by the middle half: a few far ones are none.
    #[serde(skip)]
    pub(crate) usual_spread_ns: f64,
    /// At least as far from 0, and in the same direction, are three fifths of the messages.
    #[serde(skip)]
    pub(crate) usual_ns: i64,
}

impl ClockOffset {
    fn new(mut offsets_ns: Vec<i64>) -> Option<Self> {
        offsets_ns.sort_unstable();
        let rank = |share| nearest_rank(&offsets_ns, share);
        Some(Self {
            median_ns: rank(0.5)?,
            spread_ns: rank(0.95)?.saturating_sub(rank(0.05)?),
            usual_spread_ns: MIDDLE_HALVES * rank(0.75)?.saturating_sub(rank(0.25)?) as f64,
            usual_ns: rank(0.4)?.max(0).max(rank(0.6)?.saturating_neg()),
        })
    }
}

/// TopicTimes of a topic by some rule, in the order of their log times.
struct TopicTimes {
    all: Vec<TimedMessage>,
    /// Messages per second of the first ones, by stamps and by log times.
    rates: [Option<f64>; 2],
    /// The median time to the next stamp, of consecutive messages.
    step_ns: Option<u64>,
}

impl TopicTimes {
    fn new(topic: &TopicScan, rule: StampRule) -> Self {
        let restamped = |sample: &TimedMessage| sample.restamped(rule);
        let first: Vec<_> = topic.first.iter().map(restamped).collect();
        let rate = |time: fn(&TimedMessage) -> u64| rate_hz(first.iter().map(time).collect());
        let rates = [rate(|sample| sample.stamp_ns), rate(|sample| sample.log_ns)];
        let mut steps: Vec<_> = first
            .windows(2)
            .map(|two| two[1].stamp_ns.saturating_sub(two[0].stamp_ns))
            .filter(|step| *step > 0)
            .collect();
        steps.sort_unstable();
        let mut all = first;
        all.extend(topic.later.iter().map(restamped));
        all.sort_by_key(|sample| sample.log_ns);
        Self {
            rates,
            step_ns: nearest_rank(&steps, 0.5),
            all,
        }
    }

    fn not_measured(&self) -> Option<&'static str> {
        let log_ns = |sample: &TimedMessage| sample.log_ns;
        let is_equal =
            |sample: &TimedMessage| sample.log_ns.abs_diff(sample.stamp_ns) <= MAX_ROUNDING_NS;
        if self.all.len() < MIN_MESSAGES {
            Some("fewer than 10 messages")
        } else if self.all.first().map(log_ns) == self.all.last().map(log_ns) {
            Some("log times do not advance")
        } else if self.all.iter().all(is_equal) {
            Some(LOG_IS_STAMP)
        } else if self.speed().is_some_and(|speed| speed > BURST) {
            Some("written in a burst")
        } else {
            None
        }
    }

    /// Speed of the log times against the stamps: stamp time over log time.
    fn speed(&self) -> Option<f64> {
        let [stamps_hz, log_hz] = self.rates;
        Some(log_hz? / stamps_hz?)
    }

    /// Difference of the log times' speed from that of the stamps, all over the recording.
    fn drift(&self) -> f64 {
        let span = |time: fn(&TimedMessage) -> u64| {
            let ends = [self.all.first(), self.all.last()].map(|end| end.map(time));
            Some(ends[1]?.abs_diff(ends[0]?) as f64)
        };
        let spans = span(|sample| sample.stamp_ns).zip(span(|sample| sample.log_ns));
        spans.map_or(0.0, |(stamps, logs)| (1.0 - stamps / logs).abs())
    }

    /// Period by the log times; of a topic of few messages at least that.
    fn period_ns(&self) -> f64 {
        let span = |all: &[TimedMessage]| Some(all.last()?.log_ns - all.first()?.log_ns);
        match self.rates[1] {
            Some(hz) => 1e9 / hz,
            None => span(&self.all).unwrap_or(0) as f64 / (self.all.len().max(2) - 1) as f64,
        }
    }

    /// The delay at that rank of the messages that were logged within `window_ns` of a time.
    fn delay_at(&self, log_ns: u64, window_ns: u64, rank: f64) -> Option<i64> {
        let from = self
            .all
            .partition_point(|sample| sample.log_ns < log_ns.saturating_sub(window_ns));
        let near = self.all[from..]
            .iter()
            .take_while(|sample| sample.log_ns <= log_ns.saturating_add(window_ns));
        let mut delays: Vec<_> = near.map(TimedMessage::delay_ns).collect();
        delays.sort_unstable();
        nearest_rank(&delays, rank)
    }

    /// The shift of the stamps near `shift_ns` by which they are nearest to those of `left`: the
    /// cameras' latencies may differ.
    fn shift_ns(&self, left: &Self, shift_ns: i64) -> i64 {
        let mut stamps: Vec<_> = left.all.iter().map(|sample| sample.stamp_ns).collect();
        stamps.sort_unstable();
        let missing = |sample: &TimedMessage| {
            let stamp_ns = sample.stamp_ns.saturating_add_signed(shift_ns);
            let after = stamps.partition_point(|left| *left < stamp_ns);
            let near = stamps[after.saturating_sub(1)..].iter().take(2);
            let missing = near.map(|left| left.wrapping_sub(stamp_ns).cast_signed());
            missing.min_by_key(|ns| ns.unsigned_abs())
        };
        let mut missing: Vec<_> = self.all.iter().filter_map(missing).collect();
        missing.sort_unstable();
        shift_ns.saturating_add(nearest_rank(&missing, 0.5).unwrap_or(0))
    }

    /// The delays less the median around each.
    fn jitter(&self) -> ClockOffset {
        let window_ns = window_ns(self.period_ns());
        let apart = |sample: &TimedMessage| {
            let usual = self.delay_at(sample.log_ns, window_ns, 0.5)?;
            Some(sample.delay_ns().saturating_sub(usual))
        };
        ClockOffset::new(self.all.iter().filter_map(apart).collect()).unwrap_or_default()
    }

    /// Several standard errors of the difference of two medians. Places of one message have no
    /// jitter of their own.
    fn noise_ns(&self, left: &Self, behind: &ClockOffset) -> f64 {
        let messages = self.all.len().min(left.all.len()) as f64;
        let spread_ns = 2.0 * behind.usual_spread_ns;
        let jitter_ns = [self, left].map(|times| times.jitter().usual_spread_ns);
        jitter_ns.into_iter().sum::<f64>().max(spread_ns) / messages.sqrt()
    }

    /// The delay at that rank less that of `left` at equal log times. Ranks on both sides: a
    /// recorder that stalls logs the messages of one topic after those of another.
    fn behind(&self, left: &Self, rank: f64) -> Option<ClockOffset> {
        let ratio = self.speed().zip(left.speed()).map(|(own, left)| own / left);
        let is_alike = |ratio: f64| (1.0 / MAX_SPEED_RATIO..=MAX_SPEED_RATIO).contains(&ratio);
        if !ratio.is_none_or(is_alike) {
            return None;
        }
        let window_ns = window_ns(self.period_ns().max(left.period_ns()));
        let at = |sample: &TimedMessage| {
            let own = self.delay_at(sample.log_ns, window_ns, rank)?;
            Some(own.saturating_sub(left.delay_at(sample.log_ns, window_ns, rank)?))
        };
        let offsets: Vec<_> = self.all.iter().filter_map(at).collect();
        if offsets.len() < MIN_MESSAGES {
            return None;
        }
        ClockOffset::new(offsets)
    }

    /// The clock of a topic that is `behind` that of the left images.
    fn compared(&self, left: &Self, behind: &ClockOffset) -> ComparedClock {
        let period_ns = self.period_ns().max(left.period_ns());
        let jitter_ns = [self, left].map(|times| times.jitter().spread_ns as f64);
        let mut bins = OffsetBins::new(period_ns);
        bins.take_in_all([&left.all, &self.all]);
        let shift_ns = self.shift_ns(left, behind.median_ns);
        let is_usual = behind.median_ns.unsigned_abs() < MAX_LATENCY_NS
            && (self.shift_ns(left, 0).unsigned_abs() as f64) < period_ns / 10.0;
        let is_late = |(own, left): (&TimedMessage, &TimedMessage)| {
            let logged = own.log_ns.wrapping_sub(left.log_ns).cast_signed();
            let begins_apart = logged.unsigned_abs() as f64 > period_ns / 2.0;
            let has_one_stamp = (own.stamp_ns.abs_diff(left.stamp_ns) as f64) < period_ns / 4.0
                && logged.signum() == behind.median_ns.signum()
                && logged.unsigned_abs() > behind.median_ns.unsigned_abs() / 2;
            has_one_stamp || is_usual && begins_apart
        };
        ComparedClock {
            shift_ns,
            is_late: self.all.first().zip(left.all.first()).is_some_and(is_late),
            bin_noise_ns: jitter_ns.into_iter().sum::<f64>() + left.drift() * bins.width_ns as f64,
            bins,
        }
    }
}

/// Messages per second by times of theirs. A pause, or a time that is far from the others, is no
/// part of the rate.
fn rate_hz(mut times_ns: Vec<u64>) -> Option<f64> {
    times_ns.sort_unstable();
    let steps = times_ns.windows(2).map(|two| two[1] - two[0]);
    let mut steps: Vec<_> = steps.collect();
    steps.sort_unstable();
    let pause_ns = nearest_rank(&steps, 0.9)?.saturating_mul(PAUSE_STEPS);
    let most_ns = if pause_ns > 0 { pause_ns } else { u64::MAX };
    let span_ns: u64 = steps.iter().map(|step| (*step).min(most_ns)).sum();
    (span_ns > 0).then(|| steps.len() as f64 * 1e9 / span_ns as f64)
}

/// Log time around a message in which offsets are compared.
fn window_ns(period_ns: f64) -> u64 {
    (WINDOW_PERIODS * period_ns).max(WINDOW_NS) as u64
}

impl TopicScan {
    /// True if the stamps begin at 0, as those of a simulation: the first that is set is just above
    /// it.
    pub(crate) fn begins_at_0(&self) -> bool {
        let (Some(first), true) = (self.first.first(), self.unset > 0) else {
            return false;
        };
        let next = self.first.get(1).map_or(0, |next| next.stamp_ns);
        let step_ns = next.saturating_sub(first.stamp_ns);
        first.stamp_ns <= (2 * step_ns).max(1_000_000_000)
    }

    /// Reading of the stamps by the unit that the user names. Those of topics whose rates are in
    /// order or show another unit stay, but log times are used for all.
    pub(crate) fn reading(&self, named: Option<StampUnit>) -> StampReading {
        let unit_ns = match named {
            None => return StampReading::AsWritten,
            Some(StampUnit::Log) => return StampReading::Log,
            Some(StampUnit::Milliseconds) => 1_000_000,
            Some(StampUnit::Microseconds) => 1_000,
        };
        let samples = TopicTimes::new(self, StampRule::default());
        match self.wrong_unit(&samples) {
            Some(wrong) if wrong.unit.is_none() || wrong.unit == named => {
                if self.is_below_second(&samples) {
                    StampReading::BelowSecond(unit_ns)
                } else {
                    StampReading::Whole(unit_ns)
                }
            }
            _ => StampReading::AsWritten,
        }
    }

    /// The unit of stamps that are too fast to be nanoseconds.
    fn wrong_unit(&self, samples: &TopicTimes) -> Option<WrongUnit> {
        if samples.not_measured() == Some("fewer than 10 messages") {
            return None;
        }
        let [stamps_hz, log_hz] = samples.rates;
        let stamps_hz = if self.is_below_second(samples) {
            samples.step_ns.map(|step_ns| 1e9 / step_ns as f64)
        } else {
            stamps_hz
        };
        let (stamps_hz, log_hz) = stamps_hz.zip(log_hz)?;
        let ratio = stamps_hz / log_hz;
        if stamps_hz <= MAX_RATE_HZ || ratio <= UNIT_RATIO {
            return None;
        }
        let is_near = |unit: f64| (ratio / unit - 1.0).abs() <= UNIT_TOLERANCE;
        let unit = if is_near(1e3) {
            Some(StampUnit::Microseconds)
        } else if is_near(1e6) {
            Some(StampUnit::Milliseconds)
        } else {
            None
        };
        Some(WrongUnit { unit, stamps_hz })
    }

    /// True if only the part below a second is too fast: microseconds or milliseconds beside whole
    /// seconds.
    fn is_below_second(&self, samples: &TopicTimes) -> bool {
        let below = |sample: &TimedMessage| sample.stamp_ns % 1_000_000_000;
        let seconds = |sample: &TimedMessage| sample.stamp_ns / 1_000_000_000;
        let Some(log_hz) = samples.rates[1] else {
            return false;
        };
        let stamps_ns = |edge: Option<u64>| edge.unwrap_or(0) as f64;
        let stamps = || self.first.iter().map(|sample| sample.stamp_ns);
        let span_ns = stamps_ns(stamps().max()) - stamps_ns(stamps().min());
        let stamps_hz = self.first.len() as f64 * 1e9 / span_ns;
        let step_hz = samples.step_ns.map_or(0.0, |step_ns| 1e9 / step_ns as f64);
        let spread = self.first.first().map(seconds) != self.first.last().map(seconds);
        let is_epoch = self.first.first().map_or(0, seconds) > MIN_EPOCH_S;
        // Within one second the whole stamps are too fast, too, but are those since 1970.
        let are_seconds_right = if spread {
            stamps_hz < UNIT_RATIO * log_hz
        } else {
            is_epoch
        };
        are_seconds_right
            && self.first.iter().all(|sample| below(sample) < 1_000_000)
            && step_hz > MAX_RATE_HZ
            && step_hz >= UNIT_RATIO * log_hz
    }
}

impl ClockScan {
    /// The clocks of all topics, with their stamps by `rules`. `info`: the right calibrations.
    pub(crate) fn measured(
        &self,
        rules: &BTreeMap<String, StampRule>,
        info: Option<&str>,
    ) -> Vec<TopicClock> {
        let samples = |name: &str, topic: &TopicScan| {
            TopicTimes::new(topic, rules.get(name).copied().unwrap_or_default())
        };
        let [left_name, right_name] = &self.images;
        let left = self.topics.get(left_name).map(|topic| {
            let left = samples(left_name, topic);
            // Where the log times of others are no stamps, those of the left images are measured.
            let reason = left.not_measured().filter(|reason| *reason != LOG_IS_STAMP);
            let is_measured = reason.is_none() && topic.wrong_unit(&left).is_none();
            (left, is_measured)
        });
        let left = left.filter(|(_, is_measured)| *is_measured);
        let is_compared = |name: &str, topic: &TopicScan| {
            let is_measured = matches!(topic.role, ClockRole::Image | ClockRole::Measurement);
            is_measured || name == right_name || info == Some(name)
        };
        let clock = |(name, topic): (&String, &TopicScan)| {
            let own = samples(name, topic);
            let not_measured = own.not_measured();
            let is_left = name == left_name;
            let others = left.as_ref().filter(|_| not_measured.is_none() && !is_left);
            let behind = others.and_then(|(left, _)| own.behind(left, 0.5));
            let floor = others.and_then(|(left, _)| own.behind(left, 0.0));
            let delays: Vec<_> = own.all.iter().map(TimedMessage::delay_ns).collect();
            TopicClock {
                topic: name.clone(),
                role: topic.role,
                messages: own.all.len() as u64,
                stamps_hz: own.rates[0],
                log_hz: own.rates[1],
                offset: ClockOffset::new(delays).filter(|_| not_measured.is_none()),
                behind,
                not_measured,
                matters: topic.role != ClockRole::Calibration || topic.changes(),
                wrong_unit: topic.wrong_unit(&own),
                noise_ns: others
                    .zip(behind)
                    .map_or(0.0, |((left, _), behind)| own.noise_ns(left, &behind)),
                floor_ns: floor.map(|floor| floor.median_ns),
                compared: behind
                    .zip(left.as_ref().filter(|_| is_compared(name, topic)))
                    .map(|(behind, (left, _))| own.compared(left, &behind)),
            }
        };
        self.topics.iter().map(clock).collect()
    }
}
