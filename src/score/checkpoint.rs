//! Checkpoints: situations of the thesis's arena (chapter 7) in which the robot has to see one
//! thing.

use super::{CellJudgement, Verdict};
use crate::counted;
use crate::error::{Error, Result};
use crate::stereo::{DepthGrid, GridShape, Pose};
use std::cmp::Ordering;

/// A pose on the robot's path, and what has to be seen there.
///
/// Cells are `[column, row]`, row 0 on top.
#[derive(Clone, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    pub number: u32,
    pub name: String,
    pub description: String,
    /// Where the left camera is, metres on the floor.
    pub at_m: [f64; 2],
    /// How near to it a frame must be taken.
    pub radius_m: f64,
    /// Direction of view in the world, `atan2(y, x)`.
    pub heading_deg: f64,
    pub heading_tolerance_deg: f64,
    /// None of these may be wrong.
    pub cells: Vec<[usize; 2]>,
    /// All of these must be right.
    pub must: Vec<[usize; 2]>,
    /// Each list: cells from the nearest to the farthest, by reported distance, strictly.
    #[serde(default)]
    pub order: Vec<Vec<[usize; 2]>>,
}

impl Checkpoint {
    /// # Errors
    /// [`Error::Invalid`] naming the checkpoint and what contradicts itself.
    pub fn validate(&self, shape: GridShape) -> Result<()> {
        let wrong = |what: String| {
            Err(Error::Invalid(format!(
                "checkpoint {} ({}): {what}",
                self.number, self.name
            )))
        };
        let numbers = [
            self.at_m[0],
            self.at_m[1],
            self.radius_m,
            self.heading_deg,
            self.heading_tolerance_deg,
        ];
        if !numbers.iter().all(|v| v.is_finite())
            || self.radius_m <= 0.0
            || self.heading_tolerance_deg <= 0.0
        {
            return wrong(
                "at_m and heading_deg must be numbers, radius_m and heading_tolerance_deg positive"
                    .into(),
            );
        }
        let all = self
            .cells
            .iter()
            .chain(&self.must)
            .chain(self.order.iter().flatten());
        if let Some([column, row]) = all
            .copied()
            .find(|[c, r]| *c >= shape.columns || *r >= shape.rows)
        {
            return wrong(format!(
                "cell [{column}, {row}] is outside the grid of {}x{}",
                shape.columns, shape.rows
            ));
        }
        if self.must.is_empty() {
            return wrong("'must' names no cell, so nothing would be tested".into());
        }
        Ok(())
    }

    /// Whether a frame taken from `pose` belongs to this checkpoint.
    pub fn covers(&self, pose: &Pose) -> bool {
        let at = pose.translation.vector;
        let view = pose.rotation * nalgebra::Vector3::z();
        let heading_deg = view.y.atan2(view.x).to_degrees();
        // Difference of two directions, in -180..180.
        let off_deg = (heading_deg - self.heading_deg + 180.0).rem_euclid(360.0) - 180.0;
        (at.x - self.at_m[0]).hypot(at.y - self.at_m[1]) <= self.radius_m
            && off_deg.abs() <= self.heading_tolerance_deg
    }

    /// Judges one of its frames from the reported grid and the cells' judgements, which are in
    /// raster order.
    pub fn judge(&self, grid: &DepthGrid, judgements: &[CellJudgement]) -> CheckpointFrame {
        let judgement =
            |[column, row]: [usize; 2]| &judgements[row * grid.shape().columns + column];
        let count = |cells: &[[usize; 2]], v: Verdict| {
            cells.iter().filter(|&&c| judgement(c).verdict == v).count()
        };
        let must_right = count(&self.must, Verdict::Right);
        let wrong = count(&self.cells, Verdict::Wrong);
        let distance =
            |&[column, row]: &[usize; 2]| grid.cell(column, row).depth.and_then(|d| d.distance_m);
        let order_holds = self.order.iter().all(|cells| {
            let distances: Vec<_> = cells.iter().map(distance).collect();
            // An unknown cell has no place in an order.
            distances.iter().all(Option::is_some)
                && distances.is_sorted_by(|nearer, farther| nearer < farther)
        });
        let error = |cell: &[usize; 2]| match (judgement(*cell).true_m, distance(cell)) {
            (Some(z_true), Some(z)) => (z - z_true).abs() / z_true,
            _ => f64::INFINITY,
        };
        CheckpointFrame {
            passed: must_right == self.must.len() && wrong == 0 && order_holds,
            must_missing: self.must.len() - must_right,
            wrong,
            order_holds,
            error: self.must.iter().map(error).fold(0.0, f64::max),
        }
    }
}

