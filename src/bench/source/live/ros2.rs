//! Live ROS 2 topics as a source, over DDS: pairs formed as those of a bag, by a thread of its own.

use crate::source::frames::Source;
use crate::source::opened::open_source::{Heard, Opened};
use crate::source::opened::request::Request;
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};
use svl_core::stereo::{Frame, Geometry};
use svl_core::{Error, Result, counted};
use svl_grab::{Pushed, Queue, WhenFull};
use svl_live::dds::{Address, Domain, FoundTopic, TopicInbox};
use svl_recording::{Header, LiveTopic, Selection, TopicFile, TopicPairs};
use svl_score::losses::{GrabberReport, Losses};

/// Longest wait for publishers of the topics, and for the first pair of their messages.
const MAX_WAIT: Duration = Duration::from_secs(10);
/// Time without a new topic after which all are found.
const SETTLING_TIME: Duration = Duration::from_secs(1);
/// Longest wait for calibrations after the first message.
const MAX_CALIBRATION_WAIT: Duration = Duration::from_secs(2);
/// Longest silence of a topic that is not reported.
const MAX_SILENCE: Duration = Duration::from_secs(2);
/// Interval at which waiting threads look whether to stop.
const STEP: Duration = Duration::from_millis(50);
/// Longest wait for the last pairs to arrive.
const MAX_LATENESS: Duration = MAX_SILENCE;
/// Pairs that may wait to be used.
const QUEUE: usize = 64;

/// The pairs of two topics, until `stopped`.
struct TopicSource {
    name: String,
    queue: Arc<Queue<Frame>>,
    receiver: Option<JoinHandle<Receiver>>,
    ended: Arc<AtomicBool>,
    /// True if a newer pair takes the place of one that waits.
    keeps_newest: bool,
    /// Time by this machine's clock after which it ends once stamps stand still.
    longest: Option<Duration>,
    began: Instant,
    /// The latest stamp, and since when it is that.
    latest: (u64, Instant),
    stopped: fn() -> bool,
}

/// Receives messages and forms pairs.
struct Receiver {
    name: String,
    inbox: TopicInbox,
    pairs: TopicPairs,
    /// Pairs of images that do not fit each other.
    unreadable: u64,
    /// Images that cannot be read, left and right.
    unreadable_images: [u64; 2],
    /// True if raw pairs have a calibration that rectifies them, or its delay was reported.
    rectifies: bool,
    /// Unreadable messages other than images, by topic.
    broken: BTreeMap<String, u64>,
    /// Pairs so far, those that found the queue full, and those that a newer one replaced there.
    formed: u64,
    dropped: u64,
    replaced: u64,
    /// The losses so far, for the status.
    shared: Arc<Mutex<Losses>>,
    /// The last image of each camera; none once its silence was reported.
    heard: [Option<Instant>; 2],
    /// Size and geometry of the first pair.
    first: Option<((usize, usize), Geometry)>,
    /// Start of the clock by which pairs wait for their calibrations.
    began: Instant,
}

/// Opens the topics that a request names, or those found by type and name.
pub(crate) fn open(request: &Request<'_>) -> Result<Opened> {
    let mut selection = request.selection();
    let address: Address = request.name.parse()?;
    if let Some([left, right]) = address.pair()? {
        (selection.left, selection.right) = (Some(left), Some(right));
    }
    let stopped = request.host.stopped;
    let domain = Domain::join(&address)?;
    let (pairs, topics) = find(&domain, request.name, &selection, stopped)?;
    let mut receiver = Receiver {
        name: request.name.to_owned(),
        inbox: TopicInbox::new(domain, &topics)?,
        pairs,
        unreadable: 0,
        unreadable_images: [0; 2],
        rectifies: false,
        broken: BTreeMap::new(),
        formed: 0,
        dropped: 0,
        replaced: 0,
        shared: Arc::default(),
        heard: [None; 2],
        first: None,
        began: Instant::now(),
    };
    let first = receiver.begin(stopped)?;
    let pairs = &receiver.pairs;
    // Several publishers of static transforms are usual: each has its own.
    let is_mixed = |found: &&FoundTopic| found.publishers > 1 && !found.topic.is_static_transform();
    let mixed = topics.iter().filter(is_mixed);
    let mixed = mixed.map(|found| {
        let FoundTopic {
            topic, publishers, ..
        } = found;
        format!(
            "{}: {publishers} publishers, whose messages are mixed",
            topic.name
        )
    });
    let mut facts = pairs.facts();
    facts.remarks.extend(mixed);
    let losses = Some(Arc::clone(&receiver.shared));
    let source = TopicSource::start(receiver, first, request);
    Ok(Opened {
        is_live: true,
        losses,
        ..Opened::new(source, Header::new(request.name), "ros2")
    }
    .with_facts(facts))
}

