//! Scores without truth, tested for their ability to separate right cells from wrong ones: svl's
//! own study.
//!
//! docs/results/without-truth.md contains the definitions, the measures and the criteria. They were
//! fixed before the first score was computed.
//!
//! ```text
//! frames ─▶ Observer: support, score ─▶ Observed: rank correlation, picks, bootstrap ─▶ Finding
//! ```

mod measures;
mod observe;
mod support;

use super::finding::{axis, series};
use super::{Context, Experiment, Finding, TableValue};
use measures::{Between, Measured, Observed, Target};
use observe::{Observation, Observer};
use svl_bench::report::plot::{Chart, SeriesStyle};
use svl_bench::sink::CollectSink;
use svl_bench::source::dataset::Scene;
use svl_bench::source::{ArenaSource, Source};
use svl_core::stereo::{CellRule, GridShape};
use svl_core::{Result, joined};
use svl_data::arena::Arena;
use svl_data::scenario::{Scenario, ScenarioSource};
use svl_data::score::Judge;

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["without-truth"],
    place: "svl's own study",
    title: "Scores without truth",
    claim: "Not from the thesis: a score that needs no truth tells which algorithm has fewer \
            wrong cells at equal coverage, and picks the best of a run more often than coverage \
            does.",
    method: "All 840 pairs of the arena's three seeds and, where data sets are named, their \
             scenes with truth, through all algorithms. Definitions, measures and criteria are \
             those of docs/results/without-truth.md. Brackets contain 95 % bootstrap intervals. \
             A second matching per algorithm and pair, and the correlations of all disparities, \
             take minutes.",
    records: false,
    by_default: false,
    run,
};

const ALGORITHMS: [&str; 7] = ["dp", "v1", "v2", "v3", "v4", "bm", "sgm"];

/// The scores, then the two coverages.
const SCORES: [&str; 7] = [
    "warped",
    "unrivalled",
    "left-right",
    "steady",
    "agreed",
    "coverage of cells",
    "coverage of pixels",
];
const CELLS: usize = 5;
const PIXELS: usize = 6;

/// Least lower end of a tau's interval.
const LEAST_TAU: f64 = 0.2;

/// The real scenes with truth, below the folder of data sets. Those on one line show one scene
/// under different light or exposure.
const REAL: &[&[&str]] = &[
    &["tsukuba"],
    &["venus"],
    &["barn1"],
    &["bull"],
    &["teddy"],
    &["cones"],
    &["middlebury2006/Art", "middlebury2014q/ArtL"],
    &["middlebury2006/Baby1"],
    &["middlebury2006/Books"],
    &["middlebury2006/Cloth3"],
    &["middlebury2006/Reindeer"],
    &["middlebury2006/Wood1"],
    &["middlebury2014q/Adirondack"],
    &["middlebury2014q/Motorcycle", "middlebury2014q/MotorcycleE"],
    &["middlebury2014q/Piano", "middlebury2014q/PianoL"],
    &["middlebury2014q/Playroom"],
    &["eth3d-playground_1l"],
    &["kitti2012-000000_10"],
];

/// Cells of about the same size as the arena's, on images of twice its width.
const REAL_GRID: GridShape = GridShape {
    columns: 10,
    rows: 6,
};

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let mut finding = Finding::default();
    let runs = arena(context)?;
    let lengths: Vec<_> = runs.iter().map(|(_, pairs)| pairs.len()).collect();
    let mut averages: Vec<_> = runs
        .iter()
        .map(|(seed, pairs)| (format!("arena, seed {seed}"), pairs.clone()))
        .collect();
    let pairs = runs.into_iter().flat_map(|(_, pairs)| pairs).collect();
    let mut sets = vec![("arena", Observed::runs(pairs, &lengths))];
    let scenes = real(context)?;
    if !scenes.is_empty() {
        averages.push((
            "real scenes".into(),
            scenes.iter().flatten().cloned().collect(),
        ));
        sets.push(("real scenes", Observed::scenes(scenes)));
    }
    let values: Vec<Vec<Values>> = sets
        .iter()
        .map(|(_, set)| (0..SCORES.len()).map(|i| Values::of(set, i)).collect())
        .collect();
    let offered: Vec<_> = (0..CELLS)
        .filter(|&score| {
            let of_sets: Vec<_> = values.iter().map(|scores| scores[score]).collect();
            judged(score, &of_sets, &sets, &mut finding)
        })
        .collect();
    let names = |scores: &[usize]| joined(scores.iter().map(|&i| SCORES[i]));
    finding.why = match (&offered[..], sets.len()) {
        (_, 1) => "On the arena alone nothing is decided: name the data sets with --data.".into(),
        ([], _) => "No score meets the criteria on both the arena and the real scenes.".into(),
        (offered, _) => format!(
            "On both the arena and the real scenes the criteria are met by: {}.",
            names(offered)
        ),
    };
    for ((place, set), values) in sets.iter().zip(&values) {
        table(place, set, values, &mut finding);
    }
    table_of_averages(&averages, &mut finding);
    if let [arena, real] = &values[..] {
        finding.plot(&figure(arena, real))?;
    }
    Ok(finding)
}

