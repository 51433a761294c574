//! Figure 7.3: the arena's six points with v3 and with the Small Vision System.

use super::measure::{grid_picture, percent};
use super::{Context, Exhibit, Experiment, Finding, TableValue};
use svl_bench::sink::{Outbox, Sink};
use svl_core::stereo::DepthGrid;
use svl_core::{Error, Result};
use svl_score::judge::{
    CellJudgement, Checkpoint, CheckpointFrame, CheckpointTally, Judged, Verdict,
};

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["7.3"],
    place: "Figure 7.3",
    title: "The arena with v3 and the SVS",
    claim: "v3 and the Small Vision System give similar results. v3 is wrong on rare occasions \
            only (point 2), the SVS more often, but the SVS handles close objects better (points \
            2 and 6). The first column of the SVS is always unknown (chapter 7).",
    method: "One run of the simulated arena replaces three runs of the real one. bm replaces the \
             SVS: it is the published algorithm of the same author, with the thesis's window of \
             nine and otherwise default parameters. The thesis rated the best and the worst frame \
             of each point by eye. Here every frame that shows a point is scored against the \
             exact truth. It passes when the cells that matter are right, no cell that an exact \
             matcher could measure is wrong, and the distances are in the scene's order. The SVS \
             cannot see that order where it needs the first column. A cross marks a wrong cell.",
    run,
};

const ALGORITHMS: [&str; 2] = ["v3", "bm"];
/// Their names here.
const NAMES: [&str; 2] = ["v3", "SVS (bm)"];
/// Difference between the fractions of right cells, in percentage points, that counts as near.
const MAX_NEAR_DIFFERENCE: f64 = 5.0;

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let Some((scenario, mut source)) = context.recording.take() else {
        return Err(Error::Invalid("figure 7.3 needs a run of the arena".into()));
    };
    let points = scenario.checkpoints.iter().cloned();
    let sink = PointSink {
        points: points.map(|point| (point, Default::default())).collect(),
        ..PointSink::default()
    };
    let outbox = sink.outbox.clone();
    context.run(&mut *source, &ALGORITHMS, &scenario.judge(), sink)?;
    let (points, cells) = outbox.take();
    conclude(&points, cells, finding);
    finding.table(HEADS, points.iter().map(row));
    for (name, cells) in NAMES.iter().zip(cells) {
        for (verdict, count) in [("right", cells.right), ("wrong", cells.wrong)] {
            let name = format!("all frames, {name}: cells {verdict}");
            finding.quantity(name, "%", "", percent(count, cells.all));
        }
    }
    let mut bars = Vec::new();
    for (Checkpoint { number, name, .. }, scores) in &points {
        let shares = scores.each_ref().map(PointScore::passed_percent);
        let names = NAMES.map(|algorithm| format!("{number}. {name}, {algorithm}"));
        bars.extend(names.into_iter().zip(shares.map(|share| vec![share])));
    }
    let label = "fraction of the frames that show the point, %";
    finding.bars("Frames that pass", label, &[""], bars);
    add_pictures(points, finding)
}

/// A point with its scores by v3 and the SVS.
type ThesisPoint = (Checkpoint, [PointScore; 2]);

/// Scores of an algorithm over the frames of a point.
#[derive(Default)]
struct PointScore {
    tally: CheckpointTally<Result<Exhibit>>,
    /// Frames in which one of the point's own cells is wrong.
    wrong: usize,
    /// Cells of all its frames.
    cells: PointCells,
}

impl PointScore {
    /// NaN for a point shown in no frame.
    fn passed_percent(&self) -> f64 {
        percent(self.tally.passed, self.tally.frames)
    }

    /// Best and worst frame, the fraction that passes and that with a wrong cell, and the fraction
    /// of right cells.
    fn values(&self) -> [TableValue; 5] {
        let leading = |lead: &Option<(_, CheckpointFrame)>| match lead {
            Some((_, frame)) if frame.passed => "pass".into(),
            Some(_) => "fail".into(),
            None => TableValue::Nothing,
        };
        [
            leading(&self.tally.best),
            leading(&self.tally.worst),
            self.passed_percent().into(),
            percent(self.wrong, self.tally.frames).into(),
            self.cells.right_percent().into(),
        ]
    }
}

