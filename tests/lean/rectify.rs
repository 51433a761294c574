//! Rectification of the data sets' real cameras with their own calibrations.

use crate::common::{datasets, pair};
use nalgebra::{Matrix3, Vector3};
use svl_core::rectify::{Alignment, AlignmentMeter, Framing, Rectifier, bouguet};
use svl_core::stereo::{Gray, Intrinsics, LengthUnit, StereoCalibration, StereoPair, motion};

/// A calibration with the rotations of OpenCV 5.0.0's `stereoRectify`, and its focal length at
/// `alpha` 0.
struct Reference {
    calibration: StereoCalibration,
    rotations: [Matrix3<f64>; 2],
    focal_px: f64,
}

type Numbers = ([f64; 4], [f64; 5]);

fn calibration(
    size: (usize, usize),
    [left, right]: [Numbers; 2],
    rotation: [f64; 9],
    translation: [f64; 3],
    unit: LengthUnit,
) -> StereoCalibration {
    let camera = |([fx, fy, cx, cy], distortion): Numbers| {
        Intrinsics::new(size, (fx, fy), (cx, cy), distortion).unwrap()
    };
    let motion = motion(
        &Matrix3::from_row_slice(&rotation),
        Vector3::from(translation),
    )
    .unwrap();
    StereoCalibration::new(camera(left), camera(right), motion, unit).unwrap()
}

/// euroc-v1_01_easy/reference_rectification_opencv.yml.
#[rustfmt::skip]
fn euroc() -> Reference {
    Reference {
        calibration: calibration(
            (752, 480),
            [
                (
                    [458.654, 457.296, 367.215, 248.375],
                    [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0.0],
                ),
                (
                    [457.587, 456.134, 379.999, 255.238],
                    [-0.28368365, 0.07451284, -0.00010473, -3.555907e-05, 0.0],
                ),
            ],
            [
                0.9999972564778812, 0.0023120671924238864, 0.0003760081024155938,
                -0.0023171357232812354, 0.9998980485066438, 0.014089835846648196,
                -0.0003433931205241621, -0.01409066845271459, 0.9999006626377283,
            ],
            [-0.11007380812718678, 0.00039912154701414806, -0.0008537025033580449],
            LengthUnit::Metres,
        ),
        rotations: [
            Matrix3::new(
                0.9999663475300326, -0.0014227391387192799, 0.008079580483489718,
                0.001365741834640079, 0.9999741760894847, 0.007055629199258192,
                -0.00808941015693637, -0.007044357138835821, 0.9999424675829172,
            ),
            Matrix3::new(
                0.9999633526194371, -0.0036258118715556003, 0.007755443660230329,
                0.0036803985472554446, 0.9999684752771629, -0.007035845251224842,
                -0.007729688520780125, 0.007064130529506773, 0.9999451734846435,
            ),
        ],
        focal_px: 436.244295647102,
    }
}

/// calibration-chessboard/reference_opencv.yml.
#[rustfmt::skip]
fn chessboard() -> Reference {
    Reference {
        calibration: calibration(
            (640, 480),
            [
                (
                    [532.8272227477366, 532.9459873112339, 342.48682246161326, 233.8557426682177],
                    [
                        -0.28088218761062583, 0.025178964545986057, 0.0012165000934142934,
                        -0.00013551769990920287, 0.16343305509208755,
                    ],
                ),
                (
                    [537.4531475621111, 536.9690430958763, 327.5856606126764, 248.88187558235168],
                    [
                        -0.297547000323466, 0.14967883087644943, -0.0007597561163467401,
                        0.00032645391998765993, -0.06601221564834957,
                    ],
                ),
            ],
            [
                0.9999853908559561, 0.003768074832358345, 0.003875524057286176,
                -0.0037414948727018246, 0.9999695871553413, -0.006842951153833625,
                -0.0039011909435968696, 0.006828350930785164, 0.9999690766882682,
            ],
            [-3.3279810404554335, 0.03724411774878666, 0.01445687200543935],
            LengthUnit::Squares,
        ),
        rotations: [
            Matrix3::new(
                0.9999721573493703, -0.007451915383024056, -0.00039176928228955993,
                0.007450535706452402, 0.9999664217536528, -0.00341245994592209,
                0.00041718549012904806, 0.0034094460429656315, 0.9999941007995732,
            ),
            Matrix3::new(
                0.9999279509259976, -0.011190398590578677, -0.004343723784922365,
                0.011205150096896026, 0.9999314850857841, 0.00338670126294326,
                0.0043055276380203015, -0.00343512933124286, 0.9999848310440693,
            ),
        ],
        focal_px: 515.9419667854827,
    }
}

/// bumblebee2-raw/stereo.yaml, its motion inverted; rectified with OpenCV for this test.
#[rustfmt::skip]
fn bumblebee() -> Reference {
    Reference {
        calibration: calibration(
            (640, 480),
            [
                (
                    [524.6141554796689, 526.9202267407102, 312.4508572809385, 247.40163214599613],
                    [-0.3625365821238732, 0.17532754393079863, 0.0, 0.0, 0.0],
                ),
                (
                    [526.437309515818, 528.6524795626539, 318.40405668073225, 245.93504188705572],
                    [-0.35299970494414057, 0.16297446727663975, 0.0, 0.0, 0.0],
                ),
            ],
            [
                0.9999694757041413, 0.002144760822245101, -0.007513165844052039,
                -0.002167658916924345, 0.9999930270271246, -0.003040913011953583,
                0.007506591423858594, 0.0030571061711613945, 0.999967152054033,
            ],
            [-0.12004887740083396, -0.0006400040220990794, 1.106536192457797e-5],
            LengthUnit::Metres,
        ),
        rotations: [
            Matrix3::new(
                0.9999430134207418, 0.00747553099112463, -0.00762143998515532,
                -0.00748706572031586, 0.9999708673251835, -0.00148605108255943,
                0.00761010893130053, 0.00154302861964392, 0.9999698521979213,
            ),
            Matrix3::new(
                0.9999857852329324, 0.0053311196110090815, -9.217249567628144e-5,
                -0.005330973895041431, 0.999984642912294, 0.001514812497326887,
                0.00010024672678668684, -0.0015142995954518063, 0.9999988484230014,
            ),
        ],
        focal_px: 494.13216282702604,
    }
}

