//! Damage at every position of a recording: everything untouched is salvaged.

use super::frames::{bare, read, record, recover, summarize};
use super::recovery::{are_of, recovered, specimen};
use super::says::Says;
use std::ops::Range;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use svl::Error;
use svl::recording::{ImageFormat, Reader, Recovery};
use svl::stereo::Frame;

/// The records of the file itself: opcodes and positions.
pub(crate) fn records(bytes: &[u8]) -> Vec<(u8, Range<usize>)> {
    let (mut at, mut records) = (8, Vec::new());
    while at + 9 < bytes.len() {
        let end = at + 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        records.push((bytes[at], at..end));
        at = end;
    }
    records
}

/// Positions of the chunks of a file.
pub(crate) fn chunks(bytes: &[u8]) -> Vec<Range<usize>> {
    let chunks = records(bytes).into_iter();
    let chunks = chunks.filter(|(opcode, _)| *opcode == 6);
    chunks.map(|(_, range)| range).collect()
}

/// A recording, and the records that must survive when some of its bytes are hit.
struct Whole {
    folder: tempfile::TempDir,
    bytes: Vec<u8>,
    frames: Vec<Frame>,
    chunks: Vec<Range<usize>>,
    attachment: Range<usize>,
}

impl Whole {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (bytes, frames) = specimen(folder.path());
        let (chunks, mut records) = (chunks(&bytes), records(&bytes).into_iter());
        let (_, attachment) = records.find(|(opcode, _)| *opcode == 9).unwrap();
        assert_eq!(chunks.len(), frames.len());
        Self {
            folder,
            chunks,
            attachment,
            frames,
            bytes,
        }
    }

    /// The recording that [`Whole::check`] damaged last.
    fn damaged(&self) -> PathBuf {
        self.folder.path().join("damaged.mcap")
    }

    /// Checks `bad`, the recording with `hit` changed: every chunk outside is salvaged, and nothing
    /// is wrong.
    fn check(&self, bad: &[u8], hit: &Range<usize>, what: &str) -> Recovery {
        let missed = |range: &Range<usize>| range.end <= hit.start || hit.end <= range.start;
        let (recovery, saved) = recovered(self.folder.path(), bad);
        let recovery = recovery.unwrap_or_else(|error| panic!("{what}: {error}"));
        let losses = &recovery.losses;
        assert!(!losses.is_empty(), "{what}: not a word");
        let summary = summarize(&self.damaged()).unwrap();
        assert_eq!(&summary.losses, losses, "{what}");
        assert_eq!(summary.missing, recovery.missing, "{what}");
        let is_intact = summarize(&saved).unwrap().is_intact();
        assert!(is_intact, "{what}: the saved file is damaged");
        // Every command reports the same position for the same damage.
        if let Some(error @ Error::Damaged { .. }) = read(&self.damaged()).1 {
            let error = format!("{what}: {error}");
            error.says(&losses[0].to_string()).says("`svl recover ");
        }
        let (frames, error) = read(&saved);
        assert!(error.is_none() || frames.is_empty(), "{what}: {error:?}");
        assert!(are_of(&frames, &self.frames), "{what}: a wrong pair");
        for (i, (chunk, frame)) in self.chunks.iter().zip(&self.frames).enumerate() {
            let is_kept = !missed(chunk) || frames.contains(frame);
            assert!(is_kept, "{what}: pair {i} at {chunk:?} is lost: {losses:?}");
        }
        let is_kept = !missed(&self.attachment) || recovery.attachments == 1;
        assert!(is_kept, "{what}: {losses:?}");
        let mut ends = losses.iter().map(|loss| loss.at_byte + loss.bytes);
        let are_within = ends.all(|end| end <= bad.len() as u64);
        assert!(are_within, "{what}: {losses:?}");
        recovery
    }
}