/// The runs of the arena: seed, observations per pair.
fn arena(context: &mut Context<'_>) -> Result<Vec<(u64, Vec<Vec<Observation>>)>> {
    let scenario = Scenario::arena()?;
    let ScenarioSource::Arena { config, seeds } = &scenario.source else {
        return Ok(Vec::new());
    };
    let run = |&seed| {
        let mut source = ArenaSource::new(Arena::new(config, seed)?, seed);
        let pairs = observed(context, &mut source, &scenario.judge())?;
        Ok((seed, pairs))
    };
    seeds.iter().map(run).collect()
}

/// The real scenes that exist: observations per scene and pair.
fn real(context: &mut Context<'_>) -> Result<Vec<Vec<Vec<Observation>>>> {
    let Some(data) = context.data else {
        return Ok(Vec::new());
    };
    let mut scenes = Vec::new();
    for names in REAL {
        let mut pairs = Vec::new();
        for name in *names {
            let Some(scene) = Scene::find(&data.join(name), name) else {
                continue;
            };
            let tolerance_px = if name.starts_with("kitti") { 3.0 } else { 2.0 };
            let judge = Judge {
                grid: REAL_GRID.into(),
                cells: CellRule::Disparity { tolerance_px },
                ..Judge::default()
            };
            let frames = vec![scene.read(0)?];
            let mut source = super::Frames(frames.into_iter());
            pairs.extend(observed(context, &mut source, &judge)?);
        }
        if !pairs.is_empty() {
            scenes.push(pairs);
        }
    }
    Ok(scenes)
}

fn observed(
    context: &mut Context<'_>,
    source: &mut dyn Source,
    judge: &Judge,
) -> Result<Vec<Vec<Observation>>> {
    let mut observer = Observer::new(judge.clone())?;
    let sink = CollectSink::new(move |judged| observer.observe(judged));
    let outbox = sink.outbox();
    context.run(source, &ALGORITHMS, judge, sink)?;
    outbox.take().into_iter().collect()
}

/// Worth of a score on a set of pairs.
#[derive(Clone, Copy)]
struct Values {
    /// Between algorithms on one pair, with wrong cells at equal coverage and with right cells.
    algorithms: [Measured; 2],
    /// The same between pairs of one algorithm.
    pairs: [Measured; 2],
    picks: Measured,
    beyond_coverage: Measured,
}

impl Values {
    fn of(set: &Observed, score: usize) -> Self {
        let taus = |between| [Target::NotWrong, Target::Right].map(|t| set.tau(score, between, t));
        Self {
            algorithms: taus(Between::Algorithms),
            pairs: taus(Between::Pairs),
            picks: set.picks(score),
            beyond_coverage: set.picks_beyond_coverage(score),
        }
    }

    /// Criteria 1 to 3 of docs/results/without-truth.md, and 4.
    fn met(&self, in_arena: bool) -> [bool; 4] {
        let [wrong, right] = self.algorithms.map(|tau| tau.is_above(LEAST_TAU));
        let beyond = self.beyond_coverage;
        let picks = beyond.value.is_some_and(|v| v > 0.0) && (!in_arena || beyond.is_above(0.0));
        [wrong, right, picks, self.pairs[0].is_above(LEAST_TAU)]
    }
}

/// The condition of a score, met or not. `None` without real scenes.
fn judged(
    score: usize,
    values: &[Values],
    sets: &[(&str, Observed)],
    finding: &mut Finding,
) -> bool {
    if values.len() < 2 {
        return false;
    }
    let places = values.iter().enumerate();
    let met: Vec<_> = places.map(|(i, values)| values.met(i == 0)).collect();
    let is_met = |criterion: usize| met.iter().all(|met| met[criterion]);
    let offered = (0..3).all(is_met);
    let words = |(values, (place, _)): (&Values, &(&str, Observed))| {
        format!(
            "{place}: tau with wrong cells at equal coverage {}, with right cells {}, picks beyond \
             coverage {}",
            values.algorithms[0].words(),
            values.algorithms[1].words(),
            values.beyond_coverage.words()
        )
    };
    let words: Vec<_> = values.iter().zip(sets).map(words).collect();
    let frames = if is_met(3) { "also" } else { "not" };
    finding.condition(
        offered,
        format!(
            "{} meets criteria 1 to 3, {frames} 4. {}.",
            SCORES[score],
            words.join("; ")
        ),
    );
    offered
}

