//! Reads the pairs of a recording.

use crate::bags::container::Container;
use crate::bags::header::Header;
use crate::bags::index::PairIndex;
use crate::bags::opened::Recording;
use crate::cameras::topics::Selection;
use crate::clocks::table::ClockTable;
use crate::mcap::messages::Messages;
use crate::message::sync;
use crate::message::wire::{PROFILE, topic};
use crate::pairs::pair_reader::PairReader;
use crate::pairs::stream_facts::StreamFacts;
use crate::sensor::kind::SensorSelection;
use crate::sensor::topic::SensorTopic;
use crate::stream::channel::{Channel, EventReader, FileEvent};
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use svl_core::stereo::Frame;
use svl_core::{Error, Result};

/// Reads the pairs of one recording, a file or the folder of a ROS 2 bag, in file order, with few
/// in memory at a time.
///
/// Left and right are paired by `/stereo/sync` in svl's own recordings, by stamp in others.
pub struct Reader {
    recording: Recording,
    messages: Box<dyn EventReader>,
    /// Index of the next file to read.
    next_file: usize,
    source: PairReader,
    /// Topics of the left and the right images.
    topics: [String; 2],
    header: Option<Header>,
    pairs: Option<u64>,
    /// Positions of the pairs, once requested.
    index: Option<Option<PairIndex>>,
    /// Sequence of the first pair, also if it cannot be read.
    pub first_sequence: u64,
    /// The first pair, read on opening the file, after the errors of unreadable pairs before it.
    ahead: VecDeque<Result<Frame>>,
    /// Damage found, reported after the pairs before it.
    damage: Option<Error>,
    /// Unreadable messages other than images, by topic.
    broken: BTreeMap<String, u64>,
    /// The clocks of another program's recording.
    clocks: ClockTable,
}

/// Limit on unreadable pairs before the first readable one.
const UNREADABLE: usize = 1000;

impl Reader {
    /// Opens a recording and reads its first pair.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a file that is not a recording or has no readable pair;
    /// [`Error::Damaged`] if it ends before its first pair is complete.
    pub fn open(path: impl Into<PathBuf>) -> Result<Self> {
        Self::new(Recording::open(path)?, &Selection::default())
    }

    /// Reads the first pair of an open recording, from the selected topics if svl did not write it.
    ///
    /// # Errors
    /// The errors of [`Reader::open`]; [`Error::Format`] also if the topics of the cameras are
    /// missing or ambiguous.
    pub fn new(recording: Recording, selection: &Selection) -> Result<Self> {
        let is_own = !selection.names_topics() && is_own(&recording)?;
        let clocks = if is_own {
            if selection.stamps.is_some() || selection.right_offset_ns.is_some() {
                let cure = "svl recorded it by one clock; leave them out";
                return Err(Error::Usage(format!(
                    "{}: --stamps and --right-offset-ms are for other programs' recordings: {cure}",
                    recording.path().display()
                )));
            }
            None
        } else {
            ClockTable::read(&recording, selection)?
        };
        let recording = match &clocks {
            Some(clocks) => {
                let name = recording.path().display().to_string();
                let checked = clocks.check(&name);
                checked.map_err(|doubt| Error::format(recording.path(), doubt.clone()))?;
                recording.restamped(clocks.rules())
            }
            None => recording,
        };
        let first = recording.files().next();
        let first = first.ok_or_else(|| Error::format(recording.path(), "has no files"))?;
        let messages = first.messages()?;
        let mut source = PairReader::open(&recording, selection, is_own)?;
        source.watch = clocks.as_ref().and_then(ClockTable::watch);
        let mut reader = Self {
            messages,
            next_file: 1,
            // Without an intact summary the length is unknown.
            pairs: if is_own {
                recording.count(topic::SYNC)?
            } else {
                None
            },
            topics: source.facts().topics,
            source,
            index: None,
            first_sequence: 0,
            header: recording.header().ok(),
            ahead: VecDeque::new(),
            damage: None,
            broken: BTreeMap::new(),
            clocks: clocks.unwrap_or_default(),
            recording,
        };
        reader.read_first()?;
        Ok(reader)
    }

    /// # Errors
    /// The reason why there is no first pair.
    fn read_first(&mut self) -> Result<()> {
        // Errors before the first pair are kept, so that they are reported in order, once.
        while self.ahead.len() < UNREADABLE {
            match self.read() {
                Ok(Some(first)) => {
                    if self.source.is_own() {
                        let unreadable = self.ahead.len() as u64;
                        self.first_sequence = first.sequence.saturating_sub(unreadable);
                    }
                    self.ahead.push_back(Ok(first));
                    return Ok(());
                }
                Err(error @ Error::Format { .. }) => self.ahead.push_back(Err(error)),
                Err(error) => return Err(error),
                Ok(None) => break,
            }
        }
        if let Some(Err(unreadable)) = self.ahead.pop_front() {
            return Err(unreadable);
        }
        Err(Error::format(
            self.recording.path(),
            self.source.facts().why_none,
        ))
    }

