//! v1, v2 and v4 against their oracles: on images of every kind, size and range, on every
//! instruction set and thread count.

use crate::common::cases;
use crate::oracle::scenes::{Scene, pair, scenes};
use crate::oracle::symmetric::{Filter, Symmetric};
use crate::oracle::v4::V4;
use crate::{common, contract};
use proptest::prelude::*;
use svl_core::kernel::Isa;
use svl_core::stereo::{ExtraPlanes, Gray, StereoPair};

/// Disparity ranges: near zero, and beyond any image.
fn ends() -> impl Strategy<Value = (i32, i32)> {
    let ends = prop_oneof![
        4 => (-20i32..=20, 0i32..=100),
        1 => (-1024i32..=1024, 0i32..=2048),
    ];
    ends.prop_map(|(min, span)| (min, (min + span).min(1024)))
}

fn sigmas() -> impl Strategy<Value = f64> {
    prop::sample::select(vec![1.0, 0.0, 2.2])
}

fn symmetric() -> impl Strategy<Value = Symmetric> {
    let filter = prop_oneof![
        prop::sample::select(vec![10.0, 0.0, 3.33, 200.0])
            .prop_map(|uniqueness| Filter::V1 { uniqueness }),
        (
            prop::sample::select(vec![4.0, 0.0, 1.7, 60.0]),
            prop::sample::select(vec![8.0, 0.0, 2.0, 3.3, 40.0])
        )
            .prop_map(|(texture_threshold, spread_threshold)| Filter::V2 {
                texture_threshold,
                spread_threshold
            }),
    ];
    (ends(), sigmas(), filter, 0i32..=3, any::<(bool, bool)>()).prop_map(
        |((min, max), smoothing_sigma, filter, symmetry_tolerance, (subpixel, back_check))| {
            Symmetric {
                min,
                max,
                smoothing_sigma,
                filter,
                symmetry_tolerance,
                subpixel,
                back_check,
            }
        },
    )
}

fn v4() -> impl Strategy<Value = V4> {
    let tolerances = (
        prop::sample::select(vec![150, 0, 40, 2295]),
        prop::sample::select(vec![2, 0, 1, 5]),
    );
    (ends(), sigmas(), tolerances, any::<(bool, bool)>()).prop_map(
        |((min, max), smoothing_sigma, (hash_tolerance, row_tolerance), (subpixel, back_check))| {
            V4 {
                min,
                max,
                smoothing_sigma,
                hash_tolerance,
                row_tolerance,
                subpixel,
                back_check,
            }
        },
    )
}

/// `pair` with the right image moved down by `rows`, edges replicated.
fn lowered(pair: &StereoPair, rows: i32) -> StereoPair {
    let right = pair.right();
    let row = |y: usize| (y as i32 - rows).clamp(0, right.height() as i32 - 1) as usize;
    let lower = Gray::from_fn(right.width(), right.height(), |x, y| right.get(x, row(y))).unwrap();
    StereoPair::new(pair.left().clone(), lower).unwrap()
}

proptest! {
    #![proptest_config(cases(500))]

    #[test]
    fn v1_and_v2_equal_their_oracle(pair in scenes(), algorithm in symmetric()) {
        contract::equals(&algorithm.text(), &algorithm.compute(&pair), &pair)?;
    }
}

proptest! {
    #![proptest_config(cases(250))]

    #[test]
    fn v4_equals_its_oracle(pair in scenes(), rows in -3i32..=3, algorithm in v4()) {
        let pair = lowered(&pair, rows);
        contract::equals(&algorithm.text(), &algorithm.compute(&pair), &pair)?;
    }
}

/// Several blocks of rows, and rows that only a neighbouring band's thread has.
#[test]
fn tall_pairs_equal_their_oracles() {
    let pair = lowered(&pair(Scene::Noise, (30, 200), 3, 9, 11), 1);
    let v4 = V4 {
        min: -2,
        max: 9,
        smoothing_sigma: 1.0,
        hash_tolerance: 150,
        row_tolerance: 2,
        subpixel: true,
        back_check: false,
    };
    contract::equals(&v4.text(), &v4.compute(&pair), &pair).unwrap();
    for filter in [
        Filter::V1 { uniqueness: 10.0 },
        Filter::V2 {
            texture_threshold: 4.0,
            spread_threshold: 3.0,
        },
    ] {
        let algorithm = Symmetric {
            min: -2,
            max: 9,
            smoothing_sigma: 1.0,
            filter,
            symmetry_tolerance: 1,
            subpixel: true,
            back_check: false,
        };
        contract::equals(&algorithm.text(), &algorithm.compute(&pair), &pair).unwrap();
    }
}

#[test]
fn the_misalignment_is_the_rows_that_the_right_image_is_too_low() {
    let pair = pair(Scene::Noise, (80, 40), 6, 0, 5);
    for rows in -2..=2 {
        let map = common::run("v4:max_disparity=20", Isa::BASELINE, &lowered(&pair, rows));
        assert_eq!(map.median_row_offset(), Some(rows as i8));
    }
    assert_eq!(
        common::run("v3", Isa::BASELINE, &pair).median_row_offset(),
        None,
        "v3 knows of no other row"
    );
    let flat = Gray::filled(80, 40, 9).unwrap();
    let map = common::run(
        "v4",
        Isa::BASELINE,
        &StereoPair::new(flat.clone(), flat).unwrap(),
    );
    assert_eq!((map.valid(), map.median_row_offset()), (0, None));
}

/// A map with row offsets has none after a matcher without any.
#[test]
fn row_offsets_do_not_outlive_their_result() {
    let pair = pair(Scene::Noise, (60, 8), 5, 9, 42);
    let map = common::run("v4", Isa::BASELINE, &pair);
    assert_eq!(map.extra(), ExtraPlanes::ALL);
    let mut output = svl_core::matcher::MatchOutput::with_memory(map);
    let mut v3 = "v3"
        .parse::<svl_core::matcher::Algorithm>()
        .unwrap()
        .build()
        .unwrap();
    common::compute(&mut *v3, &pair, &mut output).unwrap();
    assert_eq!(output.disparity.extra(), ExtraPlanes::SSDPI);
}

/// A window moved by a fraction of a pixel has the lowest point of its parabola near that fraction.
#[test]
fn subpixel_follows_a_half_pixel_shift() {
    let wave = |x: f64| (128.0 + 60.0 * (x * 0.5).sin() + 50.0 * (x * 0.23).cos()).round() as u8;
    let side = |shift: f64| Gray::from_fn(120, 4, |x, _| wave(x as f64 + shift)).unwrap();
    for fraction in [0.0, 0.25, 0.5, 0.75] {
        let pair = StereoPair::new(side(0.0), side(7.0 + fraction)).unwrap();
        let map = common::run(
            "v1:max_disparity=20,subpixel=true,uniqueness=0",
            Isa::BASELINE,
            &pair,
        );
        let mut found: Vec<f32> = map.disparity().pixels().filter(|d| d.is_finite()).collect();
        found.sort_by(f32::total_cmp);
        let median = found[found.len() / 2];
        assert!(
            (f64::from(median) - 7.0 - fraction).abs() < 0.1,
            "{fraction}: {median}"
        );
    }
}