/// The topics, once `is_enough` and no further one was found for a while, or after a long wait.
fn settled(
    domain: &Domain,
    stopped: fn() -> bool,
    is_enough: impl Fn(&[FoundTopic]) -> bool,
) -> Result<Vec<FoundTopic>> {
    let (began, mut changed) = (Instant::now(), Instant::now());
    let mut known = Vec::new();
    loop {
        let found = domain.topics();
        if found != known {
            (known, changed) = (found, Instant::now());
        }
        let is_settled = changed.elapsed() >= SETTLING_TIME && is_enough(&known);
        if is_settled || began.elapsed() >= MAX_WAIT {
            return Ok(known);
        }
        if stopped() {
            return Err(Error::Interrupted);
        }
        std::thread::sleep(STEP);
    }
}

/// Waits for the topics of both cameras and of their calibrations.
fn find(
    domain: &Domain,
    name: &str,
    selection: &Selection,
    stopped: fn() -> bool,
) -> Result<(TopicPairs, Vec<FoundTopic>)> {
    let topics = |known: &[FoundTopic]| -> Vec<LiveTopic> {
        known.iter().map(|found| found.topic.clone()).collect()
    };
    let choose = |known: &[FoundTopic]| TopicPairs::new(name, &topics(known), selection);
    let known = settled(domain, stopped, |known| choose(known).is_ok())?;
    let pairs = choose(&known).map_err(|reason| {
        let found = counted(known.len() as u64, "topic");
        let cure = format!("`svl info {name}` lists what is published");
        Error::other(format!(
            "{name}: {reason}; {found} found in {MAX_WAIT:?}; {cure}"
        ))
    })?;
    let named = |name| known.iter().find(|found| found.topic.name == name).cloned();
    let needed = pairs.topics().filter_map(named).collect();
    Ok((pairs, needed))
}

impl Receiver {
    /// Decides calibrations and bit depth by the first messages, and returns the first pair.
    fn begin(&mut self, stopped: fn() -> bool) -> Result<Frame> {
        let began = Instant::now();
        let mut first = None;
        let mut ahead = Vec::new();
        let mut is_ready = false;
        let is_waiting = |pairs: &TopicPairs, is_ready: bool| !is_ready || !pairs.knows_clocks();
        while is_waiting(&self.pairs, is_ready)
            && first.is_none_or(|first: Instant| first.elapsed() < MAX_CALIBRATION_WAIT)
        {
            self.check_patience(began, stopped)?;
            let pairs = &mut self.pairs;
            self.inbox.receive(STEP, |topic, data| {
                first.get_or_insert_with(Instant::now);
                let at_ns = now_ns();
                is_ready |= pairs.look_at(topic, at_ns, &data);
                ahead.push((topic, at_ns, data));
            })?;
        }
        self.pairs.begin()?;
        self.rectifies = self.pairs.facts().calibration.is_some();
        for (topic, at_ns, data) in ahead {
            self.take_in(topic, at_ns, &data);
        }
        loop {
            if let Some(frame) = self.pop() {
                return Ok(frame);
            }
            self.check_patience(began, stopped)?;
            self.receive()?;
        }
    }

    fn check_patience(&self, began: Instant, stopped: fn() -> bool) -> Result<()> {
        if stopped() {
            return Err(Error::Interrupted);
        }
        if began.elapsed() < MAX_WAIT {
            return Ok(());
        }
        let why = self.pairs.facts().why_none;
        Err(Error::other(format!(
            "{}: {why}, in {MAX_WAIT:?}",
            self.name
        )))
    }