/// Rotations are equal. Focal lengths are not, as OpenCV fixes the centre first: ours are shorter
/// by up to 5 %, so that more of the images is kept while every pixel is still valid.
#[test]
fn rotations_are_those_of_opencv() {
    for Reference {
        calibration,
        rotations,
        focal_px,
    } in [euroc(), chessboard(), bumblebee()]
    {
        let found = bouguet(&calibration, &Framing::default()).unwrap();
        assert!(
            (found.left.matrix() - rotations[0]).amax() < 1e-6
                && (found.right.matrix() - rotations[1]).amax() < 1e-6
        );
        let ratio = found.rig.focal_px() / focal_px;
        assert!(
            (0.95..1.0).contains(&ratio),
            "{} px, OpenCV {focal_px} px",
            found.rig.focal_px()
        );
        assert_eq!(Rectifier::new(&calibration).unwrap().outside(), 0.0);
        let all = bouguet(
            &calibration,
            &Framing {
                alpha: 1.0,
                size: None,
            },
        )
        .unwrap();
        assert!(all.rig.focal_px() < found.rig.focal_px());
        let outside = Rectifier::new(&calibration.with_rectification(all))
            .unwrap()
            .outside();
        assert!((0.01..0.4).contains(&outside), "{outside}");
    }
}

fn rectified(rectifier: &Rectifier, pair: &StereoPair) -> StereoPair {
    let [mut left, mut right] = [(); 2].map(|()| Gray::filled(1, 1, 0).unwrap());
    rectifier.apply(pair, &mut left, &mut right).unwrap();
    StereoPair::new(left, right).unwrap()
}

/// The misalignment of these pairs.
fn measured(pairs: impl IntoIterator<Item = StereoPair>) -> Alignment {
    let mut meter = AlignmentMeter::new();
    pairs.into_iter().for_each(|pair| meter.add(&pair));
    meter.alignment().unwrap()
}

/// Raw pairs are misaligned by at most `good_px` after rectification by their calibration (OpenCV's
/// SIFT finds the same).
fn becomes_aligned(pairs: &[StereoPair], reference: &Reference, raw_px: f64, good_px: f64) {
    let raw = measured(pairs.iter().cloned());
    assert!((raw.median_abs_px - raw_px).abs() < 0.8, "{raw:?}");
    let rectifier = Rectifier::new(&reference.calibration).unwrap();
    let by_calibration = measured(pairs.iter().map(|pair| rectified(&rectifier, pair)));
    assert!(
        by_calibration.median_abs_px <= good_px,
        "{by_calibration:?}"
    );
    assert!(by_calibration.matches > 300, "{by_calibration:?}");
    println!(
        "raw {:.2}, calibrated {:.3} px",
        raw.median_abs_px, by_calibration.median_abs_px
    );
}

#[test]
fn euroc_becomes_aligned() {
    let Some(folder) = datasets().map(|folder| folder.join("euroc-v1_01_easy/mav0")) else {
        return;
    };
    let images = std::fs::read_dir(folder.join("cam0/data"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name());
    let mut names: Vec<_> = images.map(|name| name.into_string().unwrap()).collect();
    names.sort();
    let pairs: Vec<_> = names
        .iter()
        .map(|n| {
            pair(
                &folder,
                &format!("cam0/data/{n}"),
                &format!("cam1/data/{n}"),
            )
        })
        .collect();
    becomes_aligned(&pairs, &euroc(), 12.9, 0.15);
}

#[test]
fn bumblebee_becomes_aligned() {
    let Some(folder) = datasets().map(|folder| folder.join("bumblebee2-raw")) else {
        return;
    };
    let pairs =
        ["chair01", "garden01"].map(|scene| pair(&folder.join(scene), "im0.jpg", "im1.jpg"));
    becomes_aligned(&pairs, &bumblebee(), 3.2, 0.25);
}

#[test]
fn rectified_data_sets_raise_no_alarm() {
    let Some(folder) = datasets() else { return };
    let index = std::fs::read_to_string(folder.join("index.tsv")).unwrap();
    let mut told = 0;
    for line in index.lines().skip(1) {
        let [scene, left, right, ..] = line.split('\t').collect::<Vec<_>>()[..] else {
            panic!("{line}")
        };
        let mut meter = AlignmentMeter::new();
        meter.add(&pair(&folder.join(scene), left, right));
        let Some(alignment) = meter.alignment() else {
            continue;
        };
        println!(
            "{scene} {} {:.2}",
            alignment.matches, alignment.median_abs_px
        );
        assert!(!alignment.is_off(), "{scene}: {alignment:?}");
        told += 1;
    }
    assert!(told >= 25, "{told} scenes have texture enough to tell");
}
