//! Small ROS 2 bags and Foxglove recordings, written without svl.

mod foxglove;
mod messages;
mod stereo;

pub(crate) use foxglove::*;
pub(crate) use messages::*;
pub(crate) use stereo::*;

use super::says::Says;
use crate::cli::fixture::Fixture;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use svl::scenario::SourceOptions;
use svl::source::{Opened, Request, open_recording};
use svl::stereo::{Frame, Truth};

/// A message: topic, schema, encoding, log time, bytes.
#[derive(Clone)]
pub(crate) struct Message {
    pub(crate) topic: &'static str,
    pub(crate) schema: &'static str,
    pub(crate) encoding: &'static str,
    pub(crate) log_time: u64,
    pub(crate) data: Vec<u8>,
}

impl Message {
    /// In CDR, like ROS 2.
    pub(crate) fn cdr(
        topic: &'static str,
        schema: &'static str,
        log_time: u64,
        data: Vec<u8>,
    ) -> Self {
        let encoding = "cdr";
        Self {
            topic,
            schema,
            encoding,
            log_time,
            data,
        }
    }

    /// The message with other bytes.
    pub(crate) fn with(&self, data: Vec<u8>) -> Self {
        Self {
            data,
            ..self.clone()
        }
    }

    /// The message without its bytes from there on.
    pub(crate) fn cut(&self, length: usize) -> Self {
        self.with(self.data[..length].to_vec())
    }

    /// The message on another topic.
    pub(crate) fn on(self, topic: &'static str) -> Self {
        Self { topic, ..self }
    }

    /// The message at another log time.
    pub(crate) fn logged(self, log_time: u64) -> Self {
        Self { log_time, ..self }
    }

    /// The stamp in its header.
    pub(crate) fn stamp(&self) -> u64 {
        let [seconds, nanoseconds] =
            [4, 8].map(|at| u32::from_le_bytes(*self.data[at..].first_chunk().unwrap()));
        u64::from(seconds) * 1_000_000_000 + u64::from(nanoseconds)
    }

    /// The message with another stamp in its header, at another log time.
    pub(crate) fn at(&self, stamp: u64, log_time: u64) -> Self {
        let mut data = self.data.clone();
        let parts = [stamp / 1_000_000_000, stamp % 1_000_000_000];
        data[4..12].copy_from_slice(&parts.map(|part| (part as u32).to_le_bytes()).concat());
        self.with(data).logged(log_time)
    }
}

/// The messages of a bag, in the order in which they are written.
#[derive(Clone, Default)]
pub(crate) struct Bag(pub(crate) Vec<Message>);

impl Bag {
    pub(crate) fn new(messages: impl IntoIterator<Item = Message>) -> Self {
        Self(messages.into_iter().collect())
    }

    /// Adds messages behind the others.
    pub(crate) fn and(mut self, messages: impl IntoIterator<Item = Message>) -> Self {
        self.0.extend(messages);
        self
    }

    /// Adds static transforms: parent, child, place of the child.
    pub(crate) fn tf(self, links: &[(&str, &str, [f64; 3])]) -> Self {
        self.and([tf("/tf_static", links)])
    }

    /// Leaves out all messages of a topic.
    pub(crate) fn without(mut self, topic: &str) -> Self {
        self.0.retain(|message| message.topic != topic);
        self
    }

    /// Replaces each message by others.
    pub(crate) fn each<T>(self, change: impl FnMut(Message) -> T) -> Self
    where
        T: IntoIterator<Item = Message>,
    {
        Self(self.0.into_iter().flat_map(change).collect())
    }

    /// Gives each message a stamp and a log time by its topic and its own stamp, or leaves it out;
    /// in the order of the log.
    pub(crate) fn clock(self, times: impl Fn(&str, u64) -> Option<(u64, u64)>) -> Self {
        let timed = |message: Message| {
            let (stamp, log_time) = times(message.topic, message.stamp())?;
            Some(message.at(stamp, log_time))
        };
        self.each(timed).by_log_time()
    }

