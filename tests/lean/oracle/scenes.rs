//! Synthetic pairs for comparing a matcher with its oracle.

use proptest::prelude::*;
use svl_core::stereo::{DisparityMap, Gray, StereoPair};

/// Content of the images. Pairs of all kinds together cause every reason.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Scene {
    Noise,
    Constant,
    /// A slow ramp with a little noise.
    Faint,
    /// Only extremes: the largest possible SSDs.
    BlackAndWhite,
    /// Blocks that repeat along the row: equal costs and self-similarity.
    Periodic,
}

impl Scene {
    pub(crate) const ALL: [Self; 5] = [
        Self::Noise,
        Self::Constant,
        Self::Faint,
        Self::BlackAndWhite,
        Self::Periodic,
    ];
}

/// A grey value of a place.
pub(crate) fn random(x: u64, y: usize, seed: u64) -> u8 {
    let mut z = seed ^ (x << 32 | y as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) as u8
}

/// A pair of `scene` whose right image is the left one moved by `shift`, each with its own noise of
/// `noise` levels.
pub(crate) fn pair(
    scene: Scene,
    (width, height): (usize, usize),
    shift: i32,
    noise: u8,
    seed: u64,
) -> StereoPair {
    let random = |x: i32, y, salt: u64| random(x as u64, y, seed ^ salt);
    let world = |x: i32, y: usize| match scene {
        Scene::Noise => random(x, y, 1),
        Scene::Constant => seed as u8,
        Scene::Faint => (90 + x / 3) as u8 + random(x, y, 2) % 3,
        Scene::BlackAndWhite => 255 * (random(x, y, 3) % 2),
        Scene::Periodic => random(x.rem_euclid(7), y, 4),
    };
    let side = |shift: i32, salt: u64| {
        Gray::from_fn(width, height, |x, y| {
            let x = x as i32 + shift;
            world(x, y).saturating_add(if noise == 0 {
                0
            } else {
                random(x, y, salt) % noise
            })
        })
        .unwrap()
    };
    StereoPair::new(side(0, 5), side(shift, 6)).unwrap()
}

/// Pairs of those sizes.
pub(crate) fn pairs(
    size: impl Strategy<Value = (usize, usize)>,
) -> impl Strategy<Value = StereoPair> {
    let scene = prop::sample::select(Scene::ALL.to_vec());
    (
        scene,
        size,
        -12i32..=12,
        prop::sample::select(vec![0u8, 2, 9, 60]),
        any::<u64>(),
    )
        .prop_map(|(scene, size, shift, noise, seed)| pair(scene, size, shift, noise, seed))
}

/// Pairs of odd sizes: around the lengths of vectors, smaller than a window, long and flat.
pub(crate) fn scenes() -> impl Strategy<Value = StereoPair> {
    pairs(prop_oneof![
        4 => (15usize..=70, 1usize..=8),
        2 => (1usize..=14, 1usize..=8),
        1 => (70usize..=180, 1usize..=2),
    ])
}

pub(crate) fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap()
}

/// The first pixel at which the maps differ, with both values.
pub(crate) fn difference(got: &DisparityMap, expected: &DisparityMap) -> Option<String> {
    assert_eq!(got.size(), expected.size());
    let (width, height) = got.size();
    let says = |map: &DisparityMap, x, y| {
        (
            map.at(x, y),
            map.disparity().get(x, y),
            map.ssdpi().map(|plane| plane.get(x, y)),
            map.row_offset().map(|plane| plane.get(x, y)),
        )
    };
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .find(|&(x, y)| says(got, x, y) != says(expected, x, y))
        .map(|(x, y)| {
            format!(
                "({x}, {y}): got {:?}, expected {:?}",
                says(got, x, y),
                says(expected, x, y)
            )
        })
}
