//! CycloneDDS, which is ROS 2's default, at the other end.

use super::robot::{self, address};
use super::wait_for;
use crate::cli::fixture::{Fixture, assert_says};
use crate::cli::interrupt::interrupted;
use crate::common::{python, skip};
use std::collections::BTreeSet;
use svl::source::{RecordingSource, Source};

const SCRIPT: &str = "ros2_topics.py";
const MODULES: &str = "cyclonedds, numpy";

/// The output of the script, a word per argument.
fn cyclone(words: &str) -> Option<Vec<u8>> {
    python(SCRIPT, MODULES, words.split_whitespace())
}

#[cfg(unix)]
#[test]
fn cyclone_s_images_arrive_and_it_reads_the_results() {
    let (source, prefix, domain) = (address(8, ""), address(8, "/svl"), robot::domain(8));
    let fixture = Fixture::new();
    let read_all = fixture.path("read-all");
    let until = format!("until={}", read_all.display());
    let publish = format!("publish {domain} 6000 10 320 240 latched {until}");
    let pixel_svl = format!("replay {source} --dense --publish {}", address(8, "/dense"));
    let output = std::thread::scope(|scope| {
        let sent = scope.spawn(|| cyclone(&publish));
        let read = |what: &str| {
            let words = format!("read {domain} {what}");
            scope.spawn(move || cyclone(&words))
        };
        let points = read("/svl/points 1 600 reliable");
        let topics = ["scan", "disparity", "depth"].map(|topic| format!("/svl/{topic} 1 600"));
        let [scan, disparity, depth] = topics.each_ref().map(|topic| read(topic));
        let unfit = read(&format!("/svl/depth 1 600 reliable {until}"));
        let status = read("/diagnostics 1 600");
        let dense = read("/dense/points 1 600");
        let line = format!("replay {source} --publish {prefix} -o live.mcap");
        let svl = [pixel_svl, line].map(|line| {
            let (fixture, read_all) = (&fixture, &read_all);
            scope.spawn(move || interrupted(fixture, &line, || read_all.exists()))
        });
        let readers = [points, dense, scan, disparity, depth, status];
        let read = readers.map(|thread| thread.join().unwrap());
        std::fs::write(&read_all, "").unwrap();
        let [pixel_svl, svl] = svl.map(|svl| svl.join().unwrap());
        if read[0].is_some() {
            for (code, stderr) in [&pixel_svl, &svl] {
                // A busy machine may lose images.
                assert!(matches!(code, Some(0 | 4)), "{stderr}");
            }
            let words = "/svl/depth: it asks for the QoS reliable";
            assert_eq!(svl.1.matches(words).count(), 1, "{}", svl.1);
            assert_eq!(unfit.join().unwrap(), Some(Vec::new()));
        }
        let [points, dense, scan, disparity, depth, status] = read;
        let sent = sent.join().unwrap();
        [sent, points, dense, scan, disparity, depth, status]
    });
    // Without CycloneDDS it was skipped aloud.
    let [
        Some(sent),
        Some(points),
        Some(dense),
        Some(scan),
        Some(disparity),
        Some(depth),
        Some(status),
    ] = output
    else {
        return;
    };
    let pairs = recorded(&fixture, "live.mcap", &sent);
    assert!(pairs > 0, "no pair");
    // The wall is 400 px · 0.1 m / 16 px away.
    let cloud = &lines(&points)[0];
    assert_eq!(cloud["frame_id"], "cam_left_optical_frame");
    assert_eq!(
        cloud["fields"],
        serde_json::json!(["x", "y", "z", "probability"])
    );
    let z = |point: &serde_json::Value| point[2].as_f64().unwrap();
    let points = cloud["points"].as_array().unwrap();
    assert!(!points.is_empty() && points.iter().all(|point| (z(point) - 2.5).abs() < 0.05));
    assert_dense(&lines(&dense)[0]);
    let image = &lines(&disparity)[0];
    assert_eq!(image["size"], serde_json::json!([320, 240]));
    assert_eq!(
        (image["f"].as_f64(), image["median"].as_f64()),
        (Some(400.0), Some(16.0))
    );
    let image = &lines(&depth)[0];
    assert_eq!(image["size"], serde_json::json!([320, 240]));
    assert_eq!(
        (image["encoding"].as_str(), image["step"].as_u64()),
        (Some("32FC1"), Some(4 * 320))
    );
    assert_eq!(
        (image["is_bigendian"].as_u64(), image["median"].as_f64()),
        (Some(0), Some(2.5))
    );
    assert_eq!(image["frame_id"], "cam_left_optical_frame");
    let scan = &lines(&scan)[0];
    assert_eq!(scan["frame_id"], "cam_left_frame");
    let number = |field: &str| scan[field].as_f64().unwrap();
    let ranges = scan["ranges"].as_array().unwrap();
    let span = number("angle_max") - number("angle_min");
    let beams = (span / number("angle_increment")).round() as usize + 1;
    assert_eq!((ranges.len(), number("range_max")), (beams, 10.0));
    assert_eq!(scan["intensities"].as_array().unwrap().len(), beams);
    // The wall is perpendicular to the optical axis.
    let middle = ranges[beams / 2].as_f64().unwrap();
    assert!((middle - 2.5).abs() < 0.05, "{middle}");
    let status = &lines(&status)[0];
    // Both commands publish one.
    let name = status["name"].as_str().unwrap();
    assert!(["svl /svl: v5", "svl /dense: v5"].contains(&name), "{name}");
    let keys = [
        "latency ms, longest",
        "images lost",
        "pairs lost",
        "pairs dropped",
        "pairs replaced",
        "readers matched",
        "readers unfit",
    ];
    for key in keys {
        assert!(status["values"][key].is_string(), "{key}: {status}");
    }
}