    pub(crate) fn by_log_time(mut self) -> Self {
        self.0.sort_by_key(|message| message.log_time);
        self
    }

    /// The truth of each pair by a topic; all that are none are counted as such.
    #[track_caller]
    pub(crate) fn truths(&self, topic: &str) -> Vec<Option<Truth>> {
        let saved = self.saved();
        let (frames, without) = open(&saved, topic).and_then(all_frames).unwrap();
        let truths: Vec<_> = frames.into_iter().map(|frame| frame.truth).collect();
        let lacking = truths.iter().filter(|truth| truth.is_none()).count();
        assert_eq!(without, lacking as u64);
        truths
    }

    /// Asserts that the truth of a topic is refused, by one line with the topic and these words,
    /// separated by ` | `.
    #[track_caller]
    pub(crate) fn refused(&self, topic: &str, words: &str) {
        let read = open(&self.saved(), topic).and_then(all_frames);
        let error = read.expect_err("it is bad").to_string();
        assert!(!error.contains('\n'), "{error}");
        error.says(topic).says(words);
    }

    /// Writes the bag as `bag.mcap` into the folder of a fixture.
    pub(crate) fn write(&self, fixture: &Fixture) -> PathBuf {
        write(&fixture.path(""), &self.0)
    }

    /// Writes the bag into a folder of its own.
    pub(crate) fn saved(&self) -> Saved {
        let folder = tempfile::tempdir().unwrap();
        Saved {
            path: write(folder.path(), &self.0),
            folder,
        }
    }
}

impl IntoIterator for Bag {
    type Item = Message;
    type IntoIter = std::vec::IntoIter<Message>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

/// A bag in a folder that is removed with it.
pub(crate) struct Saved {
    path: PathBuf,
    pub(crate) folder: tempfile::TempDir,
}

impl Deref for Saved {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.path
    }
}

impl From<&Saved> for PathBuf {
    fn from(saved: &Saved) -> Self {
        saved.path.clone()
    }
}

/// A recording with the truth of a topic.
pub(crate) fn open(path: &Path, topic: &str) -> svl::Result<Opened> {
    let options = SourceOptions {
        truth: Some(topic.to_owned()),
        ..Default::default()
    };
    open_with(path, options)
}

pub(crate) fn open_with(path: &Path, options: SourceOptions) -> svl::Result<Opened> {
    open_recording(&Request {
        options,
        ..Request::new(path.to_str().unwrap())
    })
}

/// The frames of an opened recording, and the number of those that lack a truth.
pub(crate) fn all_frames(mut opened: Opened) -> svl::Result<(Vec<Frame>, u64)> {
    let source = &mut opened.source;
    let frames = std::iter::from_fn(|| source.next().transpose());
    let frames = frames.collect::<svl::Result<Vec<_>>>()?;
    let without = source.finish(frames.len() as u64).without_truth;
    Ok((frames, without))
}

/// The truth of each pair by a topic.
pub(crate) fn truths_in(path: &Path, topic: &str) -> Vec<Option<Truth>> {
    let (frames, _) = open(path, topic).and_then(all_frames).unwrap();
    frames.into_iter().map(|frame| frame.truth).collect()
}

/// Writes the messages in this order, in small chunks.
pub(crate) fn write(folder: &Path, messages: &[Message]) -> PathBuf {
    write_with_qos(folder, messages, |_| String::new())
}

/// Same as [`write`], with the QoS of each topic's publisher as rosbag2 stores it.
pub(crate) fn write_with_qos(
    folder: &Path,
    messages: &[Message],
    qos: impl Fn(&str) -> String,
) -> PathBuf {
    write_as(mcap::WriteOptions::new(), folder, messages, qos)
}

/// Same as [`write`], like ROS 2's own recorder: without compression and without checksums.
pub(crate) fn write_unchecked(folder: &Path, messages: &[Message]) -> PathBuf {
    let options = mcap::WriteOptions::new().compression(None);
    let options = options
        .calculate_chunk_crcs(false)
        .calculate_data_section_crc(false);
    let options = options.calculate_summary_section_crc(false);
    write_as(options, folder, messages, |_| String::new())
}

