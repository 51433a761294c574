//! Figure 7.3: the arena's six points with v3 and with the Small Vision System.

use super::measure::{grid_picture, percent};
use super::{Context, Exhibit, Experiment, Finding, TableValue};
use svl_bench::sink::{Outbox, Sink};
use svl_core::stereo::DepthGrid;
use svl_core::{Error, Result};
use svl_report::plot::Bars;
use svl_score::judge::{
    CellJudgement, Checkpoint, CheckpointFrame, CheckpointTally, Judged, Verdict,
};
use svl_score::scenario::Scenario;

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
    records: true,
    run,
};

const ALGORITHMS: [&str; 2] = ["v3", "bm"];
/// Their names here.
const NAMES: [&str; 2] = ["v3", "SVS (bm)"];
/// Difference between the fractions of right cells, in percentage points, that counts as near.
const MAX_NEAR_DIFFERENCE: f64 = 5.0;

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let Some((scenario, mut source)) = context.recording.take() else {
        return Err(Error::Invalid("figure 7.3 needs a run of the arena".into()));
    };
    let points = ThesisPoints::new(&scenario);
    let outbox = points.outbox.clone();
    context.run(&mut *source, &ALGORITHMS, &scenario.judge(), points)?;
    // The sink returns its points when it is finished.
    outbox
        .take()
        .map_or_else(|| Ok(Finding::default()), ThesisPoints::finding)
}

/// Scores over the frames of the six points.
struct ThesisPoints {
    scenario: Scenario,
    points: Vec<[Point; 2]>,
    cells: [PointCells; 2],
    outbox: Outbox<Option<ThesisPoints>>,
}

#[derive(Default)]
struct Point {
    tally: CheckpointTally<Exhibit>,
    /// Frames in which one of the point's own cells is wrong.
    wrong: usize,
    /// Cells of all its frames.
    cells: PointCells,
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
        percent(self.right, self.all).unwrap_or(f64::NAN)
    }
}

impl Point {
    /// Best and worst frame, the fraction that passes and that with a wrong cell, and the fraction
    /// of right cells.
    fn values(&self) -> [TableValue; 5] {
        let leading = |lead: &Option<(Exhibit, CheckpointFrame)>| match lead {
            Some((_, frame)) => {
                TableValue::Text(if frame.passed { "pass" } else { "fail" }.to_owned())
            }
            None => TableValue::Nothing,
        };
        let frames = self.tally.frames;
        [
            leading(&self.tally.best),
            leading(&self.tally.worst),
            percent(self.tally.passed, frames).into(),
            percent(self.wrong, frames).into(),
            self.cells.right_percent().into(),
        ]
    }
}

impl ThesisPoints {
    fn new(scenario: &Scenario) -> Self {
        let points = scenario
            .checkpoints
            .iter()
            .map(|_| <[Point; 2]>::default())
            .collect();
        Self {
            scenario: scenario.clone(),
            points,
            cells: Default::default(),
            outbox: Outbox::default(),
        }
    }

    fn finding(self) -> Result<Finding> {
        let Self {
            scenario,
            points,
            cells,
            ..
        } = self;
        let mut finding = Finding::default();
        // A point shown in no frame has no fraction.
        let share = |p: &Point| percent(p.tally.passed, p.tally.frames).unwrap_or(f64::NAN);
        conclude(&scenario.checkpoints, &points, cells, &mut finding);
        add_table(&scenario.checkpoints, &points, &mut finding);
        for (name, cells) in NAMES.iter().zip(cells) {
            for (verdict, count) in [("right", cells.right), ("wrong", cells.wrong)] {
                let words = format!("all frames, {name}: cells {verdict}");
                finding.quantity(words, "%", "", percent(count, cells.all));
            }
        }
        let bars = scenario
            .checkpoints
            .iter()
            .zip(&points)
            .flat_map(|(checkpoint, point)| {
                let bar = move |(name, point)| {
                    (
                        format!("{}. {}, {name}", checkpoint.number, checkpoint.name),
                        vec![share(point)],
                    )
                };
                NAMES.iter().zip(point).map(bar)
            });
        let chart = Bars {
            title: "Frames that pass".into(),
            label: "fraction of the frames that show the point, %".into(),
            parts: vec![String::new()],
            bars: bars.collect(),
        };
        finding.exhibits.push(Exhibit::Plot(chart.svg()));
        show_frames(&points, &mut finding);
        Ok(finding)
    }
}

