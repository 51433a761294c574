//! Results to live ROS 2 topics: cloud, scan and disparities of each pair, and a status once a
//! second.

use super::{PassEnd, PassStart, PublishRequest, Sink};
use parking_lot::Mutex;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};
use svl_core::{Error, Result, counted, interrupt};
use svl_live::dds::{Address, Domain, FoundReader, TopicOutbox};
use svl_recording::{
    DIAGNOSTICS, LiveTopic, PairResult, RESULT_TOPICS, ResultMessage, ResultOptions, diagnostics,
    result_messages, static_transforms,
};
use svl_score::judge::Judged;
use svl_score::losses::Losses;

/// Interval of the status.
const STATUS_EVERY: Duration = Duration::from_secs(1);
/// Time without anything new in the domain after which all subscribers are found, with live topics
/// and with a recording, and the longest wait for them.
const STEP: Duration = Duration::from_millis(300);
const SETTLING_TIME: Duration = Duration::from_secs(2);
const MAX_WAIT: Duration = Duration::from_secs(10);
/// Level of a status, as in diagnostic_msgs/msg/DiagnosticStatus.
const FINE: u8 = 0;
const WARNING: u8 = 1;
const STALE: u8 = 3;

/// The results of the run's algorithm, as messages below a prefix.
pub(super) struct PublishSink {
    state: Arc<Mutex<Publication>>,
    /// Sends the status, also while there are no pairs, until the sink is gone.
    status: Option<JoinHandle<()>>,
}

/// The topics, and what the next status will tell.
struct Publication {
    outbox: TopicOutbox,
    prefix: String,
    options: ResultOptions,
    /// The subscribers now, and the unfit ones that the user was warned of.
    readers: Vec<FoundReader>,
    warned: BTreeSet<String>,
    /// Label of the last pair's algorithm.
    algorithm: String,
    /// The last status and the last pair.
    since: Instant,
    last_pair: Instant,
    interval: StatusInterval,
    /// Losses of live topics so far.
    losses: Option<Arc<Mutex<Losses>>>,
    /// Messages that could not be sent.
    unsent: u64,
    ended: bool,
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
    /// Pairs without a calibration.
    without_rig: u32,
}

/// Declares the topics below a prefix. `dense`: the cloud has all pixels.
fn declare(outbox: &mut TopicOutbox, prefix: &str, dense: bool) -> Result<()> {
    for (topic, schema) in RESULT_TOPICS.into_iter().chain([DIAGNOSTICS]) {
        let live = LiveTopic {
            name: full_name(prefix, topic),
            schema: schema.to_owned(),
        };
        // DDS keeps seconds of reliable messages: too much memory for images.
        let is_large = matches!(topic, "disparity" | "depth") || topic == "points" && dense;
        outbox.declare(&live, !is_large, false)?;
    }
    Ok(())
}

