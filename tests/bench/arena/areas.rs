//! Areas of cells, and obstacles that are not floor: against a slow count of the arena's surfaces,
//! for points of the same truth, and by a plane instead of surfaces.

use svl::arena::{Arena, ArenaConfig};
use svl::depth::{GridSettings, grid};
use svl::score::{AreaChoice, CellArea, CellJudgement, CellTallies, TrueCells, Verdict};
use svl::stereo::{
    CellRule, FloorPlane, Frame, GridShape, MapDensity, Plane, Surface, Truth, TruthKind,
};

const BEYOND_M: f64 = 2.0;

/// The arena's rule.
const RULE: CellRule = CellRule::Distance {
    tolerance_m: 0.1,
    tolerance_percent: 20.0,
    obstacle_m: 0.5,
    clear_m: 0.75,
    beyond_m: Some(BEYOND_M),
};

/// Every n-th frame of a seed.
fn frames(seed: u64, every: usize) -> Vec<Frame> {
    let arena = Arena::new(&ArenaConfig::default(), seed).unwrap();
    let numbers = (0..arena.frames()).step_by(every);
    numbers.map(|i| arena.frame(i).unwrap()).collect()
}

/// The area of a cell and whether a quarter of it is an obstacle, pixel by pixel.
fn counted(frame: &Frame, shape: GridShape, place: (usize, usize)) -> (CellArea, bool) {
    let (truth, rig) = (frame.truth.as_ref().unwrap(), frame.rig().unwrap());
    let surfaces = truth.surface.as_ref().unwrap();
    let (columns, rows) = shape.pixels(place, truth.disparity.size());
    let (mut floor, mut near, mut distances) = (0, 0, Vec::new());
    for y in rows {
        for x in columns.clone() {
            let z = rig
                .depth_m(truth.disparity.get(x, y).into())
                .unwrap_or(f64::INFINITY);
            let is_floor = surfaces.get(x, y) == Surface::Floor;
            floor += usize::from(is_floor);
            near += usize::from(!is_floor && z < 0.5);
            distances.push(z);
        }
    }
    distances.sort_by(f64::total_cmp);
    let pixels = distances.len();
    let area = if 2 * floor >= pixels {
        CellArea::Floor
    } else if distances[pixels / 2] > BEYOND_M {
        CellArea::Beyond
    } else {
        CellArea::Obstacle
    };
    (area, 4 * near >= pixels)
}

/// The scores of a report of 0.4 m everywhere.
fn judged(frame: &Frame, rule: CellRule) -> Vec<CellJudgement> {
    let shape = GridShape::default();
    let truth = TrueCells::new(frame, shape, rule).unwrap();
    let (width, height) = frame.pair.size();
    let px = frame.rig().unwrap().disparity_px(0.4) as f32;
    let map = Plane::filled(width, height, px).unwrap();
    truth.judge(frame, &grid(&map, GridSettings::from(shape), frame.rig()))
}

/// The frame with another truth of the same disparities.
fn with_truth(frame: &Frame, change: impl FnOnce(Truth) -> Truth) -> Frame {
    let truth = frame.truth.clone().map(change);
    Frame {
        truth,
        ..frame.clone()
    }
}

#[test]
fn areas_and_obstacles_equal_a_count_of_the_pixels() {
    let shape = GridShape::default();
    let mut counts = [0; 3];
    for frame in frames(304, 40) {
        let cells = judged(&frame, RULE);
        for (place, cell) in shape.iter().zip(&cells) {
            let (area, is_obstacle) = counted(&frame, shape, place);
            assert_eq!(cell.area, Some(area), "{} {place:?}", frame.sequence);
            assert_eq!(
                cell.near.is_near, is_obstacle,
                "{} {place:?}",
                frame.sequence
            );
            counts[area as usize] += 1;
        }
        // The areas add up to what was one number before there were areas.
        let tallies = CellTallies::new(&cells);
        let sum = |count: fn(&svl::score::CellTally) -> usize| {
            let parts = AreaChoice::PARTS.map(|area| count(tallies.get(area)));
            (
                parts.iter().sum::<usize>(),
                count(tallies.get(AreaChoice::All)),
            )
        };
        for (parts, all) in [
            sum(|cells| cells.right),
            sum(|cells| cells.wrong),
            sum(|cells| cells.unknown),
            sum(|cells| cells.near),
        ] {
            assert_eq!(parts, all);
        }
    }
    assert!(counts.iter().all(|count| *count > 10), "{counts:?}");
}

