//! Refused calibrations: the message is one line with the remedy; nothing panics.

use super::simulated::{Simulated, Spoil};
use crate::common::cases;
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use proptest::prelude::*;
use svl_calibrate::{Board, StereoView, solve};
use svl_core::stereo::DistortionModel;

const SIZE: (usize, usize) = (640, 480);

fn board() -> Board {
    Board::new((9, 6), Some(0.025)).unwrap()
}

/// The view of two pinholes 10 cm apart of a board in a pose, with a little deterministic noise.
fn view(place: Vector3<f64>, turn: Vector3<f64>) -> StereoView {
    let pose = Isometry3::new(place, turn);
    let noise = |i: usize, k: usize| 0.1 * ((i * 7919 + k * 104_729) % 1000) as f64 / 500.0 - 0.1;
    let image = |x: f64| {
        let pixel = |(i, point): (usize, Point3<f64>)| {
            let p = pose * (point - Vector3::new(0.1, 0.0625, 0.0));
            let salt = (place.norm() * 1e6) as usize;
            Point2::new(
                500.0 * (p.x - x) / p.z + 319.5 + noise(i, salt),
                500.0 * p.y / p.z + 239.5 + noise(i + 99, salt),
            )
        };
        board().corners().enumerate().map(pixel).collect()
    };
    StereoView {
        left: image(0.0),
        right: image(0.1),
    }
}

fn message(views: &[StereoView]) -> String {
    let message = solve(&board(), SIZE, DistortionModel::PlumbBob, views)
        .unwrap_err()
        .to_string();
    assert!(!message.contains('\n'), "{message}");
    message
}

fn places() -> impl Iterator<Item = Vector3<f64>> {
    (0..10).map(|i| {
        Vector3::new(
            0.05 + 0.02 * f64::from(i % 3),
            0.02 * f64::from(i % 4) - 0.03,
            0.6 + 0.04 * f64::from(i),
        )
    })
}

#[test]
fn parallel_boards_need_tilt() {
    for turn in [Vector3::zeros(), Vector3::new(0.4, 0.3, 0.0)] {
        let views: Vec<_> = places().map(|place| view(place, turn)).collect();
        let message = message(&views);
        assert!(message.contains("tilt"), "{message}");
    }
}

#[test]
fn a_repeated_pose_needs_tilt() {
    let views = vec![view(Vector3::new(0.05, 0.0, 0.6), Vector3::new(0.1, 0.2, 0.0)); 8];
    let message = message(&views);
    assert!(message.contains("tilt"), "{message}");
}

#[test]
fn too_few_views() {
    assert!(message(&[]).contains("at least 3"));
    let two = [
        view(Vector3::z() * 0.6, Vector3::x() * 0.5),
        view(Vector3::z() * 0.6, Vector3::y() * 0.5),
    ];
    assert!(message(&two).contains("2 of 2 views"));
}

#[test]
fn not_numbers_lines_and_points_are_refused() {
    let good: Vec<_> = places()
        .zip([(0.5, 0.0), (0.0, 0.5), (-0.5, 0.1), (0.2, -0.5), (0.4, 0.4)])
        .collect();
    let mut views: Vec<_> = good
        .into_iter()
        .map(|(place, (x, y))| view(place, Vector3::new(x, y, 0.0)))
        .collect();
    let mut not_finite = views[0].clone();
    not_finite.left[7].x = f64::NAN;
    let mut far = views[1].clone();
    far.right[0].y = 1e300;
    let mut line = views[2].clone();
    line.left.iter_mut().for_each(|p| p.y = 100.0);
    let mut point = views[3].clone();
    point
        .right
        .iter_mut()
        .for_each(|p| *p = Point2::new(5.0, 5.0));
    views.extend([not_finite, far, line, point]);
    let solution = solve(&board(), SIZE, DistortionModel::PlumbBob, &views).unwrap();
    let reasons: Vec<_> = solution.refused().collect();
    assert_eq!(
        reasons.iter().map(|(id, _)| *id).collect::<Vec<_>>(),
        [5, 6, 7, 8]
    );
    assert!(
        reasons[0].1.contains("outside") && reasons[2].1.contains("line"),
        "{reasons:?}"
    );
    views.drain(..5);
    views.extend_from_within(..2);
    let message = message(&views);
    assert!(
        message.contains("view 1: corner 8 is outside the left image"),
        "{message}"
    );
    assert!(message.contains("and 1 more"), "{message}");
}

#[test]
fn a_view_of_another_board_and_an_image_of_nothing() {
    let mut views: Vec<_> = places()
        .map(|place| view(place, Vector3::x() * 0.3))
        .collect();
    views[3].right.pop();
    let message = message(&views);
    assert!(
        message.contains("view 4") && message.contains("53"),
        "{message}"
    );
    views.truncate(3);
    assert!(solve(&board(), (0, 0), DistortionModel::PlumbBob, &views).is_err());
}

#[test]
fn swapped_cameras_are_reported() {
    let simulated = Simulated::new(DistortionModel::PlumbBob, 2, Some(0.2), 0);
    let views: Vec<_> = simulated
        .views
        .into_iter()
        .map(|StereoView { left, right }| StereoView {
            left: right,
            right: left,
        })
        .collect();
    let size = simulated.truth.left().size();
    let message = solve(&simulated.board, size, DistortionModel::PlumbBob, &views)
        .unwrap_err()
        .to_string();
    assert!(message.contains("swap left and right"), "{message}");
}

#[test]
fn reasons_describe_what_happened() {
    let (mut reversed, mut slipped) = (0, 0);
    for seed in 0..20 {
        let simulated = Simulated::new(DistortionModel::PlumbBob, seed, Some(0.3), 2);
        let solution = solve(
            &simulated.board,
            simulated.truth.left().size(),
            DistortionModel::PlumbBob,
            &simulated.views,
        )
        .unwrap();
        for (id, reason) in solution.refused() {
            match simulated.spoilt[id] {
                Some(Spoil::Reversed) => {
                    reversed += 1;
                    assert!(reason.contains("numbered from another end"), "{reason}");
                }
                Some(Spoil::Slipped) => {
                    slipped += 1;
                    assert!(reason.contains("slipped by ("), "{reason}");
                }
                Some(Spoil::Garbage) => assert!(reason.contains("order"), "{reason}"),
                _ => {}
            }
        }
    }
    assert!(reversed > 2 && slipped > 2, "{reversed} {slipped}");
}

proptest! {
    #![proptest_config(cases(200))]

    #[test]
    fn nothing_panics(
        numbers in prop::collection::vec(
            prop_oneof![
                8 => 0.0..640.0,
                1 => Just(f64::NAN),
                1 => Just(f64::INFINITY),
                1 => Just(-1e308),
                2 => Just(100.0),
            ],
            5 * 2 * 9 * 2,
        ),
        clean in any::<bool>(),
    ) {
        let board = Board::new((3, 3), None).unwrap();
        let number = |v: &f64| if clean && !v.is_finite() { 17.0 } else { *v };
        let points = numbers.chunks(2).map(|p| Point2::new(number(&p[0]), number(&p[1])));
        let points = points.collect::<Vec<_>>();
        let view = |v: &[Point2<f64>]| {
            let (left, right) = (v[..9].to_vec(), v[9..].to_vec());
            StereoView { left, right }
        };
        let views = points.chunks(18).map(view).collect::<Vec<_>>();
        if let Ok(solution) = solve(&board, SIZE, DistortionModel::PlumbBob, &views) {
            let shown = format!("{solution:?}");
            prop_assert!(!shown.contains("NaN"));
        }
    }
}
