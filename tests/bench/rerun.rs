//! Files of the Rerun sink, read back with the SDK's decoder and, if available, the viewer.

use rerun::StoreKind;
use rerun::external::re_log_encoding::DecoderApp;
use rerun::external::re_log_types::StoreId;
use rerun::log::{Chunk, LogMsg};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::time::Duration;
use svl::arena::WireObject;
use svl::manifest::Manifest;
use svl::overlay::CODES_PER_PX;
use svl::score::Judge;
use svl::sink::{
    PassStart, RerunDetail, RerunTarget, ResultsSoFar, ViewedScene, Viewer, WorstSecond,
};
use svl::stereo::{
    Cell, CellDepth, DepthGrid, DisparityMap, Estimate, Exposure, ExtraPlanes, Frame, Geometry,
    Gray, GridShape, Plane, Pose, Reason, Rig, StereoPair, Truth,
};
use svl::timing::{Stage, StageTimes};
use svl::viewer::Rerun;

const SIZE: (usize, usize) = (40, 30);
const LABELS: [&str; 3] = ["v3", "bm:max_disparity=64", "v4"];

/// A frame with truth; with a rig it also has a pose, without one a name.
fn frame(sequence: u64, rig: bool) -> Frame {
    let (width, height) = SIZE;
    let image = Gray::from_fn(width, height, |x, y| (3 * x + 4 * y) as u8).unwrap();
    let truth = Plane::from_fn(
        width,
        height,
        |x, _| if x < 8 { f32::INFINITY } else { 20.0 },
    )
    .unwrap();
    Frame {
        sequence,
        stamp_ns: 40_000_000 * sequence,
        name: (!rig).then(|| format!("scene {sequence}")),
        pair: StereoPair::new(image.clone(), image).unwrap(),
        geometry: Geometry::Rectified(
            rig.then(|| Rig::new(40.0, (19.5, 14.5), 0.05, 0.0).unwrap()),
        ),
        calibration: None,
        recorded: None,
        pose: rig.then(|| Pose::translation(0.01 * sequence as f64, 0.0, 0.1)),
        base: None,
        truth: Some(Truth::exact(truth, None)),
        floor: None,
        maps: Vec::new(),
        color: None,
        exposure: Exposure::default(),
    }
}

/// 20 px in the right half; the left one is untextured and its cell unknown.
fn estimate(label: &str, rig: Option<&Rig>) -> Estimate {
    let extra = ExtraPlanes {
        ssdpi: label != "bm:max_disparity=64",
        row_offset: label == "v4",
    };
    let mut disparity = DisparityMap::with_planes(SIZE.0, SIZE.1, extra).unwrap();
    for mut row in disparity.rows_mut() {
        (0..20).for_each(|x| row.reject(x, Reason::Untextured));
        (20..40).for_each(|x| row.accept(x, 20.0));
        if extra.ssdpi {
            (20..40).for_each(|x| row.set_ssdpi(x, 100));
        }
    }
    let known = CellDepth::at(20.0, rig);
    let cells = vec![
        Cell {
            valid_share: 0.0,
            depth: None,
            ..Cell::UNKNOWN
        },
        Cell {
            valid_share: 1.0,
            depth: Some(known),
            ..Cell::UNKNOWN
        },
    ];
    let grid = DepthGrid::new(
        GridShape {
            columns: 2,
            rows: 1,
        },
        cells,
    )
    .unwrap();
    let mut times = StageTimes::default();
    times.add(Stage::Matching, Duration::from_micros(900));
    Estimate {
        algorithm: label.to_owned(),
        disparity,
        grid,
        own_grid: false,
        unfiltered: None,
        range_px: None,
        times: Some(times),
    }
}

fn write(path: &Path, rig: bool) {
    write_frames(path, rig, 3, RerunDetail::Full);
}

