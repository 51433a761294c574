//! ROS 2 bags as folders of files.

use super::bag::{self, Bag, Message, SIZE, STEREO, Stereo, describe, write_split};
use super::frames::{bare, complaint, intact, read};
use super::says::Says;
use crate::cli::fixture::{Fixture, has};
use std::path::PathBuf;
use svl::recording::{files, is_bag, only_file};

const SECOND: u64 = 1_000_000_000;

/// A folder of files of these messages, and metadata that names them.
fn bag_of(parts: &[&[Message]]) -> (tempfile::TempDir, PathBuf) {
    let holder = tempfile::tempdir().unwrap();
    let folder = holder.path().join("walk");
    // Not in the order of their names.
    let parts = parts.iter().enumerate();
    let parts = parts.map(|(i, part)| (format!("walk_{}.mcap", 9 + i), *part));
    write_split(&folder, "mcap", parts, bag::write);
    (holder, folder)
}

/// Pair `i`, and behind the first its calibrations.
fn messages(i: u64) -> Vec<Message> {
    let stereo = Stereo {
        images: ["/left/image_rect", "/right/image_rect"],
        infos: ["/left/camera_info", "/right/camera_info"],
        ..STEREO
    };
    let stamp = (i + 1) * SECOND;
    let infos = stereo.infos(stamp).into_iter().filter(|_| i == 0);
    stereo
        .images_at(i, stamp)
        .into_iter()
        .chain(infos)
        .collect()
}

#[test]
fn the_files_of_a_bag_are_one_recording() {
    let all: Vec<_> = (0..6).flat_map(messages).collect();
    // The second file begins between the two images of a pair.
    let (_holder, folder) = bag_of(&[&all[..5], &all[5..8], &all[8..]]);
    let frames = intact(&folder);
    assert_eq!(frames.len(), 6);
    for (i, frame) in (0..).zip(&frames) {
        assert_eq!((frame.sequence, frame.stamp_ns), (i, (i + 1) * SECOND));
        assert_eq!(frame.pair, bare(i, SIZE).pair);
        // The calibration of the first file holds for the others.
        assert!(frame.rig().is_some());
    }
    let error = only_file(&folder).unwrap_err();
    error.says("is a bag of 3 files: name one of  | walk_10.mcap, ");
    // A damaged file loses only its own pairs: at its end, and at once.
    for (file, pairs) in [("walk_11.mcap", 6), ("walk_10.mcap", 4)] {
        let file = folder.join(file);
        let bytes = std::fs::read(&file).unwrap();
        let kept = if pairs == 6 { bytes.len() - 9 } else { 9 };
        std::fs::write(&file, &bytes[..kept]).unwrap();
        let (frames, error) = read(&folder);
        let error = error.unwrap().to_string();
        let words = format!("{}: the recording is incomplete", file.display());
        assert!(error.starts_with(&words), "{error}");
        assert_eq!(frames.len(), pairs, "{error}");
        error.says(&format!("intact pairs read: {pairs}; "));
    }
}

#[test]
fn a_bag_without_metadata_is_its_only_file() {
    let (_holder, folder) = bag_of(&[&messages(0), &messages(1)]);
    assert!(is_bag(&folder));
    let remove = |name: &str| std::fs::remove_file(folder.join(name)).unwrap();
    remove("metadata.yaml");
    complaint(&folder).says("without a bag's metadata.yaml: name one of  | walk_9.mcap");
    remove("walk_9.mcap");
    assert_eq!(read(&folder).0.len(), 1);
    assert_eq!(only_file(&folder).unwrap(), folder.join("walk_10.mcap"));
    remove("walk_10.mcap");
    assert!(!is_bag(&folder));
    complaint(&folder).says("nor a ROS 2 bag");
}

