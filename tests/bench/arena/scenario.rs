//! `scenarios/arena.toml`: every run passes every checkpoint, and the checkpoints separate good
//! matchers from bad ones.

use super::seen;
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Deserialize;
use std::sync::LazyLock;
use svl::arena::{Arena, ArenaConfig};
use svl::stereo::{Frame, GridShape, Pose, Visibility};

/// Column and row.
type Place = (usize, usize);

#[derive(Deserialize)]
struct Scenario {
    arena: ArenaConfig,
    grid: Grid,
    source: Source,
    checkpoint: Vec<Checkpoint>,
}

#[derive(Deserialize)]
struct Grid {
    #[serde(flatten)]
    shape: GridShapeNumbers,
    min_valid: f64,
}

#[derive(Deserialize)]
struct GridShapeNumbers {
    columns: usize,
    rows: usize,
}

#[derive(Deserialize)]
struct Source {
    seeds: Vec<u64>,
}

#[derive(Deserialize)]
struct Checkpoint {
    number: u32,
    at_m: [f64; 2],
    radius_m: f64,
    heading_deg: f64,
    heading_tolerance_deg: f64,
    cells: Vec<Place>,
    must: Vec<Place>,
    order: Vec<Vec<Place>>,
}

impl Checkpoint {
    fn shows(&self, pose: &Pose) -> bool {
        let away = (pose.translation.x - self.at_m[0]).hypot(pose.translation.y - self.at_m[1]);
        let view = pose.rotation * Vector3::z();
        let turn = view.y.atan2(view.x).to_degrees() - self.heading_deg;
        away <= self.radius_m
            && ((turn + 540.0).rem_euclid(360.0) - 180.0).abs() <= self.heading_tolerance_deg
    }

    /// Reason why an estimate fails here, by the rules of the obstacle grid; `None` if it passes.
    fn failure(&self, estimate: &Cells, truth: &Cells) -> Option<String> {
        for &place in &self.cells {
            let (z, z_true) = (estimate.at(place), truth.at(place).unwrap());
            let right = z.map(|z| (z - z_true).abs() <= f64::max(0.10, 0.2 * z_true));
            if right == Some(false) || (self.must.contains(&place) && right.is_none()) {
                return Some(format!("cell {place:?} is {z:?} instead of {z_true:.2}"));
            }
        }
        let list = self
            .order
            .iter()
            .find(|list| !estimate.ascends(list, 1.0))?;
        Some(format!("order {list:?}"))
    }
}

/// Distances of the grid's cells in raster order.
struct Cells(Vec<Option<f64>>);

impl Cells {
    /// Medians of the disparities that `select` returns; `None` below the scenario's fraction of
    /// pixels.
    fn new(frame: &Frame, select: impl Fn(usize, usize) -> Option<f32>) -> Self {
        let Grid { shape, min_valid } = &SCENARIO.grid;
        let shape = GridShape {
            columns: shape.columns,
            rows: shape.rows,
        };
        let cell = |place| {
            let (xs, ys) = shape.pixels(place, frame.pair.size());
            let least = min_valid * (xs.len() * ys.len()) as f64;
            let pixels = ys.flat_map(|y| xs.clone().map(move |x| (x, y)));
            let mut values: Vec<f32> = pixels.filter_map(|(x, y)| select(x, y)).collect();
            values.sort_by(f32::total_cmp);
            let median = values
                .get(values.len() / 2)
                .filter(|_| values.len() as f64 >= least)?;
            frame.rig().unwrap().depth_m(f64::from(*median))
        };
        Self(shape.iter().map(cell).collect())
    }

    fn at(&self, (column, row): Place) -> Option<f64> {
        self.0[row * SCENARIO.grid.shape.columns + column]
    }

    /// True if the distances of `list` are known and ascending, each by more than the factor.
    fn ascends(&self, list: &[Place], factor: f64) -> bool {
        let distances: Option<Vec<f64>> = list.iter().map(|&place| self.at(place)).collect();
        distances.is_some_and(|d| d.is_sorted_by(|a, b| factor * a < *b))
    }
}

static SCENARIO: LazyLock<Scenario> = LazyLock::new(|| {
    toml::from_str(include_str!("../../../scenarios/arena.toml")).unwrap_or_else(|e| panic!("{e}"))
});

