//! Invalid recordings: the error is one line, and no wrong pair is returned.

use super::frames::{attachment, bare, header, one_line, read, record, summarize};
use super::recovery::specimen;
use crate::common::assert_says;
use std::path::Path;
use svl::Result;
use svl::recording::{ImageFormat, Reader};
use svl::source::{RecordingSource, Source};
use svl::stereo::Frame;

const SIZE: (usize, usize) = (24, 16);

/// The error of opening `bytes` as a recording.
fn complaint(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.mcap");
    std::fs::write(&path, bytes).unwrap();
    let (frames, error) = read(&path);
    assert!(frames.is_empty());
    one_line(&path, &error.expect("it is bad"))
}

/// An MCAP file of messages: topic, schema, stamp, bytes.
fn mcap_of(messages: &[(&str, &str, u64, &[u8])]) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut file).unwrap();
    for &(topic, schema, stamp, data) in messages {
        let schema = writer.add_schema(schema, "protobuf", b"").unwrap();
        let channel_id = writer
            .add_channel(schema, topic, "protobuf", &Default::default())
            .unwrap();
        let header = mcap::records::MessageHeader {
            channel_id,
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
    use foxglove::Encode as _;
    let image = foxglove::messages::RawImage {
        width,
        height,
        step: width,
        encoding: encoding.to_owned(),
        data: vec![7; bytes].into(),
        ..Default::default()
    };
    let mut data = Vec::new();
    image.encode(&mut data).unwrap();
    data
}

const SYNC: &[u8] = br#"{"sequence":0,"left_stamp_ns":9,"right_stamp_ns":9,"trigger_id":0,
"skew_ns":0,"shutter_us":0,"gain_mdb":0,"drops":0}"#;

/// A recording of one pair of these images.
fn pair_of(left: &[u8], right: &[u8]) -> Vec<u8> {
    let (image, left_topic, right_topic) = (
        "foxglove.RawImage",
        "/stereo/left/image",
        "/stereo/right/image",
    );
    mcap_of(&[
        (left_topic, image, 9, left),
        (right_topic, image, 9, right),
        ("/stereo/sync", "svl.StereoSync", 9, SYNC),
    ])
}

#[test]
fn files_that_are_no_recordings_are_refused() {
    let missing = Path::new("no/such/file.mcap");
    assert!(one_line(missing, &Reader::open(missing).err().unwrap()).contains("no such file"));
    let folder = tempfile::tempdir().unwrap();
    assert_says(
        &Reader::open(folder.path()).err().unwrap().to_string(),
        &["is a folder"],
    );
    assert!(complaint(b"").contains("is empty"));
    assert!(complaint(b"\x89MC").contains("not an MCAP file"));
    assert!(complaint(b"# a recording, honestly").contains("not an MCAP file"));
}

#[test]
fn recordings_without_pairs_are_refused() {
    let image = raw_image(4, 2, "mono8", 8);
    assert!(complaint(&mcap_of(&[])).contains("it has no images"));
    assert!(complaint(&mcap_of(&[("/scan", "LaserScan", 1, b"x")])).contains("it has no images"));
    let left = ("/stereo/left/image", "foxglove.RawImage", 1, &*image);
    let right = ("/stereo/right/image", "foxglove.RawImage", 1, &*image);
    let sync = ("/stereo/sync", "svl.StereoSync", 9, SYNC);
    assert!(
        complaint(&mcap_of(&[left])).contains("/stereo/left/image is its only topic of images")
    );
    assert!(complaint(&mcap_of(&[sync])).contains("ended before the first"));
    for (messages, lefts, rights) in [
        (&[left, left, sync][..], "2 images", 0),
        (&[right, sync], "0 images", 1),
        (&[left, right, sync], "1 image", 1),
    ] {
        let counts = format!("{lefts} of /stereo/left/image and {rights} of /stereo/right/image");
        assert_says(
            &complaint(&mcap_of(messages)),
            &["no /stereo/sync says which", &counts],
        );
    }
}