fn table(place: &str, set: &Observed, values: &[Values], finding: &mut Finding) {
    let pairs = set.pairs.len();
    let first = format!("{place}, {pairs} pairs");
    let chance = set.chance().map_or(f64::NAN, |chance| 100.0 * chance);
    let picks = format!("picks the best, % (chance {chance:.0})");
    let table = finding.table([
        &first,
        "tau, algorithms, wrong cells at equal coverage",
        "couples",
        "tau, algorithms, right cells",
        "tau, pairs, wrong cells at equal coverage",
        "couples",
        "tau, pairs, right cells",
        &picks,
        "beyond coverage, %",
    ]);
    for (score, values) in values.iter().enumerate() {
        let [algorithms, pairs] = [Between::Algorithms, Between::Pairs]
            .map(|between| set.couples(score, between, Target::NotWrong) as f64);
        table.row(
            SCORES[score],
            [
                tau(values.algorithms[0]),
                algorithms.into(),
                tau(values.algorithms[1]),
                tau(values.pairs[0]),
                pairs.into(),
                tau(values.pairs[1]),
                share(values.picks),
                share(values.beyond_coverage),
            ],
        );
    }
}

fn tau(measured: Measured) -> TableValue {
    TableValue::Text(measured.words())
}

fn share(measured: Measured) -> TableValue {
    let percent = |share: f64| format!("{:.0}", 100.0 * share);
    TableValue::Text(match (measured.value, measured.interval) {
        (Some(value), Some((low, high))) => {
            format!("{} [{}, {}]", percent(value), percent(low), percent(high))
        }
        (Some(value), None) => percent(value),
        _ => "none".into(),
    })
}

/// The means over a run for each algorithm.
fn table_of_averages(runs: &[(String, Vec<Vec<Observation>>)], finding: &mut Finding) {
    let table = finding.table([
        "mean, %",
        "right of all cells",
        "wrong of known cells",
        SCORES[0],
        SCORES[1],
        SCORES[2],
        SCORES[3],
        SCORES[4],
        SCORES[CELLS],
    ]);
    for (run, pairs) in runs {
        for (algorithm, name) in ALGORITHMS.iter().enumerate() {
            let own = || pairs.iter().flatten().filter(|o| o.algorithm == algorithm);
            let mean = |value: &dyn Fn(&Observation) -> Option<f64>| {
                let values: Vec<_> = own().filter_map(value).collect();
                TableValue::from(100.0 * values.iter().sum::<f64>() / values.len() as f64)
            };
            let wrong: usize = own().map(|o| o.truth.wrong).sum();
            let right: usize = own().map(|o| o.truth.right).sum();
            let score = |i: usize| mean(&|o| o.scores[i]);
            table.row(
                format!("{run}, {name}"),
                [
                    mean(&|o| Some(o.right())),
                    (100.0 * wrong as f64 / (right + wrong) as f64).into(),
                    score(0),
                    score(1),
                    score(2),
                    score(3),
                    score(4),
                    score(CELLS),
                ],
            );
        }
    }
}

/// Each score by its tau, in the arena and on the real scenes.
fn figure(arena: &[Values], real: &[Values]) -> Chart {
    let point = |(i, name): (usize, &&str)| {
        let tau = |values: &[Values]| values[i].algorithms[0].value.unwrap_or(f64::NAN);
        series(*name, SeriesStyle::Named, [(tau(arena), tau(real))])
    };
    let corner = [(LEAST_TAU, 1.0), (LEAST_TAU, LEAST_TAU), (1.0, LEAST_TAU)];
    let limit = series(
        "least, of the interval's lower end",
        SeriesStyle::Line,
        corner,
    );
    let points = SCORES.iter().enumerate().map(point);
    let range = (-0.5, 1.0);
    Chart {
        title: "Tau with wrong cells at equal coverage, between algorithms".into(),
        x: axis("in the arena", range),
        y: axis("on the real scenes", range),
        series: points.chain([limit]).collect(),
    }
}