    /// The open recording.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    pub fn path(&self) -> &Path {
        self.recording.path()
    }

    /// The metadata record `svl`; `None` if svl did not write the recording.
    pub fn header(&self) -> Option<&Header> {
        self.header.as_ref()
    }

    /// Number of pairs according to the file's summary; `None` without a summary, as in a truncated
    /// file.
    pub fn pairs(&self) -> Option<u64> {
        self.pairs
    }

    /// Number of left images according to the file's summary: no more pairs can be made.
    pub fn images(&self) -> Option<u64> {
        self.recording.count(&self.topics[0]).ok()?
    }

    /// The facts of the pairs so far; the counts are final at the end of the recording.
    pub fn facts(&self) -> StreamFacts {
        StreamFacts {
            broken: self.broken.clone(),
            ..self.source.facts()
        }
    }

    /// The distances that a topic of the recording has.
    ///
    /// # Errors
    /// [`Error::Format`] for a topic that cannot have any; [`Error::Io`].
    pub fn sensor(&self, selection: &SensorSelection) -> Result<SensorTopic> {
        let checked = self.clocks.check_measurements(&selection.topic);
        checked.map_err(|doubt| {
            let reason = format!("{}: {}", selection.asked(), doubt.cure);
            Error::format(self.recording.path(), reason)
        })?;
        SensorTopic::open(
            &self.recording,
            &self.topics,
            self.source.left_calibration(),
            self.source.stamps(),
            selection,
        )
    }

    /// Makes [`Reader::next_pair`] return the pair at `index`, counted from 0, next. Returns false,
    /// with no effect, if the recording has no index of its pairs: svl did not write it, or not to
    /// its end, or its pairs share stamps.
    ///
    /// # Errors
    /// [`Error::Format`] if the pair is not at its indexed position: the file has to be reopened.
    pub fn seek(&mut self, index: u64) -> Result<bool> {
        if !self.source.is_own() {
            return Ok(false);
        }
        let Container::Mcap(file) = self.recording.only_file()? else {
            return Ok(false);
        };
        if self.index.is_none() {
            self.index = Some(PairIndex::read(file)?);
        }
        let Some(Some(PairIndex { declared, pairs })) = &self.index else {
            return Ok(false);
        };
        let Some(&(stamp_ns, chunk)) = pairs.get(index as usize) else {
            return Ok(false);
        };
        self.messages = Box::new(Messages::from(file, chunk, declared.clone())?);
        self.source.restart();
        self.ahead.clear();
        self.damage = None;
        loop {
            match self.read() {
                Ok(Some(frame)) if frame.stamp_ns == stamp_ns => {
                    self.ahead.push_back(Ok(frame));
                    return Ok(true);
                }
                // Earlier pairs, including those whose first messages were skipped.
                Ok(Some(frame)) if frame.stamp_ns < stamp_ns => {}
                Err(Error::Format { .. }) => {}
                Ok(_) => {
                    let reason = format!("pair {index} is not where its index says");
                    return Err(Error::format(self.recording.path(), reason));
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// The next pair, or `None` at the end.
    ///
    /// # Errors
    /// [`Error::Format`] for an unreadable pair, after which reading can continue.
    /// [`Error::Damaged`], once, if the file is truncated or corrupt: all pairs before it are
    /// valid, and there are no more.
    pub fn next_pair(&mut self) -> Result<Option<Frame>> {
        let ahead = self.ahead.pop_front();
        ahead.map_or_else(|| self.read(), |next| next.map(Some))
    }

    fn read(&mut self) -> Result<Option<Frame>> {
        let mut ended = false;
        loop {
            if let Some(frame) = self.source.pop() {
                return frame
                    .map(Some)
                    .map_err(|e| Error::format(self.recording.path(), e.to_string()));
            }
            if ended {
                return self
                    .damage
                    .take()
                    .map_or(Ok(None), |damage| Err(self.counted(damage)));
            }
            match self.messages.next() {
                Ok(Some(FileEvent::Message(channel, log_time, data))) => {
                    let taken = self.source.take_in(channel, log_time, &data);
                    let name = &channel.topic;
                    let bad = |reason| {
                        let reason = format!("{name} at {log_time} ns: {reason}");
                        Error::format(self.recording.path(), reason)
                    };
                    let makes_pairs = self.topics.contains(name) || name == topic::SYNC;
                    match taken.map_err(bad) {
                        Ok(()) => {}
                        Err(error) if makes_pairs => return Err(error),
                        Err(error) => {
                            let broken = self.broken.entry(name.clone()).or_default();
                            if *broken == 0 {
                                tracing::warn!("{error}; dropped, its pair is used without it");
                            }
                            *broken += 1;
                        }
                    }
                }
                Ok(Some(_)) => {}
                // Pairing continues across files: left and right may be in different ones.
                Ok(None) => match self.recording.files().nth(self.next_file) {
                    Some(next) => {
                        self.messages = next.messages()?;
                        self.next_file += 1;
                    }
                    None => ended = true,
                },
                // This file ends here, but a bag may have others. Only the first damage is
                // reported: its remedy is svl recover, whatever follows.
                Err(error) => self.damage = self.damage.take().or(Some(error)),
            }
            if ended {
                self.source.end();
            }
        }
    }

    /// The error, with the number of pairs read before it.
    fn counted(&self, error: Error) -> Error {
        let Error::Damaged { path, reason } = error else {
            return error;
        };
        let pairs = self.source.facts().pairs;
        Error::damaged(path, format!("{reason}; intact pairs read: {pairs}"))
    }
}

/// True if svl wrote the recording in its own dialect, which is always one file.
pub(crate) fn is_own(recording: &Recording) -> Result<bool> {
    if recording.only_file().is_err() {
        return Ok(false);
    }
    let profile = recording.profile()?;
    if profile == Some(PROFILE) {
        return Ok(true);
    }
    // Other programs copy svl's messages into files of another profile, and the header may be
    // corrupt. A ROS 2 bag by svl has no such message.
    let channels = recording.channels()?;
    // If nothing at all can be read, the damage is reported, not the absence of topics.
    let is_sync =
        |channel: &&Channel| channel.topic == topic::SYNC && channel.schema == sync::SCHEMA;
    Ok(channels.iter().any(is_sync) || channels.is_empty() && profile.is_none())
}
