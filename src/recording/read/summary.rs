//! Summarizes a recording: topics, pairs, gaps, skew, damage.

use super::reader::is_own;
use crate::bags::container::Container;
use crate::bags::header::{Header, StampOrigin};
use crate::bags::opened::Recording;
use crate::bags::ros1_bag::Ros1Messages;
use crate::cameras::topics::{Selection, choose, is_image};
use crate::clocks::table::ClockTable;
use crate::decode::head::head;
use crate::decode::video::message::is_picture;
use crate::decode::video::topic::{VideoScan, VideoSummary};
use crate::mcap::file::McapFile;
use crate::mcap::messages::Messages;
use crate::mcap::records::{DamagedPart, attachment};
use crate::message::sync::StereoSync;
use crate::message::wire::{GRABBER, MANIFEST, PROFILE, topic};
use crate::pairs::pair_reader::{StampedImage, pair_stamps};
use crate::pairs::skew::SkewSummary;
use crate::pairs::stamp_pairing::UnpairedImages;
use crate::pairs::steps::without_stamp;
use crate::poses::pose_summary::{PoseSummary, pose_summary};
use crate::results::result::AlgorithmResult;
use crate::stream::channel::{Channel, EventReader, FileEvent};
use crate::stream::restamped::StampRules;
use crate::stream::unpack::unpack_message;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use svl_core::statistics::upper_rank;
use svl_core::stereo::Side;
use svl_core::{Result, nanoseconds};

/// Two pairs more than this many median periods apart are separated by a gap.
const GAP_PERIODS: f64 = 1.5;

/// Messages of a healthy recording are less out of order.
const CLOCK_JUMP_NS: u64 = 500_000_000;

/// The contents of an MCAP file, read completely. Works for any MCAP file, intact or corrupt.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct RecordingSummary {
    pub path: PathBuf,
    pub bytes: u64,
    /// The reason why the file is not intact, if so.
    pub damage: Option<String>,
    /// True if CRCs cover all messages. Otherwise bytes changed inside messages are undetected.
    pub checksums: bool,
    /// The damaged parts, in file order.
    pub losses: Vec<DamagedPart>,
    /// Messages counted in the file's own summary but not found, by topic.
    pub missing: BTreeMap<String, u64>,
    /// Missing numbers in the sequence of pairs, lost to damage or dropped by the recorder, and
    /// pairs that the network lost.
    pub missing_pairs: u64,
    /// Image topics that `svl replay` would use for left and right, in another program's recording.
    pub stereo: Option<[String; 2]>,
    /// Vertical misalignment from the results in the recording, in the order of the algorithms.
    pub misalignment: Vec<Misalignment>,
    /// The library that wrote the file, and its MCAP profile.
    pub library: String,
    pub profile: String,
    /// `None` if svl did not write it.
    pub header: Option<Header>,
    /// The counts of a synchronized grabber, in a finished recording of cameras.
    pub grabber: BTreeMap<String, String>,
    /// The manifest of the run that wrote the recording.
    pub manifest: Option<serde_json::Value>,
    /// Names and sizes in bytes.
    pub attachments: Vec<(String, u64)>,
    /// Sorted by name.
    pub topics: Vec<Topic>,
    /// First and last stamp of any message.
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub start_ns: u64,
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub end_ns: u64,
    /// Complete pairs; in other programs' recordings those that `svl replay` forms by stamp.
    pub pairs: u64,
    /// The left stamps of the pairs, in their order.
    #[serde(skip)]
    pub pair_stamps_ns: Vec<u64>,
    /// Median period of the left images by their own stamps; `None` if their topic or their rate is
    /// unknown.
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub period_ns: Option<u64>,
    /// Intervals of more than 1.5 median periods between left images.
    pub gaps: Vec<Gap>,
    /// Where the stamps of the left images jump against the log times.
    pub clock_jumps: Vec<ClockJump>,
    /// Right stamp minus left stamp, over all pairs; `None` if unknown.
    pub skew: Option<SkewSummary>,
    /// Unpaired images, as counted by the recorder.
    pub drops: u64,
    /// Unpaired images before the first pair.
    pub drops_before: u64,
    /// Images without a partner in another program's recording.
    pub unpaired: Option<UnpairedImages>,
    /// Images of each camera that are equal to the one before, left and right: pictures of a camera
    /// at rest, or of one that repeats them.
    pub repeated_images: [u64; 2],
    /// The clocks of the topics in another program's recording.
    pub clocks: Option<ClockTable>,
    /// The poses in another program's recording, if it has any.
    pub poses: Option<PoseSummary>,
    /// Topics of videos, by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub videos: BTreeMap<String, VideoSummary>,
}

