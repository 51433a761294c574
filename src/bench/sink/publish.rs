//! Results to live ROS 2 topics: cloud and disparities of each pair, and a status once a second.

use super::{RunEnd, Sink};
use crate::dds::{Address, Domain, TopicOutbox};
use std::collections::BTreeSet;
use std::time::{Duration, Instant, SystemTime};
use svl_core::{Error, Result};
use svl_data::recording::{LiveMessage, LiveTopic, diagnostics, result_messages};
use svl_data::score::Judged;

/// Interval of the status.
const STATUS_EVERY: Duration = Duration::from_secs(1);
/// Level of a status, as in diagnostic_msgs/msg/DiagnosticStatus.
const FINE: u8 = 0;
const WARNING: u8 = 1;

/// The results of the run's algorithm, as messages below a prefix.
pub(super) struct PublishSink {
    outbox: TopicOutbox,
    prefix: String,
    frame_id: String,
    declared: BTreeSet<String>,
    /// Since the last status: its time, and what it will tell.
    since: Instant,
    interval: StatusInterval,
    /// Messages that could not be sent.
    unsent: u64,
}

/// The pairs since the last status.
#[derive(Default)]
struct StatusInterval {
    pairs: u32,
    matching: Duration,
    /// The longest time from a pair's stamp to its published result.
    latency: Duration,
    skew_ns: u64,
    cells: f64,
    /// Images that the source lost so far.
    drops: u64,
}

impl PublishSink {
    /// # Errors
    /// [`Error::Usage`] for an address without one prefix; those of DDS.
    pub(super) fn new(address: &str, frame_id: &str) -> Result<Self> {
        let address: Address = address.parse()?;
        let [prefix] = &address.topics[..] else {
            let expected = "expected one prefix of topics, as ros2:/svl";
            return Err(Error::Usage(format!("{address}: {expected}")));
        };
        Ok(Self {
            prefix: prefix.trim_end_matches('/').to_owned(),
            outbox: TopicOutbox::new(Domain::join(&address)?)?,
            frame_id: frame_id.to_owned(),
            declared: BTreeSet::new(),
            since: Instant::now(),
            interval: StatusInterval::default(),
            unsent: 0,
        })
    }

    fn send(&mut self, message: LiveMessage) -> Result<()> {
        let LiveMessage {
            topic,
            schema,
            data,
        } = message;
        // ROS has all statuses on one topic.
        let is_status = topic.starts_with('/');
        let name = if is_status {
            topic.to_owned()
        } else {
            format!("{}/{topic}", self.prefix)
        };
        if self.declared.insert(name.clone()) {
            let live = LiveTopic {
                name: name.clone(),
                schema: schema.to_owned(),
            };
            // A subscriber that died must not hold up the results for the others. Readers of the
            // status ask for reliability.
            self.outbox.declare(&live, is_status)?;
        }
        if let Err(error) = self.outbox.send(&name, data) {
            if self.unsent == 0 {
                tracing::warn!("{error}; this message is dropped");
            }
            self.unsent += 1;
        }
        Ok(())
    }

    /// The status of the pairs since the last one.
    fn report(&mut self, algorithm: &str) -> Result<()> {
        let interval = std::mem::take(&mut self.interval);
        let seconds = self.since.elapsed().as_secs_f64();
        self.since = Instant::now();
        let of_pairs = |sum: f64| sum / f64::from(interval.pairs.max(1));
        let ms = |time: Duration| format!("{:.1}", time.as_secs_f64() * 1e3);
        let rate = format!("{:.1}", f64::from(interval.pairs) / seconds);
        let known = format!("{:.0}", 100.0 * of_pairs(interval.cells));
        let values = [
            ("pairs per second", rate.clone()),
            ("matching ms", ms(interval.matching / interval.pairs.max(1))),
            ("latency ms, longest", ms(interval.latency)),
            (
                "skew ms, largest",
                ms(Duration::from_nanos(interval.skew_ns)),
            ),
            ("known cells %", known.clone()),
            ("images lost", interval.drops.to_string()),
            ("messages not sent", self.unsent.to_string()),
        ];
        let level = if interval.pairs > 0 { FINE } else { WARNING };
        let message = format!("{rate} pairs a second, {known} % of cells known");
        let name = format!("svl {}: {algorithm}", self.prefix);
        let now_ns = now().as_nanos() as u64;
        self.send(diagnostics(now_ns, level, &name, &message, &values)?)
    }
}

impl Sink for PublishSink {
    fn take(&mut self, judged: &Judged) -> Result<()> {
        let frame = &judged.frame;
        let interval = &mut self.interval;
        interval.pairs += 1;
        interval.drops = frame.exposure.drops;
        let skew_ns = frame.exposure.skew_ns.unwrap_or(0).unsigned_abs();
        interval.skew_ns = interval.skew_ns.max(skew_ns);
        let Some(scored) = judged.estimates.first() else {
            return Ok(());
        };
        let estimate = &scored.estimate;
        interval.cells += estimate.grid.known_share();
        interval.matching += estimate.times.total();
        for message in result_messages(frame, estimate, &self.frame_id)? {
            self.send(message)?;
        }
        let latency = now().saturating_sub(Duration::from_nanos(frame.stamp_ns));
        self.interval.latency = self.interval.latency.max(latency);
        if self.since.elapsed() >= STATUS_EVERY {
            self.report(&estimate.algorithm)?;
        }
        Ok(())
    }

    fn end_run(&mut self, _: &RunEnd<'_>) -> Result<()> {
        if self.unsent > 0 {
            tracing::warn!(
                "{}: {} messages could not be sent",
                self.prefix,
                self.unsent
            );
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// Time since 1970.
fn now() -> Duration {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.unwrap_or_default()
}