    /// Takes in the messages that came.
    fn receive(&mut self) -> Result<()> {
        let mut came = Vec::new();
        self.inbox
            .receive(STEP, |topic, data| came.push((topic, now_ns(), data)))?;
        for (topic, at_ns, data) in came {
            self.take_in(topic, at_ns, &data);
        }
        let topics = self.pairs.topics().zip(&mut self.heard);
        for (topic, heard) in topics {
            if heard.is_some_and(|heard| heard.elapsed() >= MAX_SILENCE) {
                *heard = None;
                tracing::warn!(
                    "{}: {topic}: nothing received for {MAX_SILENCE:?}",
                    self.name
                );
            }
        }
        Ok(())
    }

    fn take_in(&mut self, topic: usize, at_ns: u64, data: &[u8]) {
        if let Some(heard) = self.heard.get_mut(topic) {
            *heard = Some(Instant::now());
        }
        let Err(error) = self.pairs.take_in(topic, at_ns, data) else {
            if topic >= self.heard.len() {
                self.check_rectification();
            }
            return;
        };
        let mut reason = error.to_string();
        if let Some(other) = self.inbox.other_type(topic) {
            reason += &format!("; the topic is published as {other} too");
        }
        if let Some(images) = self.unreadable_images.get_mut(topic) {
            *images += 1;
            if *images == 1 {
                tracing::warn!("{}: {reason}; its pairs are dropped", self.name);
            }
            return;
        }
        let name = self.pairs.topics().nth(topic).unwrap_or_default();
        let broken = self.broken.entry(name.to_owned()).or_default();
        *broken += 1;
        if *broken == 1 {
            tracing::warn!("{}: {reason}; dropped", self.name);
        }
    }

    /// Warns of a calibration that came after svl chose not to rectify.
    fn check_rectification(&mut self) {
        if self.formed > 0 && !self.rectifies && self.pairs.facts().calibration.is_some() {
            self.rectifies = true;
            tracing::warn!(
                "{}: the calibration came after the first pair, and pairs are not rectified; \
                 start svl again",
                self.name
            );
        }
    }

    /// Number of pairs that could not be read.
    fn unreadable(&self) -> u64 {
        self.unreadable + self.unreadable_images.into_iter().max().unwrap_or(0)
    }

    fn report_unreadable(&mut self, reason: &str) {
        if self.unreadable == 0 {
            tracing::warn!("{}: {reason}; this pair is dropped", self.name);
        }
        self.unreadable += 1;
    }

    /// The next pair that can be read.
    fn pop(&mut self) -> Option<Frame> {
        loop {
            match self.pairs.pop(self.began.elapsed().as_nanos() as u64)? {
                Err(error) => self.report_unreadable(&error.to_string()),
                Ok(frame) if self.cannot_be_rectified(&frame) => {
                    let (width, height) = frame.pair.size();
                    self.report_unreadable(&format!(
                        "the pair at {} ns is {width}x{height} px, without a calibration of that \
                         size, unlike the first ones; start svl again",
                        frame.stamp_ns
                    ));
                }
                Ok(mut frame) => {
                    self.formed += 1;
                    let losses = self.losses();
                    frame.exposure.drops += losses.lost_images + 2 * losses.dropped;
                    return Some(frame);
                }
            }
        }
    }

    /// True for a raw pair unlike the first one, by which svl chose the rectification, if it has no
    /// calibration of its own.
    fn cannot_be_rectified(&mut self, frame: &Frame) -> bool {
        let own = (frame.pair.size(), frame.geometry);
        let (size, geometry) = *self.first.get_or_insert(own);
        let is_raw = |geometry| geometry == Geometry::Raw;
        let is_alike = own.0 == size || frame.calibration.is_some();
        is_raw(frame.geometry) && !(is_raw(geometry) && is_alike)
    }

    /// Losses so far of the network and the queue, and the unreadable.
    fn losses(&self) -> Losses {
        let mut lost = self.inbox.lost().map(|(_, lost)| lost);
        let [left, right] = [(); 2].map(|()| lost.next().unwrap_or(0));
        // A pair that is lost whole leaves no image without a partner.
        let whole = (left + right).saturating_sub(self.pairs.unpaired()) / 2;
        Losses {
            lost_images: left + right,
            lost_pairs: whole.min(left).min(right),
            dropped: self.dropped,
            replaced: self.replaced,
            unreadable: self.unreadable(),
            ..Losses::default()
        }
    }