/// A topic and its messages.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Topic {
    pub name: String,
    pub schema: String,
    pub encoding: String,
    pub messages: u64,
    /// Bytes before compression.
    pub bytes: u64,
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub start_ns: u64,
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub end_ns: u64,
    /// Messages per second; `None` for fewer than two.
    pub rate_hz: Option<f64>,
}

/// Vertical misalignment of the pairs, as measured by an algorithm: number of pixels by which the
/// right image is lower.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Misalignment {
    pub algorithm: String,
    /// Number of pairs with a measurement.
    pub pairs: u64,
    /// Median over the pairs; the upper of the two middle values for an even number.
    pub median_px: i8,
    pub min_px: i8,
    pub max_px: i8,
}

/// An interval without pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Gap {
    /// Stamp of the last pair before it.
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub after_ns: u64,
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub length_ns: u64,
}

/// A jump of the clock that stamps the left images, against that of the log times.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct ClockJump {
    /// Stamp of the last image before it.
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub after_ns: u64,
    /// Positive for a jump ahead.
    #[serde(serialize_with = "nanoseconds::as_text")]
    pub by_ns: i64,
}

impl Recording {
    /// Reads all of the recording and summarizes it, with the pairs that this selection makes.
    /// Damage is not an error but part of the summary.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`]; [`svl_core::Error::Format`] for a file that is not MCAP.
    pub fn summary(&self, selection: &Selection) -> Result<RecordingSummary> {
        let clocks = match is_own(self) {
            Ok(is_own) if !is_own || selection.names_topics() => ClockTable::read(self, selection),
            _ => Ok(None),
        };
        // Damage is reported with the messages.
        let clocks = clocks.ok().flatten();
        let mut seen = SummaryScan {
            rules: clocks.as_ref().map(ClockTable::rules).unwrap_or_default(),
            ..SummaryScan::default()
        };
        seen.found.clocks = clocks;
        seen.found.checksums = true;
        for file in self.containers() {
            let losses = match file {
                Container::Mcap(file) => seen.take_mcap(file)?,
                Container::Ros1(file) => {
                    let mut messages = Ros1Messages::open(file)?;
                    // The error at its end is the first of the losses.
                    drop(seen.take_all(&mut messages));
                    let losses = messages.take_losses();
                    seen.take_foreign("rosbag, of ROS 1", "ros1", messages.channels());
                    losses
                }
                Container::Sqlite(file) => {
                    let losses = seen.take_all(&mut file.messages()?);
                    seen.take_foreign("rosbag2, in SQLite", "ros2", file.channels()?);
                    losses
                }
            };
            let name = file.path().display();
            let in_file = |loss: DamagedPart| match self.only_file() {
                Ok(_) => loss,
                Err(_) => DamagedPart {
                    reason: format!("{name}: {}", loss.reason),
                    ..loss
                },
            };
            seen.found.losses.extend(losses.into_iter().map(in_file));
            seen.found.bytes += file.len();
        }
        seen.summary(self, selection)
    }
}

impl RecordingSummary {
    /// True if the file is complete and intact.
    pub fn is_intact(&self) -> bool {
        self.damage.is_none()
    }

    /// From the first to the last stamp.
    pub fn duration_ns(&self) -> u64 {
        self.end_ns.saturating_sub(self.start_ns)
    }
}

/// State of the scan of a file.
#[derive(Default)]
struct SummaryScan {
    /// The parts of the summary that are found as they come.
    found: RecordingSummary,
    /// The rules by which stamps are read.
    rules: StampRules,
    /// Start of the first attached manifest.
    manifest: Option<u64>,
    channels: Vec<Channel>,
    topics: BTreeMap<String, Topic>,
    images: BTreeMap<String, TopicImages>,
    /// The left images of svl's own recordings, by their `/stereo/sync`.
    synced: Vec<StampedImage>,
    /// Images so far.
    places: u64,
    videos: BTreeMap<String, VideoScan>,
    skews: Vec<i64>,
    sequences: BTreeSet<u64>,
    /// Row offsets of the results, by algorithm.
    row_offsets: BTreeMap<String, Vec<i8>>,
    drops_before: Option<u64>,
}

/// The images of a topic.
#[derive(Default)]
struct TopicImages {
    /// Images that can be read, in file order, with their number.
    images: Vec<StampedImage>,
    /// The frame of the first of them.
    frame: Option<String>,
    /// Hash of the last image, and the number of those equal to the one before.
    hash: u64,
    repeated: u64,
}

