//! KITTI 2012 and 2015, before and after densifying.

use super::{NO, assert_numbers, image, map, numbers};
use svl::score::protocol::Protocol::{Kitti12, Kitti15};
use svl::score::protocol::{ProtocolImage, Score};
use svl::stereo::Plane;

#[test]
fn a_hole_is_minus_one_until_it_is_filled() {
    // The holes: one with a truth so small that −1 is hardly an outlier, one between 8 and 20, one
    // at the end of the row.
    let estimate = map(&[&[NO, 8.0, NO, 20.0, NO]]);
    let truth = map(&[&[1.5, 8.0, 10.5, 20.0, 24.5]]);
    let expected = [
        ("out1", Some(60.0)),
        ("out2", Some(60.0)),
        ("out3", Some(40.0)),
        ("out5", Some(40.0)),
        ("avgerr", Some(0.0)),
        ("density", Some(40.0)),
        // Filled with 8, 8 and 20: off by 6.5, 2.5 and 4.5.
        ("out2_dense", Some(60.0)),
        ("out3_dense", Some(40.0)),
        ("out4_dense", Some(40.0)),
        ("out5_dense", Some(20.0)),
        ("avgerr_dense", Some(13.5 / 5.0)),
        ("density_dense", Some(100.0)),
        ("out1_est", Some(0.0)),
        ("pixels", Some(5.0)),
    ];
    assert_numbers(&numbers(Kitti12, &image(&estimate, &truth)), &expected);
}

#[test]
fn thresholds_are_strict() {
    let (estimate, truth) = (map(&[&[11.0, 12.0, 13.0, 13.25]]), map(&[&[10.0; 4]]));
    let outliers = [
        ("out1", 75.0),
        ("out2", 50.0),
        ("out3", 25.0),
        ("out4", 0.0),
    ];
    assert_numbers(
        &numbers(Kitti12, &image(&estimate, &truth)),
        &outliers.map(|(name, value)| (name, Some(value))),
    );
}

#[test]
fn an_outlier_of_2015_exceeds_both_thresholds() {
    let off = |truth: f32, error: f32| {
        let found = numbers(
            Kitti15,
            &image(&map(&[&[truth + error]]), &map(&[&[truth]])),
        );
        found.get("d1_all").unwrap() == 100.0
    };
    assert!(!off(10.0, 3.0), "3 px are not more than 3 px");
    assert!(off(10.0, 3.25));
    assert!(!off(100.0, 4.0), "4 %");
    assert!(!off(80.25, 4.0), "less than 5 %");
    assert!(off(80.0, 4.0), "exactly 5 % count in single precision");
    assert!(off(200.0, -10.25));
}

#[test]
fn regions_are_counted_apart() {
    let estimate = map(&[&[10.0, 20.0, NO], &[10.0, 10.0, 10.0]]);
    let truth = map(&[&[10.0, 10.0, 10.0], &[10.0, NO, 20.0]]);
    let foreground = map(&[&[false, false, false], &[true, true, true]]);
    let with = ProtocolImage {
        foreground: Some(&foreground),
        ..image(&estimate, &truth)
    };
    let expected = [
        ("d1_bg", Some(200.0 / 3.0)),
        ("d1_fg", Some(50.0)),
        ("d1_all", Some(60.0)),
        ("density", Some(80.0)),
        ("d1_bg_dense", Some(200.0 / 3.0)),
        ("d1_bg_est", Some(50.0)),
        ("d1_all_est", Some(50.0)),
        ("density_dense", Some(100.0)),
        ("pixels", Some(5.0)),
    ];
    assert_numbers(&numbers(Kitti15, &with), &expected);
    let without = [
        ("d1_bg", None),
        ("d1_fg", None),
        ("d1_fg_dense", None),
        ("d1_all", Some(60.0)),
    ];
    assert_numbers(&numbers(Kitti15, &image(&estimate, &truth)), &without);
}

#[test]
fn images_of_2012_are_averaged_and_those_of_2015_pooled() {
    let right = (
        Plane::filled(3, 1, 10.0).unwrap(),
        Plane::filled(3, 1, 10.0).unwrap(),
    );
    let wrong = (
        Plane::filled(1, 1, 99.0).unwrap(),
        Plane::filled(1, 1, 10.0).unwrap(),
    );
    let both = [&right, &wrong];
    let over = |protocol: svl::score::protocol::Protocol| {
        let scores =
            both.map(|(estimate, truth)| (1.0, protocol.score(&image(estimate, truth)).unwrap()));
        Score::over(&scores)
    };
    assert_numbers(
        &over(Kitti12),
        &[("out3", Some(50.0)), ("pixels", Some(4.0))],
    );
    assert_numbers(
        &over(Kitti15),
        &[("d1_all", Some(25.0)), ("pixels", Some(4.0))],
    );
}

#[test]
fn rows_between_others_stay_empty_as_in_the_kits() {
    let estimate = map(&[&[NO], &[7.0], &[NO], &[7.0], &[NO]]);
    let truth = map(&[&[7.0], &[7.0], &[7.0], &[7.0], &[7.0]]);
    let expected = [
        ("density", Some(40.0)),
        ("density_dense", Some(80.0)),
        ("out5_dense", Some(20.0)),
    ];
    assert_numbers(&numbers(Kitti12, &image(&estimate, &truth)), &expected);
    assert_numbers(
        &numbers(Kitti15, &image(&estimate, &truth)),
        &[("d1_all_dense", Some(20.0)), expected[1]],
    );
}

#[test]
fn an_empty_map_and_one_of_negative_disparities_are_all_outliers() {
    for estimate in [map(&[&[NO, NO]]), map(&[&[-0.5, -9.0]])] {
        let truth = map(&[&[7.0, 8.0]]);
        let expected = [
            ("out5", Some(100.0)),
            ("out5_dense", Some(100.0)),
            ("out5_est", None),
            ("avgerr", None),
        ];
        let found = numbers(Kitti12, &image(&estimate, &truth));
        assert_numbers(&found, &expected);
        assert_numbers(
            &found,
            &[
                ("density", Some(0.0)),
                ("density_dense", Some(0.0)),
                ("avgerr_dense", Some(8.5)),
            ],
        );
        assert_numbers(
            &numbers(Kitti15, &image(&estimate, &truth)),
            &[
                ("d1_all", Some(100.0)),
                ("d1_all_est", None),
                ("density", Some(0.0)),
            ],
        );
    }
}