#[test]
fn any_bit_of_a_head_costs_no_more_than_its_record() {
    let whole = Whole::new();
    for (opcode, range) in records(&whole.bytes) {
        // Sample of a chunk: its head up to its data. Message indexes and the summary are as large
        // as all the rest: a sample of them.
        let is_sampled = matches!(opcode, 7..=8 | 10..=14);
        let step = crate::common::step(if is_sampled { 5 } else { 1 });
        for at in (range.start..range.end.min(range.start + 55)).step_by(step) {
            let mut bad = whole.bytes.clone();
            let bit = (at / step) % 8;
            bad[at] ^= 1 << bit;
            let what = format!("bit {bit} of byte {at}, record {opcode:#x}");
            whole.check(&bad, &(at..at + 1), &what);
        }
        for bit in (0..64).filter(|bit| opcode == 6 || bit % 11 == 0) {
            let mut bad = whole.bytes.clone();
            bad[range.start + 1 + bit / 8] ^= 1 << (bit % 8);
            let at = range.start;
            let what = format!("bit {bit} of the length of record {opcode:#x} at {at}");
            whole.check(&bad, &range, &what);
        }
    }
}

#[test]
fn bytes_that_are_zeroed_or_gone_cost_only_what_they_hit() {
    let whole = Whole::new();
    for (length, step) in [(1, 97), (20, 83), (300, 61), (1500, 127)] {
        for at in (0..whole.bytes.len() - length).step_by(crate::common::step(step)) {
            let hit = at..at + length;
            let mut zeroed = whole.bytes.clone();
            zeroed[hit.clone()].fill(0);
            if zeroed != whole.bytes {
                whole.check(&zeroed, &hit, &format!("{hit:?} zeroed"));
            }
            let gone = [&whole.bytes[..at], &whole.bytes[at + length..]].concat();
            whole.check(&gone, &hit, &format!("{hit:?} gone"));
        }
    }
}

/// After damage, bytes from 0x80 on look like private records, of any length.
#[test]
fn a_false_private_record_behind_damage_covers_no_other() {
    let whole = Whole::new();
    let (chunk, next) = (&whole.chunks[2], &whole.chunks[3]);
    let length = (next.end - chunk.end) as u64;
    let mut bad = whole.bytes.clone();
    bad[chunk.end - 40..chunk.end - 20].fill(0);
    let fake = [&[0x9a][..], &length.to_le_bytes()].concat();
    bad.splice(chunk.end..chunk.end, fake);
    whole.check(&bad, chunk, "a fake private record");
    // Without damage it is one, which only its owner understands.
    let mut private = whole.bytes.clone();
    let record = [&[0x9a][..], &4_u64.to_le_bytes(), b"mine"].concat();
    private.splice(chunk.end..chunk.end, record);
    let (recovery, _) = recovered(whole.folder.path(), &private);
    assert_eq!(recovery.unwrap().pairs, 6);
}

#[test]
fn losses_say_where_they_are() {
    let whole = Whole::new();
    let (chunk, next) = (&whole.chunks[2], &whole.chunks[3]);
    let mut bad = whole.bytes.clone();
    bad[chunk.start + 1 + 5] ^= 0x40;
    let recovery = whole.check(&bad, chunk, "a length beyond the file");
    let [loss] = &recovery.losses[..] else {
        panic!("{:?}", recovery.losses)
    };
    let found = (loss.at_byte, loss.at_byte + loss.bytes);
    assert_eq!(found, (chunk.start as u64, next.start as u64));
    assert_eq!((recovery.pairs, recovery.missing["/stereo/sync"]), (5, 1));
    let (pairs, error) = read(&whole.damaged());
    assert_eq!(pairs.len(), 2, "replay ends there: {error:?}");
    assert!(matches!(error, Some(Error::Damaged { .. })), "{error:?}");
}

#[test]
fn a_recording_is_known_without_its_first_bytes() {
    let whole = Whole::new();
    for hit in [0..1, 0..4, 0..8, 0..9, 0..40] {
        let mut bad = whole.bytes.clone();
        bad[hit.clone()].fill(0);
        let recovery = whole.check(&bad, &hit, &format!("{hit:?} zeroed"));
        let first = &recovery.losses[0];
        let words = "does not begin as an MCAP file does";
        first.reason.as_str().says(words);
        assert_eq!((first.at_byte, recovery.pairs), (0, 6));
    }
    let (none, _) = recovered(whole.folder.path(), &vec![6; 100_000]);
    none.unwrap_err().says("is not an MCAP file");
}

