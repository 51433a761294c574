//! ROS 2 bags as folders of files.

use super::bag;
use super::frames::{image, one_line, read};
use crate::cli::fixture::{Fixture, has};
use crate::common::assert_says;
use std::path::{Path, PathBuf};
use svl::recording::{Reader, files, is_bag, only_file};

const SIZE: (usize, usize) = (24, 16);
const SECOND: u64 = 1_000_000_000;

/// A folder of files of these messages, and metadata that names them.
fn bag_of(parts: &[&[bag::Message]]) -> (tempfile::TempDir, PathBuf) {
    let (holder, folder) = (tempfile::tempdir().unwrap(), PathBuf::from("walk"));
    let folder = holder.path().join(folder);
    std::fs::create_dir(&folder).unwrap();
    let mut names = String::new();
    for (i, messages) in parts.iter().enumerate() {
        // Not in the order of their names.
        let name = format!("walk_{}.mcap", 9 + i);
        std::fs::rename(bag::write(&folder, messages), folder.join(&name)).unwrap();
        names += &format!("    - {name}\n");
    }
    describe(&folder, "mcap", "", &names);
    (holder, folder)
}

pub(super) fn describe(folder: &Path, storage: &str, compression: &str, names: &str) {
    let metadata = format!(
        "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: {storage}\n  \
         compression_mode: \"{compression}\"\n  relative_file_paths:\n{names}  \
         topics_with_message_count:\n    - topic_metadata:\n        name: /a\n        \
         offered_qos_profiles:\n          - history: keep_last\n            deadline: {{sec: 1, \
         nsec: 2}}\n"
    );
    std::fs::write(folder.join("metadata.yaml"), metadata).unwrap();
}

/// Left and right image `i`, and before the first their calibrations.
fn messages(i: u64) -> Vec<bag::Message> {
    let stamp = (i + 1) * SECOND;
    let pixels = |seed: u64| image(SIZE, seed).pixels().collect::<Vec<u8>>();
    let mut all = vec![
        bag::ros_image("/left/image_rect", stamp, SIZE, "mono8", &pixels(2 * i)),
        bag::ros_image(
            "/right/image_rect",
            stamp,
            SIZE,
            "mono8",
            &pixels(2 * i + 1),
        ),
    ];
    if i == 0 {
        all.push(bag::camera_info("/left/camera_info", stamp, &[], 0.0));
        all.push(bag::camera_info("/right/camera_info", stamp, &[], -14.432));
    }
    all
}

fn complaint(path: &Path) -> String {
    one_line(path, &Reader::open(path).err().expect("it is bad"))
}

#[test]
fn the_files_of_a_bag_are_one_recording() {
    let all: Vec<_> = (0..6).flat_map(messages).collect();
    // The second file begins between the two images of a pair.
    let (_holder, folder) = bag_of(&[&all[..5], &all[5..8], &all[8..]]);
    let (frames, error) = read(&folder);
    assert!(error.is_none() && frames.len() == 6, "{error:?}");
    for (i, frame) in (0..).zip(&frames) {
        assert_eq!((frame.sequence, frame.stamp_ns), (i, (i + 1) * SECOND));
        assert_eq!(
            (frame.pair.left(), frame.pair.right()),
            (&image(SIZE, 2 * i), &image(SIZE, 2 * i + 1))
        );
        assert!(
            frame.rig().is_some(),
            "the calibration of the first file holds for the others"
        );
    }
    let error = only_file(&folder).unwrap_err().to_string();
    assert_says(
        &error,
        &["is a bag of 3 files: name one of ", "walk_10.mcap, "],
    );
    // A damaged file loses only its own pairs.
    for (file, cut, pairs) in [("walk_11.mcap", "end", 6), ("walk_10.mcap", "at once", 4)] {
        let file = folder.join(file);
        let bytes = std::fs::read(&file).unwrap();
        std::fs::write(
            &file,
            if cut == "end" {
                &bytes[..bytes.len() - 9]
            } else {
                &bytes[..9]
            },
        )
        .unwrap();
        let (frames, error) = read(&folder);
        let error = error.unwrap().to_string();
        assert!(
            error.starts_with(&format!("{}: the recording is incomplete", file.display())),
            "{error}"
        );
        assert!(
            frames.len() == pairs && error.contains(&format!("intact pairs read: {pairs}; ")),
            "{error}"
        );
    }
}

