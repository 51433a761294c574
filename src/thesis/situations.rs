//! Table 5.1 and annex A: the situations in which the thesis abandoned dynamic programming.

use super::measure::grid_picture;
use super::{Context, Experiment, Finding, stage};
use serde_json::Value;
use svl_core::Result;
use svl_score::judge::{CellJudgement, CellTally, Verdict};
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
    run,
};

const ALGORITHMS: [&str; 2] = ["dp", "v3"];

/// A view of table 5.1 or annex A: name, the thesis's observation on dp, and what it adds to an
/// empty arena.
type Situation = (&'static str, &'static str, fn(&mut ArenaConfig));

const SITUATIONS: [Situation; 8] = [
    ("normal", "as expected", normal),
    ("small escape", "totally missed", small_escape),
    ("low light", "completely wrong", low_light),
    ("single object", "–", |config| {
        config.world.balls = vec![stage::ball(0.4, 0.05, 0.08)];
    }),
    ("infinite distance", "–", infinite_distance),
    ("tilt", "–", tilt),
    ("dark", "–", |config| {
        normal(config);
        config.sensor.white_e_per_ms = 60.0;
    }),
    ("too far", "–", too_far),
];

/// Walls to the left and right, high enough to leave the view at the top, and one behind.
fn normal(config: &mut ArenaConfig) {
    config.world.blocks = vec![
        stage::block(0.7, -0.45, [0.6, 0.1, 0.6], 0.0),
        stage::block(0.5, 0.4, [0.5, 0.1, 0.6], 0.0),
        stage::block(1.3, 0.0, [3.0, 0.1, 1.0], 0.0),
    ];
}

/// The escape: a door as wide as a column of cells, in a wall 0.5 m ahead.
const DOOR: usize = 4;

fn small_escape(config: &mut ArenaConfig) {
    // Seen from the left camera, 22 mm left of the middle, 0.5 m away: columns 4 to 5 of 6 are 81
    // mm to 163 mm right.
    let (from, to) = (0.050, 0.150);
    config.world.blocks = vec![
        stage::block(0.5, from - 0.5, [1.0, 0.05, 0.6], 0.0),
        stage::block(0.5, to + 0.5, [1.0, 0.05, 0.6], 0.0),
        stage::block(1.6, 0.0, [3.0, 0.1, 1.2], 0.0),
    ];
}

/// A uniform wall in dim light.
fn low_light(config: &mut ArenaConfig) {
    normal(config);
    config.sensor.white_e_per_ms = 450.0;
    config.world.forest_contrast = 0.1;
}

fn infinite_distance(config: &mut ArenaConfig) {
    config.world.length_m = 20.0;
    config.world.room_margin_m = 20.0;
    config.world.wall_height_m = 0.05;
}

/// The normal view with the robot's head rolled by up to 20°.
fn tilt(config: &mut ArenaConfig) {
    normal(config);
    config.frames = 20;
    config.rate_hz = 10.0;
    config.robot.roll_sway_deg = 20.0;
}

/// A wall 4 m away: 3.6 px of disparity, where a pixel is a metre.
fn too_far(config: &mut ArenaConfig) {
    config.rig.above_floor_m = 0.3;
    config.world.blocks = vec![stage::block(4.0, 0.0, [4.0, 0.1, 4.0], 0.0)];
}

/// The cells of dp and of v3 in a situation.
type Answers = [Vec<CellJudgement>; 2];

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let (mut outcomes, mut rows, mut bars) = (Vec::new(), Vec::new(), Vec::new());
    for (situation, thesis, add) in SITUATIONS {
        let mut config = stage::empty();
        add(&mut config);
        let frame = context.frame(&config, most_tilted(&config)?)?;
        let judged = context.judged(vec![frame], &ALGORITHMS, &stage::judge())?;
        let (mut answers, mut row) = (Answers::default(), vec![Value::from(thesis)]);
        for (i, scored) in judged[0].estimates.iter().enumerate() {
            answers[i] = scored.cells.clone().unwrap_or_default();
            let name = format!("{situation}, {}", ALGORITHMS[i]);
            let [right, wrong, unknown] = counts(&answers[i]);
            let caption = format!("{name}: {right} right, {wrong} wrong, {unknown} unknown");
            let picture = grid_picture(caption, &judged[0].frame, scored)?;
            finding.pictures.push(picture);
            let counts = [right, wrong, unknown].map(|count| count as f64);
            row.extend(counts.map(Value::from));
            bars.push((name, counts.to_vec()));
        }
        // The cells that dp leaves unknown have no column.
        row.remove(3);
        rows.push((situation.to_owned(), row));
        outcomes.push(answers);
    }
    finding.table(
        "cells of 18 | thesis on dp | dp: right | dp: wrong | v3: right | v3: wrong | v3: unknown",
        rows,
    );
    conclude(&outcomes, finding);
    let parts = ["right", "wrong", "unknown"];
    finding.bars("Cells of eight situations", "cells of 18", &parts, bars);
    Ok(())
}

