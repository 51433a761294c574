//! Middlebury v3 and v2, and ETH3D: similar tables, different rules.

use super::{NO, assert_numbers, image, map, numbers};
use svl::score::protocol::Protocol::{self, Eth3d, Middeval3, MiddleburyV2};
use svl::score::protocol::{ProtocolImage, Score};
use svl::stereo::{Plane, Visibility};

/// An estimate below 0, none, off by exactly 2, by exactly 0.5, and far beyond the range; a pixel
/// without truth.
fn five() -> (Plane<f32>, Plane<f32>) {
    (
        map(&[&[-3.0, NO, 12.0, 10.5, 6.0, 30.0]]),
        map(&[&[0.0, 1.0, 10.0, 10.0, NO, 20.0]]),
    )
}

#[test]
fn middeval3_clips_and_counts_holes_apart() {
    let (estimate, truth) = five();
    let clipped = numbers(
        Middeval3,
        &ProtocolImage {
            max_disparity: Some(20.0),
            ..image(&estimate, &truth)
        },
    );
    let expected = [
        ("pixels", Some(5.0)),
        ("bad0.5", Some(20.0)),
        ("bad1.0", Some(20.0)),
        ("bad2.0", Some(0.0)),
        ("bad4.0", Some(0.0)),
        ("invalid", Some(20.0)),
        ("totbad2.0", Some(20.0)),
        ("avgerr", Some(2.5 / 4.0)),
        ("rms", Some((4.25f64 / 4.0).sqrt())),
        // 0, 0, 0.5, 2: ranks 2, 3, 3, 3.
        ("a50", Some(0.5)),
        ("a90", Some(2.0)),
        ("a95", Some(2.0)),
        ("a99", Some(2.0)),
        ("coverage", Some(80.0)),
    ];
    assert_numbers(&clipped, &expected);
    // Without a range there is nothing to clip to above, but still below.
    assert_numbers(
        &numbers(Middeval3, &image(&estimate, &truth)),
        &[("bad4.0", Some(20.0)), ("avgerr", Some(3.125))],
    );
}

#[test]
fn v2_counts_holes_as_bad() {
    let (estimate, truth) = five();
    let expected = [
        ("bad0.5", Some(80.0)),
        ("bad2.0", Some(60.0)),
        ("totbad2.0", Some(60.0)),
        ("invalid", Some(20.0)),
        ("avgerr", Some(15.5 / 4.0)),
    ];
    assert_numbers(&numbers(MiddleburyV2, &image(&estimate, &truth)), &expected);
}

#[test]
fn eth3d_divides_by_the_estimated_and_drops_what_exceeds_the_width() {
    // Six pixels wide: 6 and -6 are disparities, 6.5 and -6.5 none.
    let estimate = map(&[&[6.0, 6.5, -6.0, -6.5, NO, 4.0]]);
    let truth = map(&[&[6.0, 6.0, 0.0, 0.0, 1.0, 3.4]]);
    let expected = [
        ("pixels", Some(6.0)),
        ("coverage", Some(50.0)),
        ("invalid", Some(50.0)),
        ("bad0.5", Some(200.0 / 3.0)),
        ("bad1.0", Some(100.0 / 3.0)),
        ("totbad2.0", Some(400.0 / 6.0)),
    ];
    let found = numbers(Eth3d, &image(&estimate, &truth));
    assert_numbers(&found, &expected);
    // 0, 0.6, 6: ranks 1, 2, 2, 2.
    assert_eq!(
        (found.get("a50"), found.get("a90")),
        (Some(f64::from(4.0f32 - 3.4)), Some(6.0))
    );
}

#[test]
fn eth3d_ranks_in_single_precision() {
    // 1 100 002 · 0.99 is 1 089 001.98, in single precision 1 089 002: the next error already.
    let width = 11_702;
    let height = 94 + 1;
    let count = 1_100_002;
    let truth = Plane::from_fn(
        width,
        height,
        |x, y| if y * width + x < count { 0.0 } else { NO },
    )
    .unwrap();
    let estimate = Plane::from_fn(width, height, |x, y| (y * width + x) as f32 / 256.0).unwrap();
    assert_eq!(
        numbers(Eth3d, &image(&estimate, &truth)).get("a99"),
        Some(1_089_002.0 / 256.0)
    );
    assert_eq!(
        numbers(MiddleburyV2, &image(&estimate, &truth)).get("a99"),
        Some(1_089_001.0 / 256.0)
    );
}

#[test]
fn smaller_estimates_are_repeated_times_the_factor() {
    for scale in [2, 4] {
        let factor = scale as f32;
        let estimate = map(&[&[3.0, NO], &[8.0, 5.0]]);
        let truth = Plane::from_fn(2 * scale, 2 * scale, |x, y| match (x / scale, y / scale) {
            (0, 0) => 3.0 * factor,
            (1, 0) => 1.0,
            (0, _) => 8.0 * factor - 1.5,
            _ => 5.0 * factor,
        });
        let truth = truth.unwrap();
        let found = numbers(Middeval3, &image(&estimate, &truth));
        let pixels = (16 * scale * scale / 4) as f64;
        assert_numbers(
            &found,
            &[
                ("pixels", Some(pixels)),
                ("invalid", Some(25.0)),
                ("bad1.0", Some(25.0)),
            ],
        );
        // The range is the estimate's: 7 there is 7 times the factor here, whose error is 1 times
        // the factor less 1.5.
        let clipped = numbers(
            Middeval3,
            &ProtocolImage {
                max_disparity: Some(7.0),
                ..image(&estimate, &truth)
            },
        );
        assert_numbers(&clipped, &[("avgerr", Some(f64::from(factor - 1.5) / 3.0))]);
    }
}

