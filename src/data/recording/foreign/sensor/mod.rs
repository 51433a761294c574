//! Truth from another sensor of the recording: depth images, point clouds, laser scans.

mod clock;
mod depth_image;
mod kind;
mod points;
mod transforms;
mod view;

use super::topics;
use crate::recording::messages::{Channel, EventReader, FileEvent};
use crate::recording::{Recording, truth};
pub(in crate::recording) use kind::head;
use kind::{Measured, MeasuredKind};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use svl_core::stereo::{Frame, Plane, Rig, Truth, TruthDensity, TruthKind, TruthOrigin};
use svl_core::{Error, Result};
pub use view::RawCamera;
use view::{Setup, View};

/// Which topic holds the truth, and how near in time a measurement must be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TruthSelection {
    pub topic: String,
    /// Largest difference of the stamps of a pair and its measurement.
    pub max_skew_ns: u64,
}

impl TruthSelection {
    /// At 1 m/s a robot moves 2 cm in that time, a fifth of what a cell's distance may be off.
    pub const MAX_SKEW_NS: u64 = 20_000_000;
}

/// The measurements of a topic, as truths of the pairs of the same recording.
///
/// They are read on their own, in the order of the file, with those around the current pair in
/// memory.
pub struct TruthTopic {
    recording: Recording,
    left: String,
    selection: TruthSelection,
    kind: &'static MeasuredKind,
    setup: Setup,
    /// How measurements are seen by the left camera, known from the first pair on.
    view: Option<View>,
    messages: Box<dyn EventReader>,
    /// Index of the file that is read next.
    next_file: usize,
    ended: bool,
    /// Measurements around the current pair, by stamp.
    waiting: BTreeMap<u64, Arc<Measured>>,
    /// Whether the stamps of pairs and measurements were found to overlap.
    same_clock: bool,
    warned: bool,
    warned_of_conflict: bool,
    without: u64,
}

/// The topics whose messages measure distances, but for those of the pairs, by the first message of
/// each: of images only those of depths.
///
/// # Errors
/// [`Error::Io`], [`Error::Format`].
pub(in crate::recording) fn truth_topics(
    recording: &Recording,
    pairs: [&str; 2],
) -> Result<Vec<String>> {
    let channels = recording.channels()?;
    let is_candidate = |channel: &&&Channel| {
        !pairs.contains(&channel.topic.as_str())
            // A map of disparities has the pixels of a depth image.
            && !channel.topic.contains("disparity")
            && kind::of(&channels, &channel.topic, pairs[0]).is_ok()
    };
    let candidates = channels.iter().filter(is_candidate);
    let mut unknown: BTreeSet<_> = candidates.map(|channel| channel.topic.clone()).collect();
    let mut found = BTreeSet::new();
    for file in recording.files() {
        let mut messages = file.messages()?;
        // Damage is reported with the pairs.
        while !unknown.is_empty()
            && let Ok(Some(event)) = messages.next()
        {
            if let FileEvent::Message {
                channel,
                log_time,
                data,
            } = event
                && unknown.remove(&channel.topic)
                && let Ok(kind) = kind::of(&channels, &channel.topic, pairs[0])
                && kind.read(channel, log_time, &data).is_ok()
            {
                found.insert(channel.topic.clone());
            }
        }
    }
    Ok(found.into_iter().collect())
}

impl TruthTopic {
    /// Finds the topic, the left camera and the transform between the two. `left`: the topic of the
    /// left images.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] where the topic is missing or of another type, its first
    /// message cannot be read, or no transform leads to the left camera.
    pub fn open(recording: &Recording, left: &str, selection: &TruthSelection) -> Result<Self> {
        let channels = recording.channels()?;
        let wrong = |reason: String| {
            let reason = format!("--truth {}: {reason}", selection.topic);
            Error::format(recording.path(), reason)
        };
        let kind = kind::of(&channels, &selection.topic, left).map_err(wrong)?;
        let setup = Setup::find(recording, &channels, left, &selection.topic, kind)?;
        let setup = setup.map_err(wrong)?;
        let first = recording.files().next();
        let first = first.ok_or_else(|| Error::format(recording.path(), "has no files"))?;
        Ok(Self {
            messages: first.messages()?,
            recording: recording.clone(),
            left: left.to_owned(),
            selection: selection.clone(),
            kind,
            setup,
            view: None,
            next_file: 1,
            ended: false,
            waiting: BTreeMap::new(),
            same_clock: false,
            warned: false,
            warned_of_conflict: false,
            without: 0,
        })
    }

    /// Pairs so far for which there was no measurement.
    pub fn without(&self) -> u64 {
        self.without
    }

