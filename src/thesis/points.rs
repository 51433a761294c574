//! Figure 7.3: the arena's six points with v3 and with the Small Vision System.

use super::measure::{grid_picture, percent};
use super::{Context, Exhibit, Experiment, Finding};
use serde_json::Value;
use svl_core::{Error, Result, joined};
use svl_score::judge::{Checkpoint, CheckpointFrame, CheckpointTally};
use svl_score::judge::{Judged, JudgedEstimate, Verdict};

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
    let points = points.map(|point| (point, Default::default())).collect();
    let (judge, none) = (scenario.judge(), (points, Default::default()));
    let (points, cells) = context.fold(&mut *source, &ALGORITHMS, &judge, none, add_scores)?;
    conclude(&points, cells, finding);
    for (name, cells) in NAMES.iter().zip(cells) {
        for (verdict, count) in [("right", cells.right), ("wrong", cells.wrong)] {
            let name = format!("all frames, {name}: cells {verdict}");
            finding.quantity(name, "%", "", percent(count, cells.all));
        }
    }
    let (mut rows, mut bars) = (Vec::new(), Vec::new());
    for (point, scores) in &points {
        let name = format!("{}. {}", point.number, point.name);
        let thesis = match point.number {
            2 => "v3 erroneous, SVS better",
            3 => "v3 unknown where flat",
            6 => "SVS better",
            _ => "near results",
        };
        let mut row = vec![thesis.into()];
        for (algorithm, score) in NAMES.iter().zip(scores) {
            row.extend(score.values());
            let passed = percent(score.tally.passed, score.tally.frames);
            bars.push((format!("{name}, {algorithm}"), vec![passed]));
        }
        rows.push((name, row));
    }
    finding.table(HEADS, rows);
    let label = "fraction of the frames that show the point, %";
    finding.bars("Frames that pass", label, &[""], bars);
    add_pictures(points, finding)
}

const HEADS: &str = "point | thesis | v3: best | v3: worst | v3: frames that pass, % | \
                     v3: frames with a wrong cell, % | v3: cells right, % | SVS: best | \
                     SVS: worst | SVS: frames that pass, % | SVS: frames with a wrong cell, % | \
                     SVS: cells right, %";

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
    /// The values under [`HEADS`]; null for a point shown in no frame.
    fn values(&self) -> [Value; 5] {
        let tally = &self.tally;
        let word = |lead: &Option<(_, CheckpointFrame)>| {
            let passed = lead.as_ref().map(|(_, frame)| frame.passed);
            passed.map(|passed| if passed { "pass" } else { "fail" })
        };
        [
            word(&tally.best).into(),
            word(&tally.worst).into(),
            percent(tally.passed, tally.frames).into(),
            percent(self.wrong, tally.frames).into(),
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
    fn add(&mut self, scored: &JudgedEstimate) {
        let (judgements, grid) = (|| scored.cells.iter().flatten(), &scored.estimate.grid);
        let count = |verdict| judgements().filter(|j| j.verdict == verdict).count();
        self.all += judgements().count();
        self.right += count(Verdict::Right);
        self.wrong += count(Verdict::Wrong);
        let first_column = (0..grid.shape().rows).map(|row| grid.cell(0, row));
        self.first_column += first_column.filter(|cell| cell.depth.is_some()).count();
    }

    fn right_percent(&self) -> f64 {
        percent(self.right, self.all)
    }
}

/// Adds the scores of a frame to those of the points and of all frames.
fn add_scores((points, cells): &mut (Vec<ThesisPoint>, [PointCells; 2]), judged: &Judged) {
    for (i, scored) in judged.estimates.iter().enumerate() {
        // The arena has truth in every frame; a recording of it could have lost it.
        if scored.cells.is_none() {
            continue;
        }
        cells[i].add(scored);
        for (point, verdict) in &scored.checkpoints {
            let score = &mut points[*point].1[i];
            // Only leading frames are kept, as encoding a picture takes longer than scoring.
            let picture = || grid_picture(String::new(), &judged.frame, scored);
            score.tally.add(*verdict, picture);
            score.wrong += usize::from(verdict.wrong > 0);
            score.cells.add(scored);
        }
    }
}

/// Adds the worst and the best frame of each point.
fn add_pictures(points: Vec<ThesisPoint>, finding: &mut Finding) -> Result<()> {
    for (point, [v3, svs]) in points {
        for (name, rank, lead) in [
            (NAMES[0], "worst", v3.tally.worst),
            (NAMES[1], "worst", svs.tally.worst),
            (NAMES[0], "best", v3.tally.best),
            (NAMES[1], "best", svs.tally.best),
        ] {
            let Some((picture, frame)) = lead else {
                continue;
            };
            let fails = frame.reasons().map(|reasons| format!("fails, {reasons}"));
            let outcome = fails.unwrap_or_else(|| "passes".to_owned());
            let mut picture = picture?;
            picture.caption = format!("Point {}: {name} {rank}: {outcome}", point.number);
            finding.pictures.push(picture);
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
    let where_wrong = match &joined(places)[..] {
        "" => String::new(),
        places => format!(": it has some at {places}"),
    };
    finding.condition(where_wrong.is_empty()).says(format!(
        "v3 has wrong cells at no point but 2{where_wrong}."
    ));
    let sums = |count: fn(&PointScore) -> usize| {
        let counts = |i: usize| points.iter().map(move |(_, scores)| count(&scores[i]));
        [counts(0).sum(), counts(1).sum::<usize>()]
    };
    let [frames, _] = sums(|score| score.tally.frames);
    let [v3_wrong, svs_wrong] = sums(|score| score.wrong);
    finding.condition(v3_wrong < svs_wrong).says(format!(
        "The SVS is wrong in more frames than v3: {svs_wrong} and {v3_wrong} of {frames}."
    ));
    for (point, [v3, svs]) in points {
        let (number, name, frames) = (point.number, &point.name, svs.tally.frames);
        if ![2, 6].contains(&number) {
            continue;
        }
        let [v3_passed, svs_passed] = [v3, svs].map(|score| score.tally.passed);
        let [v3_right, svs_right] = [v3, svs].map(|score| score.cells.right_percent());
        finding.condition(svs_passed > v3_passed).says(format!(
            "The SVS handles point {number}, {name}, better: it passes {svs_passed} of {frames} \
             frames, v3 {v3_passed} ({svs_right:.0} % and {v3_right:.0} % of all their cells are \
             right)."
        ));
    }
    let known = cells[1].first_column;
    finding.condition(known == 0).says(format!(
        "The SVS's first column is unknown in every frame: {known} of its cells are known."
    ));
    let [v3, svs] = sums(|score| score.tally.passed);
    finding.why = format!(
        "Of the {frames} frames of the six points v3 passes {v3} and the SVS {svs}; v3 is wrong \
         somewhere in {v3_wrong} of them, the SVS in {svs_wrong}."
    );
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