#[test]
fn files_one_behind_the_other_are_all_read() {
    let folder = tempfile::tempdir().unwrap();
    let bare_frames = |range: Range<u64>| -> Vec<_> { range.map(|i| bare(i, (24, 16))).collect() };
    let written = |frames: &[Frame]| {
        let folder = tempfile::tempdir().unwrap();
        std::fs::read(record(folder.path(), frames, ImageFormat::Raw)).unwrap()
    };
    let (first_frames, second_frames) = (bare_frames(0..3), bare_frames(10..14));
    let (first, second) = (&written(&first_frames)[..], &written(&second_frames)[..]);
    let cut = &first[..first.len() - 100];
    let path = folder.path().join("damaged.mcap");
    for (first, says) in [
        (first, "another MCAP file follows"),
        (cut, "it is truncated, and another MCAP file follows"),
    ] {
        let both = [first, second].concat();
        let (recovery, saved) = recovered(folder.path(), &both);
        let recovery = recovery.unwrap();
        let is_named = recovery.losses.iter().any(|loss| loss.reason == says);
        assert!(is_named, "{:?}", recovery.losses);
        assert!(recovery.missing.is_empty() && recovery.checksums);
        assert_eq!(recovery.pairs, 7, "{recovery:?}");
        let all = [&first_frames[..], &second_frames].concat();
        assert!(read(&saved).0 == all);
        let summary = summarize(&path).unwrap();
        assert_eq!((summary.pairs, summary.gaps.len()), (7, 1));
        assert_eq!(summary.losses, recovery.losses);
        let (frames, error) = read(&path);
        assert_eq!(frames, first_frames, "replay ends where the first does");
        assert!(matches!(error, Some(Error::Damaged { .. })), "{error:?}");
    }
    let (recovery, _) = recovered(folder.path(), &[second, second].concat());
    let gaps = summarize(&path).unwrap().gaps.len();
    assert_eq!((recovery.unwrap().pairs, gaps), (8, 0));
}

#[test]
fn false_records_are_skipped_quickly() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, _) = specimen(folder.path());
    let path = folder.path().join("hostile.mcap");
    // Heads of chunks, each up to the end of the file.
    let length = 8 << 20;
    let mut hostile = bytes[..bytes.len() - 8].to_vec();
    while hostile.len() < length {
        let left = (length + 100 - hostile.len()) as u64;
        let (size, packed) = ((2_u64 << 30).to_le_bytes(), (left - 44).to_le_bytes());
        hostile.push(6);
        hostile.extend([&left.to_le_bytes()[..], &[0; 16], &size, &[1; 4]].concat());
        hostile.extend([&4_u32.to_le_bytes()[..], b"zstd", &packed].concat());
    }
    hostile.resize(length + 200, 0);
    // Records of other programs' own kinds, each containing a whole chunk, up to the end of the
    // file.
    let chunk = chunks(&bytes).swap_remove(0);
    let mut nested = bytes[..chunk.start].to_vec();
    while nested.len() < length {
        let left = (length + 10_000 - nested.len()) as u64;
        nested.extend([&[0x80][..], &left.to_le_bytes(), &bytes[chunk.clone()]].concat());
    }
    nested.resize(length + 20_000, 0);
    for hostile in [hostile, nested] {
        std::fs::write(&path, hostile).unwrap();
        let began = Instant::now();
        let saved = folder.path().join("saved.mcap");
        let _ = std::fs::remove_file(&saved);
        drop((recover(&path, &saved), summarize(&path)));
        drop(Reader::open(&path));
        let took = began.elapsed();
        println!("{took:?}");
        assert!(took < Duration::from_secs(60), "{took:?}");
    }
}
