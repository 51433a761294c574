//! Seeking to any pair of a recording.

use super::frames::{full, read, record};
use svl::recording::ImageFormat;
use svl::source::{RecordingSource, Source};

#[test]
fn any_pair_can_be_gone_to() {
    let frames: Vec<_> = (0..60).map(|i| full(i, (160, 120))).collect();
    for format in [ImageFormat::Raw, ImageFormat::Png] {
        let folder = tempfile::tempdir().unwrap();
        let path = record(folder.path(), &frames, format);
        let (all, _) = read(&path);
        let mut source = RecordingSource::open(&path).unwrap();
        for index in [59, 0, 30, 31, 29, 1, 58] {
            assert!(source.seek(index).unwrap());
            // It continues from there to the end.
            for expected in &all[index as usize..] {
                assert_eq!(source.next().unwrap().as_ref(), Some(expected));
            }
            assert!(source.next().unwrap().is_none());
        }
        assert!(!source.seek(60).unwrap(), "there are 60");
    }
}

#[test]
fn a_recording_without_an_index_is_read_on() {
    let folder = tempfile::tempdir().unwrap();
    let frames: Vec<_> = (0..20).map(|i| full(i, (160, 120))).collect();
    let path = record(folder.path(), &frames, ImageFormat::Raw);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 40]).unwrap();
    let mut source = RecordingSource::open(&path).unwrap();
    source.next().unwrap();
    assert!(!source.seek(9).unwrap());
    let next = source.next().unwrap().unwrap();
    assert_eq!(next.sequence, 1, "nothing changed");
}
