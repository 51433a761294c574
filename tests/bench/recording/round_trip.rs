//! Round trips: every frame is read back as written.

use super::frames::{attachment, bare, full, header, read, record, summarize};
use crate::common::assert_says;
use svl::recording::{Dialect, Header, ImageFormat, Recording, RecordingFormat, Selection, Writer};
use svl::score::Judge;
use svl::sink::{RecordingSink, Sink};
use svl::source::{RecordingSource, Source};
use svl::stereo::{
    Cell, DepthGrid, DisparityMap, Estimate, Frame, Geometry, GridShape, Plane, Rig, Side, Truth,
};

const SIZE: (usize, usize) = (61, 47);

/// Frames are equal, true disparities up to `tolerance_px`.
fn assert_same(read: &Frame, written: &Frame, tolerance_px: f32) {
    if let (Some(read), Some(written)) = (&read.truth, &written.truth) {
        for (r, w) in read.disparity.pixels().zip(written.disparity.pixels()) {
            assert!(
                r == w || (r - w).abs() <= tolerance_px,
                "disparity {w} came back as {r}"
            );
        }
        assert_eq!(read.visibility, written.visibility);
        assert_eq!(read.surface, written.surface);
    }
    assert_eq!(read.truth.is_some(), written.truth.is_some());
    let bare = |frame: &Frame| Frame {
        truth: None,
        ..frame.clone()
    };
    assert_eq!(bare(read), bare(written));
}

fn round_trip(frames: &[Frame], images: ImageFormat, tolerance_px: f32) {
    let folder = tempfile::tempdir().unwrap();
    let (back, error) = read(&record(folder.path(), frames, images));
    assert!(error.is_none(), "{error:?}");
    assert_eq!(back.len(), frames.len());
    back.iter()
        .zip(frames)
        .for_each(|(read, written)| assert_same(read, written, tolerance_px));
}

#[test]
fn everything_comes_back() {
    let frames: Vec<_> = (0..20).map(|i| full(i, SIZE)).collect();
    round_trip(&frames, ImageFormat::Raw, 1e-5);
    round_trip(&frames, ImageFormat::Png, 1e-5);
}

#[test]
fn bare_pairs_come_back() {
    let frames: Vec<_> = (0..20).map(|i| bare(i, SIZE)).collect();
    round_trip(&frames, ImageFormat::Raw, 0.0);
    round_trip(&frames, ImageFormat::Png, 0.0);
}

#[test]
fn a_ros_2_bag_gives_back_pairs_and_rig() {
    for images in [ImageFormat::Raw, ImageFormat::Png] {
        let folder = tempfile::tempdir().unwrap();
        let frames: Vec<_> = (0..5)
            .map(|i| {
                if images == ImageFormat::Raw {
                    full(i, SIZE)
                } else {
                    bare(i, SIZE)
                }
            })
            .collect();
        let (back, error) = read(&record(
            folder.path(),
            &frames,
            RecordingFormat {
                dialect: Dialect::Ros2,
                images,
            },
        ));
        assert!(error.is_none() && back.len() == frames.len(), "{error:?}");
        for (read, written) in back.iter().zip(&frames) {
            assert_eq!(
                (&read.pair, read.stamp_ns),
                (&written.pair, written.stamp_ns)
            );
            // Stamps alone cannot show that they are unknown.
            assert_eq!(
                read.exposure.skew_ns.unwrap_or(0),
                written.exposure.skew_ns.unwrap_or(0)
            );
            assert_eq!(
                read.rig().map(|rig| rig.intrinsics(Side::Right)),
                written.rig().map(|rig| rig.intrinsics(Side::Right))
            );
            let baseline = |frame: &Frame| frame.rig().map_or(0.0, |rig| rig.baseline_m());
            assert!((baseline(read) - baseline(written)).abs() < 1e-12);
        }
    }
}

