//! The interface of a robot: its cells are the bench's, and it refuses what does not fit.

use crate::matchers::allocations;
use crate::oracle::scenes::{Scene, pair, pool};
use svl_core::depth;
use svl_core::matcher::{Algorithm, MATCHERS, MatchContext, MatchOutput};
use svl_core::ranger::{ImageFormat, ImageRef, Optics, Ranger, RangerOptions};
use svl_core::rectify::Rectifier;
use svl_core::stereo::{
    CellRule, CellState, Gray, GridShape, Intrinsics, LengthUnit, Reason, RectifiedPair, Rig,
    StereoCalibration, StereoPair,
};
use svl_core::{Error, Result};

const SIZE: (usize, usize) = (160, 96);

fn rig() -> Rig {
    Rig::new(164.0, (80.0, 48.0), 0.044, 0.0).unwrap()
}

fn calibration() -> StereoCalibration {
    let distortion = [-0.1, 0.01, 0.0, 0.0, 0.0];
    let camera = Intrinsics::new(SIZE, (164.0, 164.0), (80.0, 48.0), distortion).unwrap();
    let apart = nalgebra::Isometry3::translation(-0.044, 0.0002, 0.0);
    StereoCalibration::new(camera, camera, apart, LengthUnit::Metres).unwrap()
}

/// Three pairs of a wall that comes nearer, and one without texture.
fn pairs() -> Vec<StereoPair> {
    let near = (4..7).map(|shift| pair(Scene::Noise, SIZE, shift, 9, 1));
    near.chain([pair(Scene::Faint, SIZE, 3, 2, 1)]).collect()
}

fn open(algorithm: &str, optics: impl Into<Optics>) -> Result<Ranger> {
    Ranger::open(algorithm, optics, &RangerOptions::default())
}

/// Asserts that a ranger's cells and map are those of a run of the bench.
fn assert_as_in_the_bench(algorithm: &str, mut ranger: Ranger, rectifier: Option<&Rectifier>) {
    let rig = ranger.rig().copied();
    let infinity = rig.map(|_| f64::INFINITY);
    let (settings, rule) = (GridShape::default().into(), CellRule::default());
    let mut matcher = algorithm.parse::<Algorithm>().unwrap().build().unwrap();
    for (i, raw) in pairs().into_iter().enumerate() {
        let stamp_ns = 100_000_000 * i as u64;
        let cells = ranger.cells_at(raw.left(), raw.right(), stamp_ns).unwrap();
        let cells = cells.as_slice().to_vec();
        let pair = match rectifier {
            None => raw,
            Some(rectifier) => {
                let [mut left, mut right] = [(); 2].map(|()| Gray::filled(1, 1, 0).unwrap());
                rectifier.apply(&raw, &mut left, &mut right).unwrap();
                StereoPair::new(left, right).unwrap()
            }
        };
        let context = MatchContext {
            sequence: i as u64,
            stamp_ns: Some(stamp_ns),
            rig,
            ..MatchContext::default()
        };
        let mut output = MatchOutput::new().unwrap();
        let rectified = RectifiedPair::assume(&pair);
        matcher.compute(rectified, &context, &mut output).unwrap();
        let map = output.disparity.disparity();
        // The cells as the judge makes them.
        let made = || depth::cells(map, pair.left(), settings, rule, rig.as_ref());
        let grid = output.grid.clone().unwrap_or_else(made);
        assert_eq!(cells.len(), grid.shape().cells());
        for ((_, expected), cell) in grid.iter().zip(&cells) {
            let depth = expected.depth;
            let distance_m = depth.and_then(|depth| depth.distance_m.or(infinity));
            let found = (cell.distance_m, cell.disparity_px, cell.probability);
            let probability = expected.near.or(expected.probability);
            let disparity_px = depth.map(|depth| depth.median_px);
            let expected_values = (distance_m, disparity_px, probability);
            assert_eq!(found, expected_values, "{algorithm}, pair {i}");
            let found = (cell.valid_share, cell.state);
            let expected_values = (expected.valid_share, expected.state());
            assert_eq!(found, expected_values, "{algorithm}, pair {i}");
        }
        let same = ranger.disparity().unwrap().hash();
        assert_eq!(same, output.disparity.hash(), "{algorithm}, pair {i}");
    }
}