/// Waits until subscribers that are there were found: until nothing new is.
fn await_readers(outbox: &TopicOutbox, settling_time: Duration) {
    let (began, mut changed, mut known) = (Instant::now(), Instant::now(), 0);
    while changed.elapsed() < settling_time && began.elapsed() < MAX_WAIT && !interrupt::requested()
    {
        let discovered = outbox.discovered();
        if discovered != known {
            (known, changed) = (discovered, Instant::now());
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let readers = counted(outbox.readers().len() as u64, "subscriber");
    tracing::info!("{readers} found");
}

/// ROS has all statuses on one topic, and all transforms.
fn full_name(prefix: &str, topic: &str) -> String {
    if topic.starts_with('/') {
        topic.to_owned()
    } else {
        format!("{prefix}/{topic}")
    }
}

impl PublishSink {
    /// # Errors
    /// [`Error::Usage`] for an address without one prefix; those of DDS.
    pub(super) fn new(request: PublishRequest<'_>) -> Result<Self> {
        let address: Address = request.address.parse()?;
        let [prefix] = &address.topics[..] else {
            let expected = "expected one prefix of topics, as ros2:/svl";
            return Err(Error::Usage(format!("{address}: {expected}")));
        };
        let (options, losses) = (request.options, request.losses);
        let prefix = prefix.trim_end_matches('/').to_owned();
        let mut outbox = TopicOutbox::new(Domain::join(&address)?)?;
        declare(&mut outbox, &prefix, options.dense)?;
        let transform = static_transforms(&options.frame_id, None, now().as_nanos() as u64)?;
        if let Some(transform) = transform {
            let live = LiveTopic {
                name: transform.topic.to_owned(),
                schema: transform.schema().to_owned(),
            };
            outbox.declare(&live, true, true)?;
            outbox.send(transform.topic, transform.into_data())?;
        }
        // The next pair of live topics comes soon; the first one of a recording comes once.
        let is_live = losses.is_some();
        await_readers(&outbox, if is_live { STEP } else { SETTLING_TIME });
        let publication = Publication {
            outbox,
            prefix,
            options,
            readers: Vec::new(),
            warned: BTreeSet::new(),
            algorithm: String::new(),
            since: Instant::now(),
            last_pair: Instant::now(),
            interval: StatusInterval::default(),
            losses,
            unsent: 0,
            ended: false,
        };
        let state = Arc::new(Mutex::new(publication));
        let shared = Arc::clone(&state);
        let status = std::thread::spawn(move || report_until_ended(&shared));
        Ok(Self {
            state,
            status: Some(status),
        })
    }
}

/// Sends a status once a second.
fn report_until_ended(state: &Mutex<Publication>) {
    loop {
        std::thread::park_timeout(STATUS_EVERY);
        let mut state = state.lock();
        if state.ended {
            return;
        }
        if state.since.elapsed() >= STATUS_EVERY
            && let Err(error) = state.report()
        {
            tracing::warn!("{}: no status: {error}", state.prefix);
        }
    }
}

impl Publication {
    fn send(&mut self, message: ResultMessage) {
        let name = full_name(&self.prefix, message.topic);
        if let Err(error) = self.outbox.send(&name, message.into_data()) {
            if self.unsent == 0 {
                tracing::warn!("{error}; this message is dropped");
            }
            self.unsent += 1;
        }
    }

    /// Looks for subscribers, and warns once of each that receives nothing.
    fn find_readers(&mut self) {
        self.readers = self.outbox.readers();
        for FoundReader { topic, unfit } in &self.readers {
            let unfit = unfit.as_ref().map(|why| format!("{topic}: {why}"));
            if let Some(unfit) = unfit.filter(|unfit| self.warned.insert(unfit.clone())) {
                tracing::warn!("{unfit}: a subscriber receives nothing");
            }
        }
    }

    /// The status of the pairs since the last one.
    fn report(&mut self) -> Result<()> {
        self.find_readers();
        let interval = std::mem::take(&mut self.interval);
        let seconds = self.since.elapsed().as_secs_f64();
        self.since = Instant::now();
        let per_pair = |sum: f64| sum / f64::from(interval.pairs.max(1));
        let ms = |time: Duration| format!("{:.1}", time.as_secs_f64() * 1e3);
        let rate = format!("{:.1}", f64::from(interval.pairs) / seconds);
        let known = format!("{:.0}", 100.0 * per_pair(interval.cells));
        let losses = self.losses.as_ref().map(|losses| losses.lock().clone());
        let losses = losses.unwrap_or_default();
        let unfit = self.readers.iter().filter(|own| own.unfit.is_some());
        let unfit = unfit.count();
        let values = [
            ("pairs per second", rate.clone()),
            ("matching ms", ms(interval.matching / interval.pairs.max(1))),
            ("latency ms, longest", ms(interval.latency)),
            (
                "skew ms, largest",
                ms(Duration::from_nanos(interval.skew_ns)),
            ),
            ("known cells %", known.clone()),
            ("images lost", losses.lost_images.to_string()),
            ("pairs lost", losses.lost_pairs.to_string()),
            ("pairs dropped", losses.dropped.to_string()),
            ("pairs replaced", losses.replaced.to_string()),
            ("messages not sent", self.unsent.to_string()),
            ("readers matched", (self.readers.len() - unfit).to_string()),
            ("readers unfit", unfit.to_string()),
        ];
        let (level, message) = match interval.pairs {
            0 => {
                let silence = self.last_pair.elapsed().as_secs();
                (STALE, format!("no pairs for {silence} s"))
            }
            _ if interval.without_rig > 0 => {
                let pairs = counted(interval.without_rig, "pair");
                let why = "without a calibration, so nothing is published of them";
                (WARNING, format!("{pairs} {why}"))
            }
            _ => {
                let message = format!("{rate} pairs a second, {known} % of cells known");
                (FINE, message)
            }
        };
        let name = format!("svl {}: {}", self.prefix, self.algorithm);
        let now_ns = now().as_nanos() as u64;
        self.send(diagnostics(now_ns, level, &name, &message, &values)?);
        Ok(())
    }

    fn take(&mut self, judged: &Judged) -> Result<()> {
        let frame = &judged.frame;
        self.last_pair = Instant::now();
        let interval = &mut self.interval;
        interval.pairs += 1;
        interval.without_rig += u32::from(frame.rig().is_none());
        let skew_ns = frame.exposure.skew_ns.unwrap_or(0).unsigned_abs();
        interval.skew_ns = interval.skew_ns.max(skew_ns);
        let Some(scored) = judged.estimates.first() else {
            return Ok(());
        };
        let estimate = &scored.estimate;
        self.algorithm.clone_from(&estimate.algorithm);
        interval.cells += estimate.grid.known_share();
        interval.matching += estimate.times.map_or(Duration::ZERO, |times| times.total());
        let result = PairResult::new(frame, estimate, [judged.pair_hash(), scored.hash]);
        self.find_readers();
        let is_read = |topic: &str| {
            let name = full_name(&self.prefix, topic);
            let mut readers = self.readers.iter();
            readers.any(|reader| reader.topic == name && reader.unfit.is_none())
        };
        for message in result_messages(frame, &result, &self.options, is_read)? {
            self.send(message);
        }
        let latency = now().saturating_sub(Duration::from_nanos(frame.stamp_ns));
        self.interval.latency = self.interval.latency.max(latency);
        Ok(())
    }
}

impl Sink for PublishSink {
    fn begin_pass(&mut self, start: &PassStart<'_>) -> Result<()> {
        let mut state = self.state.lock();
        if let Some(algorithm) = start.manifest.algorithms.first() {
            state.algorithm.clone_from(&algorithm.label);
        }
        Ok(())
    }

    fn take(&mut self, judged: &Judged) -> Result<()> {
        self.state.lock().take(judged)
    }

    fn end_pass(&mut self, _: &PassEnd<'_>) -> Result<()> {
        let state = self.state.lock();
        if state.unsent > 0 {
            let (prefix, unsent) = (&state.prefix, state.unsent);
            tracing::warn!("{prefix}: {unsent} messages could not be sent");
        }
        Ok(())
    }
}

impl Drop for PublishSink {
    fn drop(&mut self) {
        self.state.lock().ended = true;
        if let Some(status) = self.status.take() {
            status.thread().unpark();
            // It holds nothing that its end could lose.
            let _ = status.join();
        }
    }
}

/// Time since 1970.
fn now() -> Duration {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.unwrap_or_default()
}
