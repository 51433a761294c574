//! Calibrations written and read back in every format.

use super::*;
use crate::common::{assert_says, cases};
use proptest::prelude::*;

/// Lenses of each model that do not fold, one model for both cameras.
fn lenses() -> impl Strategy<Value = [Distortion; 2]> {
    let coefficients = || prop::collection::vec(0.0..0.3, 14);
    let counts = prop::sample::select(vec![
        (DistortionModel::PlumbBob, 4),
        (DistortionModel::PlumbBob, 5),
        (DistortionModel::RationalPolynomial, 8),
        (DistortionModel::RationalPolynomial, 12),
        (DistortionModel::RationalPolynomial, 14),
        (DistortionModel::Equidistant, 4),
    ]);
    (counts, coefficients(), coefficients()).prop_map(|((model, count), left, right)| {
        [left, right].map(|mut all: Vec<f64>| {
            // The denominator stays far below the numerator.
            for small in all.iter_mut().skip(5) {
                *small *= 1e-3;
            }
            model.with_coefficients(&all[..count]).unwrap()
        })
    })
}

fn camera() -> impl Strategy<Value = Intrinsics> {
    (200.0..2000.0, 0.9..1.1, 200.0..500.0, 150.0..400.0).prop_map(|(fx, ratio, cx, cy)| {
        Intrinsics::new((752, 480), (fx, fx * ratio), (cx, cy), Distortion::NONE).unwrap()
    })
}

fn calibrations() -> impl Strategy<Value = StereoCalibration> {
    let turns = prop::array::uniform6(-0.05..0.05f64);
    (
        camera(),
        camera(),
        lenses(),
        turns,
        0.01..2.0,
        any::<bool>(),
    )
        .prop_map(|(left, right, lenses, turns, baseline, metres)| {
            let with = |camera: Intrinsics, lens: Distortion| {
                let (size, focal, center) = (camera.size(), camera.focal_px(), camera.center_px());
                Intrinsics::new(size, focal, center, lens).unwrap()
            };
            let (left, right) = (with(left, lenses[0]), with(right, lenses[1]));
            let unit = if metres {
                LengthUnit::Metres
            } else {
                LengthUnit::Squares
            };
            calibration(left, right, turns, baseline, unit)
        })
}

/// The part of a calibration that a format can represent; `None` if it rejects the calibration.
fn held(format: &str, c: &StereoCalibration) -> Option<StereoCalibration> {
    let metres = c.unit() == LengthUnit::Metres;
    let is_kalibr = [c.left(), c.right()]
        .iter()
        .all(|camera| match camera.distortion() {
            Distortion::PlumbBob([.., k3]) => *k3 == 0.0,
            other => other.model() == DistortionModel::Equidistant,
        });
    match format {
        "xml" | "opencv" => Some(c.clone()),
        "kalibr" => (metres && is_kalibr).then(|| unrectified(c)),
        "ros" => c.rectification().filter(|_| metres).map(|_| c.clone()),
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
        ("kalibr", "rectification"),
        ("middlebury", "distortion"),
        ("kitti", "distortion"),
    ] {
        let left_out = folder.write(format, &sample(format)).unwrap();
        assert!(
            left_out.len() == 1 && left_out[0].contains(word),
            "{format}: {left_out:?}"
        );
        assert_eq!(
            folder.write(format, &rectified(&raw())).unwrap().len(),
            usize::from(format == "kalibr")
        );
    }
    let k3 = folder.write("kalibr", &raw()).unwrap_err().to_string();
    assert_says(&k3, &["radtan k1 k2 p1 p2", "plumb_bob with 5", "--to"]);
    for (format, word) in [("ros", "has none"), ("middlebury", "no rectification")] {
        let error = folder
            .write(format, &unrectified(&raw()))
            .unwrap_err()
            .to_string();
        assert!(error.contains(word), "{format}: {error}");
    }
    for (format, file) in [("euroc", "a.yaml,b.yaml"), KITTI_RAW] {
        let format = files::format(format).unwrap();
        let written = files::write_as(&folder.path(file), format, &raw(), Path::to_owned);
        assert_says(&written.unwrap_err().to_string(), &["read only"]);
    }
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
    for format in ["xml", "opencv"] {
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
        &["--to: middlebury, kitti"],
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