/// Same as [`write`], with a summary that does not repeat what the chunks declare.
pub(crate) fn write_unrepeated(folder: &Path, messages: &[Message]) -> PathBuf {
    let options = mcap::WriteOptions::new();
    let options = options.repeat_channels(false).repeat_schemas(false);
    write_as(options, folder, messages, |_| String::new())
}

fn write_as(
    options: mcap::WriteOptions,
    folder: &Path,
    messages: &[Message],
    qos: impl Fn(&str) -> String,
) -> PathBuf {
    let path = folder.join("bag.mcap");
    let file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    let options = options.profile("ros2").chunk_size(Some(4096));
    let mut writer = options.create(file).unwrap();
    for message in messages {
        let (name, definition) = (message.schema, b"definition");
        let schema = writer.add_schema(name, "some", definition).unwrap();
        let qos = Some(qos(message.topic)).filter(|qos| !qos.is_empty());
        let metadata = qos.map(|qos| ("offered_qos_profiles".to_owned(), qos));
        let metadata = metadata.into_iter().collect();
        let (topic, encoding) = (message.topic, message.encoding);
        let channel = writer.add_channel(schema, topic, encoding, &metadata);
        let header = mcap::records::MessageHeader {
            channel_id: channel.unwrap(),
            sequence: 7,
            log_time: message.log_time,
            publish_time: message.log_time + 1,
        };
        let written = writer.write_to_known_channel(&header, &message.data);
        written.unwrap();
    }
    writer.finish().unwrap();
    path
}

/// Writes parts of a bag, each into a file of that name in a folder, with the metadata of rosbag2.
pub(crate) fn write_split<'a>(
    folder: &Path,
    storage: &str,
    parts: impl IntoIterator<Item = (String, &'a [Message])>,
    write: fn(&Path, &[Message]) -> PathBuf,
) {
    std::fs::create_dir(folder).unwrap();
    let mut names = String::new();
    for (name, part) in parts {
        std::fs::rename(write(folder, part), folder.join(&name)).unwrap();
        names += &format!("    - {name}\n");
    }
    describe(folder, storage, "", &names);
}

/// Writes the metadata of rosbag2 into a folder.
pub(crate) fn describe(folder: &Path, storage: &str, compression: &str, names: &str) {
    let metadata = format!(
        "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: {storage}\n  \
         compression_mode: \"{compression}\"\n  relative_file_paths:\n{names}  \
         topics_with_message_count:\n    - topic_metadata:\n        name: /a\n        \
         offered_qos_profiles:\n          - history: keep_last\n            deadline: {{sec: 1, \
         nsec: 2}}\n"
    );
    std::fs::write(folder.join("metadata.yaml"), metadata).unwrap();
}

/// Same as [`write`], in SQLite as ROS 2's recorder and the RealSense SDK do.
pub(crate) fn write_sqlite(folder: &Path, messages: &[Message]) -> PathBuf {
    let path = folder.join("bag.db3");
    let mut connection = rusqlite::Connection::open(&path).unwrap();
    let tables = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT \
                  NULL, serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
                  CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, \
                  timestamp INTEGER NOT NULL, data BLOB NOT NULL);";
    connection.execute_batch(tables).unwrap();
    let rows = connection.transaction().unwrap();
    let mut topics: Vec<&str> = Vec::new();
    let add_topic = "INSERT INTO topics VALUES(?, ?, ?, ?, '')";
    let add_message = "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)";
    for message in messages {
        let topic = message.topic;
        let known = topics.iter().position(|known| *known == topic);
        let id = known.unwrap_or(topics.len()) as i64;
        if known.is_none() {
            let row = (id, topic, message.schema, message.encoding);
            rows.execute(add_topic, row).unwrap();
            topics.push(topic);
        }
        let row = (id, message.log_time as i64, &message.data);
        rows.execute(add_message, row).unwrap();
    }
    rows.commit().unwrap();
    path
}
