//! Recovery of damaged and truncated files.

use super::bag::{Bag, RAW, SIZE};
use super::damage::chunks;
use super::frames::{attachment, bare, full, header, intact, read, recover, summarize};
use super::says::Says;
use std::path::{Path, PathBuf};
use svl::Error;
use svl::recording::{Header, ImageFormat, Recovery, Writer};
use svl::stereo::Frame;

/// A recording of six pairs, each in a chunk of its own, with every kind of record and message.
pub(crate) fn specimen(folder: &Path) -> (Vec<u8>, Vec<Frame>) {
    let path = folder.join("specimen.mcap");
    let mut header = Header::new("test");
    header.seed = Some(7);
    let mut writer = Writer::create(&path, &header, ImageFormat::Raw).unwrap();
    let (media, text) = ("application/toml", b"name = 'x'");
    writer.attach("scenario.toml", media, text).unwrap();
    for i in 0..6 {
        let frame = if i < 4 { full(i, SIZE) } else { bare(i, SIZE) };
        writer.write(&frame).unwrap();
        writer.sync().unwrap();
    }
    writer.finish().unwrap();
    let frames = intact(&path);
    assert_eq!(frames.len(), 6);
    (std::fs::read(&path).unwrap(), frames)
}

pub(crate) fn recovered(folder: &Path, bytes: &[u8]) -> (svl::Result<Recovery>, PathBuf) {
    let (damaged, saved) = (folder.join("damaged.mcap"), folder.join("saved.mcap"));
    let _ = std::fs::remove_file(&saved);
    std::fs::write(&damaged, bytes).unwrap();
    (recover(&damaged, &saved), saved)
}

/// Recovers all of a specimen.
pub(crate) fn all_recovered(folder: &Path, bytes: &[u8], frames: &[Frame]) -> PathBuf {
    let (recovery, saved) = recovered(folder, bytes);
    let recovery = recovery.unwrap();
    assert!(recovery.losses.is_empty(), "{:?}", recovery.losses);
    assert!(recovery.missing.is_empty() && !recovery.partial);
    let counts = (recovery.pairs, recovery.attachments, recovery.metadata);
    assert_eq!(counts, (6, 1, 1));
    for file in [&folder.join("damaged.mcap"), &saved] {
        assert!(intact(file) == frames);
        let scenario = attachment(file, "scenario.toml").unwrap();
        assert_eq!(scenario.unwrap(), b"name = 'x'");
        assert_eq!(header(file).unwrap().seed, Some(7));
    }
    saved
}

#[test]
fn a_whole_file_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, frames) = specimen(folder.path());
    let saved = all_recovered(folder.path(), &bytes, &frames);
    let again = recover(&folder.path().join("damaged.mcap"), &saved);
    again.unwrap_err().says("never overwritten");
}

#[test]
fn a_damaged_chunk_costs_only_itself() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, frames) = specimen(folder.path());
    let chunks = chunks(&bytes);
    assert_eq!(chunks.len(), 6);
    for (i, chunk) in chunks.into_iter().enumerate() {
        let mut bad = bytes.clone();
        bad[(chunk.start + chunk.end) / 2] ^= 0x10;
        let (recovery, saved) = recovered(folder.path(), &bad);
        let recovery = recovery.unwrap();
        let [loss] = &recovery.losses[..] else {
            panic!("{:?}", recovery.losses)
        };
        let hit = (chunk.start as u64, chunk.len() as u64);
        assert_eq!((loss.at_byte, loss.bytes), hit);
        assert!(loss.reason.contains("chunk"), "{loss}");
        assert_eq!((recovery.pairs, recovery.missing["/stereo/sync"]), (5, 1));
        let mut others = frames.clone();
        others.remove(i);
        assert!(intact(&saved) == others, "chunk {i}");
        let summary = summarize(&folder.path().join("damaged.mcap")).unwrap();
        let told = (&summary.losses, &summary.missing, summary.pairs);
        assert_eq!(told, (&recovery.losses, &recovery.missing, 5));
        assert_eq!(summary.missing_pairs, u64::from((1..5).contains(&i)));
    }
}

