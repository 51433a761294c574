//! Recovery of damaged and truncated files.

use super::bag;
use super::damage::chunks;
use super::frames::{attachment, bare, full, header, image, read, recover, summarize};
use crate::common::assert_says;
use std::path::{Path, PathBuf};
use svl::Error;
use svl::recording::{Header, ImageFormat, Recovery, Writer};
use svl::stereo::Frame;

const SIZE: (usize, usize) = (24, 16);

/// A recording of six pairs, each in a chunk of its own, with every kind of record and message.
pub(crate) fn specimen(folder: &Path) -> (Vec<u8>, Vec<Frame>) {
    let path = folder.join("specimen.mcap");
    let mut writer = Writer::create(
        &path,
        &Header {
            seed: Some(7),
            ..Header::new("test")
        },
        ImageFormat::Raw,
    )
    .unwrap();
    writer
        .attach("scenario.toml", "application/toml", b"name = 'x'")
        .unwrap();
    for i in 0..6 {
        writer
            .write(&if i < 4 { full(i, SIZE) } else { bare(i, SIZE) })
            .unwrap();
        writer.sync().unwrap();
    }
    writer.finish().unwrap();
    let (frames, error) = read(&path);
    assert!(error.is_none() && frames.len() == 6);
    (std::fs::read(&path).unwrap(), frames)
}

pub(crate) fn recovered(folder: &Path, bytes: &[u8]) -> (svl::Result<Recovery>, PathBuf) {
    let (damaged, saved) = (folder.join("damaged.mcap"), folder.join("saved.mcap"));
    let _ = std::fs::remove_file(&saved);
    std::fs::write(&damaged, bytes).unwrap();
    (recover(&damaged, &saved), saved)
}

#[test]
fn a_whole_file_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, frames) = specimen(folder.path());
    let (recovery, saved) = recovered(folder.path(), &bytes);
    let recovery = recovery.unwrap();
    assert!(recovery.losses.is_empty() && recovery.missing.is_empty());
    assert_eq!(
        (recovery.pairs, recovery.attachments, recovery.metadata),
        (6, 1, 1)
    );
    assert_eq!(read(&saved).0, frames);
    assert_eq!(
        attachment(&saved, "scenario.toml").unwrap().unwrap(),
        b"name = 'x'"
    );
    assert_eq!(header(&saved).unwrap().seed, Some(7));
    let again = recover(&folder.path().join("damaged.mcap"), &saved);
    assert_says(&again.unwrap_err().to_string(), &["never overwritten"]);
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
        assert_eq!(
            (loss.at_byte, loss.bytes),
            (chunk.start as u64, chunk.len() as u64)
        );
        assert!(loss.reason.contains("chunk"), "{loss}");
        assert_eq!((recovery.pairs, recovery.missing["/stereo/sync"]), (5, 1));
        let (saved_frames, error) = read(&saved);
        assert!(error.is_none(), "{error:?}");
        let others = frames
            .iter()
            .enumerate()
            .filter(|&(j, _)| j != i)
            .map(|(_, frame)| frame);
        assert!(saved_frames.iter().eq(others), "chunk {i}");
        let summary = summarize(&folder.path().join("damaged.mcap")).unwrap();
        assert_eq!(
            (&summary.losses, &summary.missing, summary.pairs),
            (&recovery.losses, &recovery.missing, 5)
        );
        assert_eq!(summary.missing_pairs, u64::from((1..5).contains(&i)));
    }
}

/// Number of pairs saved of a damaged file; what is saved is intact and equals the original.
pub(crate) fn saved_pairs(folder: &Path, frames: &[Frame], bad: &[u8], what: &str) -> usize {
    let (recovery, saved) = recovered(folder, bad);
    let recovery = match recovery {
        Ok(recovery) => recovery,
        Err(error) => {
            assert!(
                matches!(error, Error::Format { .. }) && !saved.exists(),
                "{what}: {error}"
            );
            return 0;
        }
    };
    assert!(!recovery.losses.is_empty(), "{what}: not a word");
    assert!(
        summarize(&saved).unwrap().is_intact(),
        "{what}: the saved file is damaged"
    );
    let (saved_frames, _) = read(&saved);
    let mut originals = frames.iter();
    assert!(
        saved_frames
            .iter()
            .all(|frame| originals.any(|original| original == frame)),
        "{what}: a wrong pair"
    );
    saved_frames.len()
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
    assert!(
        saved.is_sorted() && saved.last() == Some(&6),
        "the longer, the more: {saved:?}"
    );
}

#[test]
fn other_peoples_files_keep_everything() {
    let folder = tempfile::tempdir().unwrap();
    let pixels = |i| image(SIZE, i).pixels().collect::<Vec<_>>();
    let mut messages: Vec<_> = (0..60)
        .map(|i| {
            bag::ros_image(
                "/cam0/image_raw",
                1_000_000_000 + i,
                SIZE,
                "mono8",
                &pixels(i),
            )
        })
        .collect();
    messages.push(bag::camera_info("/cam0/camera_info", 5, &[0.1], 0.0));
    let path = bag::write(folder.path(), &messages);
    let saved = folder.path().join("saved.mcap");
    let recovery = recover(&path, &saved).unwrap();
    assert_eq!(
        (
            recovery.messages["/cam0/image_raw"],
            recovery.messages["/cam0/camera_info"]
        ),
        (60, 1)
    );
    let all = |path: &Path| {
        let bytes = std::fs::read(path).unwrap();
        let messages = mcap::MessageStream::new(&bytes).unwrap().map(|message| {
            let mcap::Message {
                channel,
                sequence,
                log_time,
                publish_time,
                data,
            } = message.unwrap();
            let schema = channel.schema.as_ref().unwrap();
            let schema = (
                schema.name.clone(),
                schema.encoding.clone(),
                schema.data.to_vec(),
            );
            let channel = (
                channel.topic.clone(),
                channel.message_encoding.clone(),
                schema,
            );
            (channel, sequence, log_time, publish_time, data.into_owned())
        });
        messages.collect::<Vec<_>>()
    };
    assert_eq!(all(&path), all(&saved));
    let (nothing, _) = recovered(folder.path(), &std::fs::read(&path).unwrap()[..40]);
    assert_says(
        &nothing.unwrap_err().to_string(),
        &["nothing that can be recovered"],
    );
}
