//! Table 5.1 and annex A: the situations in which the thesis abandoned dynamic programming.

use super::measure::grid_picture;
use super::{Context, Exhibit, Experiment, Finding, TableValue, stage};
use svl_core::Result;
use svl_core::stereo::{Frame, GridShape};
use svl_report::plot::Bars;
use svl_score::judge::{CellJudgement, CellTally, Judge, Judged, Verdict};
use svl_sim::arena::{Arena, ArenaConfig};

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["table5.1", "A.1", "A.2"],
    place: "Table 5.1",
    title: "Eight situations with dynamic programming",
    claim: "OpenCV's dynamic programming gives the expected answer for a normal view. It misses a \
            small escape, and its depth map is completely wrong where low light leaves a uniform \
            texture (section 5.2, annex A).",
    method: "The thesis shows frames of a walk, most without comment. Here each situation of its \
             tables is a still view with exact truth, and v3 runs beside dp. The grid has 6 x 3 \
             cells. A cell is right within 0.10 m or 20 % of the true distance, and unknown when \
             the algorithm says so. In the pictures, larger squares are nearer, a dot is \
             unknown, a cross is wrong.",
    records: false,
    run,
};

const SHAPE: GridShape = GridShape {
    columns: 6,
    rows: 3,
};
const ALGORITHMS: [&str; 2] = ["dp", "v3"];

/// A view of table 5.1 or annex A.
struct Situation {
    name: &'static str,
    /// The thesis's observation on dp.
    thesis: &'static str,
    view: fn() -> ArenaConfig,
}

impl Situation {
    const fn new(name: &'static str, thesis: &'static str, view: fn() -> ArenaConfig) -> Self {
        Self { name, thesis, view }
    }
}

const SITUATIONS: [Situation; 8] = [
    Situation::new("normal", "as expected", normal),
    Situation::new("small escape", "totally missed", small_escape),
    Situation::new("low light", "completely wrong", low_light),
    Situation::new("single object", "", single_object),
    Situation::new("infinite distance", "", infinite_distance),
    Situation::new("tilt", "", tilt),
    Situation::new("dark", "", dark),
    Situation::new("too far", "", too_far),
];

/// Walls to the left and right, high enough to leave the view at the top, and one behind.
fn normal() -> ArenaConfig {
    let mut config = stage::empty();
    config.world.blocks = vec![
        stage::block(0.7, -0.45, [0.6, 0.1, 0.6], 0.0),
        stage::block(0.5, 0.4, [0.5, 0.1, 0.6], 0.0),
        stage::block(1.3, 0.0, [3.0, 0.1, 1.0], 0.0),
    ];
    config
}

/// The escape: a door as wide as a column of cells, in a wall 0.5 m ahead.
const DOOR: usize = 4;

fn small_escape() -> ArenaConfig {
    let mut config = stage::empty();
    // Seen from the left camera, 22 mm left of the middle, 0.5 m away: columns 4 to 5 of 6 are 81
    // mm to 163 mm right.
    let (from, to) = (0.050, 0.150);
    config.world.blocks = vec![
        stage::block(0.5, from - 0.5, [1.0, 0.05, 0.6], 0.0),
        stage::block(0.5, to + 0.5, [1.0, 0.05, 0.6], 0.0),
        stage::block(1.6, 0.0, [3.0, 0.1, 1.2], 0.0),
    ];
    config
}

/// A uniform wall in dim light.
fn low_light() -> ArenaConfig {
    let mut config = normal();
    config.sensor.white_e_per_ms = 450.0;
    config.world.forest_contrast = 0.1;
    config
}

fn single_object() -> ArenaConfig {
    let mut config = stage::empty();
    config.world.balls = vec![stage::ball(0.4, 0.05, 0.08)];
    config
}

fn infinite_distance() -> ArenaConfig {
    let mut config = stage::empty();
    config.world.length_m = 20.0;
    config.world.room_margin_m = 20.0;
    config.world.wall_height_m = 0.05;
    config
}

/// The normal view with the robot's head rolled by up to 20°.
fn tilt() -> ArenaConfig {
    let mut config = normal();
    config.frames = 20;
    config.rate_hz = 10.0;
    config.robot.roll_sway_deg = 20.0;
    config
}

fn dark() -> ArenaConfig {
    let mut config = normal();
    config.sensor.white_e_per_ms = 60.0;
    config
}

