//! Board detection on real chessboards, and on real images without one.

use crate::common;
use nalgebra::Vector2;
use svl::calibrate::choose::Chooser;
use svl::calibrate::detect::{Detection, Detector, PairDetector};
use svl::calibrate::{Board, solve};
use svl::report::calibration;
use svl::report::table::TerminalStyle;
use svl::stereo::DistortionModel;

const NUMBERS: [u32; 13] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14];

/// OpenCV 5.0.0 from its own corners: `calibration-chessboard/reference_opencv.yml`.
const OPENCV_RMS_PX: f64 = 0.217;
const OPENCV_FX: [f64; 2] = [532.83, 537.45];
const OPENCV_BASELINE: f64 = 3.3282;

#[test]
fn opencvs_own_pictures_calibrate_no_worse_than_with_opencv() {
    let Some(folder) = common::datasets()
        .map(|d| d.join("calibration-chessboard"))
        .filter(|d| d.is_dir())
    else {
        return;
    };
    let board = Board::new((9, 6), None).unwrap();
    let mut detector = PairDetector::new(board).unwrap();
    let mut chooser = Chooser::new(board, (640, 480));
    for number in NUMBERS {
        let pair = common::pair(
            &folder,
            &format!("left{number:02}.jpg"),
            &format!("right{number:02}.jpg"),
        );
        let seen = detector.find(&pair);
        assert!(
            seen.iter().all(|seen| matches!(seen, Detection::Whole(_))),
            "{number}: {seen:?}"
        );
        match chooser.judge(None, &seen) {
            Ok(view) => chooser.keep(view),
            Err(refusal) => println!("{number}: {refusal}"),
        }
    }
    assert!(chooser.views.len() >= 12, "{}", chooser.views.len());
    let solution = solve(
        &board,
        (640, 480),
        DistortionModel::PlumbBob,
        &chooser.views,
    )
    .unwrap();
    let style = TerminalStyle::plain(100);
    println!("{}", calibration::terminal(&solution, style));
    assert!(solution.rms_px < OPENCV_RMS_PX, "{}", solution.rms_px);
    for (camera, fx) in [&solution.left, &solution.right].into_iter().zip(OPENCV_FX) {
        assert!(
            (camera.parameters.get("fx").unwrap().value / fx - 1.0).abs() < 0.005,
            "{:?}",
            camera.parameters
        );
    }
    assert!(
        (solution.baseline.value / OPENCV_BASELINE - 1.0).abs() < 0.005,
        "{}",
        solution.baseline.value
    );
}

#[test]
fn pictures_without_a_board_show_none() {
    let Some(folder) = common::datasets() else {
        return;
    };
    let Ok(index) = std::fs::read_to_string(folder.join("index.tsv")) else {
        return;
    };
    let mut detectors =
        [(9, 6), (4, 3)].map(|sides| Detector::new(Board::new(sides, None).unwrap()).unwrap());
    let mut images = 0;
    for line in index.lines().skip(1).step_by(common::step(1)) {
        let mut fields = line.split('\t');
        let [Some(scene), Some(left), Some(right)] = [fields.next(), fields.next(), fields.next()]
        else {
            continue;
        };
        let pair = common::pair(&folder.join(scene), left, right);
        for image in [pair.left(), pair.right()] {
            images += 1;
            for detector in &mut detectors {
                let seen = detector.find(image, Vector2::new(1.0, 1.0));
                assert!(!matches!(seen, Detection::Whole(_)), "{scene}: {seen:?}");
            }
        }
    }
    assert!(images >= 50 / common::step(1), "{images}");
}