    /// Passes pairs on until it is told to end, or the network fails.
    fn run(&mut self, queue: &Queue<Frame>, ended: &AtomicBool) -> Result<()> {
        while !ended.load(Ordering::Relaxed) {
            self.receive()?;
            while let Some(frame) = self.pop() {
                match queue.push(frame) {
                    Pushed::Taken | Pushed::Late => {}
                    Pushed::Dropped => self.dropped += 1,
                    Pushed::Replaced => self.replaced += 1,
                    Pushed::Abandoned => return Ok(()),
                }
            }
            *self.shared.lock() = self.losses();
        }
        Ok(())
    }

    /// The counts, by name and in a line.
    fn report(&self, taken: u64) -> GrabberReport {
        let [left, right] = self.pairs.counts();
        let (pairs, dropped, losses) = (self.formed, self.dropped, self.losses());
        let unread = pairs.saturating_sub(dropped + self.replaced + taken);
        let counts = [
            ("left_images", left),
            ("right_images", right),
            ("pairs", pairs),
            ("dropped_pairs", dropped),
            ("replaced_pairs", self.replaced),
            ("lost_images", losses.lost_images),
            ("lost_pairs", losses.lost_pairs),
            ("unread_pairs", unread),
        ];
        let lost: Vec<_> = self.inbox.lost().filter(|(_, lost)| *lost > 0).collect();
        let words = lost
            .iter()
            .map(|(topic, lost)| format!("{lost} of {topic}"));
        let words = match &words.collect::<Vec<_>>()[..] {
            [] => "no message lost".to_owned(),
            words => format!("messages lost: {}", words.join(", ")),
        };
        let mut text = format!(
            "{left} left and {}, {}; {words}; {} dropped by a full queue",
            counted(right, "right image"),
            counted(pairs, "pair"),
            counted(dropped, "pair")
        );
        if self.replaced > 0 {
            text += &format!(", {} replaced by newer ones", self.replaced);
        }
        let jumps = self.pairs.jumps();
        if jumps > 0 {
            let jumps = counted(jumps, "jump");
            text += &format!(", {jumps} of the clock");
        }
        if unread > 0 {
            text += &format!(", {unread} received beyond the end");
        }
        let counts = counts.map(|(name, n)| (name.to_owned(), n.to_string()));
        let lost = lost
            .iter()
            .map(|(topic, n)| (format!("lost {topic}"), n.to_string()));
        let facts = counts.into_iter().chain(lost);
        let facts = facts.chain([("counts".to_owned(), text.clone())]).collect();
        GrabberReport { facts, text }
    }
}

impl TopicSource {
    fn start(mut receiver: Receiver, first: Frame, request: &Request<'_>) -> Self {
        let length = request.grab.queue.unwrap_or(QUEUE);
        let when_full = request.grab.when_full.unwrap_or(WhenFull::Drop);
        let queue = Arc::new(Queue::new(length, when_full));
        queue.push(first);
        let ended = Arc::new(AtomicBool::new(false));
        let (thread_queue, told) = (Arc::clone(&queue), Arc::clone(&ended));
        let run = move || {
            let ran = receiver.run(&thread_queue, &told);
            thread_queue.close(ran);
            receiver
        };
        Self {
            name: request.name.to_owned(),
            queue,
            receiver: Some(std::thread::spawn(run)),
            ended,
            keeps_newest: when_full == WhenFull::Replace,
            longest: request.live_s.and_then(|seconds| {
                let longest = Duration::try_from_secs_f64(seconds).ok()?;
                longest.checked_add(MAX_LATENESS)
            }),
            began: Instant::now(),
            latest: (0, Instant::now()),
            stopped: request.host.stopped,
        }
    }

    /// True if the time is over by this machine's clock, and there was no later stamp `since`.
    fn is_over(&self, since: Instant) -> bool {
        let is_past = |longest| self.began.elapsed() >= longest;
        self.longest.is_some_and(is_past) && since.elapsed() >= MAX_LATENESS
    }
}

