//! Archives of data sets, unpacked.

use crate::common::assert_says;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use svl::fetch::{Unpacked, unpack};
use tempfile::TempDir;
use zip::write::SimpleFileOptions;

struct Place(TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn unpack(&self, name: &str, bytes: &[u8]) -> svl::Result<Unpacked> {
        let archive = self.path(name);
        std::fs::write(&archive, bytes).unwrap();
        unpack(&archive, &self.path("out"), &mut |_, _| true)
    }

    #[track_caller]
    fn refused(&self, name: &str, bytes: &[u8], words: &[&str]) {
        let error = self.unpack(name, bytes).unwrap_err().to_string();
        assert!(
            words.iter().all(|word| error.contains(word)) && !error.contains('\n'),
            "{error}"
        );
        assert!(!self.path("escaped.txt").exists());
    }
}

fn zipped(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        writer
            .start_file(*name, SimpleFileOptions::default())
            .unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// A 7z archive that stores its files as they are (7zFormat.txt of the LZMA SDK), each with its
/// attributes.
fn sevenz(entries: &[(&str, &[u8], u32)]) -> Vec<u8> {
    fn number(value: usize) -> Vec<u8> {
        assert!(value < 1 << 14);
        if value < 0x80 {
            vec![value as u8]
        } else {
            vec![0x80 | (value >> 8) as u8, value as u8]
        }
    }
    let data: Vec<u8> = entries
        .iter()
        .flat_map(|(_, bytes, _)| bytes.to_vec())
        .collect();
    let mut header = vec![0x01, 0x04, 0x06, 0, 1, 0x09];
    header.extend(number(data.len()));
    // One folder, one coder: copy.
    header.extend([0, 0x07, 0x0b, 1, 0, 1, 0x01, 0x00, 0x0c]);
    header.extend(number(data.len()));
    header.extend([0, 0x08, 0x0d]);
    header.extend(number(entries.len()));
    header.push(0x09);
    entries[..entries.len() - 1]
        .iter()
        .for_each(|(_, bytes, _)| header.extend(number(bytes.len())));
    header.extend([0x0a, 1]);
    entries
        .iter()
        .for_each(|(_, bytes, _)| header.extend(crc32fast::hash(bytes).to_le_bytes()));
    header.extend([0, 0, 0x05]);
    header.extend(number(entries.len()));
    let names: Vec<u8> = entries
        .iter()
        .flat_map(|(name, ..)| {
            name.encode_utf16()
                .chain([0])
                .flat_map(u16::to_le_bytes)
                .collect::<Vec<_>>()
        })
        .collect();
    header.push(0x11);
    header.extend(number(names.len() + 1));
    header.push(0);
    header.extend(names);
    header.push(0x15);
    header.extend(number(2 + 4 * entries.len()));
    header.extend([1, 0]);
    entries
        .iter()
        .for_each(|(_, _, attributes)| header.extend(attributes.to_le_bytes()));
    header.extend([0, 0]);
    let mut start = Vec::new();
    start.extend((data.len() as u64).to_le_bytes());
    start.extend((header.len() as u64).to_le_bytes());
    start.extend(crc32fast::hash(&header).to_le_bytes());
    let mut archive = vec![b'7', b'z', 0xbc, 0xaf, 0x27, 0x1c, 0, 4];
    archive.extend(crc32fast::hash(&start).to_le_bytes());
    archive.extend(start);
    archive.extend(data);
    archive.extend(header);
    archive
}

#[test]
fn files_land_below_the_folder_and_stay_what_they_were() {
    let place = Place::new();
    let (a, b): (&[u8], &[u8]) = (b"truth", &[7; 300_000]);
    for (name, archive) in [
        (
            "a.zip",
            zipped(&[("scene/deep/a.txt", a), ("scene/b.bin", b)]),
        ),
        (
            "a.7z",
            sevenz(&[("seven/deep/a.txt", a, 0x20), ("seven/b.bin", &b[..900], 0)]),
        ),
    ] {
        let unpacked = place.unpack(name, &archive).unwrap();
        let top = unpacked.top.first().unwrap().clone();
        assert_eq!(
            (unpacked.written, unpacked.kept, unpacked.top.len()),
            (2, 0, 1)
        );
        assert_eq!(
            std::fs::read(place.path("out").join(&top).join("deep/a.txt")).unwrap(),
            a
        );
        std::fs::write(place.path("out").join(&top).join("b.bin"), "mine").unwrap();
        let again = place.unpack(name, &archive).unwrap();
        assert_eq!((again.written, again.kept), (0, 2));
        assert_eq!(
            std::fs::read(place.path("out").join(&top).join("b.bin")).unwrap(),
            b"mine"
        );
    }
}

#[test]
fn nothing_leaves_the_folder() {
    let place = Place::new();
    let outside = place.path("escaped.txt").display().to_string();
    for name in [
        "../escaped.txt",
        "a/../../escaped.txt",
        &outside,
        "C:\\escaped.txt",
        "..\\escaped.txt",
    ] {
        let zip = zipped(&[("good.txt", b"good"), (name, b"bad")]);
        place.refused("hostile.zip", &zip, &["hostile.zip", "outside its folder"]);
        let seven = sevenz(&[("good.txt", b"good", 0), (name, b"bad", 0)]);
        place.refused("hostile.7z", &seven, &["hostile.7z", "outside its folder"]);
    }
}

#[test]
fn links_are_refused() {
    let place = Place::new();
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    writer
        .add_symlink("link", "/etc", SimpleFileOptions::default())
        .unwrap();
    place.refused(
        "link.zip",
        &writer.finish().unwrap().into_inner(),
        &["'link'", "is a link"],
    );
    place.refused(
        "link.7z",
        &sevenz(&[("link", b"/etc", 0o120_777 << 16 | 0x8000)]),
        &["'link'", "is a link"],
    );
    assert!(place.path("out/link").symlink_metadata().is_err());
}

#[test]
fn bombs_are_refused_before_anything_is_written() {
    let place = Place::new();
    let bomb = zipped(&[("zeros", &vec![0; 40 << 20])]);
    assert!(bomb.len() < 1 << 18);
    place.refused(
        "bomb.zip",
        &bomb,
        &["bomb.zip", "41943040 bytes", "not unpacked"],
    );
    assert!(!place.path("out").exists());
}

#[test]
fn damage_is_seen() {
    let place = Place::new();
    let whole = zipped(&[(
        "a.bin",
        &(0..100_000u32)
            .flat_map(u32::to_le_bytes)
            .collect::<Vec<_>>(),
    )]);
    place.refused(
        "cut.zip",
        &whole[..whole.len() / 2],
        &["not an intact archive", "fetch it again"],
    );
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 1;
    place.refused("flipped.zip", &flipped, &["not an intact archive"]);
    assert!(
        !place.path("out/a.bin").exists(),
        "a damaged file has a name"
    );
    let seven = sevenz(&[("a.txt", b"some truth", 0)]);
    let mut flipped = seven.clone();
    flipped[35] ^= 1;
    place.refused("flipped.7z", &flipped, &["not an intact archive"]);
    assert!(!place.path("out/a.txt").exists());
    place.refused(
        "cut.7z",
        &seven[..seven.len() - 3],
        &["not an intact archive"],
    );
    place.refused(
        "page.zip",
        b"<html>moved</html>",
        &["not an intact archive"],
    );
    place.refused("a.rar", b"Rar!", &["unpack it yourself"]);
}

#[test]
fn stopped_in_the_middle_goes_on_later() {
    let place = Place::new();
    let archive = place.path("a.zip");
    std::fs::write(&archive, zipped(&[("a", &[1; 1000]), ("b", &[2; 1000])])).unwrap();
    let mut calls = 0;
    let stop = unpack(&archive, &place.path("out"), &mut |_, _| {
        calls += 1;
        calls < 3
    });
    assert_says(&stop.unwrap_err().to_string(), &["stopped"]);
    let unpacked = unpack(&archive, Path::new(&place.path("out")), &mut |_, _| true).unwrap();
    assert_eq!((unpacked.written, unpacked.kept), (1, 1));
}