#[test]
fn raw_and_rectified_pairs_with_and_without_a_rig_are_told_apart() {
    let geometries = [
        Geometry::Raw,
        Geometry::Rectified(None),
        full(0, SIZE).geometry,
    ];
    for dialect in [Dialect::Svl, Dialect::Ros2] {
        let images = ImageFormat::Raw;
        for geometry in geometries {
            let folder = tempfile::tempdir().unwrap();
            let written: Vec<_> = (0..3)
                .map(|i| Frame {
                    geometry,
                    ..bare(i, SIZE)
                })
                .collect();
            let path = record(folder.path(), &written, RecordingFormat { dialect, images });
            let (frames, error) = read(&path);
            assert!(error.is_none() && frames.len() == 3, "{error:?}");
            for frame in frames {
                match dialect {
                    Dialect::Svl => assert_eq!(frame.geometry, geometry),
                    // ROS's P contains only the product of focal length and baseline.
                    Dialect::Ros2 => assert_eq!(
                        (frame.geometry == Geometry::Raw, frame.rig().is_some()),
                        (geometry == Geometry::Raw, geometry.rig().is_some())
                    ),
                }
            }
        }
    }
}

#[test]
fn a_recording_may_change_what_it_knows_and_its_size() {
    let exact = |frame: Frame| Frame {
        geometry: Geometry::Rectified(None),
        ..frame
    };
    let no_truth = |frame: Frame| Frame {
        truth: None,
        ..frame
    };
    let frames = [
        bare(0, SIZE),
        full(1, SIZE),
        exact(full(2, (8, 9))),
        no_truth(full(3, (1, 1))),
        bare(4, SIZE),
    ];
    round_trip(&frames, ImageFormat::Raw, 1e-5);
}

#[test]
fn truth_without_a_rig_is_exact() {
    let frames: Vec<_> = (0..3)
        .map(|i| Frame {
            geometry: Geometry::Rectified(None),
            ..full(i, SIZE)
        })
        .collect();
    round_trip(&frames, ImageFormat::Raw, 0.0);
}

#[test]
fn truth_beyond_infinity_is_exact() {
    let rig = Rig::new(1000.0, (30.0, 20.0), 0.1, -10.0).unwrap();
    let disparity = Plane::from_fn(SIZE.0, SIZE.1, |x, y| x as f32 + y as f32 / 3.0).unwrap();
    let frame = Frame {
        geometry: Geometry::Rectified(Some(rig)),
        truth: Some(Truth::exact(disparity, None)),
        ..bare(0, SIZE)
    };
    round_trip(&[frame], ImageFormat::Raw, 0.0);
}

#[test]
fn a_right_image_a_whole_period_late_finds_its_left_one() {
    let late = |i| {
        let mut frame = bare(i, SIZE);
        frame.exposure.skew_ns = Some(super::frames::PERIOD_NS as i64);
        frame
    };
    round_trip(&(0..5).map(late).collect::<Vec<_>>(), ImageFormat::Raw, 0.0);
}

#[test]
fn header_attachments_and_length_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let (scenario, hash) = (Some("arena".to_owned()), Some("c0ffee".to_owned()));
    let written = Header {
        scenario,
        hash,
        seed: Some(u64::MAX),
        ..Header::new("arena")
    };
    let mut writer = Writer::create(&path, &written, ImageFormat::Raw).unwrap();
    writer
        .attach("scenario.toml", "application/toml", b"name = 'arena'")
        .unwrap();
    (0..7).for_each(|i| writer.write(&full(i, SIZE)).unwrap());
    drop(writer);
    assert_eq!(header(&path).unwrap(), written);
    assert_eq!(
        attachment(&path, "scenario.toml").unwrap().unwrap(),
        b"name = 'arena'"
    );
    assert_eq!(attachment(&path, "calibration.xml").unwrap(), None);
    let mut source = RecordingSource::open(&path).unwrap();
    assert_eq!(
        (source.pairs(), source.reader().header()),
        (Some(7), Some(&written))
    );
    assert_eq!(source.next().unwrap().unwrap().sequence, 0);
    assert!(source.reader().facts().unpaired_ns.is_empty());
}