impl Source for TopicSource {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let waits = Instant::now();
        let is_told = || (self.stopped)() || self.is_over(waits);
        let next = self.queue.pop_unless(is_told)?;
        let (latest_ns, _) = self.latest;
        if let Some(frame) = next.as_ref().filter(|frame| frame.stamp_ns > latest_ns) {
            self.latest = (frame.stamp_ns, Instant::now());
        }
        // Pairs whose stamps stand still arrive beyond the end.
        let since = next.as_ref().map_or(waits, |_| self.latest.1);
        let is_over = self.is_over(since) && !(self.stopped)();
        let next = next.filter(|_| !is_over);
        if is_over {
            tracing::warn!(
                "{}: ended by the clock of this machine: by their stamps, the pairs last less",
                self.name
            );
        }
        Ok(next)
    }

    fn finish(&mut self, taken: u64) -> Losses {
        self.ended.store(true, Ordering::Relaxed);
        self.queue.abandon();
        let Some(Ok(mut receiver)) = self.receiver.take().map(JoinHandle::join) else {
            return Losses::default();
        };
        receiver.pairs.end();
        let losses = receiver.losses();
        // Images that waited for a partner as svl stopped are no losses.
        let facts = receiver.pairs.facts();
        // The partner of an unreadable image is reported with it; that of another unreadable one is
        // not unpaired.
        let [left, right] = receiver.unreadable_images;
        Losses {
            unpaired: (facts.unpaired_ns.len() as u64).saturating_sub(left.abs_diff(right)),
            outside: facts.outside,
            broken: std::mem::take(&mut receiver.broken),
            grabber: Some(receiver.report(taken)),
            ..losses
        }
    }

    fn keeps_newest(&self) -> bool {
        self.keeps_newest
    }
}

impl Drop for TopicSource {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
    }
}

fn now_ns() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |since| since.as_nanos() as u64)
}

/// Duration of [`listen`], after all topics were found.
const LISTEN: Duration = Duration::from_secs(3);
/// Limit on the bytes of its messages.
const MAX_LISTEN_BYTES: usize = 512 << 20;

/// Listens to images, calibrations and static transforms, to say what there is.
///
/// # Errors
/// [`Error::Other`] if nothing is published; those of the network and of the temporary bag.
pub(crate) fn listen(name: &str, stopped: fn() -> bool) -> Result<Heard> {
    let address: Address = name.parse()?;
    let named = address.pair()?;
    let domain = Domain::join(&address)?;
    let known = settled(&domain, stopped, |known| !known.is_empty())?;
    if known.is_empty() {
        return Err(Error::other(format!(
            "{name}: no topic in domain {} in {MAX_WAIT:?}: publishers need the same \
             ROS_DOMAIN_ID and a network with multicast, or the same host",
            address.domain
        )));
    }
    let is_wanted = |found: &FoundTopic| {
        let topic = &found.topic;
        let is_named = named
            .as_ref()
            .is_none_or(|named| named.contains(&topic.name));
        topic.is_image() && is_named || topic.is_calibration() || topic.is_static_transform()
    };
    let (wanted, others): (Vec<_>, Vec<_>) = known.into_iter().partition(is_wanted);
    let mut inbox = TopicInbox::new(domain, &wanted)?;
    let (mut messages, mut bytes, began) = (Vec::new(), 0, Instant::now());
    while began.elapsed() < LISTEN && bytes < MAX_LISTEN_BYTES && !stopped() {
        inbox.receive(STEP, |topic, data| {
            bytes += data.len();
            messages.push((topic, now_ns(), data));
        })?;
    }
    let seconds = began.elapsed().as_secs_f64();
    let temporary = |e| Error::io(std::env::temp_dir(), e);
    let lost = inbox.lost().filter(|(_, lost)| *lost > 0);
    let is_silent = |place: &usize| messages.iter().all(|(topic, ..)| topic != place);
    let silent = (0..wanted.len())
        .filter(is_silent)
        .map(|place| &wanted[place]);
    let heard = Heard {
        seconds,
        silent: silent
            .map(|found| (found.topic.name.clone(), found.publishers))
            .collect(),
        lost: lost.map(|(name, lost)| (name.to_owned(), lost)).collect(),
        others: others
            .into_iter()
            .map(|found| (found.topic.name, found.topic.schema))
            .collect(),
        named,
        folder: tempfile::tempdir().map_err(temporary)?,
    };
    let topics: Vec<_> = wanted.into_iter().map(|found| found.topic).collect();
    let mut file = TopicFile::create(&heard.bag(), &topics)?;
    for (topic, at_ns, data) in messages {
        file.write(topic, at_ns, &data)?;
    }
    file.finish()?;
    Ok(heard)
}