fn write_frames(path: &Path, rig: bool, frames: u64, detail: RerunDetail) {
    let edges = WireObject {
        name: "wall".into(),
        strips: vec![vec![[0.0; 3], [1.0, 0.0, 0.0]]],
    };
    let run = ViewedScene {
        recording_id: "run-1".into(),
        scenario: "test".into(),
        algorithms: LABELS
            .map(|label| (label.to_owned(), "window 9 px".to_owned()))
            .into(),
        wireframe: if rig { vec![edges] } else { Vec::new() },
    };
    let target = RerunTarget::File(path.to_owned());
    let results = || ResultsSoFar {
        verdicts: "# all passed".to_owned(),
        worst: None,
    };
    let verdicts = Box::new(move || Some(results()));
    let mut sink = Rerun.run(target, detail, &run, Some(verdicts)).unwrap();
    let judge = Judge {
        grid: GridShape {
            columns: 2,
            rows: 1,
        }
        .into(),
        ..Judge::default()
    };
    for sequence in 0..frames {
        let frame = frame(sequence, rig);
        let estimates = LABELS.map(|label| estimate(label, frame.rig()));
        sink.take(&judge.judge(frame, estimates.to_vec())).unwrap();
    }
    sink.finish().unwrap();
}

/// Contents of a file: its stores, and per entity of the recording the components and the
/// timelines.
#[derive(Default)]
struct Content {
    stores: Vec<StoreId>,
    components: BTreeMap<String, BTreeSet<String>>,
    timelines: BTreeMap<String, BTreeSet<String>>,
    /// On the timeline `pair`, the frames in which each component of an entity was logged.
    frames: BTreeMap<(String, String), BTreeSet<i64>>,
    /// The last range of the colours of all frames, by entity.
    ranges: BTreeMap<String, [f64; 2]>,
}

impl Content {
    fn read(path: &Path) -> Self {
        let mut content = Self::default();
        for message in DecoderApp::decode_lazy(BufReader::new(File::open(path).unwrap())) {
            match message.unwrap() {
                LogMsg::SetStoreInfo(set) => content.stores.push(set.info.store_id),
                LogMsg::ArrowMsg(store, message) if store.kind() == StoreKind::Recording => {
                    let chunk = Chunk::from_arrow_msg(&message).unwrap();
                    let entity = chunk.entity_path().to_string();
                    for component in chunk.components().keys() {
                        if chunk.is_static()
                            && component.as_str() == "EncodedDepthImage:depth_range"
                        {
                            let range = chunk.iter_slices::<[f64; 2]>(*component).last();
                            let range = range.and_then(|own| own.first().copied());
                            content
                                .ranges
                                .extend(range.map(|own| (entity.clone(), own)));
                        }
                        let frames = chunk.iter_component_indices("pair".into(), *component);
                        let key = (entity.clone(), component.to_string());
                        let all = content.frames.entry(key).or_default();
                        all.extend(frames.map(|(frame, _)| frame.as_i64()));
                    }
                    let components = chunk.components().keys().map(|c| c.to_string());
                    content
                        .components
                        .entry(entity.clone())
                        .or_default()
                        .extend(components);
                    let timelines = chunk.timelines().keys().map(|t| t.to_string());
                    content
                        .timelines
                        .entry(entity)
                        .or_default()
                        .extend(timelines);
                }
                _ => {}
            }
        }
        content
    }

    fn has(&self, entity: &str, component: &str) -> bool {
        self.components
            .get(entity)
            .is_some_and(|components| components.contains(component))
    }
}

