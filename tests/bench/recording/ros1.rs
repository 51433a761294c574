//! ROS 1 bags: written here by their format's page (wiki.ros.org/Bags/Format/2.0), and by rosbags.

use super::bag::{Bag, Message};
use super::formats::with_sensors;
use super::frames::{intact, read, recover, summarize};
use super::says::Says;
use crate::cli::fixture::Fixture;
use bzip2::Compression;
use bzip2::write::BzEncoder;
use re_cdr::{CdrReader, LittleEndian};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Fields of the types: `h` header, `t` time, `s` string, `y` bytes, `1`, `4`, `8` numbers of so
/// many bytes, `[…]` a sequence.
const TYPES: [(&str, &str); 6] = [
    ("sensor_msgs/msg/Image", "h44s14y"),
    ("sensor_msgs/msg/CompressedImage", "hsy"),
    (
        "sensor_msgs/msg/CameraInfo",
        "h44s[8]8888888888888888888888888888884444441",
    ),
    ("sensor_msgs/msg/PointCloud2", "h44[s414]144y1"),
    ("tf2_msgs/msg/TFMessage", "[hs8888888]"),
    ("std_msgs/msg/String", "s"),
];

/// A message of ROS 2 as ROS 1 serializes it: packed, strings without a zero, headers with a
/// number.
fn packed(message: &Message) -> Vec<u8> {
    let (_, fields) = TYPES
        .iter()
        .find(|(name, _)| *name == message.schema)
        .unwrap();
    let (mut out, mut cdr) = (Vec::new(), CdrReader::new(&message.data[4..]));
    copy(&mut cdr, fields, &mut out);
    out
}

fn copy(cdr: &mut CdrReader<'_, LittleEndian>, fields: &str, out: &mut Vec<u8>) {
    let mut rest = fields;
    while let Some(field) = rest.chars().next() {
        rest = &rest[1..];
        match field {
            'h' => {
                out.extend([9, 0, 0, 0]);
                copy(cdr, "44s", out);
            }
            's' => {
                let text = cdr.read_str().unwrap();
                out.extend((text.len() as u32).to_le_bytes());
                out.extend(text.as_bytes());
            }
            'y' => {
                let bytes = cdr.read_byte_sequence().unwrap();
                out.extend((bytes.len() as u32).to_le_bytes());
                out.extend(bytes);
            }
            '1' => out.push(cdr.read_u8().unwrap()),
            '4' => out.extend(cdr.read_u32().unwrap().to_le_bytes()),
            '8' => out.extend(cdr.read_f64().unwrap().to_le_bytes()),
            '[' => {
                let (inner, after) = rest.split_once(']').unwrap();
                let count = cdr.read_sequence_length().unwrap();
                out.extend((count as u32).to_le_bytes());
                (0..count).for_each(|_| copy(cdr, inner, out));
                rest = after;
            }
            other => panic!("{other}"),
        }
    }
}

/// A record of these header fields.
fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let mut header = Vec::new();
    for (name, value) in fields {
        header.extend((name.len() as u32 + 1 + value.len() as u32).to_le_bytes());
        header.extend([name.as_bytes(), b"=", value].concat());
    }
    let lengths = [header.len(), data.len()].map(|length| (length as u32).to_le_bytes());
    [&lengths[0], &header[..], &lengths[1], data].concat()
}

/// A bag of these messages, and the position of its index.
struct Ros1Bag {
    bytes: Vec<u8>,
    index: usize,
}

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

/// The header of a bag: it fills 4096 bytes.
fn head(index: u64, chunks: u32) -> Vec<u8> {
    let fields: [(&str, &[u8]); 4] = [
        ("chunk_count", &chunks.to_le_bytes()),
        ("conn_count", &7u32.to_le_bytes()),
        ("index_pos", &index.to_le_bytes()),
        ("op", &[3]),
    ];
    let length = record(&fields, b"").len();
    record(&fields, &vec![b' '; 4096 - length])
}

/// The declaration of connection number `id`.
fn connection(id: usize, message: &Message) -> Vec<u8> {
    let schema = message.schema.replace("/msg/", "/");
    let topic = message.topic.as_bytes();
    let inner = record(&[("topic", topic), ("type", schema.as_bytes())], b"");
    let id = (id as u32).to_le_bytes();
    let fields: [(&str, &[u8]); 3] = [("conn", &id), ("op", &[7]), ("topic", topic)];
    record(&fields, &inner[4..inner.len() - 4])
}

