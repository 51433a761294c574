use super::*;
use crate::simulated::{Look, Rays, render};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use svl_core::stereo::Intrinsics;

fn camera() -> Intrinsics {
    let distortion = [-0.28, 0.09, 0.001, -0.0006, 0.01];
    Intrinsics::new((640, 480), (530.0, 532.0), (325.0, 236.0), distortion).unwrap()
}

/// The rays of [`camera`], whose computation takes longer than an image.
fn rays() -> &'static Rays {
    static RAYS: std::sync::LazyLock<Rays> = std::sync::LazyLock::new(|| Rays::new(&camera()));
    &RAYS
}

fn half_camera() -> Intrinsics {
    Intrinsics::new(
        (320, 240),
        (265.0, 266.0),
        (160.0, 119.0),
        [-0.28, 0.09, 0.0, 0.0, 0.0],
    )
    .unwrap()
}

/// The pose of a board centred at `(x, y, z)` squares, rotated by `angles`.
fn pose(board: &Board, at: [f64; 3], angles: [f64; 3]) -> Isometry3<f64> {
    let middle = Vector3::new((board.columns() - 1) as f64, (board.rows() - 1) as f64, 0.0) / 2.0;
    let turn = UnitQuaternion::from_euler_angles(angles[0], angles[1], angles[2]);
    Isometry3::from_parts(Translation3::from(Vector3::from(at) - turn * middle), turn)
}

fn truth(board: &Board, pose: &Isometry3<f64>) -> Vec<Point2<f64>> {
    board
        .corners()
        .map(|corner| camera().project(&(pose * corner)).unwrap())
        .collect()
}

const POSES: [([f64; 3], [f64; 3]); 8] = [
    ([0.0, 0.0, 14.0], [0.0, 0.0, 0.0]),
    ([-1.0, 1.0, 16.0], [0.5, 0.2, 0.3]),
    ([2.0, -1.0, 20.0], [-0.4, 0.6, -0.2]),
    ([0.0, 0.0, 12.0], [0.1, -0.3, 0.05]),
    ([3.5, 2.0, 17.0], [0.2, 0.7, 0.8]),
    ([-4.0, -2.5, 22.0], [-0.7, -0.3, 0.1]),
    ([0.0, 0.0, 28.0], [0.3, 0.3, -0.6]),
    ([-2.0, 0.5, 15.0], [0.0, 0.4, 0.0]),
];

/// Root mean square distance of found and true corners over all poses, and boards missed.
fn error_px(look: impl Fn(u64) -> Look) -> (f64, usize) {
    let board = Board::new((9, 6), None).unwrap();
    let mut detector = Detector::new(board).unwrap();
    let (mut sum, mut count, mut missed) = (0.0, 0, 0);
    for (i, (at, angles)) in (0..).zip(POSES) {
        let pose = pose(&board, at, angles);
        let image = render(rays(), &board, &[pose], &look(i), i).unwrap();
        match detector.find(&image, UPPER_LEFT) {
            Detection::Whole(sighting) => {
                for (found, truth) in sighting.corners.iter().zip(truth(&board, &pose)) {
                    sum += (found - truth).norm_squared();
                    count += 1;
                }
            }
            _ => missed += 1,
        }
    }
    ((sum / f64::from(count)).sqrt(), missed)
}

/// The limit is a tenth of a pixel at every noise level; the accuracy achieved is noted next to it.
#[test]
fn corners_are_exact_to_a_tenth_of_a_pixel_in_noise() {
    for (noise, bound_px) in [(0.0, 0.02), (2.0, 0.03), (5.0, 0.06), (10.0, 0.1)] {
        let (error, missed) = error_px(|_| Look {
            blur_px: 0.7,
            noise,
            shade: 0.4,
        });
        println!("noise {noise}: {error:.4} px, {missed} of 8 missed");
        assert!(error < bound_px, "noise {noise}: {error:.4} px");
        assert_eq!(missed, 0, "noise {noise}");
    }
}

const CLEAN: Look = Look {
    blur_px: 0.7,
    noise: 2.0,
    shade: 0.2,
};

fn look_at(board: &Board, asked: &Board, pose: Isometry3<f64>) -> Detection {
    let image = render(rays(), board, &[pose], &CLEAN, 1).unwrap();
    Detector::new(*asked).unwrap().find(&image, UPPER_LEFT)
}

#[test]
fn a_board_partly_outside_is_reported_with_its_edge() {
    let board = Board::new((9, 6), None).unwrap();
    let ways = [
        ([-1.0, 0.0], Edge::Left),
        ([1.0, 0.0], Edge::Right),
        ([0.0, -1.0], Edge::Top),
        ([0.0, 1.0], Edge::Bottom),
    ];
    for ([x, y], edge) in ways {
        let mut beyond = 0;
        for step in 0..6 {
            let far = f64::from(step);
            let pose = pose(
                &board,
                [x * (3.0 + far), y * (2.5 + far), 13.0],
                [0.1, 0.1, 0.05],
            );
            let inside = |p: &Point2<f64>| p.x > 0.0 && p.x < 639.0 && p.y > 0.0 && p.y < 479.0;
            let whole = truth(&board, &pose).iter().all(inside);
            match look_at(&board, &board, pose) {
                Detection::Whole(_) => assert!(whole, "{edge:?} {far}"),
                Detection::Part { beyond: Some(at) } => {
                    assert_eq!(at, edge);
                    beyond += 1;
                }
                _ => {}
            }
        }
        assert!(beyond >= 2, "{edge:?}: {beyond}");
    }
}

