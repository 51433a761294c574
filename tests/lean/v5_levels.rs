//! v5 on images that are decided at several sizes.

use crate::oracle::scenes::{Scene, pair, pool};
use svl_core::kernel::Isa;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, V5Model, Value};
use svl_core::stereo::{Cell, DepthGrid, Gray, RectifiedPair, Rig, StereoPair};

fn rig(width: usize) -> Rig {
    let width = width as f64;
    Rig::new(width, (width / 2.0, 60.0), 0.045, 0.0).unwrap()
}

/// The map and the grid of a pair.
fn matched(algorithm: &str, isa: Isa, pair: &StereoPair, rig: Option<Rig>) -> MatchOutput {
    let algorithm: Algorithm = algorithm.parse().unwrap();
    let (mut matcher, mut output) = (
        algorithm.build_on(isa).unwrap(),
        MatchOutput::new().unwrap(),
    );
    let context = MatchContext {
        rig,
        ..MatchContext::default()
    };
    let pair = RectifiedPair::assume(pair);
    matcher.compute(pair, &context, &mut output).unwrap();
    output
}

fn grid(algorithm: &str, pair: &StereoPair) -> DepthGrid {
    let rig = rig(pair.left().width());
    matched(algorithm, Isa::BASELINE, pair, Some(rig))
        .grid
        .unwrap()
}

fn known(grid: &DepthGrid) -> Vec<&Cell> {
    let cells = grid.iter().map(|(_, cell)| cell);
    cells.filter(|cell| cell.depth.is_some()).collect()
}

/// A pair with a disparity of `shift` px.
fn wide(size: (usize, usize), shift: i32, noise: u8) -> StereoPair {
    pair(Scene::Noise, size, shift, noise, 7)
}

#[test]
fn images_wider_than_400_px_have_levels() {
    let levels = |width: usize, height: usize| {
        let mut matcher = "v5".parse::<Algorithm>().unwrap().build().unwrap();
        let mut output = MatchOutput::new().unwrap();
        let mut context = MatchContext::default();
        (context.grid.columns, context.grid.rows) = (1, 1);
        let pair = wide((width, height), 6, 5);
        let pair = RectifiedPair::assume(&pair);
        matcher.compute(pair, &context, &mut output).unwrap();
        output.grid.unwrap().levels().next().unwrap().len()
    };
    let widths = [399, 400, 401, 800, 801, 802, 1603, 1604];
    assert_eq!(
        widths.map(|width| levels(width, 40)),
        [1, 1, 2, 2, 2, 3, 3, 4]
    );
    // A level is at least 2 px high.
    assert_eq!(
        [2, 3, 4, 7, 8].map(|height| levels(1700, height)),
        [1, 1, 2, 2, 3]
    );
}

#[test]
fn instruction_sets_and_threads_do_not_matter() {
    for size in [(643, 101), (401, 60), (1290, 38)] {
        let pair = wide(size, 21, 40);
        let expected = matched("v5", Isa::BASELINE, &pair, Some(rig(size.0)));
        for isa in Isa::available() {
            for threads in [1, 2, 3] {
                let got = pool(threads).install(|| matched("v5", isa, &pair, Some(rig(size.0))));
                assert_eq!(
                    got.disparity, expected.disparity,
                    "{size:?} {isa} {threads}"
                );
                assert_eq!(got.grid, expected.grid, "{size:?} {isa} {threads}");
            }
        }
    }
}

#[test]
fn things_nearer_than_the_range_are_found_at_half_the_size() {
    let pair = wide((640, 120), 110, 5);
    let grid = grid("v5:max_disparity=40", &pair);
    let known = known(&grid);
    assert!(known.len() >= 9, "{}", known.len());
    for cell in known {
        let depth = cell.depth.unwrap();
        assert!((depth.median_px - 110.0).abs() < 4.0, "{depth:?}");
        assert!(depth.p20_px <= depth.median_px && depth.median_px <= depth.p80_px);
        // By the rig of the pair.
        let distance_m = depth.distance_m.unwrap();
        assert!(
            (distance_m * f64::from(depth.median_px) - 640.0 * 0.045).abs() < 1e-9,
            "{distance_m}"
        );
        assert_eq!(cell.level, 1);
    }
}

/// Noise of single pixels is gone at half the size.
#[test]
fn a_coarser_level_decides_where_the_finest_sees_nothing() {
    let (small, noise) = (
        wide((160, 40), 5, 0),
        pair(Scene::Constant, (640, 160), 0, 76, 0),
    );
    let mixed = |small: &Gray, noise: &Gray| {
        let grey = |x, y| small.get(x / 4, y / 4) / 12 + noise.get(x, y);
        Gray::from_fn(640, 160, grey).unwrap()
    };
    let [left, right] = [
        mixed(small.left(), noise.left()),
        mixed(small.right(), noise.right()),
    ];
    let pair = StereoPair::new(left, right).unwrap();
    let grid = grid("v5:confidence=0.8", &pair);
    let coarse = known(&grid).iter().filter(|cell| cell.level == 1).count();
    assert!(coarse > 0, "{coarse} of {}", known(&grid).len());
    let right = |cell: &&&Cell| (cell.depth.unwrap().median_px - 20.0).abs() < 3.0;
    assert_eq!(
        known(&grid).iter().filter(right).count(),
        known(&grid).len()
    );
}