/// The head of a chunk.
fn chunk_fields<'a>(compression: &'a str, size: &'a [u8; 4]) -> [(&'a str, &'a [u8]); 3] {
    let compression = compression.as_bytes();
    [("compression", compression), ("op", &[5]), ("size", size)]
}

/// A bag with a chunk for every four messages, with that compression.
fn bag(messages: &Bag, compression: &str) -> Ros1Bag {
    let pack: fn(&[u8]) -> Vec<u8> = match compression {
        "lz4" => lz4,
        "bz2" => bz2,
        _ => <[u8]>::to_vec,
    };
    let mut bytes = [MAGIC, &head(0, 0)].concat();
    let mut connections: Vec<(&str, Vec<u8>)> = Vec::new();
    let chunks = messages.0.chunks(4);
    let count = chunks.len();
    for part in chunks {
        let mut chunk = Vec::new();
        for message in part {
            let mut known = connections.iter();
            let known = known.position(|(topic, _)| *topic == message.topic);
            let id = known.unwrap_or(connections.len());
            if known.is_none() {
                let declared = connection(id, message);
                chunk.extend(&declared);
                connections.push((message.topic, declared));
            }
            let time = message.log_time;
            let time = [time / 1_000_000_000, time % 1_000_000_000];
            let time = time.map(|part| (part as u32).to_le_bytes()).concat();
            let id = (id as u32).to_le_bytes();
            let fields: [(&str, &[u8]); 3] = [("conn", &id), ("op", &[2]), ("time", &time)];
            chunk.extend(record(&fields, &packed(message)));
        }
        let size = (chunk.len() as u32).to_le_bytes();
        bytes.extend(record(&chunk_fields(compression, &size), &pack(&chunk)));
        let fields: [(&str, &[u8]); 2] = [("ver", &1u32.to_le_bytes()), ("op", &[4])];
        bytes.extend(record(&fields, &[0; 12]));
    }
    let index = bytes.len();
    bytes.extend(connections.iter().flat_map(|(_, record)| record));
    let fields: [(&str, &[u8]); 2] = [("ver", &1u32.to_le_bytes()), ("op", &[6])];
    bytes.extend(record(&fields, &[0; 8]).repeat(count));
    bytes.splice(13..13 + 4096, head(index as u64, count as u32));
    Ros1Bag { bytes, index }
}

fn lz4(chunk: &[u8]) -> Vec<u8> {
    let mut packed = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
    packed.write_all(chunk).unwrap();
    packed.finish().0
}

fn bz2(chunk: &[u8]) -> Vec<u8> {
    let mut packed = BzEncoder::new(Vec::new(), Compression::default());
    packed.write_all(chunk).unwrap();
    packed.finish().unwrap()
}

