//! Invalid recordings: the error is one line, and no wrong pair is returned.

use super::bag::{self, SIZE};
use super::frames::{attachment, bare, header, one_line, read, record, summarize};
use super::recovery::{are_of, specimen};
use super::says::Says;
use std::path::Path;
use svl::recording::{ImageFormat, Reader};
use svl::source::{RecordingSource, Source};

/// The error of opening `bytes` as a recording.
fn complaint(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.mcap");
    std::fs::write(&path, bytes).unwrap();
    let (frames, error) = read(&path);
    assert!(frames.is_empty());
    one_line(&path, &error.expect("it is bad"))
}

/// A message in an MCAP file: topic, schema, stamp, bytes.
type Part<'a> = (&'a str, &'a str, u64, &'a [u8]);

/// An MCAP file of messages.
fn mcap_of(messages: &[Part<'_>]) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut file).unwrap();
    for &(topic, schema, stamp, data) in messages {
        let schema = writer.add_schema(schema, "protobuf", b"").unwrap();
        let channel = writer.add_channel(schema, topic, "protobuf", &Default::default());
        let header = mcap::records::MessageHeader {
            channel_id: channel.unwrap(),
            sequence: 0,
            log_time: stamp,
            publish_time: stamp,
        };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

fn raw_image(width: u32, height: u32, encoding: &str, bytes: usize) -> Vec<u8> {
    let image = foxglove::messages::RawImage {
        width,
        height,
        step: width,
        encoding: encoding.to_owned(),
        data: vec![7; bytes].into(),
        ..Default::default()
    };
    bag::protobuf("", "", 0, &image).data
}

const LEFT: &str = "/stereo/left/image";
const RIGHT: &str = "/stereo/right/image";
const IMAGE: &str = "foxglove.RawImage";

/// What svl's own recordings say of the pair at 9 ns.
const SYNC: Part<'_> = (
    "/stereo/sync",
    "svl.StereoSync",
    9,
    br#"{"sequence":0,"left_stamp_ns":9,"right_stamp_ns":9,"trigger_id":0,
"skew_ns":0,"shutter_us":0,"gain_mdb":0,"drops":0}"#,
);

#[test]
fn files_that_are_no_recordings_are_refused() {
    let missing = Path::new("no/such/file.mcap");
    one_line(missing, &Reader::open(missing).err().unwrap()).says("no such file");
    let folder = tempfile::tempdir().unwrap();
    Reader::open(folder.path())
        .err()
        .unwrap()
        .says("is a folder");
    complaint(b"").says("is empty");
    complaint(b"\x89MC").says("not an MCAP file");
    complaint(b"# a recording, honestly").says("not an MCAP file");
}

#[test]
fn recordings_without_pairs_are_refused() {
    let image = raw_image(4, 2, "mono8", 8);
    let [left, right] = [LEFT, RIGHT].map(|topic| (topic, IMAGE, 1, &*image));
    let scan: Part<'_> = ("/scan", "LaserScan", 1, b"x");
    let counts = |lefts: &str, rights: u64| {
        format!("no /stereo/sync says which | {lefts} of {LEFT} and {rights} of {RIGHT}")
    };
    for (messages, words) in [
        (&[][..], "it has no images"),
        (&[scan], "it has no images"),
        (&[left], "/stereo/left/image is its only topic of images"),
        (&[SYNC], "ended before the first"),
        (&[left, left, SYNC], &counts("2 images", 0)),
        (&[right, SYNC], &counts("0 images", 1)),
        (&[left, right, SYNC], &counts("1 image", 1)),
    ] {
        complaint(&mcap_of(messages)).says(words);
    }
}

#[test]
fn invalid_pairs_are_refused() {
    let good = raw_image(4, 2, "mono8", 8);
    let wide = raw_image(5, 2, "mono8", 10);
    let max = u32::MAX;
    for (left, words) in [
        (wide, "left image is 5x2, right image is 4x2"),
        (raw_image(4, 2, "hsv8", 24), "'hsv8', svl reads mono8"),
        (raw_image(4, 2, "mono8", 7), "does not fit its 7 bytes"),
        (raw_image(0, 2, "mono8", 8), "0x2"),
        (raw_image(max, max, "mono8", 8), "4294967295x4294967295"),
        (b"\xff\xff\xff".to_vec(), ""),
    ] {
        let [left, right] = [(LEFT, &left), (RIGHT, &good)];
        let pair = [left, right].map(|(topic, image)| (topic, IMAGE, 9, &image[..]));
        complaint(&mcap_of(&[pair[0], pair[1], SYNC])).says(words);
    }
    let foreign = mcap_of(&[(LEFT, "sensor_msgs/msg/Image", 9, &good), SYNC]);
    complaint(&foreign).says("its sensor_msgs/msg/Image is in 'protobuf', svl reads");
}

#[test]
fn a_bad_pair_costs_only_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let (good, narrow) = (raw_image(4, 2, "mono8", 8), raw_image(2, 2, "mono8", 4));
    let (topic, schema, _, sync) = SYNC;
    let sync = |stamp: u64| String::from_utf8_lossy(sync).replace(":9", &format!(":{stamp}"));
    let syncs: Vec<_> = (0..4).map(sync).collect();
    let pairs = (0..4).flat_map(|i| {
        let right = if i == 2 { &narrow } else { &good };
        let sync = (topic, schema, i, syncs[i as usize].as_bytes());
        [(LEFT, IMAGE, i, &good[..]), (RIGHT, IMAGE, i, right), sync]
    });
    let messages: Vec<_> = pairs.chain([(LEFT, IMAGE, 77, &good[..])]).collect();
    std::fs::write(&path, mcap_of(&messages)).unwrap();
    let mut reader = Reader::open(&path).unwrap();
    let read = [(); 4].map(|()| reader.next_pair());
    assert!(matches!(reader.next_pair(), Ok(None)));
    let stamps = read.map(|pair| pair.ok().map(|frame| frame.unwrap().stamp_ns));
    assert_eq!(stamps, [Some(0), Some(1), None, Some(3)]);
    let unpaired = reader.facts().unpaired_ns.len();
    assert_eq!(unpaired, 1, "the lonely one at the end");
}