/// All cells of some frames.
#[derive(Clone, Copy, Default)]
struct PointCells {
    all: usize,
    right: usize,
    wrong: usize,
    /// Known cells of the first column.
    first_column: usize,
}

impl PointCells {
    fn add(&mut self, grid: &DepthGrid, judgements: &[CellJudgement]) {
        let count = |verdict| judgements.iter().filter(|j| j.verdict == verdict).count();
        self.all += judgements.len();
        self.right += count(Verdict::Right);
        self.wrong += count(Verdict::Wrong);
        self.first_column += (0..grid.shape().rows)
            .filter(|&row| grid.cell(0, row).depth.is_some())
            .count();
    }

    fn right_percent(&self) -> f64 {
        percent(self.right, self.all)
    }
}

const HEADS: &str = "point | thesis | v3: best | v3: worst | v3: frames that pass, % | \
                     v3: frames with a wrong cell, % | v3: cells right, % | SVS: best | \
                     SVS: worst | SVS: frames that pass, % | SVS: frames with a wrong cell, % | \
                     SVS: cells right, %";

/// Values under [`HEADS`].
fn row((checkpoint, [v3, svs]): &ThesisPoint) -> (String, Vec<TableValue>) {
    let thesis = match checkpoint.number {
        2 => "v3 erroneous, SVS better",
        3 => "v3 unknown where flat",
        6 => "SVS better",
        _ => "near results",
    };
    let name = format!("{}. {}", checkpoint.number, checkpoint.name);
    let values = [vec![thesis.into()], v3.values().into(), svs.values().into()];
    (name, values.concat())
}

/// Adds the worst and the best frame of each point.
fn add_pictures(points: Vec<ThesisPoint>, finding: &mut Finding) -> Result<()> {
    for (checkpoint, [v3, svs]) in points {
        let (v3, svs) = (v3.tally, svs.tally);
        for (name, rank, lead) in [
            (NAMES[0], "worst", v3.worst),
            (NAMES[1], "worst", svs.worst),
            (NAMES[0], "best", v3.best),
            (NAMES[1], "best", svs.best),
        ] {
            let Some((picture, frame)) = lead else {
                continue;
            };
            let fails = frame.reasons().map(|reasons| format!("fails, {reasons}"));
            let outcome = fails.unwrap_or_else(|| "passes".to_owned());
            let caption = format!("Point {}: {name} {rank}: {outcome}", checkpoint.number);
            finding.pictures.push(Exhibit {
                caption,
                ..picture?
            });
        }
    }
    Ok(())
}

/// Adds the conditions and the sentence that summarizes them.
fn conclude(points: &[ThesisPoint], cells: [PointCells; 2], finding: &mut Finding) {
    let [v3, svs] = cells.map(|cells| cells.right_percent());
    finding.condition((v3 - svs).abs() <= MAX_NEAR_DIFFERENCE).says(format!(
        "The results are near: the fractions of right cells, over all frames, differ by at most \
         {MAX_NEAR_DIFFERENCE} percentage points, {v3:.1} % of v3's and {svs:.1} % of the SVS's."
    ));
    // The thesis itself names point 2.
    let elsewhere = points
        .iter()
        .filter(|(point, [v3, _])| point.number != 2 && v3.wrong > 0);
    let places = elsewhere.map(|(point, [v3, _])| {
        let (wrong, frames) = (v3.wrong, v3.tally.frames);
        format!("{} (in {wrong} of {frames} frames)", point.number)
    });
    let places = places.collect::<Vec<_>>().join(", ");
    let is_right_elsewhere = places.is_empty();
    let where_wrong = if is_right_elsewhere {
        String::new()
    } else {
        format!(": it has some at {places}")
    };
    finding.condition(is_right_elsewhere).says(format!(
        "v3 has wrong cells at no point but 2{where_wrong}."
    ));
    let sum = |count: fn(&PointScore) -> usize| {
        let counts = |i: usize| points.iter().map(move |(_, scores)| count(&scores[i]));
        [counts(0).sum(), counts(1).sum::<usize>()]
    };
    let [frames, _] = sum(|score| score.tally.frames);
    let [v3_wrong, svs_wrong] = sum(|score| score.wrong);
    finding.condition(v3_wrong < svs_wrong).says(format!(
        "The SVS is wrong in more frames than v3: {svs_wrong} and {v3_wrong} of {frames}."
    ));
    let closest = points
        .iter()
        .filter(|(point, _)| [2, 6].contains(&point.number));
    closest.for_each(|(point, scores)| add_better_point(point, scores, finding));
    let known = cells[1].first_column;
    finding.condition(known == 0).says(format!(
        "The SVS's first column is unknown in every frame: {known} of its cells are known."
    ));
    let [v3, svs] = sum(|score| score.tally.passed);
    finding.why = format!(
        "Of the {frames} frames of the six points v3 passes {v3} and the SVS {svs}; v3 is wrong \
         somewhere in {v3_wrong} of them, the SVS in {svs_wrong}."
    );
}