/// A checkpoint's verdict in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CheckpointFrame {
    pub passed: bool,
    /// Cells that must be right and are not.
    pub must_missing: usize,
    /// Cells that are wrong.
    pub wrong: usize,
    /// Whether the reported distances are in the order they must be in.
    pub order_holds: bool,
    /// The largest relative error of distance among the cells that must be right; infinite when one
    /// is unknown.
    pub error: f64,
}

impl CheckpointFrame {
    /// Orders frames from the best to the worst: by what fails, and where that is equal by the
    /// error of distance.
    fn badness(&self, other: &Self) -> Ordering {
        // In the order of severity: a wrong cell may make the robot hit something, a missing one
        // makes it stop.
        let failures = |f: &Self| (!f.passed, f.wrong, f.must_missing, !f.order_holds);
        failures(self)
            .cmp(&failures(other))
            .then(self.error.total_cmp(&other.error))
    }

    /// What is amiss, in words; nothing when it passed.
    pub fn reasons(&self) -> Option<String> {
        let cells = |n: usize| counted(n, "cell");
        let amiss = [
            (self.wrong > 0).then(|| format!("{} wrong", cells(self.wrong))),
            (self.must_missing > 0).then(|| {
                format!(
                    "{} of those that must be right not right",
                    cells(self.must_missing)
                )
            }),
            (!self.order_holds).then(|| "order of distances not seen".to_owned()),
        ];
        (!self.passed).then(|| amiss.into_iter().flatten().collect::<Vec<_>>().join(", "))
    }
}

/// A checkpoint over the frames of one run or of several.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckpointTally<F> {
    pub frames: usize,
    pub passed: usize,
    /// The best frame: the first of the best.
    pub best: Option<(F, CheckpointFrame)>,
    /// The worst frame: the first of the worst.
    pub worst: Option<(F, CheckpointFrame)>,
}

impl<F> Default for CheckpointTally<F> {
    fn default() -> Self {
        Self {
            frames: 0,
            passed: 0,
            best: None,
            worst: None,
        }
    }
}

impl<F> CheckpointTally<F> {
    /// Whether a frame with that score would become the best, the worst.
    pub fn would_lead(&self, frame: &CheckpointFrame) -> (bool, bool) {
        let best = self
            .best
            .as_ref()
            // Strictly better: of equal frames the first stays, so the result does not depend on
            // how a run is split.
            .is_none_or(|(_, b)| frame.badness(b).is_lt());
        let worst = self
            .worst
            .as_ref()
            .is_none_or(|(_, w)| frame.badness(w).is_gt());
        (best, worst)
    }

    /// Counts a frame; `keep` makes what is kept of it when it leads.
    pub fn add(&mut self, frame: CheckpointFrame, keep: impl Fn() -> F) {
        let (best, worst) = self.would_lead(&frame);
        if best {
            self.best = Some((keep(), frame));
        }
        if worst {
            self.worst = Some((keep(), frame));
        }
        self.frames += 1;
        self.passed += usize::from(frame.passed);
    }

