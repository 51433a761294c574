//! pushbroom against its oracle, and what it remembers.

use crate::contract;
use crate::oracle::pushbroom::Pushbroom;
use crate::oracle::scenes::{Scene, pair, pairs};
use proptest::prelude::*;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, Matcher};
use svl_core::stereo::{Gray, Pose, RectifiedPair, Rig, StereoPair};

impl Pushbroom {
    fn text(&self) -> String {
        let Self {
            disparity,
            block_size,
            interest,
            threshold,
            invariance,
        } = self;
        format!(
            "pushbroom:disparity={disparity},block_size={block_size},interest={interest},\
             threshold={threshold},invariance={invariance}"
        )
    }
}

fn matchers() -> impl Strategy<Value = Pushbroom> {
    let ranges = (1i32..=60, prop::sample::select(vec![3, 4, 5, 9, 31]));
    let percent = || prop::sample::select(vec![1, 10, 25, 60, 1000]);
    (
        ranges,
        prop::sample::select(vec![0, 6, 40, 255]),
        percent(),
        percent(),
    )
        .prop_map(
            |((disparity, block_size), interest, threshold, invariance)| Pushbroom {
                disparity,
                block_size,
                interest,
                threshold,
                invariance,
            },
        )
}

proptest! {
    #[test]
    fn it_equals_the_oracle(matcher in matchers(), pair in pairs((1usize..=90, 1usize..=40))) {
        contract::equals(&matcher.text(), &matcher.compute(&pair), &pair)?;
    }

    /// A match of what is at that disparity occurs, also where the pair has noise.
    #[test]
    fn the_oracle_finds_its_plane(seed in any::<u64>(), noise in 0u8..9) {
        let matcher = Pushbroom {
            disparity: 7,
            block_size: 5,
            interest: 12,
            threshold: 20,
            invariance: 5,
        };
        let map = matcher.compute(&pair(Scene::Noise, (60, 20), 7, noise, seed));
        prop_assert!(map.coverage() > 0.8, "{}", map.coverage());
    }
}

const SIZE: (usize, usize) = (120, 60);

fn rig() -> Rig {
    Rig::new(100.0, (59.5, 29.5), 0.1, 0.0).unwrap()
}

/// A run: pairs with their sequences and the robot's way, metres; the maps' disparities.
struct Walk {
    matcher: Box<dyn Matcher>,
    seen: StereoPair,
}

impl Walk {
    fn new(algorithm: &str) -> Self {
        Self {
            matcher: algorithm.parse::<Algorithm>().unwrap().build().unwrap(),
            // Everything is at 10 px, 1 m away.
            seen: pair(Scene::Noise, SIZE, 10, 0, 1),
        }
    }

    /// The disparities after a pair of the wall, or of nothing.
    fn step(&mut self, sequence: u64, sees: bool, at_m: Option<f64>) -> Vec<f32> {
        let plain = Gray::from_fn(SIZE.0, SIZE.1, |_, _| 90).unwrap();
        let plain = StereoPair::new(plain.clone(), plain).unwrap();
        // Through the left image's optical axis.
        let pose = at_m.map(|m| Pose::translation(0.0, 0.0, m));
        let context = MatchContext {
            sequence,
            rig: Some(rig()),
            pose,
            ..MatchContext::default()
        };
        let mut output = MatchOutput::new().unwrap();
        let pair = if sees { &self.seen } else { &plain };
        output.begin();
        let pair = RectifiedPair::assume(pair);
        self.matcher.compute(pair, &context, &mut output).unwrap();
        assert!(output.grid.is_some());
        output.disparity.disparity().pixels().collect()
    }
}

fn seen(disparities: &[f32]) -> Vec<f32> {
    let mut seen: Vec<_> = disparities
        .iter()
        .copied()
        .filter(|d| d.is_finite())
        .collect();
    seen.sort_by(f32::total_cmp);
    seen.dedup();
    seen
}

#[test]
fn points_come_nearer_with_the_robot() {
    let mut walk = Walk::new("pushbroom:disparity=10,block_size=5,invariance=5,memory=5");
    assert_eq!(seen(&walk.step(0, true, Some(0.0))), [10.0]);
    // Half way to the wall it has twice the disparity, and fills the image.
    let near = walk.step(1, false, Some(0.5));
    assert!(seen(&near).iter().all(|d| (d - 20.0).abs() < 1e-4));
    let fraction = |d: &[f32]| d.iter().filter(|d| d.is_finite()).count() as f64 / d.len() as f64;
    assert!(fraction(&near) > 0.95, "{}", fraction(&near));
    // What was passed is forgotten: nothing is behind the cameras.
    assert!(seen(&walk.step(2, false, Some(1.1))).is_empty());
}

#[test]
fn the_nearest_point_is_in_front() {
    let mut walk = Walk::new("pushbroom:disparity=10,block_size=5,invariance=5");
    walk.step(0, true, Some(0.0));
    // The remembered wall is half as far away as the one that this pair shows behind it.
    let both = walk.step(1, true, Some(0.5));
    let near = both.iter().filter(|d| (**d - 20.0).abs() < 1e-4).count();
    assert!(near as f64 > 0.95 * both.len() as f64, "{near}");
}

#[test]
fn points_are_kept_as_long_as_the_parameter_says() {
    let mut walk = Walk::new("pushbroom:disparity=10,block_size=5,invariance=5,memory=2");
    walk.step(7, true, Some(0.0));
    assert!(!seen(&walk.step(9, false, Some(0.0))).is_empty());
    assert!(seen(&walk.step(10, false, Some(0.0))).is_empty());
    let mut walk = Walk::new("pushbroom:disparity=10,block_size=5,invariance=5,memory=0");
    walk.step(0, true, Some(0.0));
    assert!(seen(&walk.step(1, false, Some(0.0))).is_empty());
}

#[test]
fn a_pair_matched_again_counts_once_and_another_run_starts_without_memory() {
    let mut walk = Walk::new("pushbroom:disparity=10,block_size=5,invariance=5");
    walk.step(3, true, Some(0.0));
    // The same pair again sees nothing this time: its points are replaced.
    assert!(seen(&walk.step(3, false, Some(0.0))).is_empty());
    walk.step(4, true, Some(0.0));
    assert!(seen(&walk.step(0, false, Some(0.0))).is_empty());
    // Also where the next run begins with a later pair.
    walk.step(4, true, Some(0.0));
    walk.matcher.reset();
    assert!(seen(&walk.step(5, false, Some(0.0))).is_empty());
}

#[test]
fn nothing_is_remembered_without_poses() {
    let mut walk = Walk::new("pushbroom:disparity=10,block_size=5,invariance=5");
    walk.step(0, true, None);
    assert!(seen(&walk.step(1, false, Some(0.0))).is_empty());
}