#[test]
fn every_entity_is_there_for_every_algorithm() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.rrd");
    write(&path, true);
    let content = Content::read(&path);
    let mut expected = vec![
        ("/world".to_owned(), "ViewCoordinates:xyz"),
        ("/world/arena".to_owned(), "LineStrips3D:strips"),
        ("/world/trail".to_owned(), "LineStrips3D:strips"),
        ("/world/rig/left".to_owned(), "Transform3D:translation"),
        ("/world/rig/left".to_owned(), "Pinhole:image_from_camera"),
        ("/world/rig/left/image".to_owned(), "EncodedImage:blob"),
        ("/truth/overlay".to_owned(), "Boxes2D:half_sizes"),
        ("/truth/depth".to_owned(), "EncodedDepthImage:blob"),
        ("/truth/depth/none".to_owned(), "EncodedImage:blob"),
        ("/run/parameters".to_owned(), "TextDocument:text"),
        ("/run/verdicts".to_owned(), "TextDocument:text"),
    ];
    for name in ["v3", "bm-max_disparity-64", "v4"] {
        let entity = |path: &str| format!("/algo/{name}/{path}");
        let maps = ["depth", "disparity", "ssdpi"];
        for map in maps
            .into_iter()
            .filter(|&map| map != "ssdpi" || name.starts_with('v'))
        {
            let components = [
                "EncodedDepthImage:blob",
                "EncodedDepthImage:meter",
                "EncodedDepthImage:depth_range",
                "EncodedDepthImage:colormap",
            ];
            expected.extend(components.map(|component| (entity(map), component)));
        }
        if name == "v4" {
            expected.push((entity("row_offset"), "Scalars:scalars"));
        }
        expected.extend([
            (entity("overlay"), "Boxes2D:half_sizes"),
            (entity("overlay"), "Points2D:positions"),
            (entity("overlay"), "LineStrips2D:strips"),
            (entity("overlay/percentiles"), "Boxes2D:half_sizes"),
            (entity("overlay/cells"), "Points2D:labels"),
            (entity("known_cells"), "Scalars:scalars"),
            (entity("why"), "EncodedImage:blob"),
            (entity("points"), "EncodedDepthImage:blob"),
            (entity("latency/total"), "Scalars:scalars"),
            (entity("latency/matching"), "Scalars:scalars"),
            (entity("coverage"), "Scalars:scalars"),
            (entity("wrong_cells"), "Scalars:scalars"),
        ]);
    }
    let missing: Vec<_> = expected
        .iter()
        .filter(|(entity, component)| !content.has(entity, component))
        .collect();
    assert!(
        missing.is_empty(),
        "missing {missing:?} in {:#?}",
        content.components
    );
    // Nor does an algorithm show planes it does not produce.
    assert!(
        !content
            .components
            .contains_key("/algo/bm-max_disparity-64/ssdpi")
    );
    for name in ["bm-max_disparity-64", "v3"] {
        let entity = format!("/algo/{name}/row_offset");
        assert!(!content.has(&entity, "Scalars:scalars"), "{entity}");
    }
    assert!(
        ["pair", "time"]
            .iter()
            .all(|&timeline| content.timelines["/algo/v3/depth"].contains(timeline))
    );
}

#[test]
fn light_has_images_and_numbers_of_all_frames_and_maps_of_some() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.rrd");
    write_frames(&path, true, 40, RerunDetail::Light);
    let content = Content::read(&path);
    let frames = |entity: &str, component: &str| {
        let key = (entity.to_owned(), component.to_owned());
        content.frames[&key].iter().copied().collect::<Vec<_>>()
    };
    let all: Vec<i64> = (0..40).collect();
    assert_eq!(frames("/world/rig/left/image", "EncodedImage:blob"), all);
    assert_eq!(frames("/algo/v3/overlay", "Boxes2D:half_sizes"), all);
    assert_eq!(frames("/algo/v3/latency/total", "Scalars:scalars"), all);
    for map in ["disparity", "depth", "points", "ssdpi"] {
        let entity = format!("/algo/v3/{map}");
        assert_eq!(frames(&entity, "EncodedDepthImage:blob"), [0, 30], "{map}");
        // They do not remain next to the images of other frames.
        assert_eq!(frames(&entity, "Clear:is_recursive"), [1, 31], "{map}");
    }
    assert_eq!(frames("/algo/v3/why", "EncodedImage:blob"), [0, 30]);
    assert_eq!(frames("/algo/v3/why", "Clear:is_recursive"), [1, 31]);
    assert_eq!(frames("/truth/depth", "EncodedDepthImage:blob"), [0, 30]);
    // A list of them, in which a click leads to the frame.
    assert_eq!(frames("/run/frames", "TextLog:text"), [0, 30]);
}

