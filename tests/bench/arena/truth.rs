//! True disparities and visibility against an independent implementation of their formulas.

use super::{ball, empty, ray, seen};
use nalgebra::Vector3;
use svl::arena::{Arena, ArenaConfig, Ball, Block, Waypoint};
use svl::stereo::Visibility;

/// Entry of `origin + t * direction` into a sphere.
fn enter_sphere(origin: Vector3<f64>, direction: Vector3<f64>, ball: &Ball) -> Option<f64> {
    let from = origin - Vector3::new(ball.at_m[0], ball.at_m[1], ball.height_m);
    let (a, b) = (direction.norm_squared(), from.dot(&direction));
    let root = b * b - a * (from.norm_squared() - ball.radius_m * ball.radius_m);
    (root > 0.0).then(|| (-b - root.sqrt()) / a)
}

#[test]
fn a_wall_straight_ahead_has_the_disparity_of_its_distance() {
    let arena = Arena::new(&empty(), 1).unwrap();
    for index in [0, 5, 10] {
        let frame = arena.frame(index).unwrap();
        let distance = 3.0 - (0.5 + index as f64 / 11.0);
        let focal = 160.0 / 26f64.to_radians().tan();
        let truth = &frame.truth.as_ref().unwrap().disparity;
        let disparity = truth.get(160, 119);
        assert!(
            (f64::from(disparity) - focal * 0.044 / distance).abs() < 1e-4,
            "{disparity} at {distance} m"
        );
        // The wall is 20 cm high and the camera 7 cm above the floor.
        let rows_above = (focal * 0.13 / distance) as usize;
        assert!((truth.get(160, 120 - rows_above) - disparity).abs() < 1e-4);
        assert!(
            truth.get(160, 117 - rows_above) < 0.7 * disparity,
            "the room is farther"
        );
    }
}

#[test]
fn rays_along_an_axis_meet_what_stands_on_it_and_nothing_beside_it() {
    let mut config = empty();
    // Odd sides: the ray of the centre has no component across.
    (config.rig.width_px, config.rig.height_px) = (65, 49);
    config.robot.path = vec![
        Waypoint {
            at_m: [0.5, 1.0],
            heading_deg: 0.0,
        },
        Waypoint {
            at_m: [1.0, 1.0],
            heading_deg: 0.0,
        },
    ];
    for at_m in [[1.3, 1.5], [1.3, 0.5]] {
        let (name, size_m) = ("beside".into(), [0.2, 0.2, 0.3]);
        config.world.blocks.push(Block {
            name,
            at_m,
            size_m,
            above_floor_m: 0.0,
            heading_deg: 0.0,
        });
    }
    let frame = Arena::new(&config, 1).unwrap().frame(0).unwrap();
    let (depth, point) = seen(&frame, 32, 24);
    assert!(
        (depth - 1.5).abs() < 1e-5 && (point.x - 2.0).abs() < 1e-5,
        "{depth} m, {point}"
    );
}

#[test]
fn floor_and_ball_lie_where_their_equations_say() {
    let mut config = ArenaConfig {
        frames: 40,
        ..empty()
    };
    // A pose with non-zero rotations about all axes.
    (
        config.robot.yaw_sway_deg,
        config.robot.roll_sway_deg,
        config.robot.pitch_sway_deg,
    ) = (4.0, 5.0, 2.0);
    // Next to the path, which it may not touch.
    let ball = Ball {
        at_m: [1.15, 1.2],
        ..ball()
    };
    config.world.balls = vec![ball.clone()];
    let frame = Arena::new(&config, 4).unwrap().frame(3).unwrap();
    let (rig, pose) = (frame.rig().unwrap(), frame.pose.unwrap());
    let right = pose.translation.vector + pose.rotation * Vector3::x() * rig.baseline_m();
    let visibility = frame.truth.as_ref().unwrap().visibility.as_ref().unwrap();
    let (mut on_ball, mut on_floor, mut hidden) = (0, 0, 0);
    for (x, y) in (0..240).flat_map(|y| (0..320).map(move |x| (x, y))) {
        let (depth, point) = seen(&frame, x, y);
        let on = enter_sphere(pose.translation.vector, ray(rig, &pose, x, y), &ball);
        if let Some(t) = on {
            let (expected, got) = (rig.disparity_px(t), rig.disparity_px(depth));
            assert!(
                (expected - got).abs() < 5e-3,
                "({x}, {y}): {got} px instead of {expected}"
            );
            on_ball += 1;
        } else if point.z < 0.001 && point.y < 2.99 && (0.01..1.99).contains(&point.x) {
            assert!(point.z.abs() < 1e-5, "{point}");
            on_floor += 1;
        }
        // Visibility of the point in the right camera, from the ball's equation and the image's
        // border. Skipped where either is touched, and above the walls, which occlude some of the
        // laboratory.
        let right_x = x as f64 - rig.disparity_px(depth);
        let before = enter_sphere(right, point - right, &ball).unwrap_or(f64::INFINITY);
        if point.z < 0.199 && (right_x + 0.5).abs() > 0.01 && !(0.99..0.9999).contains(&before) {
            let expected = if right_x > -0.5 && before > 0.99 {
                Visibility::Visible
            } else {
                Visibility::Occluded
            };
            assert_eq!(visibility.get(x, y), expected, "({x}, {y}) {before}");
            hidden += usize::from(right_x > -0.5 && expected == Visibility::Occluded);
        }
    }
    assert!(
        on_ball > 500 && on_floor > 20_000 && hidden > 100,
        "{on_ball} {on_floor} {hidden}"
    );
}