/// Reports of either level from `obstacle_m` to 2 m; none if a confidence is given.
#[test]
fn near_reports_of_several_levels_are_held_to_less() {
    let mut model = V5Model::built_in();
    for table in [&mut model.levels.finest, &mut model.levels.coarsest] {
        assert_eq!(table.near_least_score, model.median.near_least_score);
        table.base -= 20_000;
        table.near_least_score = Some(-50_000);
    }
    let file = Value::file("m", model.to_bytes());
    let known_cells = |text: &str, shift: i32| {
        let algorithm: Algorithm = text.parse().unwrap();
        let algorithm = algorithm.with("model", &file).unwrap();
        let mut output = MatchOutput::new().unwrap();
        let context = MatchContext {
            rig: Some(rig(640)),
            ..MatchContext::default()
        };
        let pair = wide((640, 240), shift, 20);
        let pair = RectifiedPair::assume(&pair);
        let mut matcher = algorithm.build().unwrap();
        matcher.compute(pair, &context, &mut output).unwrap();
        known(&output.grid.unwrap()).len()
    };
    // 1.2, 2.9 and 0.4 m.
    let near = known_cells("v5", 24);
    assert!(near > 7, "{near}");
    assert!(known_cells("v5:width=320", 24) > 7);
    assert_eq!([10, 70].map(|shift| known_cells("v5", shift)), [0, 0]);
    assert_eq!(known_cells("v5:confidence=0.8", 24), 0);
}

#[test]
fn wider_levels_than_asked_for_are_not_computed() {
    let pair = wide((1290, 240), 24, 20);
    for (width, finest) in [(0, 0), (1290, 0), (1289, 1), (645, 1), (644, 2), (1, 2)] {
        let text = format!("v5:width={width}");
        let output = matched(&text, Isa::BASELINE, &pair, Some(rig(1290)));
        let grid = output.grid.unwrap();
        let numbers = grid
            .levels()
            .next()
            .unwrap()
            .iter()
            .map(|level| level.level);
        assert!(numbers.eq(finest..3), "{text}");
        assert!(known(&grid).len() > 5, "{text}");
        // Each pixel of the level is a square of the map.
        let side = 2 << finest;
        for y in 0..240 {
            for x in 0..1290 {
                let place = [(x, 1290), (y, 240)]
                    .map(|(at, size): (usize, usize)| (at / side).min(size / side - 1) * side);
                let [own, first] = [
                    output.disparity.at(x, y),
                    output.disparity.at(place[0], place[1]),
                ];
                assert_eq!(own, first, "{text} at {x}, {y}");
            }
        }
    }
    // A small image is its own coarsest level.
    let small = wide((320, 60), 6, 5);
    assert_eq!(grid("v5:width=1", &small), grid("v5", &small));
}

#[test]
fn cells_known_at_a_higher_confidence_are_the_same_at_a_lower_one() {
    let pair = wide((860, 120), 30, 150);
    let cells = ["0.999", "0.97", "0.9", "0.5", "0.001"].map(|confidence| {
        let grid = grid(&format!("v5:confidence={confidence}"), &pair);
        grid.into_cells()
    });
    for pair in cells.windows(2) {
        for (high, low) in pair[0].iter().zip(&pair[1]) {
            assert!(
                high.depth.is_none() || high.depth == low.depth,
                "{high:?} {low:?}"
            );
        }
    }
    let count = |cells: &[Cell]| cells.iter().filter(|cell| cell.depth.is_some()).count();
    assert!(count(&cells[0]) < count(&cells[4]));
}

#[test]
fn difficult_images_are_matched_without_a_rig_too() {
    let black = Gray::filled(640, 48, 0).unwrap();
    let textured = wide((640, 48), 9, 9);
    let half = Gray::from_fn(640, 48, |x, y| match x {
        0..320 => 0,
        _ => textured.left().get(x, y),
    })
    .unwrap();
    let pairs = [
        StereoPair::new(black.clone(), black.clone()).unwrap(),
        StereoPair::new(textured.left().clone(), black).unwrap(),
        StereoPair::new(half, textured.right().clone()).unwrap(),
        wide((401, 2), 3, 0),
        wide((801, 3), 3, 0),
        wide((8000, 9), 40, 9),
    ];
    for (i, pair) in pairs.iter().enumerate() {
        for rig in [None, Some(rig(pair.left().width()))] {
            let output = matched("v5", Isa::BASELINE, pair, rig);
            let grid = output.grid.unwrap();
            let unknown = grid.iter().filter(|(_, cell)| cell.depth.is_none()).count();
            assert!(i > 1 || unknown == 15, "{i}: {unknown}");
        }
    }
}

/// The tolerance in pixels of the pair is half as many of the next level.
#[test]
fn a_tolerance_in_pixels_is_halved_with_the_image() {
    let pair = wide((640, 120), 40, 5);
    let output = matched("v5", Isa::BASELINE, &pair, None);
    let grid = output.grid.unwrap();
    for levels in grid.levels() {
        let span = |level: usize| levels[level].evidence.map(|evidence| evidence.features[6]);
        // 2 px are 16 bins, less 2 on both sides; at half size 8 less 2.
        assert_eq!([span(0), span(1)], [Some(29), Some(13)]);
    }
}
