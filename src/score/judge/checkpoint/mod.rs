//! Checkpoints: situations in which the robot has to see one thing, as in the thesis's arena
//! (chapter 7), or as measured by a person in a recording.

mod cell;
mod place;
mod tally;

pub use cell::{CellExpectation, ExpectedCell};
pub use place::{CheckpointFault, CheckpointPlace, FrameOrigin};
pub use tally::CheckpointTally;

use super::{CellJudgement, Verdict};
use std::cmp::Ordering;
use std::fmt::Display;
use svl_core::stereo::{CellRule, DepthGrid, Frame, GridShape, hash_words};
use svl_core::{Error, Result, counted, joined};

/// Frames of a run, and what must be seen in them.
///
/// Cells are `[column, row]`, row 0 at the top.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "CheckpointTable", into = "CheckpointTable")]
pub struct Checkpoint {
    pub number: u32,
    pub name: String,
    pub description: String,
    /// The frames that show it.
    pub place: CheckpointPlace,
    /// The run they belong to, in a scenario of recordings: the end of its file's path.
    pub file: Option<String>,
    /// The frames at which a person labelled it, with their pairs.
    pub pairs: Vec<LabelledPair>,
    /// None of these may be wrong; needs truth.
    pub cells: Vec<[usize; 2]>,
    /// All of these must be right; needs truth.
    pub must: Vec<[usize; 2]>,
    /// Each list: cells from the nearest to the farthest, by reported distance, strictly.
    pub order: Vec<Vec<[usize; 2]>>,
    /// Measurements or estimates by eye; they need no truth.
    pub expected: Vec<ExpectedCell>,
}

/// The pair seen by the person who labelled it.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LabelledPair {
    pub frame: u64,
    /// Hash of its pixels, as in the tables of a report.
    pub hash: String,
}

impl LabelledPair {
    /// The pair of a frame.
    pub fn new(frame: &Frame) -> Self {
        Self {
            frame: frame.sequence,
            hash: hash_words(frame.pair.hash()),
        }
    }
}

/// The labelled pairs in a file.
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(
    untagged,
    expecting = "expected { frame = N, hash = \"…\" }, or a list of them"
)]
enum WrittenPairs {
    One(LabelledPair),
    Several(Vec<LabelledPair>),
}

/// A checkpoint in a file.
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct CheckpointTable {
    number: u32,
    name: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    description: String,
    at_m: Option<[f64; 2]>,
    radius_m: Option<f64>,
    heading_deg: Option<f64>,
    heading_tolerance_deg: Option<f64>,
    frames: Option<[u64; 2]>,
    seconds: Option<[f64; 2]>,
    file: Option<String>,
    pair: Option<WrittenPairs>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    cells: Vec<[usize; 2]>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    must: Vec<[usize; 2]>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    order: Vec<Vec<[usize; 2]>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    cell: Vec<ExpectedCell>,
}

impl TryFrom<CheckpointTable> for Checkpoint {
    type Error = Error;

    fn try_from(mut table: CheckpointTable) -> Result<Self> {
        let written = table.pair.take();
        let CheckpointTable { number, name, .. } = &table;
        let pairs = match written {
            None => Vec::new(),
            Some(WrittenPairs::One(pair)) => vec![pair],
            Some(WrittenPairs::Several(pairs)) => pairs,
        };
        // Labelled pairs are a place, too, if no other is given.
        let has_place = table.at_m.is_some() || table.seconds.is_some();
        let labelled = || {
            let frames = || pairs.iter().map(|pair| pair.frame);
            Some([frames().min()?, frames().max()?])
        };
        let frames = table.frames.or_else(|| labelled().filter(|_| !has_place));
        let tolerance_deg = table.heading_tolerance_deg;
        let angles = [table.radius_m, table.heading_deg, tolerance_deg];
        let place = CheckpointPlace::new(table.at_m, angles, frames, table.seconds);
        let wrong = |what| Error::Invalid(format!("checkpoint {number} ({name}): {what}"));
        let place = place.map_err(wrong)?;
        Ok(Self {
            number: table.number,
            name: table.name,
            description: table.description,
            place,
            file: table.file,
            pairs,
            cells: table.cells,
            must: table.must,
            order: table.order,
            expected: table.cell,
        })
    }
}