/// Adds whether the SVS handles a point better.
fn add_better_point(point: &Checkpoint, [v3, svs]: &[PointScore; 2], finding: &mut Finding) {
    let (number, name, frames) = (point.number, &point.name, svs.tally.frames);
    let [v3_passed, svs_passed] = [v3, svs].map(|score| score.tally.passed);
    let [v3_right, svs_right] = [v3, svs].map(|score| score.cells.right_percent());
    finding.condition(svs_passed > v3_passed).says(format!(
        "The SVS handles point {number}, {name}, better: it passes {svs_passed} of {frames} \
         frames, v3 {v3_passed} ({svs_right:.0} % and {v3_right:.0} % of all their cells are \
         right)."
    ));
}

/// Scores the frames of a run, at its points and all of them.
#[derive(Default)]
struct PointSink {
    points: Vec<ThesisPoint>,
    cells: [PointCells; 2],
    outbox: Outbox<(Vec<ThesisPoint>, [PointCells; 2])>,
}

impl Sink for PointSink {
    fn take(&mut self, judged: &Judged) -> Result<()> {
        for (i, scored) in judged.estimates.iter().enumerate() {
            // The arena has truth in every frame; a recording of it could have lost it.
            let Some(cells) = &scored.cells else { continue };
            let grid = &scored.estimate.grid;
            self.cells[i].add(grid, cells);
            for (point, verdict) in &scored.checkpoints {
                let score = &mut self.points[*point].1[i];
                // Only leading frames are kept, as encoding a picture takes longer than scoring.
                let picture = || grid_picture(String::new(), &judged.frame, scored);
                score.tally.add(*verdict, picture);
                score.wrong += usize::from(verdict.wrong > 0);
                score.cells.add(grid, cells);
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.outbox.put((self.points, self.cells));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_score::scenario::Scenario;

    /// Points with ten frames each: number that passes, and number with a wrong cell.
    fn points(v3: [(usize, usize); 6], svs: [(usize, usize); 6]) -> Vec<ThesisPoint> {
        let score = |(passed, wrong)| PointScore {
            tally: CheckpointTally {
                frames: 10,
                passed,
                ..CheckpointTally::default()
            },
            wrong,
            cells: PointCells {
                all: 150,
                right: 10 * passed,
                ..PointCells::default()
            },
        };
        let checkpoints = Scenario::arena().unwrap().checkpoints.into_iter();
        let scores = v3.into_iter().zip(svs);
        checkpoints
            .zip(scores.map(|(v3, svs)| [score(v3), score(svs)]))
            .collect()
    }

    #[test]
    fn the_observations_of_the_thesis_hold() {
        let cells = PointCells {
            all: 100,
            right: 40,
            wrong: 3,
            first_column: 0,
        };
        let met = |v3, svs, cells| {
            let mut finding = Finding::default();
            conclude(&points(v3, svs), cells, &mut finding);
            finding.conditions.iter().map(|c| c.met).collect::<Vec<_>>()
        };
        let v3 = [(10, 0), (4, 3), (10, 0), (10, 0), (10, 0), (8, 0)];
        let svs = [(9, 1), (6, 4), (9, 1), (9, 1), (9, 1), (10, 0)];
        assert_eq!(met(v3, svs, [cells; 2]), [true; 6]);
        let seen = PointCells {
            right: 46,
            first_column: 1,
            ..cells
        };
        assert_eq!(met(svs, v3, [cells, seen]), [false; 6]);
    }
}