impl SummaryScan {
    fn take_mcap(&mut self, file: &McapFile) -> Result<Vec<DamagedPart>> {
        let mut messages = Messages::salvage(file)?;
        while let Some(event) = messages.next()? {
            self.take_in(event);
        }
        for (topic, missing) in messages.take_missing() {
            *self.found.missing.entry(topic).or_default() += missing;
        }
        self.found.checksums &= messages.records.is_checked();
        if let Some(start) = self.manifest.take() {
            let manifest = attachment(file, start)?;
            self.found.manifest = manifest.and_then(|json| serde_json::from_slice(&json).ok());
        }
        self.channels.extend(messages.declared().channels());
        Ok(messages.records.losses.clone())
    }

    fn take_foreign(&mut self, library: &str, profile: &str, channels: Vec<Channel>) {
        (self.found.library, self.found.profile) = (library.to_owned(), profile.to_owned());
        self.found.checksums = false;
        self.channels.extend(channels);
    }

    /// Takes in all messages; the errors are those of a file that names no bytes.
    fn take_all(&mut self, messages: &mut dyn EventReader) -> Vec<DamagedPart> {
        let mut losses = Vec::new();
        loop {
            match messages.next() {
                Ok(Some(event)) => self.take_in(event),
                Ok(None) => return losses,
                Err(error) => losses.push(DamagedPart {
                    at_byte: 0,
                    bytes: 0,
                    reason: error.to_string(),
                }),
            }
        }
    }

    fn take_in(&mut self, event: FileEvent<'_>) {
        match event {
            // If files are appended, the header of the first one is used.
            FileEvent::Library(header) if self.found.library.is_empty() => {
                (self.found.library, self.found.profile) = (header.library, header.profile);
            }
            FileEvent::Library(_) => {}
            FileEvent::Metadata(metadata) if metadata.name == GRABBER => {
                self.found.grabber = metadata.metadata
            }
            FileEvent::Metadata(metadata) => {
                self.found.header = self
                    .found
                    .header
                    .take()
                    .or_else(|| Header::from_record(&metadata))
            }
            FileEvent::Attachment { start, name, bytes } => {
                if name == MANIFEST {
                    self.manifest.get_or_insert(start);
                }
                self.found.attachments.push((name, bytes));
            }
            FileEvent::Message(channel, log_time, data) => self.count(channel, log_time, &data),
        }
    }

    fn count(&mut self, channel: &Channel, stamp_ns: u64, data: &[u8]) {
        self.count_in_topic(channel, stamp_ns, data);
        if is_image(channel) {
            self.take_in_image(channel, stamp_ns, data);
        }
        if channel.topic == topic::SYNC
            && let Ok(sync) = StereoSync::decode(&channel.schema, data)
        {
            self.take_in_sync(&sync, stamp_ns);
        }
        if let Some(Ok(result)) = AlgorithmResult::decode(&channel.schema, data)
            && let Some(row_offset_px) = result.row_offset_px
        {
            let offsets = self.row_offsets.entry(result.algorithm).or_default();
            offsets.push(row_offset_px);
        }
    }

    fn count_in_topic(&mut self, channel: &Channel, stamp_ns: u64, data: &[u8]) {
        let topic = self.topics.entry(channel.topic.clone());
        let topic = topic.or_insert_with(|| Topic {
            name: channel.topic.clone(),
            schema: channel.schema.clone(),
            encoding: channel.encoding.clone(),
            messages: 0,
            bytes: 0,
            start_ns: stamp_ns,
            end_ns: stamp_ns,
            rate_hz: None,
        });
        topic.messages += 1;
        topic.bytes += data.len() as u64;
        topic.start_ns = topic.start_ns.min(stamp_ns);
        topic.end_ns = topic.end_ns.max(stamp_ns);
        let seconds = (topic.end_ns - topic.start_ns) as f64 / 1e9;
        topic.rate_hz = (seconds > 0.0).then(|| (topic.messages - 1) as f64 / seconds);
    }

    fn take_in_image(&mut self, channel: &Channel, log_ns: u64, data: &[u8]) {
        let topic = || channel.topic.clone();
        let images = self.images.entry(topic()).or_default();
        let hash = xxhash_rust::xxh3::xxh3_64(without_stamp(channel, data));
        images.repeated += u64::from(images.hash == hash);
        images.hash = hash;
        let unpacked = unpack_message(data).ok().flatten();
        let data = unpacked.as_deref().unwrap_or(data);
        let restamped = self.rules.get(&channel.topic);
        let restamped = restamped.map(|rule| channel.restamped(*rule));
        let channel = restamped.as_ref().unwrap_or(channel);
        let head = head(channel, data);
        let video = is_picture(channel, data).then(|| self.videos.entry(topic()));
        let is_decodable = video.is_none_or(|video| video.or_default().take_in(channel, data));
        // An unreadable message is reported by `svl replay`, and is not counted as an image here.
        if let Ok((stamp_ns, frame)) = head
            && is_decodable
        {
            images.frame.get_or_insert(frame);
            images.images.push(StampedImage {
                place: self.places,
                stamp_ns: stamp_ns.unwrap_or(log_ns),
                log_ns,
                bytes: data.len(),
            });
            self.places += 1;
        }
    }