impl From<Checkpoint> for CheckpointTable {
    fn from(checkpoint: Checkpoint) -> Self {
        let mut table = Self {
            number: checkpoint.number,
            name: checkpoint.name,
            description: checkpoint.description,
            at_m: None,
            radius_m: None,
            heading_deg: None,
            heading_tolerance_deg: None,
            frames: None,
            seconds: None,
            file: checkpoint.file,
            pair: match checkpoint.pairs.len() {
                0 => None,
                1 => checkpoint.pairs.into_iter().next().map(WrittenPairs::One),
                _ => Some(WrittenPairs::Several(checkpoint.pairs)),
            },
            cells: checkpoint.cells,
            must: checkpoint.must,
            order: checkpoint.order,
            cell: checkpoint.expected,
        };
        match checkpoint.place {
            CheckpointPlace::Pose {
                at_m,
                radius_m,
                heading_deg,
                heading_tolerance_deg,
            } => {
                table.at_m = Some(at_m);
                table.radius_m = Some(radius_m);
                table.heading_deg = Some(heading_deg);
                table.heading_tolerance_deg = Some(heading_tolerance_deg);
            }
            CheckpointPlace::Frames(frames) => table.frames = Some(frames),
            CheckpointPlace::Seconds(seconds) => table.seconds = Some(seconds),
        }
        table
    }
}

impl Checkpoint {
    /// # Errors
    /// [`Error::Invalid`] with the name of the checkpoint and its contradiction.
    pub fn validate(&self, shape: GridShape) -> Result<()> {
        self.place.validate().or_else(|what| self.wrong(what))?;
        let mut frames = self.pairs.iter().map(|pair| pair.frame);
        if let CheckpointPlace::Frames([first, last]) = self.place
            && let Some(frame) = frames.find(|frame| !(first..=last).contains(frame))
        {
            return self.wrong(format!(
                "frame {frame} was labelled, and its frames are {first} to {last}: extend them, or \
                 label it in one of these"
            ));
        }
        let all = self.cells.iter().chain(&self.must);
        let all = all.chain(self.order.iter().flatten());
        let all = all.chain(self.expected.iter().map(|cell| &cell.at));
        if let Some([column, row]) = all
            .copied()
            .find(|[c, r]| *c >= shape.columns || *r >= shape.rows)
        {
            let (columns, rows) = (shape.columns, shape.rows);
            return self.wrong(format!(
                "cell [{column}, {row}] is outside the grid of {columns}x{rows}"
            ));
        }
        for (i, cell) in self.expected.iter().enumerate() {
            cell.validate().or_else(|what| self.wrong(what))?;
            let [column, row] = cell.at;
            if self.expected[..i].iter().any(|other| other.at == cell.at) {
                let what = format!("cell [{column}, {row}] is expected twice; list it once");
                return self.wrong(what);
            }
        }
        if self.must.is_empty() && self.order.is_empty() && self.expected.is_empty() {
            return self.wrong(
                "names no cell in must, order or [[checkpoint.cell]], so nothing would be tested",
            );
        }
        Ok(())
    }

    fn wrong<T>(&self, what: impl Display) -> Result<T> {
        let Self { number, name, .. } = self;
        Err(Error::Invalid(format!(
            "checkpoint {number} ({name}): {what}"
        )))
    }

    /// True if its conditions on cells can only be checked against true distances.
    pub fn needs_truth(&self) -> bool {
        !(self.cells.is_empty() && self.must.is_empty())
    }

    /// True if it needs reported distances, which only a calibrated pair has.
    pub fn needs_rig(&self) -> bool {
        !(self.order.is_empty() && self.expected.is_empty())
    }

