//! Bags without checksums, as written by ROS 2's recorder: the damage that is detected.

use super::bag::{self, Bag, RAW, STEREO};
use super::damage::{chunks, records};
use super::frames::{read, summarize};
use super::recovery;
use super::says::Says;
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;
use svl::Error;
use svl::recording::{RecordingSummary, Recovery};

const PAIRS: u64 = 20;

/// A bag of pairs in several chunks.
fn specimen(folder: &Path) -> Vec<u8> {
    let pair = |i| RAW.images_at(i, 1_000_000_000 + i * 50_000_000);
    let bag = Bag::new((0..PAIRS).flat_map(pair));
    std::fs::read(bag::write_unchecked(folder, &bag.0)).unwrap()
}

/// The common report of info and recover on `bytes`.
fn judged(folder: &Path, bytes: &[u8]) -> (RecordingSummary, Recovery) {
    let (recovery, _) = recovery::recovered(folder, bytes);
    let summary = summarize(&folder.join("damaged.mcap")).unwrap();
    let recovery = recovery.unwrap();
    assert_eq!(summary.losses, recovery.losses);
    assert_eq!(summary.missing, recovery.missing);
    assert_eq!(summary.checksums, recovery.checksums);
    assert_eq!(summary.is_intact(), recovery.losses.is_empty());
    (summary, recovery)
}

#[test]
fn pixels_without_a_checksum_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = specimen(folder.path());
    let (summary, recovery) = judged(folder.path(), &bytes);
    assert!(summary.is_intact() && !summary.checksums && recovery.missing.is_empty());
    let chunk = &chunks(&bytes)[2];
    let middle = (chunk.start + chunk.end) / 2;
    let mut zeroed = bytes.clone();
    zeroed[middle..middle + 100].fill(0);
    let (summary, _) = judged(folder.path(), &zeroed);
    assert!(summary.is_intact() && !summary.checksums, "nobody can tell");
    // With checksums it is intact without reservation: in each chunk, or over all the data.
    let checked = std::fs::read(&*Bag::new(STEREO.images_at(0, 5)).saved()).unwrap();
    let mut in_the_whole = checked.clone();
    let chunk = &chunks(&checked)[0];
    assert!(judged(folder.path(), &checked).0.checksums);
    in_the_whole[chunk.start + 9 + 24..chunk.start + 9 + 28].fill(0);
    let mut records = records(&checked).into_iter();
    let (_, end) = records.find(|(opcode, _)| *opcode == 15).unwrap();
    let crc = crc32fast::hash(&in_the_whole[..end.start]);
    in_the_whole[end.end - 4..end.end].copy_from_slice(&crc.to_le_bytes());
    let (summary, _) = judged(folder.path(), &in_the_whole);
    assert!(summary.is_intact() && summary.checksums, "{summary:?}");
}

#[test]
fn a_chunk_that_is_not_found_is_missed() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = specimen(folder.path());
    let mut bad = bytes.clone();
    bad[chunks(&bytes)[2].start] ^= 0x40;
    let (summary, _) = judged(folder.path(), &bad);
    let lost = summary.missing["/cam0/image_raw"];
    let is_missed = lost > 0 && summary.missing.len() == 2;
    assert!(!summary.is_intact() && is_missed, "{summary:?}");
    let (frames, error) = read(&folder.path().join("damaged.mcap"));
    let words = "a record is of the unknown kind 0x46; intact pairs read: ";
    error.expect("a word").says(words);
    let read = frames.len() as u64;
    assert!((PAIRS - lost - 1..PAIRS).contains(&read), "{read} pairs");
}

#[test]
fn a_damaged_header_is_told_and_the_pairs_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = specimen(folder.path());
    for (at, bit, pairs) in [(8, 0x40, PAIRS as usize), (17, 0x80, 0)] {
        let mut bad = bytes.clone();
        bad[at] ^= bit;
        let (summary, recovery) = judged(folder.path(), &bad);
        assert!(!summary.is_intact());
        assert_eq!(summary.losses[0].at_byte, 8, "{:?}", summary.losses);
        assert_eq!(recovery.messages["/cam1/image_raw"], PAIRS);
        let (frames, error) = read(&folder.path().join("damaged.mcap"));
        assert_eq!(frames.len(), pairs);
        assert!(matches!(error, Some(Error::Damaged { .. })), "{error:?}");
        let saved = folder.path().join("saved.mcap");
        assert_eq!(read(&saved).0.len(), PAIRS as usize);
    }
}