#[test]
fn a_bag_without_metadata_is_its_only_file() {
    let (_holder, folder) = bag_of(&[&messages(0), &messages(1)]);
    assert!(is_bag(&folder));
    std::fs::remove_file(folder.join("metadata.yaml")).unwrap();
    let text = complaint(&folder);
    assert_says(
        &text,
        &["without a bag's metadata.yaml: name one of ", "walk_9.mcap"],
    );
    std::fs::remove_file(folder.join("walk_9.mcap")).unwrap();
    assert_eq!(read(&folder).0.len(), 1);
    assert_eq!(only_file(&folder).unwrap(), folder.join("walk_10.mcap"));
    std::fs::remove_file(folder.join("walk_10.mcap")).unwrap();
    assert!(!is_bag(&folder) && complaint(&folder).contains("nor a ROS 2 bag"));
}

#[test]
fn no_bag_names_files_elsewhere() {
    let (_holder, folder) = bag_of(&[&messages(0)]);
    describe(
        &folder,
        "mcap",
        "",
        "    - ../../walk/walk_9.mcap\n    - /etc/passwd\n",
    );
    assert_eq!(
        files(&folder).unwrap(),
        [folder.join("walk_9.mcap"), folder.join("passwd")]
    );
    for names in [
        "    - ..\n",
        "    - /\n",
        "    []\n",
        "    - [a]\n",
        "    walk_9.mcap\n",
    ] {
        describe(&folder, "mcap", "", names);
        assert!(
            complaint(&folder).contains("relative_file_paths"),
            "{names}"
        );
    }
    for (metadata, what) in [
        ("- a", "not that of a ROS 2 bag"),
        ("a: 1", "rosbag2_bagfile"),
        ("a: [", "not YAML"),
        ("", "empty"),
    ] {
        std::fs::write(folder.join("metadata.yaml"), metadata).unwrap();
        assert!(
            complaint(&folder).contains(what),
            "{metadata}: {}",
            complaint(&folder)
        );
    }
    let bomb = format!("rosbag2_bagfile_information: {}", "[".repeat(100_000));
    std::fs::write(folder.join("metadata.yaml"), bomb).unwrap();
    assert!(complaint(&folder).contains("metadata.yaml: line 1: "));
    std::fs::write(folder.join("metadata.yaml"), vec![b'#'; 5 << 20]).unwrap();
    assert!(complaint(&folder).contains("is larger than"));
}

#[test]
fn other_containers_have_a_cure() {
    let (holder, folder) = bag_of(&[&messages(0)]);
    let cure = "`ros2 bag convert`";
    for (storage, compression, what) in [
        (
            "leveldb",
            "",
            "the bag is in 'leveldb', svl reads mcap and sqlite3",
        ),
        ("mcap", "FILE", "compressed file by file"),
        ("mcap", "message", "compressed message by message"),
    ] {
        describe(&folder, storage, compression, "    - walk_9.mcap\n");
        let text = complaint(&folder);
        assert!(text.contains(what) && text.contains(cure), "{text}");
    }
    let file = holder.path().join("a.db3");
    for (bytes, what) in [
        (
            &b"SQLite format 3\0 and more"[..],
            "is not a rosbag2 bag in SQLite",
        ),
        (b"\x28\xB5\x2F\xFD and more", "zstd and cannot be unpacked"),
        (b"\x28\xB5\x2F", "is not an MCAP file"),
    ] {
        std::fs::write(&file, bytes).unwrap();
        assert!(complaint(&file).contains(what));
    }
    let mut compressed = messages(0);
    compressed.iter_mut().for_each(|message| {
        message
            .data
            .splice(..4, [0x28, 0xB5, 0x2F, 0xFD])
            .for_each(drop)
    });
    let text = complaint(&bag::write(holder.path(), &compressed));
    assert!(text.contains("zstd and cannot be unpacked"), "{text}");
}

/// Root, who has all rights to the folder, becomes a user who has none.
#[cfg(unix)]
#[test]
fn a_bag_in_a_folder_that_cannot_be_written_is_read() {
    use std::fs::{Permissions, metadata, set_permissions};
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let fixture = Fixture::new();
    let pixels = [7; 24 * 16];
    let images = (1..4).flat_map(|i| {
        ["/left/image_rect", "/right/image_rect"]
            .map(|topic| bag::ros_image(topic, i * 100_000_000, (24, 16), "mono8", &pixels))
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
    assert!(
        said.starts_with("usable: 3 rectified pairs"),
        "{said} {ran:?}"
    );
}