#[test]
fn cells_are_those_of_the_bench() {
    for spec in MATCHERS.iter().filter(|spec| spec.matches_images()) {
        assert_as_in_the_bench(spec.name, open(spec.name, rig()).unwrap(), None);
    }
    assert_as_in_the_bench("v5", open("v5", Optics::Unknown).unwrap(), None);
}

/// A textured scene at that many quarters of a pixel, with noise of its own in each image.
fn distant(quarters: usize) -> StereoPair {
    let ((width, height), mut random) = (SIZE, fastrand::Rng::with_seed(7));
    let mut drawn = |count| -> Vec<f32> { (0..count).map(|_| random.f32()).collect() };
    let samples = drawn((4 * width + 16) * height);
    let [left, right] = [0, quarters].map(|from| {
        let noise = drawn(width * height);
        let grey = |x: usize, y: usize| {
            let seen = &samples[(4 * width + 16) * y + 4 * x + from..][..8];
            40.0 + 20.0 * seen.iter().sum::<f32>() + 6.0 * noise[y * width + x]
        };
        Gray::from_fn(width, height, |x, y| grey(x, y) as u8).unwrap()
    });
    StereoPair::new(left, right).unwrap()
}

#[test]
fn far_cells_are_known_at_an_infinite_distance_and_unknown_ones_have_a_reason() {
    let mut disagreements = 0;
    for spec in MATCHERS.iter().filter(|spec| spec.matches_images()) {
        let mut ranger = open(spec.name, rig()).unwrap();
        for quarters in [0, 1, 2, 4, 8] {
            let pair = distant(quarters);
            ranger.reset();
            let cells = ranger.cells(pair.left(), pair.right()).unwrap();
            for cell in cells {
                let expected = match cell.state {
                    CellState::Far => Some(f64::INFINITY),
                    CellState::Known => rig().depth_m(cell.disparity_px.unwrap().into()),
                    _ => None,
                };
                assert_eq!(cell.distance_m, expected, "{}, {quarters}", spec.name);
                let is_known = cell.distance_m.is_some();
                assert_eq!(cell.reason == Reason::Valid, is_known, "{}", spec.name);
                disagreements += usize::from(cell.reason == Reason::Disagreement);
                if spec.name == "v5" && ![2, 4].contains(&quarters) {
                    assert_eq!(cell.state == CellState::Far, quarters < 4, "{quarters}");
                    let is_sure = cell.probability.is_some_and(|p| p > 0.9);
                    assert!(cell.state != CellState::Far || is_sure, "{quarters}");
                }
            }
        }
    }
    assert!(disagreements > 0);
}

#[test]
fn plain_images_are_not_far() {
    for algorithm in ["v5", "v3", "bm"] {
        for grey in [0, 90, 255] {
            // A lens cap, or too long an exposure.
            let image = Gray::filled(SIZE.0, SIZE.1, grey).unwrap();
            let mut ranger = open(algorithm, rig()).unwrap();
            let cells = ranger.cells(&image, &image).unwrap();
            let are_unknown = cells.iter().all(|cell| cell.state == CellState::Unknown);
            assert!(are_unknown, "{algorithm}, {grey}");
        }
    }
}

#[test]
fn raw_images_are_rectified() {
    let rectifier = Rectifier::new(&calibration()).unwrap();
    for algorithm in ["v5", "v3:max_disparity=32"] {
        let ranger = open(algorithm, calibration()).unwrap();
        assert_eq!(ranger.rig(), rectifier.rig());
        assert_as_in_the_bench(algorithm, ranger, Some(&rectifier));
    }
}

#[test]
fn a_caller_allocates_nothing_after_the_first_pair() {
    // tests/c/memory.rs counts all threads.
    let (pairs, bytes) = (pairs(), vec![7; 4 * SIZE.0 * SIZE.1]);
    let color = ImageRef::new(&bytes, SIZE, 4 * SIZE.0, ImageFormat::Bgra8).unwrap();
    let mut ranger = open("v5", calibration()).unwrap();
    ranger.cells(pairs[0].left(), pairs[0].right()).unwrap();
    let before = allocations();
    for pair in &pairs {
        ranger.cells(pair.left(), pair.right()).unwrap();
        ranger.cells(color, pair.right()).unwrap();
    }
    assert_eq!(allocations() - before, 0);
}

