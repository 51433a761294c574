//! Rectification on real cameras: those of the data sets, by the calibrations that came with them.

mod common;

use common::{datasets, pair};
use nalgebra::{Matrix3, Vector3};
use svl::rectify::{AlignmentMeter, Epipolar, Framing, Rectifier, bouguet, matches, uncalibrated};
use svl::stereo::{Gray, Intrinsics, LengthUnit, StereoCalibration, StereoPair, motion};

/// A calibration with the rotations that OpenCV 5.0.0's `stereoRectify` makes of it, and its focal length at `alpha` 0.
struct Reference {
    calibration: StereoCalibration,
    turns: [Matrix3<f64>; 2],
    focal_px: f64,
}

type Numbers = ([f64; 4], [f64; 5]);

fn calibration(
    size: (usize, usize),
    [left, right]: [Numbers; 2],
    turn: [f64; 9],
    apart: [f64; 3],
    unit: LengthUnit,
) -> StereoCalibration {
    let camera = |([fx, fy, cx, cy], lens): Numbers| Intrinsics::new(size, (fx, fy), (cx, cy), lens).unwrap();
    let motion = motion(&Matrix3::from_row_slice(&turn), Vector3::from(apart)).unwrap();
    StereoCalibration::new(camera(left), camera(right), motion, unit).unwrap()
}

/// euroc-v1_01_easy/reference_rectification_opencv.yml.
#[rustfmt::skip]
fn euroc() -> Reference {
    Reference {
        calibration: calibration(
            (752, 480),
            [
                ([458.654, 457.296, 367.215, 248.375], [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0.0]),
                ([457.587, 456.134, 379.999, 255.238], [-0.28368365, 0.07451284, -0.00010473, -3.555907e-05, 0.0]),
            ],
            [
                0.99999725647788118, 0.0023120671924238864, 0.0003760081024155938,
                -0.0023171357232812354, 0.99989804850664377, 0.014089835846648196,
                -0.0003433931205241621, -0.01409066845271459, 0.99990066263772825,
            ],
            [-0.11007380812718678, 0.00039912154701414806, -0.00085370250335804494],
            LengthUnit::Metres,
        ),
        turns: [
            Matrix3::new(
                0.99996634753003255, -0.0014227391387192799, 0.0080795804834897181,
                0.001365741834640079, 0.99997417608948469, 0.0070556291992581923,
                -0.0080894101569363702, -0.0070443571388358207, 0.99994246758291716,
            ),
            Matrix3::new(
                0.99996335261943714, -0.0036258118715556003, 0.0077554436602303286,
                0.0036803985472554446, 0.99996847527716293, -0.0070358452512248419,
                -0.0077296885207801249, 0.0070641305295067727, 0.99994517348464351,
            ),
        ],
        focal_px: 436.24429564710198,
    }
}

#[test]
fn try_it() {
    let Some(folder) = datasets() else { return };
    let index = std::fs::read_to_string(folder.join("index.tsv")).unwrap();
    for line in index.lines().skip(1) {
        let fields: Vec<_> = line.split('\t').collect();
        let pair = pair(&folder.join(fields[0]), fields[1], fields[2]);
        let began = std::time::Instant::now();
        let mut meter = AlignmentMeter::new();
        meter.add(&pair);
        let all = matches(&pair).len();
        println!(
            "{:30} {:?} {:5} {:.0?} ",
            fields[0],
            meter.alignment().map(|a| (a.matches, a.median_abs_px, a.p90_abs_px, a.median_px)),
            all,
            began.elapsed() / 2
        );
    }
    let names: Vec<String> = {
        let mut n: Vec<_> = std::fs::read_dir(folder.join("euroc-v1_01_easy/mav0/cam0/data"))
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        n.sort();
        n
    };
    let rectifier = Rectifier::new(&euroc().calibration).unwrap();
    println!("{:?} {:?}", rectifier.rig(), euroc().focal_px);
    let (mut raw, mut rect) = (AlignmentMeter::new(), AlignmentMeter::new());
    for name in &names {
        let f = folder.join("euroc-v1_01_easy/mav0");
        let p = pair(&f, &format!("cam0/data/{name}"), &format!("cam1/data/{name}"));
        raw.add(&p);
        let (mut l, mut r) = (Gray::filled(1, 1, 0).unwrap(), Gray::filled(1, 1, 0).unwrap());
        rectifier.apply(&p, &mut l, &mut r).unwrap();
        rect.add(&StereoPair::new(l, r).unwrap());
    }
    println!("raw {:?}\nrect {:?}", raw.alignment(), rect.alignment());
    let h = uncalibrated(raw.matches(), (752, 480), &Framing::default()).unwrap();
    println!("{h:?}");
    let _ = (Epipolar::of(&[], 1.0), bouguet(&euroc().calibration, &Framing::default()), euroc().turns);
}