/// Right, wrong and unknown cells.
fn counts(cells: &[CellJudgement]) -> [usize; 3] {
    let tally = CellTally::from_judgements(cells);
    [tally.right, tally.wrong, tally.unknown]
}

/// Adds the conditions and the sentence that summarizes them.
fn conclude(outcomes: &[Answers], finding: &mut Finding) {
    let count = |algorithm: usize, verdict: usize| -> Vec<_> {
        let answers = outcomes.iter().map(|answers| &answers[algorithm]);
        answers.map(|cells| counts(cells)[verdict]).collect()
    };
    let (dp, v3, unknown) = (count(0, 1), count(1, 1), count(1, 2));
    let (cells, situations) = (stage::GRID.cells(), outcomes.len());
    let verdict = |situation: usize, algorithm: usize, column: usize, row: usize| {
        outcomes[situation][algorithm][row * stage::GRID.columns + column].verdict
    };
    let [normal, escape, low] = [dp[0], dp[1], dp[2]];
    let lowest = 0..stage::GRID.columns;
    let lowest = lowest.filter(|&x| verdict(0, 0, x, stage::GRID.rows - 1) == Verdict::Wrong);
    finding.condition(4 * normal <= cells).says(format!(
        "In the normal view at most a quarter of dp's {cells} cells are wrong: {normal} are, {} of \
         them in the lowest row, on plain floor.",
        lowest.count()
    ));
    let [dp_door, v3_door] = [0, 1].map(|algorithm| verdict(1, algorithm, DOOR, 1));
    finding.condition(dp_door != Verdict::Right).says(format!(
        "dp misses the small escape: its cell with the door is {}; v3's is {}.",
        dp_door.name(),
        v3_door.name()
    ));
    finding.condition(2 * low > cells).says(format!(
        "In low light more than half of dp's cells are wrong: {low}."
    ));
    let better = dp.iter().zip(&v3).filter(|(dp, v3)| v3 < dp).count();
    finding.condition(better == situations).says(format!(
        "v3 has fewer wrong cells in every situation: in {better} of {situations}."
    ));
    let [dp, v3, unknown] = [dp, v3, unknown].map(|cells| cells.iter().sum::<usize>());
    finding.why = format!(
        "dp has {normal} of {cells} cells wrong in the normal view, {escape} with the small escape \
         and {low} in low light, {dp} in all eight situations; v3 has {v3}, and leaves {unknown} \
         of the {} unknown.",
        cells * situations
    );
}

/// The number of the frame with the largest roll of the head: the height of its x axis above the
/// floor.
fn most_tilted(config: &ArenaConfig) -> Result<u64> {
    let arena = Arena::new(config, stage::SEED)?;
    let roll = |i: &u64| {
        let pose = arena.pose(*i);
        pose.map_or(0.0, |pose| (pose.rotation * nalgebra::Vector3::x()).z.abs())
    };
    let frame = (0..arena.frames()).max_by(|a, b| roll(a).total_cmp(&roll(b)));
    Ok(frame.unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::CellRule;
    use svl_score::judge::TrueCells;

    /// An answer with its first `wrong` cells wrong and the others right.
    fn answers(wrong: usize) -> Vec<CellJudgement> {
        let cell = |i| CellJudgement {
            verdict: if i < wrong {
                Verdict::Wrong
            } else {
                Verdict::Right
            },
            ..CellJudgement::default()
        };
        (0..stage::GRID.cells()).map(cell).collect()
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
        let mut config = stage::empty();
        small_escape(&mut config);
        let arena = Arena::new(&config, stage::SEED).unwrap();
        let frame = arena.frame(0).unwrap();
        let truth = TrueCells::new(&frame, stage::GRID, CellRule::default()).unwrap();
        let distance = |column: usize| {
            let cell = truth.grid().cell(column, 1);
            cell.depth.unwrap().distance_m.unwrap()
        };
        assert!(distance(DOOR) > 1.5 && distance(DOOR - 1) < 0.6 && distance(DOOR + 1) < 0.6);
    }
}