#[test]
fn threads_do_not_matter_nor_does_the_pool_of_the_caller() {
    let cells = |threads| {
        let options = RangerOptions {
            threads,
            ..RangerOptions::default()
        };
        let mut ranger = Ranger::open("v5", rig(), &options).unwrap();
        let pairs = pairs().into_iter();
        let found = pairs.map(|pair| ranger.cells(pair.left(), pair.right()).unwrap().clone());
        found.collect::<Vec<_>>()
    };
    let expected = cells(1);
    assert_eq!(cells(3), expected);
    assert_eq!(pool(2).install(|| cells(0)), expected);
}

#[test]
fn a_reset_forgets_earlier_pairs() {
    let (pairs, mut ranger) = (pairs(), open("v5", rig()).unwrap());
    let cells = |i: usize, ranger: &mut Ranger| {
        let cells = ranger.cells(pairs[i].left(), pairs[i].right()).unwrap();
        cells.clone()
    };
    let first = cells(0, &mut ranger);
    assert_ne!(cells(0, &mut ranger), first);
    ranger.reset();
    assert_eq!(cells(0, &mut ranger), first);
}

#[test]
fn a_cell_has_a_place() {
    let options = RangerOptions {
        cells: GridShape {
            columns: 3,
            rows: 2,
        },
        ..RangerOptions::default()
    };
    let mut ranger = Ranger::open("bm:max_disparity=16", rig(), &options).unwrap();
    assert!(ranger.last_cells().is_none() && ranger.disparity().is_none());
    let texture = pair(Scene::Noise, SIZE, 6, 0, 1);
    let half = |image: &Gray| {
        let at = |x, y| if y < SIZE.1 / 2 { 90 } else { image.get(x, y) };
        Gray::from_fn(SIZE.0, SIZE.1, at).unwrap()
    };
    let (left, right) = (half(texture.left()), half(texture.right()));
    let cells = ranger.cells(&left, &right).unwrap();
    assert_eq!(cells.at(1, 0).state, CellState::Unknown);
    let known = cells.at(1, 1);
    // f B / d = 164 px · 0.044 m / 6 px.
    assert!(
        (known.distance_m.unwrap() - 1.203).abs() < 0.05,
        "{known:?}"
    );
    assert_eq!(ranger.last_cells().unwrap().iter().count(), 6);
}

#[test]
fn images_that_do_not_fit_are_an_error_and_the_next_pair_goes_on() {
    let refused = |algorithm, options: RangerOptions| {
        let refused = Ranger::open(algorithm, Optics::Unknown, &options);
        refused.map(drop).unwrap_err().to_string()
    };
    let defaults = RangerOptions::default;
    assert!(refused("v9", defaults()).contains("v9"));
    assert!(refused("truth", defaults()).contains("does not match images"));
    let cells = GridShape {
        columns: 65,
        rows: 1,
    };
    assert!(
        refused(
            "v5",
            RangerOptions {
                cells,
                ..defaults()
            }
        )
        .contains("65 x 1 cells")
    );
    let threads = 1025;
    assert!(
        refused(
            "v5",
            RangerOptions {
                threads,
                ..defaults()
            }
        )
        .contains("1025 threads")
    );

    let (pairs, small) = (pairs(), Gray::filled(8, 8, 0).unwrap());
    let mut ranger = open("v5", calibration()).unwrap();
    let error = ranger.cells(&small, &small).unwrap_err().to_string();
    assert!(
        error.contains("for images of 160x96 pixels, these have 8x8"),
        "{error}"
    );
    let mut ranger = open("v5", Optics::Unknown).unwrap();
    ranger.cells(pairs[0].left(), pairs[0].right()).unwrap();
    let error = ranger.cells(pairs[0].left(), &small).unwrap_err();
    assert!(matches!(error, Error::PairSize { .. }), "{error}");
    assert!(ranger.last_cells().is_none() && ranger.disparity().is_none());
    ranger.cells(pairs[0].left(), pairs[0].right()).unwrap();
    assert!(ranger.last_cells().is_some());
}