/// A wall 4 m away: 3.6 px of disparity, where a pixel is a metre.
fn too_far() -> ArenaConfig {
    let mut config = stage::empty();
    config.rig.above_floor_m = 0.3;
    config.world.blocks = vec![stage::block(4.0, 0.0, [4.0, 0.1, 4.0], 0.0)];
    config
}

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let mut finding = Finding::default();
    let mut outcomes = Vec::new();
    let judge = Judge {
        grid: SHAPE.into(),
        ..Judge::default()
    };
    for situation in &SITUATIONS {
        let frame = most_tilted(context, &(situation.view)())?;
        for judged in context.judged(vec![frame], &ALGORITHMS, &judge)? {
            outcomes.push([
                answer(situation, &judged, 0)?,
                answer(situation, &judged, 1)?,
            ]);
        }
    }
    let rows = finding.table([
        "cells of 18",
        "thesis on dp",
        "dp: right",
        "dp: wrong",
        "v3: right",
        "v3: wrong",
        "v3: unknown",
    ]);
    for (situation, outcome) in SITUATIONS.iter().zip(&outcomes) {
        let thesis = if situation.thesis.is_empty() {
            "–"
        } else {
            situation.thesis
        };
        let [dp, v3] = outcome.each_ref().map(SituationAnswer::tally);
        let cells = [dp.right, dp.wrong, v3.right, v3.wrong, v3.unknown];
        let cells = cells.map(|n| TableValue::from(n as f64));
        let thesis = TableValue::Text(thesis.to_owned());
        rows.row(situation.name, [thesis].into_iter().chain(cells));
    }
    let answers = outcomes.iter_mut().flatten();
    answers.for_each(|answer| finding.exhibits.extend(answer.exhibit.take()));
    conclude(&outcomes, &mut finding);
    let chart = chart(&outcomes);
    finding.exhibits.push(Exhibit::Plot(chart.svg()));
    Ok(finding)
}

fn chart(outcomes: &[[SituationAnswer; 2]]) -> Bars {
    let bars = SITUATIONS
        .iter()
        .zip(outcomes)
        .flat_map(|(situation, outcome)| {
            ALGORITHMS
                .iter()
                .zip(outcome)
                .map(move |(algorithm, answers)| {
                    let tally = answers.tally();
                    let cells = [tally.right, tally.wrong, tally.unknown].map(|n| n as f64);
                    (format!("{}, {algorithm}", situation.name), cells.to_vec())
                })
        });
    Bars {
        title: "Cells of eight situations".into(),
        label: "cells of 18".into(),
        parts: ["right", "wrong", "unknown"].map(str::to_owned).to_vec(),
        bars: bars.collect(),
    }
}

/// Adds the conditions and the sentence that summarizes them.
fn conclude(outcomes: &[[SituationAnswer; 2]], finding: &mut Finding) {
    let wrong = |situation: usize, algorithm: usize| outcomes[situation][algorithm].tally().wrong;
    let cells = SHAPE.cells();
    let [normal, escape, low] = [0, 1, 2];
    let lowest = (0..SHAPE.columns)
        .filter(|&column| outcomes[normal][0].at(column, SHAPE.rows - 1) == Verdict::Wrong);
    finding.condition(
        4 * wrong(normal, 0) <= cells,
        format!(
            "In the normal view at most a quarter of dp's {cells} cells are wrong: {} are, {} of \
             them in the lowest row, on plain floor.",
            wrong(normal, 0),
            lowest.count()
        ),
    );
    let door = |algorithm: usize| outcomes[escape][algorithm].at(DOOR, 1);
    finding.condition(
        door(0) != Verdict::Right,
        format!(
            "dp misses the small escape: its cell with the door is {}; v3's is {}.",
            door(0).name(),
            door(1).name()
        ),
    );
    finding.condition(
        2 * wrong(low, 0) > cells,
        format!(
            "In low light more than half of dp's cells are wrong: {}.",
            wrong(low, 0)
        ),
    );
    let better = (0..outcomes.len())
        .filter(|&s| wrong(s, 1) < wrong(s, 0))
        .count();
    finding.condition(
        better == outcomes.len(),
        format!(
            "v3 has fewer wrong cells in every situation: in {better} of {}.",
            outcomes.len()
        ),
    );
    let all = |algorithm: usize| -> usize {
        let situations = 0..outcomes.len();
        situations.map(|s| wrong(s, algorithm)).sum()
    };
    finding.why = format!(
        "dp has {} of {cells} cells wrong in the normal view, {} with the small escape and {} in \
         low light, {} in all eight situations; v3 has {}, and leaves {} of the {} unknown.",
        wrong(normal, 0),
        wrong(escape, 0),
        wrong(low, 0),
        all(0),
        all(1),
        outcomes
            .iter()
            .map(|[_, v3]| v3.tally().unknown)
            .sum::<usize>(),
        cells * outcomes.len()
    );
}

