//! v3 against its oracle: on images of every kind, size and range, on every instruction set and
//! thread count.

use crate::common::cases;
use crate::oracle::scenes::{Scene, pair, scenes};
use crate::{common, contract, oracle};
use proptest::prelude::*;
use svl_core::kernel::Isa;
use svl_core::stereo::{Gray, Reason, StereoPair};

impl oracle::V3 {
    fn text(&self) -> String {
        let Self {
            min,
            max,
            smoothing_sigma,
            texture_sigma,
            texture_delta,
            subpixel,
            back_check,
        } = self;
        format!(
            "v3:min_disparity={min},max_disparity={max},smoothing_sigma={smoothing_sigma},\
             texture_sigma={texture_sigma},texture_delta={texture_delta},subpixel={subpixel},\
             back_check={back_check}"
        )
    }
}

fn algorithms() -> impl Strategy<Value = oracle::V3> {
    let ends = prop_oneof![
        4 => (-20i32..=20, 0i32..=100),
        1 => (-1024i32..=1024, 0i32..=2048),
    ];
    let sigma = prop::sample::select(vec![1.0, 0.0, 0.3, 2.2]);
    let texture = prop::sample::select(vec![
        (0.4, 3.35),
        (0.4, 3.35),
        (0.7, 1.0),
        (2.0, 5.0),
        (0.1, 12.0),
    ]);
    let flags = any::<(bool, bool)>();
    (ends, sigma, texture, flags).prop_map(
        |((min, span), smoothing_sigma, texture, (subpixel, back_check))| oracle::V3 {
            min,
            max: (min + span).min(1024),
            smoothing_sigma,
            texture_sigma: texture.0,
            texture_delta: texture.1,
            subpixel,
            back_check,
        },
    )
}

proptest! {
    #![proptest_config(cases(600))]

    #[test]
    fn equals_the_oracle(pair in scenes(), v3 in algorithms()) {
        contract::equals(&v3.text(), &v3.compute(&pair), &pair)?;
    }
}

#[test]
fn small_images_have_no_window_or_one() {
    for (size, borders) in [((1, 1), 1), ((8, 8), 64), ((9, 1), 8)] {
        let map = common::run("v3", Isa::BASELINE, &pair(Scene::Noise, size, 0, 0, 7));
        assert_eq!(map.tally()[Reason::Border as usize], borders, "{size:?}");
    }
}

/// A single window per row has no other window to resemble: the self check passes it.
#[test]
fn a_window_without_neighbours_passes_the_self_check() {
    let line = Gray::from_fn(9, 1, |x, _| if x == 4 { 255 } else { 10 }).unwrap();
    let map = common::run(
        "v3",
        Isa::BASELINE,
        &StereoPair::new(line.clone(), line).unwrap(),
    );
    assert_eq!(map.at(4, 0), Ok(0.0));
}

#[test]
fn the_back_check_sends_negative_disparities_to_zero() {
    let pair = pair(Scene::Noise, (60, 4), -6, 0, 3);
    let plain = common::run(
        "v3:min_disparity=-10,smoothing_sigma=0",
        Isa::BASELINE,
        &pair,
    );
    let checked = common::run(
        "v3:min_disparity=-10,smoothing_sigma=0,back_check=true",
        Isa::BASELINE,
        &pair,
    );
    assert!(plain.disparity().pixels().filter(|&d| d == -6.0).count() > 20);
    for (before, after) in plain.disparity().pixels().zip(checked.disparity().pixels()) {
        assert_eq!(after, before.max(0.0));
    }
}