    fn take_in_sync(&mut self, sync: &StereoSync, log_ns: u64) {
        self.found.pairs += 1;
        self.synced.push(StampedImage {
            place: self.found.pairs,
            stamp_ns: sync.left_stamp_ns,
            log_ns,
            bytes: 0,
        });
        self.skews.extend(sync.exposure.skew_ns);
        self.sequences.insert(sync.sequence);
        // The recorder's counter never falls; after damage the last value read is used.
        self.found.drops = self.found.drops.max(sync.exposure.drops);
        self.drops_before.get_or_insert(sync.exposure.drops);
    }

    /// The images of the left and of the right camera.
    fn take_sides(&mut self) -> [TopicImages; 2] {
        Side::BOTH.map(|side| {
            let chosen = self.found.stereo.as_ref();
            let own = || topic::camera(side, "image");
            let topic = chosen.map_or_else(own, |topics| topics[side as usize].clone());
            self.images.remove(&topic).unwrap_or_default()
        })
    }

    /// Numbers need not start at 0: a part of a recording keeps its own.
    fn missing_pairs(&self) -> u64 {
        let numbers = match (self.sequences.first(), self.sequences.last()) {
            (Some(first), Some(last)) => (last - first).saturating_add(1),
            _ => 0,
        };
        numbers - self.sequences.len() as u64
    }

    /// The first and the last stamp of any message.
    fn span_ns(&self) -> (u64, u64) {
        let starts = self.topics.values().map(|topic| topic.start_ns);
        let ends = self.topics.values().map(|topic| topic.end_ns);
        (starts.min().unwrap_or(0), ends.max().unwrap_or(0))
    }

    fn summary(mut self, recording: &Recording, selection: &Selection) -> Result<RecordingSummary> {
        // Neither the profile nor a sync message: svl did not write it.
        let is_own = self.found.profile == PROFILE || !self.sequences.is_empty();
        let is_own = is_own && !selection.names_topics();
        let channels = std::mem::take(&mut self.channels);
        let channels: Vec<_> = channels.iter().collect();
        self.found.stereo = choose(&channels, selection).ok().filter(|_| !is_own);
        let [left, right] = self.take_sides();
        if let Some(topics) = &self.found.stereo {
            let sides = Side::BOTH.into_iter().zip([&left.images, &right.images]);
            let images = sides.flat_map(|(side, images)| images.iter().map(move |i| (side, i)));
            let mut images: Vec<_> = images.collect();
            images.sort_by_key(|(_, image)| image.place);
            if let Some(clocks) = &mut self.found.clocks
                && let Some(mut watch) = clocks.watch()
                && let Some(step) = images
                    .iter()
                    .find_map(|(side, i)| watch.take_in(topics, *side, i.log_ns, i.stamp_ns))
            {
                clocks.add_step(step);
            }
            let clocks = self.found.clocks.as_ref();
            if clocks.is_none_or(ClockTable::permits_pairs) {
                let (stamps, unpaired) = pair_stamps(&images, selection.max_skew_ns);
                self.found.pairs = stamps.len() as u64;
                self.found.unpaired = Some(unpaired);
                let skew = |[left, right]: &[u64; 2]| right.wrapping_sub(*left).cast_signed();
                self.skews = stamps.iter().map(skew).collect();
                self.found.pair_stamps_ns = stamps.iter().map(|[left, _]| *left).collect();
            }
            let stamps = left.images.iter().map(|image| image.stamp_ns);
            let frame = left.frame.as_deref().unwrap_or_default();
            // Damage is reported with the pairs.
            let recording = recording.restamped(Arc::clone(&self.rules));
            let poses = pose_summary(&recording, &channels, frame, stamps);
            self.found.poses = poses.ok().flatten();
        } else {
            let stamps = self.synced.iter().map(|image| image.stamp_ns);
            self.found.pair_stamps_ns = stamps.collect();
        }
        let repeated_images = [left.repeated, right.repeated];
        let images = if is_own && !self.synced.is_empty() {
            &self.synced
        } else {
            &left.images
        };
        let clock_jumps = clock_jumps(images);
        let steps = steps(images);
        let stamps = self.found.header.as_ref().map(|header| &header.stamps);
        // Nominal stamps do not reveal the rate.
        let is_nominal = matches!(stamps, Some(Some(StampOrigin::Nominal(_))));
        let period_ns = median_ns(&steps).filter(|_| !is_nominal);
        let gaps = period_ns.map_or_else(Vec::new, |period_ns| gaps(&steps, period_ns));
        // Each lost image took a pair with it, of which it was one or both.
        let grabber = |name: &str| self.found.grabber.get(name)?.parse().ok();
        let [images, pairs]: [u64; 2] =
            ["lost_images", "lost_pairs"].map(|name| grabber(name).unwrap_or(0));
        let missing_pairs = self.missing_pairs() + images.saturating_sub(pairs);
        let (start_ns, end_ns) = self.span_ns();
        let misalignment = self.row_offsets.into_iter().filter_map(misalignment);
        let videos = self.videos.into_iter();
        Ok(RecordingSummary {
            path: recording.only_path().unwrap_or(recording.path()).to_owned(),
            damage: self.found.losses.first().map(DamagedPart::to_string),
            missing_pairs,
            misalignment: misalignment.collect(),
            start_ns,
            end_ns,
            topics: self.topics.into_values().collect(),
            period_ns,
            gaps,
            clock_jumps,
            skew: SkewSummary::from_skews(&mut self.skews),
            drops_before: self.drops_before.unwrap_or_default(),
            repeated_images,
            videos: videos
                .map(|(topic, video)| (topic, video.summary))
                .collect(),
            ..self.found
        })
    }
}