/// The estimates are beyond the truth's 99th percentile.
#[test]
fn colours_of_disparities_end_with_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.rrd");
    write(&path, true);
    let content = Content::read(&path);
    let ends = content.ranges.iter().map(|(entity, [low, high])| {
        assert_eq!(*low, 0.0, "{entity}");
        (entity.as_str(), *high / f64::from(CODES_PER_PX))
    });
    let ends: Vec<_> = ends.collect();
    let maps = ["bm-max_disparity-64", "v3", "v4"];
    let expected = maps.map(|name| (format!("/algo/{name}/disparity"), 20.0));
    let expected: Vec<_> = expected
        .iter()
        .map(|(own, end)| (own.as_str(), *end))
        .collect();
    assert_eq!(ends, expected);
}

#[test]
fn the_worst_second_is_listed_at_its_pair_of_its_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.rrd");
    let info = ViewedScene {
        algorithms: vec![("v3".to_owned(), String::new())],
        ..ViewedScene::default()
    };
    let worst = || WorstSecond {
        seed: None,
        run: Some("b".to_owned()),
        sequence: 2,
        stamp_ns: 80_000_000,
        words: "worst second".to_owned(),
    };
    let results = Box::new(move || {
        Some(ResultsSoFar {
            verdicts: String::new(),
            worst: Some(worst()),
        })
    });
    let target = RerunTarget::File(path.clone());
    let mut sink = Rerun
        .run(target, RerunDetail::Light, &info, Some(results))
        .unwrap();
    for name in ["a", "b"] {
        let mut judge = Judge::default();
        judge.run.name = name.to_owned();
        sink.begin_pass(&PassStart::new(&Manifest::default(), None, &judge))
            .unwrap();
        for sequence in 0..4 {
            let frame = frame(sequence, true);
            let estimates = vec![estimate("v3", frame.rig())];
            sink.take(&judge.judge(frame, estimates)).unwrap();
        }
    }
    sink.finish().unwrap();
    let key = |component: &str| ("/run/frames".to_owned(), component.to_owned());
    let frames = Content::read(&path).frames;
    // The second run begins at 4.
    assert_eq!(frames[&key("TextLog:level")], [6].into());
    assert_eq!(frames[&key("TextLog:text")], [0, 4, 6].into());
}

#[test]
fn a_run_is_one_recording_with_a_layout() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.rrd");
    write(&path, true);
    let stores = Content::read(&path).stores;
    assert!(
        stores
            .iter()
            .all(|store| store.application_id().as_str() == "svl")
    );
    let recordings: Vec<_> = stores
        .iter()
        .filter(|store| store.kind() == StoreKind::Recording)
        .collect();
    assert!(
        !recordings.is_empty()
            && recordings
                .iter()
                .all(|store| store.recording_id().as_str() == "run-1")
    );
    assert!(
        stores
            .iter()
            .any(|store| store.kind() == StoreKind::Blueprint)
    );
}

#[test]
fn a_frame_without_rig_has_disparity_and_no_depth() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scenes.rrd");
    write(&path, false);
    let content = Content::read(&path);
    assert!(content.has("/algo/v3/disparity", "EncodedDepthImage:blob"));
    assert!(content.has("/truth/overlay", "Boxes2D:half_sizes"));
    assert!(content.has("/run/frames", "TextLog:text"));
    for map in ["depth", "points"] {
        assert!(!content.has(&format!("/algo/v3/{map}"), "EncodedDepthImage:blob"));
    }
    assert!(!content.has("/world/rig/left", "Pinhole:image_from_camera"));
}