/// The messages of a file as far as they are distinguishable.
fn messages(bytes: &[u8]) -> BTreeSet<(String, u64, Vec<u8>)> {
    let messages = mcap::MessageStream::new(bytes).unwrap().map(|message| {
        let message = message.unwrap();
        let (topic, data) = (message.channel.topic.clone(), message.data.into_owned());
        (topic, message.log_time, data)
    });
    messages.collect()
}

#[test]
fn any_change_costs_only_its_own_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = specimen(folder.path());
    let all = messages(&bytes);
    let chunks = chunks(&bytes);
    // The messages of a chunk are those that a file without it does not have.
    let of_chunk = |chunk: &Range<usize>| {
        let mut without = bytes.clone();
        without[chunk.clone()].fill(0);
        let (_, saved) = recovery::recovered(folder.path(), &without);
        let lacking = &all - &messages(&std::fs::read(saved).unwrap());
        assert!(!lacking.is_empty(), "{chunk:?}");
        lacking
    };
    let chunk_messages: Vec<_> = chunks.iter().map(of_chunk).collect();
    let counts = chunk_messages.iter().map(BTreeSet::len);
    assert_eq!(counts.sum::<usize>(), all.len());
    let check = |bad: &[u8], hit: Range<usize>, what: &str| {
        let (_, recovery) = judged(folder.path(), bad);
        let saved = messages(&std::fs::read(folder.path().join("saved.mcap")).unwrap());
        let losses = &recovery.losses;
        let is_hit = |chunk: &Range<usize>| chunk.start < hit.end && hit.start < chunk.end;
        for (chunk, messages) in chunks.iter().zip(&chunk_messages) {
            let is_saved = messages.is_subset(&saved);
            assert!(is_hit(chunk) || is_saved, "{what}: {chunk:?}: {losses:?}");
        }
        // Anything changed can only belong to the chunk that was hit, where it is undetectable.
        let wrong = (&saved - &all).len();
        let is_known = wrong == 0 || chunks.iter().any(is_hit);
        assert!(is_known, "{what}: {wrong} wrong, {losses:?}");
        let count: u64 = recovery.messages.values().sum();
        assert!(count == all.len() as u64 || !losses.is_empty(), "{what}");
    };
    for at in (0..bytes.len() - 400).step_by(crate::common::step(23)) {
        let mut flipped = bytes.clone();
        flipped[at] ^= 1 << (at % 8);
        check(&flipped, at..at + 1, &format!("byte {at} flipped"));
        let mut zeroed = bytes.clone();
        zeroed[at..at + 40].fill(0);
        check(&zeroed, at..at + 40, &format!("40 bytes at {at} zeroed"));
        let gone = [&bytes[..at], &bytes[at + 400..]].concat();
        check(&gone, at..at + 400, &format!("400 bytes at {at} gone"));
    }
}

/// The length is that of a schema inside a chunk, which no CRC covers.
#[test]
fn a_length_beyond_its_record_is_not_allocated() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = specimen(folder.path());
    // Opcode, length, number: the name of the first schema follows.
    let head = bytes.windows(11).position(|head| {
        let length = u64::from_le_bytes(*head[1..].first_chunk().unwrap());
        head[0] == mcap::records::op::SCHEMA && length < 1000 && head[9..] == [1, 0]
    });
    let name = head.unwrap() + 11;
    bytes[name..name + 4].copy_from_slice(&0xFFFF_FFFE_u32.to_le_bytes());
    let (summary, _) = judged(folder.path(), &bytes);
    let reasons: Vec<_> = summary.losses.iter().map(|loss| &loss.reason).collect();
    let is_named = |why: &&String| why.contains("a length in it is beyond it");
    assert!(reasons.iter().any(is_named), "{reasons:?}");
}