/// The frame of the run with the largest roll of the head.
fn most_tilted(context: &mut Context<'_>, config: &ArenaConfig) -> Result<Frame> {
    // Still views have one frame, rendered without motion blur.
    if config.frames == 1 {
        return context.still(config);
    }
    let arena = Arena::new(config, stage::SEED)?;
    // The roll of the head is the height of its x axis above the floor.
    let axis = |i: &u64| {
        arena
            .pose(*i)
            .map(|pose| pose.rotation * nalgebra::Vector3::x())
    };
    let roll = |i: &u64| axis(i).map_or(0.0, |axis| axis.z.abs());
    let frame = (0..arena.frames())
        .max_by(|a, b| roll(a).total_cmp(&roll(b)))
        .unwrap_or(0);
    context.step()?;
    arena.frame(frame)
}

/// Answer of an algorithm to a situation.
struct SituationAnswer {
    judgements: Vec<CellJudgement>,
    exhibit: Option<Exhibit>,
}

impl SituationAnswer {
    fn tally(&self) -> CellTally {
        CellTally::from_judgements(&self.judgements)
    }

    fn at(&self, column: usize, row: usize) -> Verdict {
        self.judgements[row * SHAPE.columns + column].verdict
    }
}

fn answer(situation: &Situation, judged: &Judged, algorithm: usize) -> Result<SituationAnswer> {
    let scored = &judged.estimates[algorithm];
    let judgements = scored.cells.clone().unwrap_or_default();
    let tally = CellTally::from_judgements(&judgements);
    let caption = format!(
        "{}, {}: {} right, {} wrong, {} unknown",
        situation.name, ALGORITHMS[algorithm], tally.right, tally.wrong, tally.unknown
    );
    Ok(SituationAnswer {
        judgements,
        exhibit: Some(grid_picture(caption, &judged.frame, scored)?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::CellRule;
    use svl_score::judge::TrueCells;

    /// An answer with its first `wrong` cells wrong and the others right.
    fn answers(wrong: usize) -> SituationAnswer {
        let cell = |i| CellJudgement {
            verdict: if i < wrong {
                Verdict::Wrong
            } else {
                Verdict::Right
            },
            ..CellJudgement::default()
        };
        SituationAnswer {
            judgements: (0..SHAPE.cells()).map(cell).collect(),
            exhibit: None,
        }
    }

    #[test]
    fn the_observations_of_the_thesis_hold() {
        let met = |dp: [usize; 8], v3: usize| {
            let mut finding = Finding::default();
            let outcomes: Vec<_> = dp
                .into_iter()
                .map(|wrong| [answers(wrong), answers(v3)])
                .collect();
            conclude(&outcomes, &mut finding);
            finding.conditions.iter().map(|c| c.met).collect::<Vec<_>>()
        };
        // The door's cell is the eleventh.
        assert_eq!(met([4, 11, 18, 5, 5, 5, 18, 5], 0), [true; 4]);
        assert_eq!(met([5, 10, 9, 5, 5, 5, 5, 5], 5), [false; 4]);
    }

    #[test]
    fn the_door_fills_its_cell() {
        let arena = Arena::new(&small_escape(), stage::SEED).unwrap();
        let frame = arena.frame(0).unwrap();
        let truth = TrueCells::new(&frame, SHAPE, CellRule::default()).unwrap();
        let distance = |column: usize| {
            let cell = truth.grid().cell(column, 1);
            cell.depth.unwrap().distance_m.unwrap()
        };
        assert!(distance(DOOR) > 1.5 && distance(DOOR - 1) < 0.6 && distance(DOOR + 1) < 0.6);
    }
}
