//! Records with unknown fields at their end, which readers ignore.

mod conformance;
mod file;

use super::damage::{chunks, records};
use super::frames::{read, recover, summarize};
use super::recovery::{all_recovered, recovered, saved_pairs, specimen};
use file::{EXTENSIBLE, extended};
use mcap::records::op;
use std::path::Path;
use svl::recording::{Reader, RecordingSummary};
use svl::stereo::Frame;

/// Unknown fields: short ones, and some that look like the start of a chunk.
const FIELDS: [&[u8]; 2] = [&[1, 0xFF, 0xFF], &[6, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]];

/// Reads an extended recording in every way, and returns its summary.
fn check(folder: &Path, bytes: &[u8], frames: &[Frame], index: bool) -> RecordingSummary {
    all_recovered(folder, bytes, frames);
    let path = folder.join("damaged.mcap");
    let mut reader = Reader::open(&path).unwrap();
    assert_eq!(reader.pairs(), index.then_some(6));
    assert_eq!(reader.seek(4).unwrap(), index);
    let next = reader.next_pair().unwrap().unwrap();
    assert_eq!(next, frames[if index { 4 } else { 0 }]);
    let summary = summarize(&path).unwrap();
    assert!(summary.losses.is_empty() || !index, "{:?}", summary.losses);
    summary
}

#[test]
fn unknown_fields_of_every_kind_of_record_are_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, frames) = specimen(folder.path());
    let present = records(&bytes);
    let one_each = EXTENSIBLE.map(|kind| vec![kind]);
    for kinds in one_each.iter().chain([&EXTENSIBLE.to_vec()]) {
        let is_inside = [op::SCHEMA, op::CHANNEL].contains(&kinds[0]);
        assert!(is_inside || present.iter().any(|(opcode, _)| *opcode == kinds[0]));
        for fields in FIELDS {
            let [with, without] = [true, false].map(|index| {
                let bytes = extended(&bytes, kinds, fields, index);
                check(folder.path(), &bytes, &frames, index)
            });
            let facts = |s: RecordingSummary| (s.topics, s.pairs, s.attachments, s.header);
            assert_eq!(facts(with), facts(without), "{kinds:?}");
        }
    }
}

#[test]
fn damaged_extended_files_lose_no_more_than_others() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, frames) = specimen(folder.path());
    for index in [true, false] {
        let bytes = extended(&bytes, &EXTENSIBLE, FIELDS[0], index);
        let chunks = chunks(&bytes);
        let pairs = |bad: &[u8], what: &str| saved_pairs(folder.path(), &frames, bad, what);
        let mut saved = Vec::new();
        for at in (0..bytes.len()).step_by(509) {
            saved.push(pairs(&bytes[..at], &format!("cut at {at}")));
            let mut bad = bytes.clone();
            bad[at] ^= 1 << (at % 8);
            let what = format!("byte {at} changed");
            let kept = pairs(&bad, &what);
            // Only the summary repeats the channels, which the first chunk declares.
            let hit = chunks.iter().any(|chunk| chunk.contains(&at));
            let is_first = !index && chunks[0].contains(&at);
            let least = 6 - usize::from(hit);
            assert!(kept >= least || is_first, "{what}: {kept} pairs");
        }
        assert!(saved.is_sorted(), "the longer, the more: {saved:?}");
    }
}

/// A length that covers the following records would hide them as unknown fields.
#[test]
fn a_length_that_covers_other_records_is_damage() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, frames) = specimen(folder.path());
    for kinds in [&[][..], &EXTENSIBLE] {
        let bytes = extended(&bytes, kinds, FIELDS[0], false);
        let chunks = chunks(&bytes);
        let (long, next) = (&chunks[1], &chunks[2]);
        let mut bad = bytes.clone();
        let length = (next.end - long.start - 9) as u64;
        bad[long.start + 1..long.start + 9].copy_from_slice(&length.to_le_bytes());
        let (recovery, saved) = recovered(folder.path(), &bad);
        let recovery = recovery.unwrap();
        assert!(recovery.partial);
        let [loss] = &recovery.losses[..] else {
            panic!("{:?}", recovery.losses)
        };
        assert_eq!(loss.reason, "the unknown part of a record covers others");
        assert_eq!((recovery.pairs, loss.at_byte), (5, long.start as u64));
        let others = frames.iter().filter(|frame| frame.sequence != 1);
        assert!(read(&saved).0.iter().eq(others));
        let again = recover(&saved, &folder.path().join("again.mcap")).unwrap();
        assert!(again.losses.is_empty() && !again.partial);
        std::fs::remove_file(folder.path().join("again.mcap")).unwrap();
    }
}