    /// Rejects a run by its first frame if nothing could ever pass. `why_no_pose`: the reason why
    /// the frames of a source with poses have none.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the missing input and the remedy.
    pub fn check_frame(
        &self,
        frame: &Frame,
        run: &FrameOrigin,
        why_no_pose: &dyn Fn() -> Option<String>,
    ) -> Result<()> {
        if !run.is_in(self.file.as_deref()) {
            return Ok(());
        }
        let source = if run.name.is_empty() {
            "the source"
        } else {
            &run.name
        };
        if self.needs_rig() && frame.rig().is_none() {
            return self.wrong(format!(
                "expects distances, and {source} has no calibration: name one with source.calib or \
                 --calib"
            ));
        }
        if self.needs_truth() && frame.truth.is_none() {
            return self.wrong(format!(
                "`cells` and `must` are compared with true distances, and {source} has none: enter \
                 the measurements in [[checkpoint.cell]]"
            ));
        }
        if matches!(self.place, CheckpointPlace::Pose { .. }) && frame.pose.is_none() {
            let none = why_no_pose().map_or_else(
                || format!("{source} has none"),
                |reason| format!("those of {source} are not usable ({reason})"),
            );
            return self.wrong(format!(
                "at_m needs poses, and {none}: name its frames by frames or seconds"
            ));
        }
        Ok(())
    }

    /// Warns if it ends after the run's last pair, of that number and stamp: a typing error, or a
    /// recording that is shorter than expected.
    pub fn warn_beyond(&self, last: (u64, u64), run: &FrameOrigin) {
        let Self { number, name, .. } = self;
        let here = run.is_in(self.file.as_deref());
        if let Some(range) = self.place.beyond(last, run).filter(|_| here) {
            tracing::warn!("checkpoint {number} ({name}): {range}");
        }
    }

    /// Rejects a frame that was another pair when it was labelled. `hash`: that of its pair.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the remedy.
    pub(super) fn check_pair(
        &self,
        frame: &Frame,
        run: &FrameOrigin,
        hash: impl FnOnce() -> u128,
    ) -> Result<()> {
        let mut pairs = self.pairs.iter();
        let Some(pair) = pairs.find(|pair| pair.frame == frame.sequence) else {
            return Ok(());
        };
        // A perturbation changes pairs, but not their scene.
        if run.stress.is_some() || !run.is_in(self.file.as_deref()) {
            return Ok(());
        }
        let found = hash_words(hash());
        if found == pair.hash {
            return Ok(());
        }
        let (frame, labelled) = (pair.frame, &pair.hash);
        self.wrong(format!(
            "frame {frame} is not the pair that was labelled, by their hashes {found} and \
             {labelled}: score the recording of then, read with the same options, label it again, \
             or remove `pair`"
        ))
    }

    /// True if a frame of that run shows this checkpoint.
    pub fn covers(&self, frame: &Frame, run: &FrameOrigin) -> bool {
        run.is_in(self.file.as_deref()) && self.place.covers(frame, run)
    }

    /// The expected cells that are wrong or missing in a frame, in words.
    pub fn findings(&self, grid: &DepthGrid, rule: CellRule) -> Vec<CellFinding> {
        let finding = |cell: &ExpectedCell| {
            let [column, row] = cell.at;
            let of_grid = grid.cell(column, row);
            let reported = of_grid.depth;
            let is_wrong = match cell.judge(of_grid, rule) {
                Verdict::Wrong => true,
                Verdict::Unknown => false,
                Verdict::Right | Verdict::NoTruth => return None,
            };
            let said = match reported.map(|depth| depth.distance_m) {
                Some(Some(z)) => format!("{z:.2} m"),
                Some(None) => "infinitely far".to_owned(),
                None => "unknown".to_owned(),
            };
            let expected = cell.words(rule);
            Some(CellFinding {
                at: cell.at,
                is_wrong,
                words: format!("({column}, {row}) {said}, expected {expected}"),
            })
        };
        self.expected.iter().filter_map(finding).collect()
    }