    /// Share of the frames that passed; nothing without frames.
    pub fn share(&self) -> Option<f64> {
        (self.frames > 0).then(|| self.passed as f64 / self.frames as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::{Cell, CellDepth};

    const SHAPE: GridShape = GridShape {
        columns: 3,
        rows: 1,
    };

    fn opening() -> Checkpoint {
        Checkpoint {
            number: 1,
            name: "opening".into(),
            description: String::new(),
            at_m: [1.0, 0.5],
            radius_m: 0.1,
            heading_deg: 90.0,
            heading_tolerance_deg: 5.0,
            cells: vec![[0, 0], [1, 0], [2, 0]],
            must: vec![[1, 0]],
            order: vec![vec![[0, 0], [1, 0]], vec![[2, 0], [1, 0]]],
        }
    }

    fn judged(cells: [(Option<f64>, Verdict); 3]) -> CheckpointFrame {
        let cell = |distance_m: Option<f64>| Cell {
            valid_share: 0.5,
            depth: distance_m.map(|z| CellDepth {
                median_px: 1.0,
                p20_px: 1.0,
                p80_px: 1.0,
                distance_m: Some(z),
            }),
        };
        let grid = DepthGrid::new(SHAPE, cells.iter().map(|(z, _)| cell(*z)).collect()).unwrap();
        let judgement = |verdict| CellJudgement {
            verdict,
            true_px: Some(9.0),
            true_m: Some(1.0),
            missed_obstacle: false,
            false_obstacle: false,
        };
        opening().judge(&grid, &cells.map(|(_, verdict)| judgement(verdict)))
    }

    #[test]
    fn passes_when_right_and_in_order() {
        use Verdict::{Right, Unknown, Wrong};
        assert!(judged([(Some(0.5), Right), (Some(1.5), Right), (Some(0.5), Right)]).passed);
        let wrong = judged([(Some(0.5), Wrong), (Some(1.5), Right), (Some(0.5), Right)]);
        assert_eq!(wrong.reasons().unwrap(), "1 cell wrong");
        let unknown = judged([(Some(0.5), Right), (None, Unknown), (Some(0.5), Right)]);
        assert!(!unknown.passed && !unknown.order_holds && unknown.wrong == 0);
        let level = judged([(Some(1.5), Right), (Some(1.5), Right), (Some(0.5), Right)]);
        assert_eq!(level.reasons().unwrap(), "order of distances not seen");
    }

    #[test]
    fn covers_by_place_and_heading() {
        // Optical frame looking along +y of the world: its z is the world's y, its x the world's x,
        // its y downwards.
        let looking = |yaw_deg: f64, x: f64| {
            let axes = nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(
                1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0,
            ));
            let turn = nalgebra::Rotation3::from_axis_angle(
                &nalgebra::Vector3::z_axis(),
                yaw_deg.to_radians(),
            );
            Pose::from_parts(
                [x, 0.5, 0.06].into(),
                nalgebra::UnitQuaternion::from_rotation_matrix(&(turn * axes)),
            )
        };
        assert!(opening().covers(&looking(0.0, 1.0)));
        assert!(opening().covers(&looking(-4.9, 1.09)) && opening().covers(&looking(4.9, 0.91)));
        assert!(!opening().covers(&looking(5.1, 1.0)) && !opening().covers(&looking(0.0, 1.11)));
        let west = Checkpoint {
            heading_deg: -179.0,
            ..opening()
        };
        assert!(
            west.covers(&looking(92.0, 1.0)),
            "179 and -179 degrees are two apart wrapping around"
        );
    }

    #[test]
    fn tally_keeps_the_first_best_and_worst() {
        let frame = |wrong, error| CheckpointFrame {
            passed: wrong == 0,
            must_missing: 0,
            wrong,
            order_holds: true,
            error,
        };
        let frames = [
            frame(1, 0.9),
            frame(0, 0.2),
            frame(3, 0.1),
            frame(0, 0.1),
            frame(3, 0.1),
            frame(0, 0.1),
        ];
        let mut tally = CheckpointTally::default();
        for (sequence, verdict) in frames.into_iter().enumerate() {
            tally.add(verdict, || sequence);
        }
        assert_eq!(
            (tally.frames, tally.passed, tally.share()),
            (6, 3, Some(0.5))
        );
        assert_eq!((tally.best.unwrap().0, tally.worst.unwrap().0), (3, 2));
    }

    #[test]
    fn nonsense_is_refused() {
        for broken in [
            Checkpoint {
                cells: vec![[3, 0]],
                ..opening()
            },
            Checkpoint {
                must: vec![],
                ..opening()
            },
            Checkpoint {
                radius_m: 0.0,
                ..opening()
            },
            Checkpoint {
                heading_deg: f64::NAN,
                ..opening()
            },
        ] {
            assert!(
                broken
                    .validate(SHAPE)
                    .unwrap_err()
                    .to_string()
                    .starts_with("checkpoint 1 (opening): ")
            );
        }
        opening().validate(SHAPE).unwrap();
    }
}