#[test]
fn a_target_that_cannot_be_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let taken = folder.path().join("taken.rrd");
    std::fs::write(&taken, "mine").unwrap();
    let targets = [
        RerunTarget::File(taken.clone()),
        // A file is in the folder's place.
        RerunTarget::File(taken.join("run.rrd")),
        // Nothing listens on port 1.
        "http://127.0.0.1:1".parse().unwrap(),
    ];
    for target in targets {
        let name = target.to_string();
        let error = Rerun
            .run(target, RerunDetail::Full, &ViewedScene::default(), None)
            .err()
            .expect("not a target")
            .to_string();
        assert!(
            error.contains("taken.rrd") || error.starts_with(&name),
            "{error}"
        );
        assert_eq!(error.lines().count(), 1, "{error}");
    }
    assert_eq!(std::fs::read(&taken).unwrap(), b"mine");
}

#[test]
fn a_recording_of_ours_gets_a_layout_and_a_foreign_one_none() {
    let folder = tempfile::tempdir().unwrap();
    let layout = folder.path().join("layout.rbl");
    let recording = Path::new("recordings/arena.mcap");
    assert!(
        !Rerun
            .save_layout(recording, &["/camera/image_raw".to_owned()], &layout)
            .unwrap()
    );
    assert!(!layout.exists());
    assert!(
        Rerun
            .save_layout(recording, &["/stereo/left/image".to_owned()], &layout)
            .unwrap()
    );
    let stores = Content::read(&layout).stores;
    let ours =
        |s: &StoreId| s.kind() == StoreKind::Blueprint && s.application_id().as_str() == "arena";
    assert!(!stores.is_empty() && stores.iter().all(ours));
}

#[test]
fn the_viewer_verifies_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.rrd");
    write(&path, true);
    let program = std::env::var("SVL_RERUN").unwrap_or_else(|_| "rerun".into());
    match std::process::Command::new(&program)
        .args(["rrd", "verify"])
        .arg(&path)
        .output()
    {
        Ok(output) => assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        ),
        Err(error) => crate::common::skip(&format!("no program {program}: {error}")),
    }
}

#[test]
fn tuning_replaces_the_tuned_maps_and_keeps_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tuned.rrd");
    let labels = ["now", "compared"];
    let info = ViewedScene {
        recording_id: "tuned".into(),
        scenario: "test".into(),
        algorithms: labels.map(|label| (label.to_owned(), String::new())).into(),
        wireframe: Vec::new(),
    };
    let target = RerunTarget::File(path.clone());
    let mut sink = Rerun.tuning(target, &info).unwrap();
    let judge = Judge::default();
    // Frame 7 with both, again with the first alone, then frame 3, on which the second failed.
    for (sequence, shown) in [(7, &labels[..]), (7, &labels[..1]), (3, &labels[..1])] {
        let frame = frame(sequence, true);
        let estimates = shown.iter().map(|label| estimate(label, frame.rig()));
        sink.take(&judge.judge(frame.clone(), estimates.collect()))
            .unwrap();
    }
    sink.finish().unwrap();
    let content = Content::read(&path);
    let frames = |entity: &str, component: &str| {
        let key = (entity.to_owned(), component.to_owned());
        content
            .frames
            .get(&key)
            .map(|frames| frames.iter().copied().collect::<Vec<_>>())
    };
    let map = "EncodedDepthImage:blob";
    assert_eq!(frames("/algo/now/disparity", map), Some(vec![3, 7]));
    assert_eq!(frames("/algo/compared/disparity", map), Some(vec![7]));
    // It is cleared if it has nothing to show, and only then.
    assert_eq!(
        frames("/algo/compared", "Clear:is_recursive"),
        Some(vec![3])
    );
    assert_eq!(frames("/algo/now", "Clear:is_recursive"), None);
    assert!(!content.has("/algo/now/depth", map) && !content.has("/algo/now/points", map));
    assert!(content.timelines["/algo/now/disparity"].contains("change"));
}