static RUNS: LazyLock<Vec<Arena>> = LazyLock::new(|| {
    let run = |&seed: &u64| Arena::new(&SCENARIO.arena, seed).unwrap_or_else(|e| panic!("{e}"));
    SCENARIO.source.seeds.iter().map(run).collect()
});

/// The frames that show a checkpoint, per run.
fn visits(checkpoint: &Checkpoint) -> impl Iterator<Item = (&'static Arena, Vec<u64>)> {
    RUNS.iter().map(|arena| {
        (
            arena,
            (0..arena.frames())
                .filter(|&i| checkpoint.shows(&arena.pose(i).unwrap()))
                .collect(),
        )
    })
}

#[test]
fn it_writes_out_the_default_arena() {
    assert_eq!(SCENARIO.arena, ArenaConfig::default());
    assert!(toml::from_str::<ArenaConfig>("framse = 3").is_err());
}

#[test]
fn every_run_visits_every_checkpoint() {
    assert_eq!(
        SCENARIO
            .checkpoint
            .iter()
            .map(|c| c.number)
            .collect::<Vec<_>>(),
        [1, 2, 3, 4, 5, 6]
    );
    for checkpoint in &SCENARIO.checkpoint {
        let counts: Vec<usize> = visits(checkpoint).map(|(_, frames)| frames.len()).collect();
        println!("checkpoint {}: {counts:?} frames", checkpoint.number);
        assert!(
            counts.iter().all(|&n| n >= 5),
            "checkpoint {}: {counts:?} frames",
            checkpoint.number
        );
    }
}

#[test]
fn an_excellent_matcher_passes_every_checkpoint_and_poor_ones_none() {
    let frames = SCENARIO.checkpoint.iter().flat_map(|checkpoint| {
        visits(checkpoint).flat_map(move |(arena, frames)| {
            frames.into_iter().map(move |i| (checkpoint, arena, i))
        })
    });
    // Every fourth in the nightly checks: one or two of each checkpoint in each run.
    frames
        .step_by(crate::common::step(4))
        .collect::<Vec<_>>()
        .par_iter()
        .for_each(|&(checkpoint, arena, index)| {
            let frame = arena.frame(index).unwrap();
            let truth = frame.truth.as_ref().unwrap();
            let visibility = truth.visibility.as_ref().unwrap();
            let exact = |x, y| truth.disparity.get(x, y);
            let expected = Cells::new(&frame, |x, y| Some(exact(x, y)));
            let place = format!(
                "checkpoint {}, frame {index}, {:.2?}",
                checkpoint.number, expected.0
            );
            for list in &checkpoint.order {
                assert!(
                    expected.ascends(list, 1.08),
                    "{place}: order {list:?} has no margin"
                );
            }
            // Whole pixels, up to 80, if both cameras see the point.
            let both = |x, y| visibility.get(x, y) == Visibility::Visible && exact(x, y) <= 80.0;
            let good = |x, y| both(x, y).then(|| exact(x, y).round());
            // The same without the floor and the laboratory, which have little texture.
            let choosy = |x, y| {
                let p = seen(&frame, x, y).1;
                let arena =
                    (-0.05..2.05).contains(&p.x) && (-0.05..3.05).contains(&p.y) && p.z > 0.001;
                good(x, y).filter(|_| arena)
            };
            for (who, cells) in [
                ("good", Cells::new(&frame, good)),
                ("choosy", Cells::new(&frame, choosy)),
            ] {
                assert_eq!(
                    checkpoint.failure(&cells, &expected),
                    None,
                    "{place}: the {who} matcher"
                );
            }
            let poor = [6.0, 14.0, 24.0, 40.0].map(|d| Cells::new(&frame, |_, _| Some(d)));
            let blind = Cells::new(&frame, |_, _| None);
            let far = Cells::new(&frame, |x, y| Some(exact(x, y) / 1.3));
            let aside = Cells::new(&frame, |x, y| Some(exact((x + 128) % 320, y)));
            for cells in poor.iter().chain([&blind, &far, &aside]) {
                assert!(
                    checkpoint.failure(cells, &expected).is_some(),
                    "{place}: {:.2?} passes",
                    cells.0
                );
            }
        });
}
