//! Round trips: every frame is read back as written.

use super::frames::{attachment, bare, full, header, intact, record, summarize};
use super::says::Says;
use std::path::PathBuf;
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
            let is_near = r == w || (r - w).abs() <= tolerance_px;
            assert!(is_near, "disparity {w} came back as {r}");
        }
        assert_eq!(read.visibility, written.visibility);
        assert_eq!(read.surface, written.surface);
    }
    assert_eq!(read.truth.is_some(), written.truth.is_some());
    assert_eq!(without_truth(read.clone()), without_truth(written.clone()));
}

fn without_truth(mut frame: Frame) -> Frame {
    frame.truth = None;
    frame
}

/// The frame with another geometry.
fn with_geometry(mut frame: Frame, geometry: Geometry) -> Frame {
    frame.geometry = geometry;
    frame
}

/// The frames, recorded and read.
fn again(frames: &[Frame], format: impl Into<RecordingFormat>) -> Vec<Frame> {
    let folder = tempfile::tempdir().unwrap();
    let back = intact(&record(folder.path(), frames, format));
    assert_eq!(back.len(), frames.len());
    back
}

fn round_trip(frames: &[Frame], images: ImageFormat, tolerance_px: f32) {
    let back = again(frames, images);
    let pairs = back.iter().zip(frames);
    pairs.for_each(|(read, written)| assert_same(read, written, tolerance_px));
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
    let makes = [full as fn(u64, (usize, usize)) -> Frame, bare];
    for (images, make) in [ImageFormat::Raw, ImageFormat::Png].into_iter().zip(makes) {
        let frames: Vec<_> = (0..5).map(|i| make(i, SIZE)).collect();
        let dialect = Dialect::Ros2;
        let back = again(&frames, RecordingFormat { dialect, images });
        for (read, written) in back.iter().zip(&frames) {
            assert_eq!(read.pair, written.pair);
            assert_eq!(read.stamp_ns, written.stamp_ns);
            // Stamps alone cannot show that they are unknown.
            let skew = |frame: &Frame| frame.exposure.skew_ns.unwrap_or(0);
            assert_eq!(skew(read), skew(written));
            let right = |frame: &Frame| frame.rig().map(|rig| rig.intrinsics(Side::Right));
            assert_eq!(right(read), right(written));
            let baseline = |frame: &Frame| frame.rig().map_or(0.0, |rig| rig.baseline_m());
            assert!((baseline(read) - baseline(written)).abs() < 1e-12);
        }
    }
}

#[test]
fn raw_and_rectified_pairs_with_and_without_a_rig_are_told_apart() {
    for dialect in [Dialect::Svl, Dialect::Ros2] {
        let with_rig = full(0, SIZE).geometry;
        for geometry in [Geometry::Raw, Geometry::Rectified(None), with_rig] {
            let frames = (0..3).map(|i| with_geometry(bare(i, SIZE), geometry));
            let frames: Vec<_> = frames.collect();
            let images = ImageFormat::Raw;
            for frame in again(&frames, RecordingFormat { dialect, images }) {
                // ROS's P contains only the product of focal length and baseline.
                let told =
                    |geometry: &Geometry| (*geometry == Geometry::Raw, geometry.rig().is_some());
                assert_eq!(told(&frame.geometry), told(&geometry));
                assert!(dialect == Dialect::Ros2 || frame.geometry == geometry);
            }
        }
    }
}

#[test]
fn a_recording_may_change_what_it_knows_and_its_size() {
    let frames = [
        bare(0, SIZE),
        full(1, SIZE),
        with_geometry(full(2, (8, 9)), Geometry::Rectified(None)),
        without_truth(full(3, (1, 1))),
        bare(4, SIZE),
    ];
    round_trip(&frames, ImageFormat::Raw, 1e-5);
}

#[test]
fn truth_without_a_rig_is_exact() {
    let exact = |i| with_geometry(full(i, SIZE), Geometry::Rectified(None));
    let frames: Vec<_> = (0..3).map(exact).collect();
    round_trip(&frames, ImageFormat::Raw, 0.0);
}

#[test]
fn truth_beyond_infinity_is_exact() {
    let rig = Rig::new(1000.0, (30.0, 20.0), 0.1, -10.0).unwrap();
    let disparity = Plane::from_fn(SIZE.0, SIZE.1, |x, y| x as f32 + y as f32 / 3.0).unwrap();
    let mut frame = with_geometry(bare(0, SIZE), Geometry::Rectified(Some(rig)));
    frame.truth = Some(Truth::exact(disparity, None));
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

/// A new recording.
fn writer(header: &Header) -> (tempfile::TempDir, PathBuf, Writer) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let writer = Writer::create(&path, header, ImageFormat::Raw).unwrap();
    (folder, path, writer)
}