#[test]
fn a_broken_message_beside_the_images_costs_no_pair() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let good = raw_image(4, 2, "mono8", 8);
    let messages = [
        (LEFT, IMAGE, 9, &good[..]),
        ("/truth/visibility", IMAGE, 9, b"\xff\xff\xff"),
        (RIGHT, IMAGE, 9, &good),
        SYNC,
    ];
    std::fs::write(&path, mcap_of(&messages)).unwrap();
    let mut source = RecordingSource::open(&path).unwrap();
    assert!(source.next().unwrap().is_some() && source.next().unwrap().is_none());
    let mut losses = source.finish(1);
    losses.add(losses.clone());
    let broken = [("/truth/visibility".to_owned(), 2)].into();
    assert_eq!((losses.lost(), losses.broken), (0, broken));
}

#[test]
fn an_attachment_cut_short_is_no_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    // Two times, empty name and media type, a length of 0, and a truncated CRC.
    for crc_bytes in 0..4 {
        let body = vec![0; 8 + 8 + 4 + 4 + 8 + crc_bytes];
        let length = (body.len() as u64).to_le_bytes();
        std::fs::write(&path, [mcap::MAGIC, &[0x09], &length, &body].concat()).unwrap();
        let error = attachment(&path, "a").unwrap_err();
        one_line(&path, &error).says("lengths of a record do not agree");
    }
}

#[test]
fn a_recording_cut_anywhere_gives_its_whole_pairs_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, frames) = specimen(folder.path());
    let cut = folder.path().join("cut.mcap");
    let mut most = 0;
    let last = bytes.len() - 300..bytes.len();
    for length in (0..bytes.len()).step_by(7).chain(last) {
        std::fs::write(&cut, &bytes[..length]).unwrap();
        let (read, error) = read(&cut);
        let error = error.unwrap_or_else(|| panic!("cut at {length}: not a word"));
        let text = one_line(&cut, &error);
        let pairs = read.len();
        assert!(read[..] == frames[..pairs], "cut at {length}: a wrong pair");
        most = most.max(pairs);
        if pairs > 0 {
            text.says(&format!("incomplete | intact pairs read: {pairs}"));
            assert!(summarize(&cut).unwrap().pairs >= pairs as u64);
        }
    }
    assert_eq!(most, frames.len());
}

#[test]
fn a_changed_byte_anywhere_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, frames) = specimen(folder.path());
    let changed = folder.path().join("changed.mcap");
    for at in (0..bytes.len()).step_by(crate::common::step(3)) {
        let mut bad = bytes.clone();
        bad[at] ^= 1 << (at % 8);
        std::fs::write(&changed, &bad).unwrap();
        let (read, error) = read(&changed);
        assert!(error.is_some(), "byte {at} changed: not a word");
        // A chunk with another opcode is skipped, so a pair may be missing in the middle.
        let are_right = are_of(&read, &frames);
        assert!(are_right, "byte {at} changed: a wrong pair");
        let _ = (header(&changed), attachment(&changed, "scenario.toml"));
        let is_intact = summarize(&changed).is_ok_and(|summary| summary.is_intact());
        assert!(!is_intact, "byte {at} changed");
    }
}

#[test]
fn rubbish_in_place_of_lengths_is_no_panic_and_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = record(folder.path(), &[bare(0, SIZE)], ImageFormat::Png);
    let bytes = std::fs::read(&path).unwrap();
    let changed = folder.path().join("changed.mcap");
    for at in (0..bytes.len() - 8).step_by(crate::common::step(3)) {
        for rubbish in [[0xFF; 8], [0; 8], [0xFF, 0xFF, 0xFF, 0x7F, 0, 0, 0, 0]] {
            let mut bad = bytes.clone();
            bad[at..at + 8].copy_from_slice(&rubbish);
            std::fs::write(&changed, &bad).unwrap();
            drop((read(&changed), summarize(&changed)));
            drop((header(&changed), attachment(&changed, "x")));
        }
    }
}
