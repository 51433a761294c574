//! Full, vanished and read-only folders; recordings that must not be overwritten.

use super::frames::{full, one_line, read};
use super::says::Says;
use std::path::{Path, PathBuf};
use std::process::Command;
use svl::Error;
use svl::recording::{Header, ImageFormat, Writer};

const SIZE: (usize, usize) = (160, 120);

fn create(path: &Path) -> svl::Result<Writer> {
    Writer::create(path, &Header::new("test"), ImageFormat::Raw)
}

/// Checks that the error is one line that names `path`, and returns that line.
fn told(path: &Path, error: &Error) -> String {
    assert!(matches!(error, Error::Io { .. }), "{error:?}");
    one_line(path, error)
}

#[test]
fn nothing_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, "precious").unwrap();
    assert!(told(&path, &create(&path).err().unwrap()).contains("never overwritten"));
    assert_eq!(std::fs::read(&path).unwrap(), b"precious");
}

#[test]
fn missing_folders_and_files_in_their_place_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("missing/a.mcap");
    assert!(told(&path, &create(&path).err().unwrap()).contains("no such file"));
    std::fs::write(folder.path().join("file"), "").unwrap();
    let path = folder.path().join("file/a.mcap");
    told(&path, &create(&path).err().unwrap());
}

#[test]
fn a_vanished_folder_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = create(&path).unwrap();
    writer.write(&full(0, SIZE)).unwrap();
    writer.sync().unwrap();
    std::fs::remove_file(&path).unwrap();
    told(&path, &writer.sync().unwrap_err());
    assert!(writer.write(&full(1, SIZE)).is_err(), "and it stays so");
}

#[test]
fn synced_pairs_survive_the_writer() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = create(&path).unwrap();
    (0..3).for_each(|i| writer.write(&full(i, SIZE)).unwrap());
    writer.sync().unwrap();
    writer.write(&full(3, SIZE)).unwrap();
    std::mem::forget(writer);
    let (frames, error) = read(&path);
    assert_eq!(frames.len(), 3);
    error.unwrap().says("never finished; intact pairs read: 3");
}

#[test]
fn a_pair_is_synced_though_none_comes_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = create(&path).unwrap();
    writer.write(&full(0, (24, 16))).unwrap();
    assert!(read(&path).0.is_empty(), "it waits for its chunk");
    // A second later it is there; a busy machine gets a minute.
    let there = |_: &u32| {
        std::thread::sleep(std::time::Duration::from_millis(100));
        read(&path).0.len() == 1
    };
    assert!((0..600).find(there).is_some());
    writer.finish().unwrap();
}

/// A separate file system; unmounted when dropped.
struct Mount(PathBuf);

impl Mount {
    fn new(folder: &Path, options: &str) -> Option<Self> {
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", options, "tmpfs"]);
        let mounted = mount.arg(folder).output();
        let is_mounted = mounted.is_ok_and(|output| output.status.success());
        is_mounted.then(|| Self(folder.to_owned()))
    }
}

impl Drop for Mount {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

#[test]
fn a_full_disk_keeps_what_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mount) = Mount::new(folder.path(), "size=2m") else {
        crate::common::skip("cannot mount a tmpfs");
        return;
    };
    let path = mount.0.join("a.mcap");
    let mut writer = create(&path).unwrap();
    let error = (0..1000)
        .find_map(|i| writer.write(&full(i, SIZE)).err())
        .expect("2 MB hold no 1000 pairs");
    assert!(told(&path, &error).contains("no space left"));
    assert!(writer.finish().is_ok(), "there is nothing more to say");
    drop(writer);
    let (frames, error) = read(&path);
    assert!(frames.len() > 10, "{} pairs survived", frames.len());
    // What did not fit whole is cut off.
    error.unwrap().says("never finished");
    let mut numbered = (0..).zip(&frames);
    assert!(numbered.all(|(i, frame)| frame.pair == full(i, SIZE).pair));
}

#[test]
fn a_read_only_disk_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mount) = Mount::new(folder.path(), "ro") else {
        crate::common::skip("cannot mount a tmpfs");
        return;
    };
    let path = mount.0.join("a.mcap");
    assert!(told(&path, &create(&path).err().unwrap()).contains("read-only"));
}