fn add_table(checkpoints: &[Checkpoint], points: &[[Point; 2]], finding: &mut Finding) {
    let rows = finding.table([
        "point",
        "thesis",
        "v3: best",
        "v3: worst",
        "v3: frames that pass, %",
        "v3: frames with a wrong cell, %",
        "v3: cells right, %",
        "SVS: best",
        "SVS: worst",
        "SVS: frames that pass, %",
        "SVS: frames with a wrong cell, %",
        "SVS: cells right, %",
    ]);
    for (checkpoint, [v3, svs]) in checkpoints.iter().zip(points) {
        let thesis = match checkpoint.number {
            2 => "v3 erroneous, SVS better",
            3 => "v3 unknown where flat",
            6 => "SVS better",
            _ => "near results",
        };
        let name = format!("{}. {}", checkpoint.number, checkpoint.name);
        let thesis = TableValue::Text(thesis.to_owned());
        let values = v3.values().into_iter().chain(svs.values());
        rows.row(name, [thesis].into_iter().chain(values));
    }
}

/// Shows the worst and the best frame of each point.
fn show_frames(points: &[[Point; 2]], finding: &mut Finding) {
    type Lead = fn(&CheckpointTally<Exhibit>) -> &Option<(Exhibit, CheckpointFrame)>;
    let leads: [(&str, Lead); 2] = [
        ("worst", |range| &range.worst),
        ("best", |range| &range.best),
    ];
    for (point, (rank, lead)) in points.iter().flat_map(|p| leads.map(|lead| (p, lead))) {
        for (exhibit, _) in point.iter().flat_map(|p| lead(&p.tally)) {
            let mut exhibit = exhibit.clone();
            if let Exhibit::Picture { caption, .. } = &mut exhibit {
                *caption = caption.replace("RANK", rank);
            }
            finding.show(exhibit);
        }
    }
}

/// Adds the conditions and the sentence that summarizes them.
fn conclude(
    checkpoints: &[Checkpoint],
    points: &[[Point; 2]],
    cells: [PointCells; 2],
    finding: &mut Finding,
) {
    let right = cells.map(|c| c.right_percent());
    finding.condition(
        (right[0] - right[1]).abs() <= MAX_NEAR_DIFFERENCE,
        format!(
            "The results are near: the fractions of right cells, over all frames, differ by at \
             most {MAX_NEAR_DIFFERENCE} percentage points, {:.1} % of v3's and {:.1} % of the \
             SVS's.",
            right[0], right[1]
        ),
    );
    add_wrong_elsewhere(checkpoints, points, finding);
    let sum = |count: fn(&Point) -> usize, algorithm: usize| {
        points.iter().map(|p| count(&p[algorithm])).sum::<usize>()
    };
    let frames = sum(|p| p.tally.frames, 0);
    let wrong = [0, 1].map(|a| sum(|p| p.wrong, a));
    finding.condition(
        wrong[0] < wrong[1],
        format!(
            "The SVS is wrong in more frames than v3: {} and {} of {frames}.",
            wrong[1], wrong[0]
        ),
    );
    add_better_points(checkpoints, points, finding);
    finding.condition(
        cells[1].first_column == 0,
        format!(
            "The SVS's first column is unknown in every frame: {} of its cells are known.",
            cells[1].first_column
        ),
    );
    let passed = [0, 1].map(|a| sum(|p| p.tally.passed, a));
    finding.why = format!(
        "Of the {frames} frames of the six points v3 passes {} and the SVS {}; v3 is wrong \
         somewhere in {} of them, the SVS in {}.",
        passed[0], passed[1], wrong[0], wrong[1]
    );
}