    /// The reasons why a frame fails that are not among the findings, with their cells.
    pub fn failures(&self, grid: &DepthGrid, judgements: Option<&[CellJudgement]>) -> Vec<String> {
        let verdict = |[column, row]: [usize; 2]| {
            let place = row * grid.shape().columns + column;
            judgements.map_or(Verdict::NoTruth, |judgements| judgements[place].verdict)
        };
        let name = |[column, row]: &[usize; 2]| format!("({column}, {row})");
        let of_cell = |cell: &[usize; 2]| match verdict(*cell) {
            Verdict::Wrong if self.cells.contains(cell) => Some(format!("{} is wrong", name(cell))),
            Verdict::Right => None,
            Verdict::NoTruth if self.must.contains(cell) => {
                Some(format!("{} has too little truth to be scored", name(cell)))
            }
            _ if self.must.contains(cell) => Some(format!("{} is not right", name(cell))),
            _ => None,
        };
        let others = self.must.iter().filter(|cell| !self.cells.contains(cell));
        let cells = self.cells.iter().chain(others).filter_map(of_cell);
        let orders = self.order.iter().filter(|cells| !is_ordered(cells, grid));
        let orders = orders.map(|cells| {
            let names = joined(cells.iter().map(name));
            format!("{names} are not in this order, from near to far")
        });
        cells.chain(orders).collect()
    }

    /// Scores one of its frames from the reported grid and the cells' scores, in raster order;
    /// without scores no cell of `must` is right.
    pub fn judge(
        &self,
        grid: &DepthGrid,
        judgements: Option<&[CellJudgement]>,
        rule: CellRule,
    ) -> CheckpointFrame {
        let judgement = |[column, row]: [usize; 2]| {
            let place = row * grid.shape().columns + column;
            judgements.map_or_else(CellJudgement::default, |own| own[place])
        };
        let count = |cells: &[[usize; 2]], v: Verdict| {
            cells.iter().filter(|&&c| judgement(c).verdict == v).count()
        };
        let depth = |[column, row]: [usize; 2]| grid.cell(column, row).depth;
        let expected = |v: Verdict| {
            let cells = self.expected.iter();
            let verdicts = cells.map(|cell| cell.judge(grid.cell(cell.at[0], cell.at[1]), rule));
            verdicts.filter(|verdict| *verdict == v).count()
        };
        let must_right = count(&self.must, Verdict::Right);
        let missing = self.must.len() - must_right + expected(Verdict::Unknown);
        let wrong = count(&self.cells, Verdict::Wrong) + expected(Verdict::Wrong);
        let distance = |cell: &[usize; 2]| depth(*cell).and_then(|d| d.distance_m);
        let order_holds = self.order.iter().all(|cells| is_ordered(cells, grid));
        let error = |true_m: Option<f64>, cell: &[usize; 2]| match (true_m, distance(cell)) {
            (Some(z_true), Some(z)) => (z - z_true).abs() / z_true,
            _ => f64::INFINITY,
        };
        // There is no error of a distance at infinity.
        let is_far = |cell: &CellJudgement| cell.true_px.is_some() && cell.true_m.is_none();
        let must = self.must.iter().map(|cell| (cell, judgement(*cell)));
        let must = must.filter(|(_, truth)| !is_far(truth));
        let must = must.map(|(cell, truth)| error(truth.true_m, cell));
        let measured = self.expected.iter();
        let measured = measured.filter(|cell| cell.distance_m().is_some());
        let measured = measured.map(|cell| error(cell.distance_m(), &cell.at));
        CheckpointFrame {
            passed: missing == 0 && wrong == 0 && order_holds,
            missing,
            wrong,
            order_holds,
            error: must.chain(measured).fold(0.0, f64::max),
        }
    }
}

/// True if all of the cells are known and each is farther than the one before it.
fn is_ordered(cells: &[[usize; 2]], grid: &DepthGrid) -> bool {
    let distance = |&[column, row]: &[usize; 2]| {
        let depth = grid.cell(column, row).depth?;
        depth.distance_m.or(depth.is_far().then_some(f64::INFINITY))
    };
    let distances: Vec<_> = cells.iter().map(distance).collect();
    distances.iter().all(Option::is_some)
        && distances.is_sorted_by(|nearer, farther| nearer < farther)
}

/// An expected cell that fails.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CellFinding {
    pub at: [usize; 2],
    /// True if it is wrong, not only missing.
    pub is_wrong: bool,
    /// The report and the expectation.
    pub words: String,
}