#[test]
fn results_stand_beside_the_pairs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("result.mcap");
    let shape = GridShape {
        columns: 1,
        rows: 1,
    };
    let mut disparity = DisparityMap::new(SIZE.0, SIZE.1).unwrap();
    disparity.rows_mut().next().unwrap().accept(5, 17.25);
    let grid = DepthGrid::new(
        shape,
        vec![Cell {
            valid_share: 0.0,
            depth: None,
            ..Cell::UNKNOWN
        }],
    )
    .unwrap();
    let estimate = |algorithm: &str| Estimate {
        algorithm: algorithm.to_owned(),
        disparity: disparity.clone(),
        grid: grid.clone(),
        own_grid: false,
        unfiltered: None,
        range_px: None,
        times: Default::default(),
    };
    let estimates = [estimate("v3"), estimate("exec:command=/bin/elas")];
    let mut sink = Box::new(RecordingSink::new(
        Writer::create(&path, &Header::new("replay"), ImageFormat::Raw).unwrap(),
        None,
    ));
    let judge = Judge {
        grid: grid.shape().into(),
        ..Judge::default()
    };
    for i in 0..4 {
        let judged = judge.judge(full(i, SIZE), estimates.to_vec());
        sink.take(&judged).unwrap();
    }
    sink.finish().unwrap();
    let summary = summarize(&path).unwrap();
    for topic in [
        "/algo/v3/disparity",
        "/algo/exec:command=_bin_elas/disparity",
    ] {
        let found = summary
            .topics
            .iter()
            .find(|found| found.name == topic)
            .unwrap();
        assert_eq!(
            (found.messages, found.schema.as_str()),
            (4, "sensor_msgs/msg/Image")
        );
    }
    assert_eq!(read(&path).0.len(), 4, "a result is a recording");
}

#[test]
fn values_without_a_field_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = Writer::create(
        folder.path().join("a.mcap"),
        &Header::new("test"),
        ImageFormat::Raw,
    )
    .unwrap();
    let late = Frame {
        stamp_ns: u64::MAX,
        ..bare(0, SIZE)
    };
    assert_says(&writer.write(&late).unwrap_err().to_string(), &["ROS 2"]);
    let mut early = Frame {
        stamp_ns: 5,
        ..bare(0, SIZE)
    };
    early.exposure.skew_ns = Some(-6);
    assert_says(
        &writer.write(&early).unwrap_err().to_string(),
        &["before 1970"],
    );
    writer.finish().unwrap();
    assert_says(
        &writer.write(&bare(1, SIZE)).unwrap_err().to_string(),
        &["finished"],
    );
}

#[test]
fn a_recording_is_opened_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = Writer::create(&path, &Header::new("test"), ImageFormat::Raw).unwrap();
    writer
        .attach("scenario.toml", "application/toml", b"name = 'x'")
        .unwrap();
    writer
        .attach("calibration/rig.yml", "text/yaml", b"%YAML:1.0")
        .unwrap();
    (0..3).for_each(|i| writer.write(&full(i, (24, 16))).unwrap());
    writer.finish().unwrap();
    let recording = Recording::open(&path).unwrap();
    // Reopening it by name would fail.
    std::fs::remove_file(&path).unwrap();
    let mut source = RecordingSource::new(recording.clone(), &Selection::default()).unwrap();
    assert_eq!(source.pairs(), Some(3));
    assert_eq!(source.scenario().unwrap().as_deref(), Some("name = 'x'"));
    assert_eq!(source.reader().header().unwrap().source, "test");
    assert_eq!(std::iter::from_fn(|| source.next().unwrap()).count(), 3);
    assert_eq!(recording.header().unwrap().source, "test");
    assert_eq!(recording.calibration_files().unwrap()[0].0, "rig.yml");
    assert!(recording.results().unwrap().is_empty());
    assert!(
        recording
            .summary(&Selection::default())
            .unwrap()
            .is_intact()
    );
    let saved = folder.path().join("saved.mcap");
    assert_eq!(recording.recover(&saved).unwrap().pairs, 3);
}

#[test]
fn an_own_recording_whose_summary_repeats_nothing_is_read_from_its_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let frames: Vec<_> = (0..3).map(|i| full(i, SIZE)).collect();
    let path = record(folder.path(), &frames, ImageFormat::Raw);
    let (expected, _) = read(&path);
    let copy = folder.path().join("copy.mcap");
    let bytes = std::fs::read(&path).unwrap();
    let options = mcap::WriteOptions::new();
    let options = options.repeat_channels(false).repeat_schemas(false);
    let mut writer = options
        .create(std::fs::File::create(&copy).unwrap())
        .unwrap();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    let (found, error) = read(&copy);
    assert!(error.is_none(), "{error:?}");
    assert_eq!(found, expected);
}