/// Number of pairs saved of a damaged file; what is saved is intact and equals the original.
pub(crate) fn saved_pairs(folder: &Path, frames: &[Frame], bad: &[u8], what: &str) -> usize {
    let (recovery, saved) = recovered(folder, bad);
    let recovery = match recovery {
        Ok(recovery) => recovery,
        Err(error) => {
            let is_format = matches!(error, Error::Format { .. });
            assert!(is_format && !saved.exists(), "{what}: {error}");
            return 0;
        }
    };
    assert!(!recovery.losses.is_empty(), "{what}: not a word");
    let is_intact = summarize(&saved).unwrap().is_intact();
    assert!(is_intact, "{what}: the saved file is damaged");
    let (saved_frames, _) = read(&saved);
    assert!(are_of(&saved_frames, frames), "{what}: a wrong pair");
    saved_frames.len()
}

/// True if each of these frames is one of the originals, in their order.
pub(crate) fn are_of(frames: &[Frame], originals: &[Frame]) -> bool {
    let mut originals = originals.iter();
    frames
        .iter()
        .all(|frame| originals.any(|original| original == frame))
}

#[test]
fn recovered_pairs_are_whole_after_any_cut_or_change() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, frames) = specimen(folder.path());
    let check = |bad: &[u8], what: &str| saved_pairs(folder.path(), &frames, bad, what);
    let mut saved = Vec::new();
    for at in (0..bytes.len()).step_by(61) {
        saved.push(check(&bytes[..at], &format!("cut at {at}")));
        let mut bad = bytes.clone();
        bad[at] ^= 1 << (at % 8);
        check(&bad, &format!("byte {at} changed"));
    }
    let is_growing = saved.is_sorted() && saved.last() == Some(&6);
    assert!(is_growing, "the longer, the more: {saved:?}");
}

#[test]
fn other_peoples_files_keep_everything() {
    let folder = tempfile::tempdir().unwrap();
    let images = (0..60).map(|i| RAW.images_at(i, 1_000_000_000 + i)[0].clone());
    let bag = Bag::new(images).and([RAW.infos(5)[0].clone()]);
    let path = bag.saved();
    let saved = folder.path().join("saved.mcap");
    let recovery = recover(&path, &saved).unwrap();
    let counts = ["/cam0/image_raw", "/cam0/camera_info"].map(|topic| recovery.messages[topic]);
    assert_eq!(counts, [60, 1]);
    let all = |path: &Path| {
        let bytes = std::fs::read(path).unwrap();
        let messages = mcap::MessageStream::new(&bytes).unwrap().map(|message| {
            let message = message.unwrap();
            let channel = message.channel;
            let schema = channel.schema.as_ref().unwrap();
            let names = [&channel.topic, &channel.message_encoding];
            let names = [names, [&schema.name, &schema.encoding]].map(|two| two.map(Clone::clone));
            let times = (message.sequence, message.log_time, message.publish_time);
            let bytes = [schema.data.to_vec(), message.data.into_owned()];
            (names, times, bytes)
        });
        messages.collect::<Vec<_>>()
    };
    assert_eq!(all(&path), all(&saved));
    // A topic stays whose only message is in a damaged chunk.
    let mut bad = std::fs::read(&*path).unwrap();
    let last = chunks(&bad).pop().unwrap();
    bad[(last.start + last.end) / 2] ^= 0x10;
    let (recovery, saved) = recovered(folder.path(), &bad);
    assert!(!recovery.unwrap().messages.contains_key("/cam0/camera_info"));
    let summary = mcap::Summary::read(&std::fs::read(saved).unwrap()).unwrap();
    let channels: Vec<_> = summary.unwrap().channels.into_values().collect();
    assert!(channels.iter().any(|own| own.topic == "/cam0/camera_info"));
    let (nothing, _) = recovered(folder.path(), &std::fs::read(&*path).unwrap()[..40]);
    let error = nothing.unwrap_err();
    error.says("nothing that can be recovered");
}