/// Result of a checkpoint in one frame.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CheckpointFrame {
    pub passed: bool,
    /// Cells that must be right and are not, or that must show something and are unknown.
    pub missing: usize,
    /// Cells that are wrong.
    pub wrong: usize,
    /// True if the reported distances are in the required order.
    pub order_holds: bool,
    /// The largest relative error of distance among the cells whose distance is known; infinite if
    /// one is not reported.
    #[serde(deserialize_with = "infinite_if_null")]
    pub error: f64,
}

/// JSON has no infinite number: serde writes null.
fn infinite_if_null<'de, D: serde::Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<f64, D::Error> {
    let number: Option<f64> = serde::Deserialize::deserialize(deserializer)?;
    Ok(number.unwrap_or(f64::INFINITY))
}

impl CheckpointFrame {
    /// Orders frames from the best to the worst: by their failures, and if equal by the error of
    /// distance.
    fn badness(&self, other: &Self) -> Ordering {
        // By severity: a wrong cell may make the robot hit something, a missing one makes it stop.
        let failures = |f: &Self| (!f.passed, f.wrong, f.missing, !f.order_holds);
        failures(self)
            .cmp(&failures(other))
            .then(self.error.total_cmp(&other.error))
    }

    /// The failures in words; `None` if it passed.
    pub fn reasons(&self) -> Option<String> {
        let cells = |n: usize| counted(n, "cell");
        let amiss = [
            (self.wrong > 0).then(|| format!("{} wrong", cells(self.wrong))),
            (self.missing > 0)
                .then(|| format!("{} missing: not right, or not seen", cells(self.missing))),
            (!self.order_holds).then(|| "order of distances not seen".to_owned()),
        ];
        (!self.passed).then(|| joined(amiss.into_iter().flatten()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{Cell, CellDepth};

    const SHAPE: GridShape = GridShape {
        columns: 3,
        rows: 1,
    };

    fn opening() -> Checkpoint {
        Checkpoint {
            number: 1,
            name: "opening".into(),
            description: String::new(),
            place: CheckpointPlace::Pose {
                at_m: [1.0, 0.5],
                radius_m: 0.1,
                heading_deg: 90.0,
                heading_tolerance_deg: 5.0,
            },
            file: None,
            pairs: Vec::new(),
            cells: vec![[0, 0], [1, 0], [2, 0]],
            must: vec![[1, 0]],
            order: vec![vec![[0, 0], [1, 0]], vec![[2, 0], [1, 0]]],
            expected: Vec::new(),
        }
    }

    fn grid_of(distances: [Option<f64>; 3]) -> DepthGrid {
        let cell = |distance_m: Option<f64>| Cell {
            valid_share: 0.5,
            depth: distance_m.map(|z| CellDepth {
                distance_m: z.is_finite().then_some(z),
                ..CellDepth::at(if z.is_finite() { 1.0 } else { 0.0 }, None)
            }),
            ..Cell::UNKNOWN
        };
        DepthGrid::new(SHAPE, distances.map(cell).to_vec()).unwrap()
    }

    fn judged(cells: [(Option<f64>, Verdict); 3]) -> CheckpointFrame {
        let grid = grid_of(cells.map(|(distance_m, _)| distance_m));
        let judgement = |verdict| CellJudgement {
            verdict,
            true_px: Some(9.0),
            true_m: Some(1.0),
            ..CellJudgement::default()
        };
        let judgements = cells.map(|(_, verdict)| judgement(verdict));
        opening().judge(&grid, Some(&judgements), CellRule::default())
    }

    #[test]
    fn passes_when_right_and_in_order() {
        use Verdict::{Right, Unknown, Wrong};
        assert!(judged([(Some(0.5), Right), (Some(1.5), Right), (Some(0.5), Right)]).passed);
        let wrong = judged([(Some(0.5), Wrong), (Some(1.5), Right), (Some(0.5), Right)]);
        assert_eq!(wrong.reasons().unwrap(), "1 cell wrong");
        let unknown = judged([(Some(0.5), Right), (None, Unknown), (Some(0.5), Right)]);
        assert!(!unknown.passed && !unknown.order_holds && unknown.wrong == 0);
        let far = f64::INFINITY;
        assert!(judged([(Some(0.5), Right), (Some(far), Right), (Some(0.5), Right)]).passed);
        let both_far = judged([(Some(far), Right), (Some(far), Right), (Some(0.5), Right)]);
        assert!(!both_far.order_holds);
        let level = judged([(Some(1.5), Right), (Some(1.5), Right), (Some(0.5), Right)]);
        assert_eq!(level.reasons().unwrap(), "order of distances not seen");
    }

    #[test]
    fn failures_name_their_cells() {
        let failures = |distances: [Option<f64>; 3], verdicts: [Verdict; 3]| {
            let judgements = verdicts.map(|verdict| CellJudgement {
                verdict,
                ..CellJudgement::default()
            });
            opening().failures(&grid_of(distances), Some(&judgements))
        };
        use Verdict::{NoTruth, Right, Unknown, Wrong};
        let seen = [Some(0.5), Some(1.5), Some(0.5)];
        let unscored = failures(seen, [Right, NoTruth, Right]);
        assert_eq!(unscored, ["(1, 0) has too little truth to be scored"]);
        assert!(failures(seen, [Right; 3]).is_empty());
        assert_eq!(failures(seen, [Wrong, Right, Right]), ["(0, 0) is wrong"]);
        let hidden = [Some(0.5), None, Some(0.5)];
        let expected = [
            "(1, 0) is not right",
            "(0, 0), (1, 0) are not in this order, from near to far",
            "(2, 0), (1, 0) are not in this order, from near to far",
        ];
        assert_eq!(failures(hidden, [Right, Unknown, Right]), expected);
    }

    #[test]
    fn measured_cells_need_no_truth() {
        let checkpoint: Checkpoint = toml::from_str(
            "number = 2\nname = \"shelf\"\nframes = [3, 5]\nfile = \"day/own.mcap\"\n\
             cell = [{ at = [0, 0], distance_m = 1.0 }, { at = [1, 0], nearer_m = 0.8 }]",
        )
        .unwrap();
        checkpoint.validate(SHAPE).unwrap();
        assert!(checkpoint.needs_rig() && !checkpoint.needs_truth());
        let judged = |distances: [Option<f64>; 3]| {
            let grid = grid_of(distances);
            let findings = checkpoint.findings(&grid, CellRule::default());
            (checkpoint.judge(&grid, None, CellRule::default()), findings)
        };
        let (right, findings) = judged([Some(1.1), Some(0.7), None]);
        assert!(right.passed && findings.is_empty());
        assert!((right.error - 0.1).abs() < 1e-9);
        let (off, findings) = judged([Some(1.5), None, None]);
        assert_eq!((off.wrong, off.missing, off.passed), (1, 1, false));
        assert_eq!(
            off.reasons().unwrap(),
            "1 cell wrong, 1 cell missing: not right, or not seen"
        );
        let words: Vec<_> = findings
            .iter()
            .map(|finding| finding.words.as_str())
            .collect();
        assert_eq!(
            words,
            [
                "(0, 0) 1.50 m, expected 1 m ± 0.20 m",
                "(1, 0) unknown, expected something nearer than 0.8 m"
            ]
        );
    }

    #[test]
    fn nonsense_is_refused() {
        let place = |radius_m, heading_deg| CheckpointPlace::Pose {
            at_m: [1.0, 0.5],
            radius_m,
            heading_deg,
            heading_tolerance_deg: 5.0,
        };
        for broken in [
            Checkpoint {
                cells: vec![[3, 0]],
                ..opening()
            },
            Checkpoint {
                must: vec![],
                order: vec![],
                ..opening()
            },
            Checkpoint {
                place: place(0.0, 90.0),
                ..opening()
            },
            Checkpoint {
                place: place(0.1, f64::NAN),
                ..opening()
            },
            Checkpoint {
                place: CheckpointPlace::Frames([5, 4]),
                ..opening()
            },
            Checkpoint {
                place: CheckpointPlace::Seconds([0.0, f64::NAN]),
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