    /// Gives the frame the truth of the nearest measurement within the limit, or none. `raw`: the
    /// left camera, where svl rectified the pair.
    ///
    /// # Errors
    /// [`Error::Format`] for a pair without rig, for depth images that cannot be placed in the left
    /// image, and where the stamps are of another clock.
    pub fn attach(&mut self, frame: &mut Frame, raw: Option<&RawCamera>) -> Result<()> {
        let Some(rig) = frame.rig().copied() else {
            let why = "pairs without a calibration have no distances to compare: --calib FILE";
            return Err(self.wrong(why));
        };
        frame.truth = None;
        let Some(measured) = self.nearest(frame.stamp_ns)? else {
            self.without += 1;
            return Ok(());
        };
        let size = frame.pair.size();
        let view = match self.view.take() {
            Some(view) => view,
            None => {
                let view = self
                    .setup
                    .view(&self.selection.topic, &measured, &rig, size, raw);
                view.map_err(|reason| self.wrong(&reason))?
            }
        };
        let disparity = view.disparities(&measured, &rig, size);
        let density = view.density();
        self.view = Some(view);
        frame.truth = Some(Truth {
            disparity: disparity.map_err(|reason| self.wrong(&reason))?,
            visibility: None,
            surface: None,
            kind: TruthKind {
                density,
                origin: TruthOrigin::Sensor(self.selection.topic.clone()),
            },
        });
        Ok(())
    }

    fn wrong(&self, reason: &str) -> Error {
        let reason = format!("--truth {}: {reason}", self.selection.topic);
        Error::format(self.recording.path(), reason)
    }

    /// The measurement nearest to a stamp, within the limit.
    fn nearest(&mut self, stamp_ns: u64) -> Result<Option<Arc<Measured>>> {
        let limit = self.selection.max_skew_ns;
        self.read_beyond(stamp_ns.saturating_add(limit));
        self.waiting
            .retain(|stamp, _| stamp.saturating_add(limit) >= stamp_ns);
        let nearest = self
            .waiting
            .iter()
            .min_by_key(|(stamp, _)| stamp.abs_diff(stamp_ns));
        let off_ns = nearest.map(|(stamp, _)| stamp.abs_diff(stamp_ns));
        let found = nearest.filter(|_| off_ns <= Some(limit));
        let found = found.map(|(_, measured)| Arc::clone(measured));
        if found.is_some() {
            self.same_clock = true;
        } else if !self.same_clock && off_ns.is_none_or(|off| off > clock::SUSPICIOUS_NS) {
            clock::check(&self.recording, [&self.left, &self.selection.topic], limit)?
                .map_err(|reason| self.wrong(&reason))?;
            self.same_clock = true;
        }
        Ok(found)
    }

    /// Reads measurements until one has that stamp or a later one.
    fn read_beyond(&mut self, stamp_ns: u64) {
        while !self.ended
            && self
                .waiting
                .last_key_value()
                .is_none_or(|(last, _)| *last < stamp_ns)
        {
            match self.messages.next() {
                Ok(Some(FileEvent::Message {
                    channel,
                    log_time,
                    data,
                })) if channel.topic == self.selection.topic => {
                    let read = self.kind.read(channel, log_time, &data);
                    match read {
                        Ok((stamp, measured)) => {
                            self.waiting.insert(stamp, Arc::new(measured));
                        }
                        Err(reason) if !self.warned => {
                            let path = self.recording.path().display();
                            let topic = &self.selection.topic;
                            tracing::warn!("{path}: {topic} at {log_time} ns: {reason}; left out");
                            self.warned = true;
                        }
                        Err(_) => {}
                    }
                }
                Ok(Some(FileEvent::Message { channel, data, .. })) => {
                    if !self.warned_of_conflict
                        && let Some(conflict) = self.setup.conflict(channel, &data)
                    {
                        let (path, topic) = (self.recording.path().display(), &channel.topic);
                        tracing::warn!(
                            "{path}: {topic}: {conflict}; the first one is used for {}: if it is \
                             wrong, remove it from the bag",
                            self.selection.topic
                        );
                        self.warned_of_conflict = true;
                    }
                }
                Ok(Some(_)) => {}
                // Damage is reported with the pairs.
                Ok(None) | Err(_) => match self.recording.files().nth(self.next_file) {
                    Some(next) => {
                        self.next_file += 1;
                        match next.messages() {
                            Ok(messages) => self.messages = messages,
                            Err(_) => self.ended = true,
                        }
                    }
                    None => self.ended = true,
                },
            }
        }
    }
}