#[test]
fn no_bag_names_files_elsewhere() {
    let (_holder, folder) = bag_of(&[&messages(0)]);
    let names = "    - ../../walk/walk_9.mcap\n    - /etc/passwd\n";
    describe(&folder, "mcap", "", names);
    let inside = [folder.join("walk_9.mcap"), folder.join("passwd")];
    assert_eq!(files(&folder).unwrap(), inside);
    for names in ["- ..", "- /", "[]", "- [a]", "walk_9.mcap"] {
        describe(&folder, "mcap", "", &format!("    {names}\n"));
        complaint(&folder).says("relative_file_paths");
    }
    let bomb = format!("rosbag2_bagfile_information: {}", "[".repeat(100_000));
    for (metadata, what) in [
        ("- a", "not that of a ROS 2 bag"),
        ("a: 1", "rosbag2_bagfile"),
        ("a: [", "not YAML"),
        ("", "empty"),
        (&bomb, "metadata.yaml: line 1: "),
        (&"#".repeat(5 << 20), "is larger than"),
    ] {
        std::fs::write(folder.join("metadata.yaml"), metadata).unwrap();
        complaint(&folder).says(what);
    }
}

#[test]
fn other_containers_have_a_cure() {
    let (holder, folder) = bag_of(&[&messages(0)]);
    let unknown = "the bag is in 'leveldb', svl reads mcap and sqlite3";
    for (storage, compression, what) in [
        ("leveldb", "", unknown),
        ("mcap", "FILE", "compressed file by file"),
        ("mcap", "message", "compressed message by message"),
    ] {
        describe(&folder, storage, compression, "    - walk_9.mcap\n");
        complaint(&folder).says(what).says("`ros2 bag convert`");
    }
    let file = holder.path().join("a.db3");
    let no_bag = "is not a rosbag2 bag in SQLite";
    for (bytes, what) in [
        (&b"SQLite format 3\0 and more"[..], no_bag),
        (b"\x28\xB5\x2F\xFD and more", "zstd and cannot be unpacked"),
        (b"\x28\xB5\x2F", "is not an MCAP file"),
    ] {
        std::fs::write(&file, bytes).unwrap();
        complaint(&file).says(what);
    }
    let mut compressed = Bag(messages(0));
    for message in &mut compressed.0 {
        message.data[..4].copy_from_slice(&[0x28, 0xB5, 0x2F, 0xFD]);
    }
    complaint(&compressed.saved()).says("zstd and cannot be unpacked");
}

/// Root, who has all rights to the folder, becomes a user who has none.
#[cfg(unix)]
#[test]
fn a_bag_in_a_folder_that_cannot_be_written_is_read() {
    use std::fs::{Permissions, metadata, set_permissions};
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let fixture = Fixture::new();
    let images = (1..4).flat_map(|i| {
        let image = |topic| bag::ros_image(topic, i * 100_000_000, SIZE, "mono8", &[7; 24 * 16]);
        ["/left/image_rect", "/right/image_rect"].map(image)
    });
    let path = bag::write_sqlite(&fixture.path(""), &images.collect::<Vec<_>>());
    let connection = rusqlite::Connection::open(&path).unwrap();
    connection
        .pragma_update(None, "journal_mode", "WAL")
        .unwrap();
    drop(connection);
    set_permissions(fixture.path(""), Permissions::from_mode(0o555)).unwrap();
    let program = env!("CARGO_BIN_EXE_svl");
    let nobody = ["--reuid=65534", "--clear-groups", program];
    let mut command = std::process::Command::new(program);
    if metadata(fixture.path("")).unwrap().uid() == 0 {
        if !has("setpriv", &[&nobody[..], &["--version"]].concat()) {
            return;
        }
        command = std::process::Command::new("setpriv");
        command.args(nobody);
    }
    let ran = command.arg("info").arg(&path).output().unwrap();
    let said = String::from_utf8_lossy(&ran.stdout);
    set_permissions(fixture.path(""), Permissions::from_mode(0o755)).unwrap();
    let is_read = said.starts_with("usable: 3 rectified pairs");
    assert!(is_read, "{said} {ran:?}");
}
