//! Synthetic frames, and recordings of them.

use std::path::{Path, PathBuf};
use svl::recording::{
    Header, Reader, Recording, RecordingFormat, RecordingSummary, Recovery, Selection, Writer,
};
use svl::stereo::{
    Exposure, Frame, Geometry, Gray, Plane, Pose, Rig, StereoPair, Surface, Truth, Visibility,
};
use svl::{Error, Result};

/// Time of the first pair.
pub(crate) const START_NS: u64 = 1_700_000_000_000_000_000;
/// Time from one pair to the next.
pub(crate) const PERIOD_NS: u64 = 66_666_667;

/// The stamp of pair number `i`.
pub(crate) fn stamp(i: u64) -> u64 {
    START_NS + i * PERIOD_NS
}

/// A gradient with noise on it, different for every `seed`.
pub(crate) fn image((width, height): (usize, usize), seed: u64) -> Gray {
    Gray::from_fn(width, height, |x, y| {
        let noise =
            (x as u64 ^ (y as u64) << 20 ^ seed << 40).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 59;
        (x * 160 / width + y * 60 / height) as u8 + noise as u8
    })
    .unwrap()
}

/// Pair number `i` with nothing but its images.
pub(crate) fn bare(i: u64, size: (usize, usize)) -> Frame {
    Frame {
        sequence: i,
        stamp_ns: stamp(i),
        ..Frame::new(
            StereoPair::new(image(size, 2 * i), image(size, 2 * i + 1)).unwrap(),
            Geometry::Rectified(None),
        )
    }
}

/// Pair number `i` with rig, pose, truth and exposure.
pub(crate) fn full(i: u64, size: (usize, usize)) -> Frame {
    let place = nalgebra::Translation3::new(0.2 * i as f64, -1.0, 0.3);
    let turn = nalgebra::UnitQuaternion::from_euler_angles(0.1, -1.3, 0.01 * i as f64);
    let disparity = |x: usize, y: usize| {
        if y < 3 {
            f32::INFINITY
        } else {
            0.37 * x as f32 + y as f32 / 7.0
        }
    };
    let visibility = |x: usize, y: usize| match (x, y) {
        (_, ..3) => Visibility::Unknown,
        (..5, _) => Visibility::Occluded,
        _ => Visibility::Visible,
    };
    use Surface::{Floor, Object, Room, Unknown, Wall};
    let surface = |x: usize, y: usize| [Unknown, Floor, Room, Wall, Object][(x + y) % 5];
    Frame {
        name: Some(format!("szene-{i} \"ä\"")),
        geometry: Geometry::Rectified(Some(Rig::new(328.0, (159.5, 119.5), 0.044, 1.25).unwrap())),
        pose: Some(Pose::from_parts(place, turn)),
        truth: Some(Truth {
            surface: Some(Plane::from_fn(size.0, size.1, surface).unwrap()),
            ..Truth::exact(
                Plane::from_fn(size.0, size.1, disparity).unwrap(),
                Some(Plane::from_fn(size.0, size.1, visibility).unwrap()),
            )
        }),
        color: None,
        exposure: Exposure {
            trigger_id: 1000 + i,
            skew_ns: Some(-12_345),
            shutter_us: 800,
            gain_mdb: -1500,
            drops: i / 3,
        },
        ..bare(i, size)
    }
}

/// Writes a recording of `frames` into `folder`.
pub(crate) fn record(
    folder: &Path,
    frames: &[Frame],
    format: impl Into<RecordingFormat>,
) -> PathBuf {
    let path = folder.join("test.mcap");
    let mut writer = Writer::create(&path, &Header::new("test"), format).unwrap();
    frames.iter().for_each(|frame| writer.write(frame).unwrap());
    writer.finish().unwrap();
    path
}

/// All frames of the recording at `path`, and the last error of reading it, if there was one.
pub(crate) fn read(path: &Path) -> (Vec<Frame>, Option<Error>) {
    let mut reader = match Reader::open(path) {
        Ok(reader) => reader,
        Err(error) => return (Vec::new(), Some(error)),
    };
    let (mut frames, mut error) = (Vec::new(), None);
    loop {
        match reader.next_pair() {
            Ok(Some(frame)) => frames.push(frame),
            Ok(None) => return (frames, error),
            Err(next) => {
                assert!(
                    !matches!(error, Some(Error::Damaged { .. })),
                    "after {error:?} there is nothing, got {next}"
                );
                error = Some(next);
            }
        }
    }
}

/// All frames of an intact recording.
#[track_caller]
pub(crate) fn intact(path: &Path) -> Vec<Frame> {
    let (frames, error) = read(path);
    assert!(error.is_none(), "{error:?}");
    frames
}

/// The error of opening a recording, which is one line that begins with its path.
#[track_caller]
pub(crate) fn complaint(path: &Path) -> String {
    one_line(path, &Reader::open(path).err().expect("it is bad"))
}

pub(crate) fn header(path: &Path) -> Result<Header> {
    Recording::open(path)?.header()
}

pub(crate) fn attachment(path: &Path, name: &str) -> Result<Option<Vec<u8>>> {
    Recording::open(path)?.attachment(name)
}

pub(crate) fn summarize(path: &Path) -> Result<RecordingSummary> {
    Recording::open(path)?.summary(&Selection::default())
}

pub(crate) fn recover(from: &Path, to: &Path) -> Result<Recovery> {
    Recording::open(from)?.recover(to)
}

/// The error, which is one line that begins with `path`.
#[track_caller]
pub fn one_line(path: &Path, error: &Error) -> String {
    let text = error.to_string();
    let is_named = text.starts_with(&path.display().to_string());
    assert!(is_named && !text.contains('\n'), "{text}");
    text
}