/// The median length of the steps between stamps.
fn median_ns(steps: &[(u64, u64)]) -> Option<u64> {
    let mut periods: Vec<_> = steps.iter().map(|&(_, step)| step).collect();
    periods.sort_unstable();
    upper_rank(&periods, 0.5)
}

/// The steps that are much longer than the median one.
fn gaps(steps: &[(u64, u64)], period_ns: u64) -> Vec<Gap> {
    let is_gap = |step: u64| step as f64 > GAP_PERIODS * period_ns as f64;
    let long = steps.iter().filter(|&&(_, step)| is_gap(step));
    let gap = |&(after_ns, length_ns): &(u64, u64)| Gap {
        after_ns,
        length_ns,
    };
    long.map(gap).collect()
}

/// Where the stamps of images in file order jump: a clock that was set, or a camera that began
/// anew.
fn clock_jumps(images: &[StampedImage]) -> Vec<ClockJump> {
    let jump = |pair: &[StampedImage]| {
        let [last, next] = pair else { return None };
        Some(ClockJump {
            after_ns: last.stamp_ns,
            by_ns: jump_ns(last, next)?,
        })
    };
    images.windows(2).filter_map(jump).collect()
}

/// The jump of the stamps against the log times. Stamps that go back jump even if the log times go
/// with them, as in svl's own recordings.
fn jump_ns(last: &StampedImage, next: &StampedImage) -> Option<i64> {
    let step = |to: u64, from: u64| to.wrapping_sub(from).cast_signed();
    let stamps = step(next.stamp_ns, last.stamp_ns);
    let against_log = stamps.saturating_sub(step(next.log_ns, last.log_ns));
    let is_jump = |ns: &i64| ns.unsigned_abs() > CLOCK_JUMP_NS;
    let back = Some(stamps).filter(|stamps| *stamps < 0);
    Some(against_log).filter(is_jump).or(back.filter(is_jump))
}

/// The stamps of images and the times to the next, in the order of the stamps between two jumps: a
/// jump is no gap.
fn steps(images: &[StampedImage]) -> Vec<(u64, u64)> {
    let parts = images.chunk_by(|last, next| jump_ns(last, next).is_none());
    let of_part = |part: &[StampedImage]| {
        let mut stamps: Vec<_> = part.iter().map(|image| image.stamp_ns).collect();
        stamps.sort_unstable();
        // A duplicate would count as a period of 0.
        stamps.dedup();
        let steps = stamps.windows(2).map(|pair| (pair[0], pair[1] - pair[0]));
        steps.collect::<Vec<_>>()
    };
    parts.flat_map(of_part).collect()
}

/// Summarizes the row offsets of an algorithm's results; `None` without any.
fn misalignment((algorithm, mut offsets): (String, Vec<i8>)) -> Option<Misalignment> {
    offsets.sort_unstable();
    Some(Misalignment {
        algorithm,
        pairs: offsets.len() as u64,
        median_px: upper_rank(&offsets, 0.5)?,
        min_px: *offsets.first()?,
        max_px: *offsets.last()?,
    })
}