#[test]
fn points_have_the_areas_of_all_pixels() {
    let sparse = |truth: Truth| {
        let every = |x: usize, y: usize| x % 5 == 2 && y % 3 == 1;
        let (width, height) = truth.disparity.size();
        let points = Plane::from_fn(width, height, |x, y| {
            if every(x, y) {
                truth.disparity.get(x, y)
            } else {
                f32::INFINITY
            }
        });
        Truth {
            disparity: points.unwrap(),
            kind: TruthKind {
                density: MapDensity::Sparse,
                ..TruthKind::default()
            },
            ..truth
        }
    };
    let (mut all, mut alike) = (0, 0);
    for frame in frames(2, 40) {
        let points = judged(&with_truth(&frame, sparse), RULE);
        for (dense, points) in judged(&frame, RULE).iter().zip(&points) {
            if points.verdict != Verdict::NoTruth && points.near.is_known {
                all += 1;
                let is_alike =
                    points.area == dense.area && points.near.is_near == dense.near.is_near;
                alike += usize::from(is_alike);
            }
        }
    }
    assert!(all > 80 && 100 * alike >= 97 * all, "{alike} of {all}");
}

#[test]
fn a_plane_below_the_camera_tells_floor_nearly_as_surfaces_do() {
    let height_m = ArenaConfig::default().rig.above_floor_m;
    let (mut near, mut lost, mut gained, mut cells, mut moved) = (0, 0, 0, 0, 0);
    for frame in frames(304, 8) {
        let by_plane = with_truth(&frame, |truth| {
            let floor = FloorPlane::level(height_m);
            let surface = floor.surfaces(&truth.disparity, frame.rig().unwrap());
            Truth {
                surface: Some(surface),
                ..truth
            }
        });
        for (exact, plane) in judged(&frame, RULE).iter().zip(&judged(&by_plane, RULE)) {
            cells += 1;
            moved += usize::from(exact.area != plane.area);
            near += usize::from(exact.near.is_near);
            lost += usize::from(exact.near.is_near && !plane.near.is_near);
            gained += usize::from(!exact.near.is_near && plane.near.is_near);
        }
    }
    println!("near {near}, lost {lost}, gained {gained}; {moved} of {cells} cells of other areas");
    assert!(
        near > 20 && 100 * (lost + gained) <= 12 * near,
        "{near}: {lost}, {gained}"
    );
    assert!(100 * moved <= 4 * cells, "{moved} of {cells}");
}

#[test]
fn floor_is_unknown_where_nothing_tells_it() {
    let frame = frames(1, 200).swap_remove(0);
    let silent = with_truth(&frame, |truth| Truth {
        surface: None,
        ..truth
    });
    let cells = judged(&silent, RULE);
    assert!(cells.iter().all(|cell| cell.area != Some(CellArea::Floor)));
    // Near floor counts as an obstacle then, as nothing says otherwise.
    let near = |cells: &[CellJudgement]| cells.iter().filter(|cell| cell.near.is_near).count();
    assert!(near(&cells) > near(&judged(&frame, RULE)));
    assert!(!cells.iter().any(|cell| cell.near.is_floor));
    // All of it floor, and all beyond.
    let of_one = |surface, rule| {
        let frame = with_truth(&frame, |truth| Truth {
            surface: Some(truth.disparity.map(|_| surface)),
            ..truth
        });
        let areas: Vec<_> = judged(&frame, rule).iter().map(|cell| cell.area).collect();
        areas
    };
    let all_floor = of_one(Surface::Floor, RULE);
    assert!(all_floor.iter().all(|area| *area == Some(CellArea::Floor)));
    let CellRule::Distance {
        tolerance_m,
        tolerance_percent,
        ..
    } = RULE
    else {
        return;
    };
    let all_beyond = CellRule::Distance {
        tolerance_m,
        tolerance_percent,
        obstacle_m: 0.01,
        clear_m: 0.02,
        beyond_m: Some(0.03),
    };
    let areas = of_one(Surface::Wall, all_beyond);
    assert!(areas.iter().all(|area| *area == Some(CellArea::Beyond)));
}