#[test]
fn sizes_must_go_together() {
    let says =
        |protocol: Protocol, image: &ProtocolImage| protocol.score(image).unwrap_err().to_string();
    let plane = |width, height| Plane::filled(width, height, 1.0).unwrap();
    let (small, truth) = (plane(2, 2), plane(6, 6));
    assert!(says(Middeval3, &image(&small, &truth)).contains("estimate is 2x2, the truth 6x6"));
    assert!(says(Middeval3, &image(&plane(4, 2), &plane(8, 8))).contains("1, 2 or 4 times"));
    assert!(says(Middeval3, &image(&truth, &small)).contains("estimate is 6x6, the truth 2x2"));
    for protocol in Protocol::ALL {
        let mask = Plane::filled(3, 6, Visibility::Visible).unwrap();
        let masked = ProtocolImage {
            mask: Some(&mask),
            ..image(&truth, &truth)
        };
        assert!(says(protocol, &masked).contains("mask is 3x6, the truth 6x6"));
        assert!(protocol.error_map(&masked).is_err());
        if protocol != Middeval3 {
            assert!(
                says(protocol, &image(&plane(3, 3), &truth))
                    .contains("estimate is 3x3, the truth 6x6")
            );
        }
    }
}

#[test]
fn masks_keep_255() {
    let codes = map(&[&[0u8, 128, 255, 254, 1, 255]]);
    let mask = codes.map(Visibility::from_code);
    let estimate = map(&[&[9.0, 9.0, 2.5, 9.0, 9.0, NO]]);
    let truth = map(&[&[1.0, 1.0, 1.0, 1.0, 1.0, 1.0]]);
    for protocol in Protocol::ALL {
        let found = numbers(
            protocol,
            &ProtocolImage {
                mask: Some(&mask),
                ..image(&estimate, &truth)
            },
        );
        assert_numbers(&found, &[("pixels", Some(2.0))]);
        if found.get("avgerr").is_some() {
            assert_numbers(&found, &[("avgerr", Some(1.5))]);
        }
    }
}

#[test]
fn without_an_estimate_nothing_is_zero() {
    let (estimate, truth) = (map(&[&[NO, NO]]), map(&[&[3.0, NO]]));
    let none = [
        ("avgerr", None),
        ("rms", None),
        ("a50", None),
        ("a99", None),
        ("coverage", Some(0.0)),
    ];
    for (protocol, bad) in [(Middeval3, 0.0), (MiddleburyV2, 100.0), (Eth3d, 100.0)] {
        let found = numbers(protocol, &image(&estimate, &truth));
        assert_numbers(&found, &none);
        assert_numbers(
            &found,
            &[
                ("bad2.0", Some(bad)),
                ("invalid", Some(100.0)),
                ("totbad2.0", Some(100.0)),
            ],
        );
    }
}

#[test]
fn one_estimate_is_every_quantile() {
    let (estimate, truth) = (map(&[&[NO, 3.0, NO]]), map(&[&[1.0, 1.0, NO]]));
    for protocol in [Middeval3, MiddleburyV2, Eth3d] {
        let two = ["avgerr", "rms", "a50", "a90", "a95", "a99"].map(|name| (name, Some(2.0)));
        assert_numbers(&numbers(protocol, &image(&estimate, &truth)), &two);
    }
}

#[test]
fn without_a_truth_there_is_nothing_to_judge() {
    let (estimate, truth) = (map(&[&[1.0, 2.0]]), map(&[&[NO, NO]]));
    for protocol in Protocol::ALL {
        let error = protocol.score(&image(&estimate, &truth)).unwrap_err();
        assert!(error.to_string().contains("nothing to score"), "{error}");
    }
}

#[test]
fn images_are_averaged_and_their_pixels_summed() {
    let score = |estimate: &[f32]| {
        let truth = vec![1.0; estimate.len()];
        let score = Eth3d.score(&image(&map(&[estimate]), &map(&[&truth])));
        (1.0, score.unwrap())
    };
    let two = [score(&[1.0, 2.0, 4.0, 1.0]), score(&[0.5])];
    assert_numbers(
        &Score::over(&two),
        &[
            ("bad0.5", Some(25.0)),
            ("avgerr", Some(0.75)),
            ("pixels", Some(5.0)),
            ("coverage", Some(100.0)),
        ],
    );
    // A mean that omits an image would flatter.
    assert_numbers(
        &Score::over(&[score(&[1.0]), score(&[NO])]),
        &[("avgerr", None), ("coverage", Some(50.0))],
    );
}