#[test]
fn invalid_pairs_are_refused() {
    let good = raw_image(4, 2, "mono8", 8);
    let says = |left: &[u8], what: &str| {
        let text = complaint(&pair_of(left, &good));
        assert!(text.contains(what), "{text}");
    };
    says(
        &raw_image(5, 2, "mono8", 10),
        "left image is 5x2, right image is 4x2",
    );
    says(&raw_image(4, 2, "hsv8", 24), "'hsv8', svl reads mono8");
    says(&raw_image(4, 2, "mono8", 7), "does not fit its 7 bytes");
    says(&raw_image(0, 2, "mono8", 8), "0x2");
    says(
        &raw_image(u32::MAX, u32::MAX, "mono8", 8),
        "4294967295x4294967295",
    );
    says(b"\xff\xff\xff", "");
    let sync = ("/stereo/sync", "svl.StereoSync", 9, SYNC);
    let foreign = mcap_of(&[
        ("/stereo/left/image", "sensor_msgs/msg/Image", 9, &good),
        sync,
    ]);
    assert!(complaint(&foreign).contains("its sensor_msgs/msg/Image is in 'protobuf', svl reads"));
}

#[test]
fn a_bad_pair_costs_only_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let (good, narrow) = (raw_image(4, 2, "mono8", 8), raw_image(2, 2, "mono8", 4));
    let image = "foxglove.RawImage";
    let sync = |stamp: u64| String::from_utf8_lossy(SYNC).replace(":9", &format!(":{stamp}"));
    let syncs: Vec<_> = (0..4).map(sync).collect();
    let messages: Vec<_> = (0..4)
        .flat_map(|i| {
            let right = if i == 2 { &narrow } else { &good };
            [
                ("/stereo/left/image", image, i, &*good),
                ("/stereo/right/image", image, i, &**right),
                (
                    "/stereo/sync",
                    "svl.StereoSync",
                    i,
                    syncs[i as usize].as_bytes(),
                ),
            ]
        })
        .chain([("/stereo/left/image", image, 77, &*good)])
        .collect();
    std::fs::write(&path, mcap_of(&messages)).unwrap();
    let mut reader = Reader::open(&path).unwrap();
    let mut read: Vec<Result<Option<Frame>>> = (0..5).map(|_| reader.next_pair()).collect();
    assert!(matches!(read.pop(), Some(Ok(None))));
    let stamps: Vec<_> = read
        .iter()
        .map(|r| r.as_ref().ok().map(|f| f.as_ref().unwrap().stamp_ns))
        .collect();
    assert_eq!(stamps, [Some(0), Some(1), None, Some(3)]);
    assert_eq!(
        reader.facts().unpaired_ns.len(),
        1,
        "the lonely one at the end"
    );
}

#[test]
fn a_broken_message_beside_the_images_costs_no_pair() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let good = raw_image(4, 2, "mono8", 8);
    let image = "foxglove.RawImage";
    std::fs::write(
        &path,
        mcap_of(&[
            ("/stereo/left/image", image, 9, &good),
            ("/truth/visibility", image, 9, b"\xff\xff\xff"),
            ("/stereo/right/image", image, 9, &good),
            ("/stereo/sync", "svl.StereoSync", 9, SYNC),
        ]),
    )
    .unwrap();
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
        assert!(one_line(&path, &error).contains("lengths of a record do not agree"));
    }
}

#[test]
fn a_recording_cut_anywhere_gives_its_whole_pairs_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, frames) = specimen(folder.path());
    let cut = folder.path().join("cut.mcap");
    let mut most = 0;
    for length in (0..bytes.len())
        .step_by(7)
        .chain(bytes.len() - 300..bytes.len())
    {
        std::fs::write(&cut, &bytes[..length]).unwrap();
        let (read, error) = read(&cut);
        let text = one_line(
            &cut,
            &error.unwrap_or_else(|| panic!("cut at {length}: not a word")),
        );
        assert!(
            read[..] == frames[..read.len()],
            "cut at {length}: a wrong pair"
        );
        most = most.max(read.len());
        if !read.is_empty() {
            assert!(
                text.contains("incomplete")
                    && text.contains(&format!("intact pairs read: {}", read.len())),
                "{text}"
            );
            assert!(summarize(&cut).unwrap().pairs >= read.len() as u64);
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
        let mut originals = frames.iter();
        assert!(
            read.iter()
                .all(|pair| originals.any(|original| original == pair)),
            "byte {at} changed: a wrong pair"
        );
        let _ = (header(&changed), attachment(&changed, "scenario.toml"));
        assert!(
            summarize(&changed).map_or(true, |summary| !summary.is_intact()),
            "byte {at} changed"
        );
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
            let _ = (
                read(&changed),
                summarize(&changed),
                header(&changed),
                attachment(&changed, "x"),
            );
        }
    }
}