#[test]
fn header_attachments_and_length_come_back() {
    let (scenario, hash) = (Some("arena".to_owned()), Some("c0ffee".to_owned()));
    let written = Header {
        scenario,
        hash,
        seed: Some(u64::MAX),
        ..Header::new("arena")
    };
    let (_folder, path, mut writer) = writer(&written);
    let (name, text) = ("scenario.toml", b"name = 'arena'");
    writer.attach(name, "application/toml", text).unwrap();
    (0..7).for_each(|i| writer.write(&full(i, SIZE)).unwrap());
    drop(writer);
    assert_eq!(header(&path).unwrap(), written);
    assert_eq!(attachment(&path, name).unwrap().unwrap(), text);
    assert_eq!(attachment(&path, "calibration.xml").unwrap(), None);
    let mut source = RecordingSource::open(&path).unwrap();
    assert_eq!(source.pairs(), Some(7));
    assert_eq!(source.reader.header(), Some(&written));
    assert_eq!(source.next().unwrap().unwrap().sequence, 0);
    assert!(source.reader.facts().unpaired_ns.is_empty());
}

#[test]
fn results_stand_beside_the_pairs() {
    let (_folder, path, writer) = writer(&Header::new("replay"));
    let mut disparity = DisparityMap::new(SIZE.0, SIZE.1).unwrap();
    disparity.rows_mut().next().unwrap().accept(5, 17.25);
    let shape = GridShape {
        columns: 1,
        rows: 1,
    };
    let mut unknown = Cell::UNKNOWN;
    (unknown.valid_share, unknown.depth) = (0.0, None);
    let grid = DepthGrid::new(shape, vec![unknown]).unwrap();
    let estimates = ["v3", "exec:command=/bin/elas"].map(|algorithm| Estimate {
        algorithm: algorithm.to_owned(),
        disparity: disparity.clone(),
        grid: grid.clone(),
        own_grid: false,
        unfiltered: None,
        range_px: None,
        times: Default::default(),
    });
    let mut sink = Box::new(RecordingSink::new(writer, None));
    let judge = Judge {
        grid: grid.shape().into(),
        ..Judge::default()
    };
    for i in 0..4 {
        let judged = judge.judge(full(i, SIZE), estimates.to_vec());
        sink.take(&judged).unwrap();
    }
    sink.finish().unwrap();
    let topics = summarize(&path).unwrap().topics;
    for name in ["v3", "exec:command=_bin_elas"] {
        let name = format!("/algo/{name}/disparity");
        let topic = topics.iter().find(|found| found.name == name).unwrap();
        assert_eq!(topic.messages, 4);
        assert_eq!(topic.schema, "sensor_msgs/msg/Image");
    }
    assert_eq!(intact(&path).len(), 4, "a result is a recording");
}

#[test]
fn values_without_a_field_are_refused() {
    let (_folder, _, mut writer) = writer(&Header::new("test"));
    let mut late = bare(0, SIZE);
    late.stamp_ns = u64::MAX;
    writer.write(&late).unwrap_err().says("ROS 2");
    let mut early = bare(0, SIZE);
    (early.stamp_ns, early.exposure.skew_ns) = (5, Some(-6));
    writer.write(&early).unwrap_err().says("before 1970");
    writer.finish().unwrap();
    let finished = writer.write(&bare(1, SIZE));
    finished.unwrap_err().says("finished");
}

#[test]
fn a_recording_is_opened_once() {
    let (folder, path, mut writer) = writer(&Header::new("test"));
    for (name, media, bytes) in [
        ("scenario.toml", "application/toml", &b"name = 'x'"[..]),
        ("calibration/rig.yml", "text/yaml", b"%YAML:1.0"),
    ] {
        writer.attach(name, media, bytes).unwrap();
    }
    (0..3).for_each(|i| writer.write(&full(i, (24, 16))).unwrap());
    writer.finish().unwrap();
    let recording = Recording::open(&path).unwrap();
    // Reopening it by name would fail.
    std::fs::remove_file(&path).unwrap();
    let selection = Selection::default();
    let mut source = RecordingSource::new(recording.clone(), &selection).unwrap();
    assert_eq!(source.pairs(), Some(3));
    assert_eq!(source.scenario().unwrap().as_deref(), Some("name = 'x'"));
    assert_eq!(source.reader.header().unwrap().source, "test");
    assert_eq!(std::iter::from_fn(|| source.next().unwrap()).count(), 3);
    assert_eq!(recording.header().unwrap().source, "test");
    assert_eq!(recording.calibration_files().unwrap()[0].0, "rig.yml");
    assert!(recording.results().unwrap().is_empty());
    assert!(recording.summary(&selection).unwrap().is_intact());
    let saved = folder.path().join("saved.mcap");
    assert_eq!(recording.recover(&saved).unwrap().pairs, 3);
}

#[test]
fn an_own_recording_whose_summary_repeats_nothing_is_read_from_its_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let frames: Vec<_> = (0..3).map(|i| full(i, SIZE)).collect();
    let path = record(folder.path(), &frames, ImageFormat::Raw);
    let copy = folder.path().join("copy.mcap");
    let bytes = std::fs::read(&path).unwrap();
    let options = mcap::WriteOptions::new();
    let options = options.repeat_channels(false).repeat_schemas(false);
    let file = std::fs::File::create(&copy).unwrap();
    let mut writer = options.create(file).unwrap();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    assert_eq!(intact(&copy), intact(&path));
}