#[cfg(unix)]
#[test]
fn images_that_the_network_lost_are_losses() {
    let (source, prefix, domain) = (address(17, ""), address(17, "/svl"), robot::domain(17));
    let fixture = Fixture::new();
    let until = format!("until={}", fixture.path("ended").display());
    let publish = format!("publish {domain} 60000 20 64 48 lose=7 lose_pairs=10 {until}");
    std::thread::scope(|scope| {
        let sent = scope.spawn(|| cyclone(&publish));
        let [recorded, replayed] = [
            format!("record {source} --frames 40 -o run.mcap"),
            format!("replay {source} --to 2 --publish {prefix}"),
        ]
        .map(|line| fixture.svl(&line));
        fixture.write("ended", "");
        if sent.join().unwrap().is_none() {
            return;
        }
        for ran in [recorded, replayed] {
            assert_eq!(ran.code, Some(4), "{}", ran.stderr);
            let words = [
                " lost on the network and ",
                " of which both images were lost",
            ];
            assert_says(&ran.stderr, &words);
            assert!(!ran.stdout.contains("none lost"), "{}", ran.stdout);
        }
        let info = fixture.json("info run.mcap --json");
        // Two or three of each kind in 40 pairs.
        let missing = info["missing_pairs"].as_u64().unwrap();
        assert!(missing >= 4, "{missing}");
    });
}

#[cfg(unix)]
#[test]
fn subscribers_that_are_there_get_the_first_pair_of_a_recording() {
    let (prefix, domain) = (address(18, "/svl"), robot::domain(18));
    let fixture = Fixture::recorded();
    let until = format!("until={}", fixture.path("ended").display());
    let kinds = ["", "reliable"];
    std::thread::scope(|scope| {
        let readers = kinds.map(|kind| {
            let ready = fixture.path(&format!("ready{kind}"));
            let words = format!(
                "read {domain} /svl/points 99 600 ages {kind} {until} ready={}",
                ready.display()
            );
            let reader = scope.spawn(move || cyclone(&words));
            wait_for(|| ready.exists() || reader.is_finished());
            reader
        });
        let line = format!("replay run.mcap -v --speed 1 --publish {prefix}");
        let ran = fixture.svl(&line);
        fixture.write("ended", "");
        let [Some(best_effort), Some(reliable)] = readers.map(|reader| reader.join().unwrap())
        else {
            return;
        };
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        assert_says(&ran.stderr, &[" found"]);
        if !ran.stderr.contains("2 subscribers found") {
            skip("discovery takes longer than svl waits, on a machine under load");
            return;
        }
        let first = frames(&fixture, "run.mcap").next().unwrap().stamp_ns;
        for read in [best_effort, reliable] {
            assert_eq!(lines(&read)[0]["first_ns"].as_u64(), Some(first));
        }
    });
}

/// Each point of the cloud of all pixels is a pixel of the wall.
fn assert_dense(cloud: &serde_json::Value) {
    let points: Vec<[f64; 4]> = serde_json::from_value(cloud["points"].clone()).unwrap();
    let expected = serde_json::json!({
        "frame_id": "cam_left_optical_frame",
        "fields": ["x", "y", "z", "intensity"],
        "offsets": [0, 4, 8, 12],
        "counts": [1, 1, 1, 1],
        "steps": [16, 16 * points.len()],
        "size": [points.len(), 1],
        "is_bigendian": false,
        "dense": true,
    });
    for (field, value) in expected.as_object().unwrap() {
        assert_eq!(&cloud[field], value, "{field}");
    }
    let pixels = points.iter().filter(|[x, y, z, intensity]| {
        let [u, v] = [159.5 + 400.0 * x / z, 119.5 + 400.0 * y / z];
        let is_pixel = |at: f64, size: f64| (at - at.round()).abs() < 0.01 && at < size;
        is_pixel(u, 320.0) && is_pixel(v, 240.0) && intensity.fract() == 0.0 && *intensity < 256.0
    });
    assert_eq!(pixels.count(), points.len());
    let near = points.iter().filter(|[.., z, _]| (z - 2.5).abs() < 0.2);
    // Within 1.2 px; the pixels at the left edge have no partner.
    assert!(near.count() > 320 * 240 * 8 / 10, "{} points", points.len());
}

/// Number of pairs of a recording, all of which the other end sent.
fn recorded(fixture: &Fixture, name: &str, sent: &[u8]) -> usize {
    let sent: BTreeSet<(u64, Vec<u64>)> = lines(sent)
        .into_iter()
        .map(|line| serde_json::from_value(line).map(|Sent { stamp_ns, crc }| (stamp_ns, crc)))
        .collect::<Result<_, _>>()
        .unwrap();
    let mut pairs = 0;
    for frame in frames(fixture, name) {
        let crc = |image: &svl::stereo::Gray| {
            u64::from(crc32fast::hash(&image.pixels().collect::<Vec<u8>>()))
        };
        let crc = vec![crc(frame.pair.left()), crc(frame.pair.right())];
        assert!(sent.contains(&(frame.stamp_ns, crc)), "{}", frame.stamp_ns);
        pairs += 1;
    }
    pairs
}

fn frames(fixture: &Fixture, name: &str) -> impl Iterator<Item = svl::stereo::Frame> {
    let mut source = RecordingSource::open(fixture.path(name)).unwrap();
    std::iter::from_fn(move || source.next().unwrap())
}

#[derive(serde::Deserialize)]
struct Sent {
    stamp_ns: u64,
    crc: Vec<u64>,
}

fn lines(text: &[u8]) -> Vec<serde_json::Value> {
    let text = std::str::from_utf8(text).unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}