fn write(folder: &Path, bytes: &[u8]) -> PathBuf {
    let path = folder.join("a.bag");
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Writes the messages into a bag with that compression.
pub(crate) fn write_bag(folder: &Path, messages: &[Message], compression: &str) -> PathBuf {
    let messages = Bag(messages.to_vec());
    write(folder, &bag(&messages, compression).bytes)
}

#[test]
fn a_bag_without_its_index_has_all_its_pairs() {
    let folder = tempfile::tempdir().unwrap();
    let whole = bag(&with_sensors(), "lz4");
    let cut = &whole.bytes[..whole.index];
    // Closed by nobody: the header still says that there is no index.
    let mut active = cut.to_vec();
    let mut places = active.windows(10);
    let field = places.position(|field| field == b"index_pos=").unwrap();
    active[field + 10..field + 18].fill(0);
    let stopped = "its recorder was stopped before it wrote the index";
    let cut_off = "it is cut off before its index";
    for (bytes, reason) in [(&active[..], stopped), (cut, cut_off)] {
        let path = write(folder.path(), bytes);
        let (frames, error) = read(&path);
        assert_eq!(frames.len(), 2);
        error.unwrap().says(reason).says("intact pairs read: 2");
        assert!(!summarize(&path).unwrap().is_intact());
    }
}

#[test]
fn damage_costs_only_its_chunk() {
    let folder = tempfile::tempdir().unwrap();
    for compression in ["none", "lz4"] {
        let whole = bag(&with_sensors(), compression).bytes;
        // The first chunk declares the connections of both cameras; the index repeats them.
        for at in [13 + 4096, 13 + 4096 + 40] {
            let mut bytes = whole.clone();
            bytes[at..at + 4].fill(0xEE);
            let path = write(folder.path(), &bytes);
            let (frames, error) = read(&path);
            assert_eq!(frames.len(), 1, "{compression} {at}");
            error
                .unwrap()
                .says("damaged at byte | intact pairs read: 1");
            let info = summarize(&path).unwrap();
            assert_eq!((info.losses.len(), info.pairs), (1, 1), "{:?}", info.losses);
            assert_eq!(info.losses[0].at_byte, 13 + 4096);
            // The rest is an intact recording of the same pair.
            let saved = folder.path().join("saved.mcap");
            assert_eq!(recover(&path, &saved).unwrap().losses, info.losses);
            assert!(intact(&saved) == frames);
            std::fs::remove_file(saved).unwrap();
        }
        // Cut anywhere, or a byte changed anywhere: pairs are lost, nothing else happens.
        for at in (14..whole.len()).step_by(61) {
            let (frames, _) = read(&write(folder.path(), &whole[..at]));
            assert!(frames.len() <= 2, "{at}");
            let mut bytes = whole.clone();
            bytes[at] ^= 0xFF;
            let path = write(folder.path(), &bytes);
            assert!(read(&path).0.len() <= 2, "{at}");
            let _ = summarize(&path).unwrap();
        }
    }
}

#[test]
fn unreadable_bags_are_reported_with_the_cure() {
    let fixture = Fixture::new();
    let head: [(&str, &[u8]); 2] = [("op", &[3]), ("encryptor", b"rosbag/AesCbcEncryptor")];
    let encrypted = [MAGIC, &record(&head, &[b' '; 9])].concat();
    fixture.write("secret.bag", encrypted);
    fixture.write("old.bag", "#ROSBAG V1.2\nrest");
    fixture.write("cut.bag", "#ROSBAG V2.0\nrest");
    fixture.write("whole.bag", bag(&with_sensors(), "lz4").bytes);
    for name in ["a.svo2", "a.svo", "a.tar", "a.tar.gz"] {
        fixture.write(name, "anything");
    }
    let calib = r#"{"boardName": "OAK-D", "cameraData": [[0, {}]]}"#;
    fixture.write("calib.json", calib);
    fixture.fails(
        "record a.svo2 => 1: a.svo2: is a recording of ZED's SDK | ZED_SVO_Export FILE FOLDER/ 2
         info a.svo => 1: ZED_SVO_Export
         record a.tar => 1: a.tar: is an archive | holistic | --left LEFT.mp4
         record a.tar.gz => 1: is an archive
         record whole.bag --calib calib.json => 1: calib.json: is DepthAI's | K1 D1 K2 D2 R T
         record secret.bag => 1: is an encrypted bag | rosbag decrypt
         record old.bag => 1: is a ROS 1 bag of another format | rosbag fix old.bag
         record cut.bag => 1: cut.bag: the recording is incomplete | its header is damaged
",
    );
    let info = fixture.run("info whole.bag");
    info.says("paired topics   /cam0/image_rect | /depth | /points");
}

/// Each begins like a chunk that reaches to the end of the file: reading them all would take the
/// square of its length.
#[test]
fn false_chunks_are_skipped_quickly() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = bag(&Bag::pairs(2), "none").bytes;
    let head = record(&chunk_fields("none", &1_u32.to_le_bytes()), b"");
    let count = 60_000;
    for i in 0..count {
        let rest = ((count - 1 - i) * head.len()) as u32;
        bytes.extend(&head[..head.len() - 4]);
        bytes.extend(rest.to_le_bytes());
    }
    let summary = summarize(&write(folder.path(), &bytes)).unwrap();
    let mut last = summary.losses.iter().rev().take(2);
    let is_named = last.any(|loss| loss.reason.contains("too many damaged parts"));
    assert!(is_named, "{:?}", summary.losses.last());
    assert!(summary.losses.len() < 1000 && summary.pairs == 2);
}