#[test]
fn a_board_of_another_size_is_reported() {
    let (board, asked) = (
        Board::new((7, 5), None).unwrap(),
        Board::new((9, 6), None).unwrap(),
    );
    let pose = pose(&board, [0.0, 0.0, 14.0], [0.2, 0.1, 0.3]);
    assert_eq!(
        look_at(&board, &asked, pose),
        Detection::Other { corners: (7, 5) }
    );
    // Part of a larger board is not the smaller one.
    let (board, asked) = (
        Board::new((9, 6), None).unwrap(),
        Board::new((8, 6), None).unwrap(),
    );
    assert_eq!(
        look_at(&board, &asked, pose),
        Detection::Other { corners: (9, 6) }
    );
}

/// Also on boards that can be read in several ways, the first corner is the same in both images.
#[test]
fn the_first_corner_is_the_same_in_both_images() {
    for sides in [(9, 6), (6, 9), (7, 5), (8, 6), (6, 6), (7, 7), (3, 4)] {
        let board = Board::new(sides, None).unwrap();
        let mut detector = PairDetector::new(board).unwrap();
        let camera = half_camera();
        let rays = Rays::new(&camera);
        for turn in 0..8 {
            // Chosen so that the two images' diagonals lie on both sides of the switching angle.
            let angle = (f64::from(turn) + 0.1) * std::f64::consts::TAU / 8.0;
            let image = |off: f64| {
                let pose = pose(&board, [off, 0.0, 22.0], [0.2, -0.1, angle + 0.03 * off]);
                let truth: Vec<_> = board
                    .corners()
                    .map(|corner| camera.project(&(pose * corner)).unwrap())
                    .collect();
                (render(&rays, &board, &[pose], &CLEAN, 1).unwrap(), truth)
            };
            let ((left, left_truth), (right, right_truth)) = (image(1.0), image(-1.0));
            let [Detection::Whole(left), Detection::Whole(right)] =
                detector.find(&StereoPair::new(left, right).unwrap())
            else {
                panic!("{sides:?} {turn}: not found");
            };
            let place = |corners: &[Point2<f64>], truth: &[Point2<f64>]| {
                truth
                    .iter()
                    .position(|truth| (truth - corners[0]).norm() < 1.0)
                    .unwrap()
            };
            let first = place(&left.corners, &left_truth);
            assert_eq!(
                first,
                place(&right.corners, &right_truth),
                "{sides:?} {turn}"
            );
            // One side even, the other odd: the colours determine the first corner.
            assert!(
                first == 0 || (sides.0 + sides.1) % 2 == 0,
                "{sides:?} {turn}: {first}"
            );
        }
    }
}

#[test]
fn small_and_blurred_boards_are_found() {
    let board = Board::new((9, 6), None).unwrap();
    let small = half_camera();
    let rays = Rays::new(&small);
    for (depth, blur_px) in [(14.0, 0.7), (25.0, 0.7), (36.0, 0.5), (14.0, 2.5)] {
        let pose = pose(&board, [0.5, 0.2, depth], [0.3, 0.2, 0.2]);
        let image = render(&rays, &board, &[pose], &Look { blur_px, ..CLEAN }, 1).unwrap();
        let Detection::Whole(sighting) = Detector::new(board).unwrap().find(&image, UPPER_LEFT)
        else {
            panic!("{depth} squares away, blur {blur_px} px: not found");
        };
        let truth = board
            .corners()
            .map(|corner| small.project(&(pose * corner)).unwrap());
        let worst = sighting
            .corners
            .iter()
            .zip(truth)
            .map(|(found, truth)| (found - truth).norm())
            .fold(0.0, f64::max);
        assert!(
            worst < 0.25,
            "{depth} squares away, blur {blur_px} px: {worst} px"
        );
        assert!(
            (sighting.blur_px - blur_px).abs() < 0.4,
            "{} {blur_px}",
            sighting.blur_px
        );
    }
}

#[test]
fn boards_out_of_focus_are_found() {
    let board = Board::new((9, 6), None).unwrap();
    let pose = pose(&board, [0.2, 0.1, 13.0], [0.1, 0.2, 0.1]);
    for blur_px in [3.0, 5.0] {
        let image = render(rays(), &board, &[pose], &Look { blur_px, ..CLEAN }, 1).unwrap();
        let Detection::Whole(sighting) = Detector::new(board).unwrap().find(&image, UPPER_LEFT)
        else {
            panic!("blur {blur_px} px: not found");
        };
        let off = sighting
            .corners
            .iter()
            .zip(truth(&board, &pose))
            .map(|(found, truth)| (found - truth).norm());
        let worst = off.fold(0.0, f64::max);
        assert!(worst < 0.4, "blur {blur_px} px: {worst} px");
        assert!(
            (sighting.blur_px / blur_px - 1.0).abs() < 0.2,
            "{} {blur_px}",
            sighting.blur_px
        );
    }
}

#[test]
fn images_without_a_board_of_any_size_have_no_detection() {
    let board = Board::new((3, 3), None).unwrap();
    let mut detector = Detector::new(board).unwrap();
    let mut random = fastrand::Rng::with_seed(1);
    for (width, height) in [(1, 1), (1, 300), (11, 11), (23, 40), (320, 240)] {
        for noise in [0, 255] {
            let pixels = (0..width * height)
                .map(|_| 90u8.saturating_add(random.u8(0..=noise)))
                .collect();
            let image = Gray::from_vec(width, height, pixels).unwrap();
            assert!(
                !matches!(detector.find(&image, UPPER_LEFT), Detection::Whole(_)),
                "{width}x{height}"
            );
        }
    }
}
