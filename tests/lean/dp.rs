//! dp against its oracle, on every instruction set and thread count, and against the results of
//! OpenCV's own code.

use crate::common::cases;
use crate::oracle::dp::Dp;
use crate::oracle::scenes::{difference, random};
use crate::{common, contract};
use proptest::prelude::*;
use svl_core::kernel::Isa;
use svl_core::matcher::Algorithm;
use svl_core::stereo::{DisparityMap, Gray, StereoPair};

const DEFAULTS: Dp = Dp {
    max: 80,
    occlusion: 25,
    reward: 5,
    slightly: 12,
    moderately: 15,
    highly: 25,
};

impl Dp {
    fn text(&self) -> String {
        let Self {
            max,
            occlusion,
            reward,
            slightly,
            moderately,
            highly,
        } = self;
        format!(
            "dp:max_disparity={max},occlusion={occlusion},reward={reward},\
             slightly_reliable={slightly},moderately_reliable={moderately},\
             highly_reliable={highly}"
        )
    }
}

/// Content of the images.
#[derive(Clone, Copy, Debug)]
enum Scene {
    /// Everything is an edge.
    Noise,
    /// Flat boxes with occasional edges: the input that spreading works on.
    Boxes,
    /// No edge in either direction.
    Faint,
    /// The highest possible costs.
    BlackAndWhite,
}

/// A pair of `scene`: in the right image every band of nine rows is moved by its own shift.
fn pair(scene: Scene, (width, height): (usize, usize), seed: u64) -> StereoPair {
    let random = |x: usize, y, salt: u64| random(x as u64, y, seed ^ salt);
    let world = |x: usize, y: usize| match scene {
        Scene::Noise => random(x, y, 1),
        Scene::Boxes => random(x / 9, y / 7, 2) / 8 * 3 + random(x, y, 3) % 2,
        Scene::Faint => 100 + random(x, y, 4) % 5,
        Scene::BlackAndWhite => 255 * (random(x, y, 5) % 2),
    };
    let side = |right: bool| {
        let shift = |y: usize| {
            if right {
                usize::from(random(0, y / 9, 6)) % 13
            } else {
                0
            }
        };
        Gray::from_fn(width, height, |x, y| world(x + shift(y), y)).unwrap()
    };
    StereoPair::new(side(false), side(true)).unwrap()
}

fn scenes() -> impl Strategy<Value = StereoPair> {
    let scene = prop::sample::select(vec![
        Scene::Noise,
        Scene::Boxes,
        Scene::Boxes,
        Scene::Faint,
        Scene::BlackAndWhite,
    ]);
    let sizes = [
        (31usize, 15usize),
        (32, 16),
        (33, 17),
        (64, 63),
        (63, 64),
        (65, 65),
        (130, 33),
    ];
    let size = prop_oneof![
        4 => (8usize..=70, 1usize..=40),
        2 => (1usize..=10, 1usize..=20),
        2 => prop::sample::select(sizes.to_vec()),
    ];
    (scene, size, any::<u64>()).prop_map(|(scene, size, seed)| pair(scene, size, seed))
}

fn algorithms() -> impl Strategy<Value = Dp> {
    let max = prop_oneof![3 => 0i32..=40, 1 => prop::sample::select(vec![0, 1, 80, 254, 255])];
    let costs = prop_oneof![
        1 => Just((25, 5)),
        2 => (0i64..=60, 0i64..=20),
        1 => Just((1000, 0)),
        1 => Just((0, 1000)),
    ];
    // Runs in small images are short.
    let runs = prop_oneof![1 => Just((12, 15, 25)), 3 => (0usize..=9, 0usize..=9, 0usize..=15)];
    (max, costs, runs).prop_map(
        |(max, (occlusion, reward), (slightly, moderately, highly))| Dp {
            max,
            occlusion,
            reward,
            slightly,
            moderately,
            highly,
        },
    )
}

proptest! {
    #![proptest_config(cases(600))]

    #[test]
    fn equals_the_oracle(pair in scenes(), dp in algorithms()) {
        contract::equals(&dp.text(), &dp.compute(&pair), &pair)?;
    }
}

#[test]
fn odd_sizes_equal_the_oracle() {
    let sizes = [
        (1, 1),
        (9, 1),
        (8, 8),
        (1, 70),
        (2, 5),
        (3, 3),
        (4, 4),
        (5, 9),
        (6, 2),
        (7, 65),
        (300, 2),
    ];
    for (size, max) in sizes
        .into_iter()
        .flat_map(|size| [0, 1, 16, 80, 255].map(|max| (size, max)))
    {
        let (dp, pair) = (Dp { max, ..DEFAULTS }, pair(Scene::Noise, size, 11));
        let got = common::run(&dp.text(), Isa::available().next().unwrap(), &pair);
        assert_eq!(
            difference(&got, &dp.compute(&pair)),
            None,
            "{size:?} 0..={max}"
        );
    }
}

#[test]
fn the_table_has_opencvs_defaults() {
    let [defaults, named] =
        ["dp".to_owned(), DEFAULTS.text()].map(|text| text.parse::<Algorithm>().unwrap());
    assert_eq!(defaults.parameters(), named.parameters());
}

fn check(scene: &str) {
    let Some(pair) = common::scene(scene) else {
        return;
    };
    let folder = common::datasets().unwrap().join("../expected/dp");
    let expected = image::open(folder.join(format!("{}.disp80.png", scene.replace('/', "_"))))
        .unwrap()
        .into_luma8();
    assert_eq!(
        (expected.width() as usize, expected.height() as usize),
        pair.size()
    );
    let differing = |map: &DisparityMap| {
        expected
            .as_raw()
            .iter()
            .zip(map.disparity().pixels())
            .filter(|(e, d)| f32::from(**e) != *d)
            .count()
    };
    assert_eq!(differing(&DEFAULTS.compute(&pair)), 0, "oracle, {scene}");
    for isa in Isa::available() {
        assert_eq!(
            differing(&common::run("dp", isa, &pair)),
            0,
            "{scene} {isa}"
        );
    }
}

#[test]
fn tsukuba() {
    check("tsukuba");
}

#[test]
fn cones() {
    check("cones");
}

#[test]
fn oakd_toy() {
    check("oakd-stereodemo/toy");
}