/// Adds the points that the thesis's SVS handles better.
fn add_better_points(checkpoints: &[Checkpoint], points: &[[Point; 2]], finding: &mut Finding) {
    for number in [2, 6] {
        for (checkpoint, point) in checkpoints
            .iter()
            .zip(points)
            .filter(|(c, _)| c.number == number)
        {
            let [v3, svs] = point;
            finding.condition(
                svs.tally.passed > v3.tally.passed,
                format!(
                    "The SVS handles point {number}, {}, better: it passes {} of {} frames, v3 {} \
                     ({:.0} % and {:.0} % of all their cells are right).",
                    checkpoint.name,
                    svs.tally.passed,
                    svs.tally.frames,
                    v3.tally.passed,
                    svs.cells.right_percent(),
                    v3.cells.right_percent()
                ),
            );
        }
    }
}

fn add_wrong_elsewhere(checkpoints: &[Checkpoint], points: &[[Point; 2]], finding: &mut Finding) {
    let elsewhere: Vec<_> = checkpoints
        .iter()
        .zip(points)
        // The thesis itself names point 2.
        .filter(|(c, p)| c.number != 2 && p[0].wrong > 0)
        .collect();
    let places: Vec<_> = elsewhere
        .iter()
        .map(|(c, p)| {
            format!(
                "{} (in {} of {} frames)",
                c.number, p[0].wrong, p[0].tally.frames
            )
        })
        .collect();
    finding.condition(
        elsewhere.is_empty(),
        match &places[..] {
            [] => "v3 has wrong cells at no point but 2.".to_owned(),
            places => format!(
                "v3 has wrong cells at no point but 2: it has some at {}.",
                places.join(", ")
            ),
        },
    );
}

impl Sink for ThesisPoints {
    fn take(&mut self, judged: &Judged) -> Result<()> {
        for (a, scored) in judged.estimates.iter().enumerate() {
            // The arena has truth in every frame; a recording of it could have lost it.
            let Some(cells) = &scored.cells else { continue };
            let grid = &scored.estimate.grid;
            self.cells[a].add(grid, cells);
            for (c, verdict) in &scored.checkpoints {
                let (checkpoint, point) = (&self.scenario.checkpoints[*c], &mut self.points[*c][a]);
                let outcome = verdict.reasons().map_or_else(
                    || "passes".to_owned(),
                    |reasons| format!("fails, {reasons}"),
                );
                let caption = format!("Point {}: {} RANK: {outcome}", checkpoint.number, NAMES[a]);
                let (best, worst) = point.tally.would_lead(verdict);
                // Only leading frames are kept, as encoding a picture takes longer than scoring.
                let exhibit = if best || worst {
                    Some(grid_picture(caption, &judged.frame, scored)?)
                } else {
                    None
                };
                point
                    .tally
                    .add(*verdict, || exhibit.clone().expect("a leading frame"));
                point.wrong += usize::from(verdict.wrong > 0);
                point.cells.add(grid, cells);
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.outbox.clone().put(Some(*self));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points with ten frames each: number that passes, and number with a wrong cell.
    fn points(v3: [(usize, usize); 6], svs: [(usize, usize); 6]) -> Vec<[Point; 2]> {
        let point = |(passed, wrong)| Point {
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
        v3.into_iter()
            .zip(svs)
            .map(|(v3, svs)| [point(v3), point(svs)])
            .collect()
    }

    #[test]
    fn the_observations_of_the_thesis_hold() {
        let checkpoints = Scenario::arena().unwrap().checkpoints;
        let cells = PointCells {
            all: 100,
            right: 40,
            wrong: 3,
            first_column: 0,
        };
        let met = |v3, svs, cells| {
            let mut finding = Finding::default();
            conclude(&checkpoints, &points(v3, svs), cells, &mut finding);
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
