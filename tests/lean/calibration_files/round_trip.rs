//! Calibrations written and read back in every format.

use super::*;
use crate::common::{assert_says, cases};
use proptest::prelude::*;

fn distortion() -> impl Strategy<Value = [f64; 5]> {
    (-0.5..0.5, -1.0..1.0, -0.01..0.01, -1e-9..1e-9, -1.0..1.0)
        .prop_map(|(k1, k2, p1, p2, k3)| [k1, k2, p1, p2, k3])
}

fn camera() -> impl Strategy<Value = Intrinsics> {
    (
        200.0..2000.0,
        0.9..1.1,
        200.0..500.0,
        150.0..400.0,
        distortion(),
    )
        .prop_map(|(fx, ratio, cx, cy, distortion)| {
            Intrinsics::new((752, 480), (fx, fx * ratio), (cx, cy), distortion).unwrap()
        })
}

fn calibrations() -> impl Strategy<Value = StereoCalibration> {
    let turns = prop::array::uniform6(-0.05..0.05f64);
    (camera(), camera(), turns, 0.01..2.0, any::<bool>()).prop_map(
        |(left, right, turns, baseline, metres)| {
            let unit = if metres {
                LengthUnit::Metres
            } else {
                LengthUnit::Squares
            };
            calibration(left, right, turns, baseline, unit)
        },
    )
}

/// The part of a calibration that a format can represent; `None` if it rejects the calibration.
fn held(format: &str, c: &StereoCalibration) -> Option<StereoCalibration> {
    let metres = c.unit() == LengthUnit::Metres;
    match format {
        "xml" | "opencv" => Some(c.clone()),
        "boofcv" => Some(unrectified(c)),
        "ros" | "kitti-raw" => c.rectification().filter(|_| metres).map(|_| c.clone()),
        _ => c.rectification().filter(|_| metres).map(|_| rectified(c)),
    }
}

proptest! {
    #![proptest_config(cases(64))]

    #[test]
    fn every_pair_of_formats_keeps_what_both_hold(c in calibrations(), keep in any::<bool>()) {
        let c = if keep { c } else { unrectified(&c) };
        let folder = Folder::new();
        for (first, _) in FILES {
            let Some(once) = held(first, &c) else {
                prop_assert!(folder.write(first, &c).is_err());
                continue;
            };
            let read = folder.through(first, &c);
            assert_same(&read, &once);
            for (second, _) in FILES {
                match held(second, &once) {
                    Some(twice) => assert_same(&folder.through(second, &read), &twice),
                    None => prop_assert!(folder.write(second, &read).is_err()),
                }
            }
        }
    }
}

#[test]
fn losses_of_a_format_are_reported() {
    let folder = Folder::new();
    for (format, word) in [
        ("boofcv", "rectification"),
        ("middlebury", "distortion"),
        ("kitti", "distortion"),
    ] {
        let left_out = folder.write(format, &raw()).unwrap();
        assert!(
            left_out.len() == 1 && left_out[0].contains(word),
            "{format}: {left_out:?}"
        );
        assert_eq!(
            folder.write(format, &rectified(&raw())).unwrap().len(),
            usize::from(format == "boofcv")
        );
    }
    for (format, word) in [
        ("ros", "has none"),
        ("middlebury", "no rectification"),
        ("kitti-raw", "no rectification"),
    ] {
        let error = folder
            .write(format, &unrectified(&raw()))
            .unwrap_err()
            .to_string();
        assert!(error.contains(word), "{format}: {error}");
    }
    let euroc = files::write_as(
        &folder.path("a.yaml,b.yaml"),
        files::format("euroc").unwrap(),
        &raw(),
    );
    assert_says(&euroc.unwrap_err().to_string(), &["read only"]);
}

#[test]
fn another_rectified_size_is_kept_or_refused() {
    let folder = Folder::new();
    let c = raw();
    let wide = Rectification {
        size: (800, 500),
        ..c.rectification().unwrap().clone()
    };
    let c = c.with_rectification(wide);
    for format in ["xml", "opencv", "kitti-raw"] {
        assert_same(&folder.through(format, &c), &c);
    }
    assert_says(
        &folder.write("ros", &c).unwrap_err().to_string(),
        &["one image size"],
    );
}

#[test]
fn extensions_choose_the_format() {
    let folder = Folder::new();
    let name = |file: &str| {
        files::written_as(&folder.path(file))
            .map(|f| f.name)
            .map_err(|e| e.to_string())
    };
    assert_eq!(name("a.xml").unwrap(), "xml");
    assert_eq!(name("a.yaml").unwrap(), "opencv");
    assert_eq!(name("a.yml").unwrap(), "opencv");
    assert_eq!(name("l.yaml,r.yaml").unwrap(), "ros");
    assert_says(
        &name("calib.txt").unwrap_err(),
        &["--to: middlebury, kitti, kitti-raw"],
    );
    assert_says(&name("calib.json").unwrap_err(), &["must end in"]);
}

#[test]
fn a_folder_holds_two_files() {
    let folder = Folder::new();
    files::write(folder.0.path(), &raw()).unwrap();
    assert!(folder.0.path().join("right.yaml").is_file());
    assert_same(&files::read(folder.0.path()).unwrap(), &raw());
}
