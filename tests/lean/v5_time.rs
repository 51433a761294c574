//! v5 over time against an oracle of its own, which adds the past to the cells of single pairs.

use crate::oracle::scenes::{Scene, pair, pool};
use svl_core::depth::decision::{Tolerance, VerdictTable};
use svl_core::kernel::Isa;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, Matcher, V5Model, Value};
use svl_core::stereo::{Cell, CellRule, RectifiedPair, Rig, StereoPair};

/// A pair of a run.
struct RunPair {
    pair: StereoPair,
    sequence: u64,
    stamp_ns: Option<u64>,
}

const MS: u64 = 1_000_000;

fn rig() -> Rig {
    Rig::new(60.0, (75.0, 30.0), 0.05, 0.0).unwrap()
}

/// A scene that comes nearer, farther, and changes, with these stamps in milliseconds.
fn run(stamps: &[Option<u64>]) -> Vec<RunPair> {
    let shifts = [6, 6, 7, 7, 12, 12, 6, 6, 6, 9, 9, 9, 3, 3, 14, 14];
    let pairs = stamps.iter().zip(shifts.iter().cycle()).enumerate();
    let pairs = pairs.map(|(i, (stamp_ms, shift))| RunPair {
        pair: pair(
            Scene::Noise,
            (150, 60),
            *shift,
            120 + 10 * (i as u8 % 7),
            i as u64,
        ),
        sequence: i as u64,
        stamp_ns: stamp_ms.map(|ms| ms * MS),
    });
    pairs.collect()
}

fn context(run_pair: &RunPair, rig: Option<Rig>) -> MatchContext<'static> {
    MatchContext {
        sequence: run_pair.sequence,
        stamp_ns: run_pair.stamp_ns,
        rig,
        ..MatchContext::default()
    }
}

fn cells(matcher: &mut dyn Matcher, run_pair: &RunPair, rig: Option<Rig>) -> Vec<Cell> {
    decided(matcher, run_pair, &context(run_pair, rig))
}

fn decided(matcher: &mut dyn Matcher, run_pair: &RunPair, context: &MatchContext<'_>) -> Vec<Cell> {
    let mut output = MatchOutput::new().unwrap();
    let pair = RectifiedPair::assume(&run_pair.pair);
    matcher.compute(pair, context, &mut output).unwrap();
    output.grid.unwrap().into_cells()
}

/// A matcher after that pair.
fn followed(algorithm: &Algorithm, pair: &RunPair) -> Box<dyn Matcher> {
    let mut matcher = algorithm.build().unwrap();
    cells(&mut *matcher, pair, None);
    matcher
}

/// A model that reports more, so that the past decides.
fn algorithm() -> Algorithm {
    // The cells of these pairs are small.
    let mut model = V5Model::built_in();
    let mut median = VerdictTable {
        base: model.median.base + 1500,
        near_least_score: Some(1000),
        ..model.median.clone()
    };
    median.time.as_mut().unwrap().least_score = 3500;
    model.levels.small = median.clone();
    model.median = median;
    model.near.base += 500;
    model.near_small = None;
    let algorithm: Algorithm = "v5:max_disparity=40".parse().unwrap();
    algorithm
        .with("model", &Value::file("m", model.to_bytes()))
        .unwrap()
}

/// The specification's section 2, cell by cell: `v` and `s`, and the stamp of the last addition.
#[derive(Clone, Copy, Default)]
struct State {
    v: i64,
    s: i64,
    added: Option<u64>,
}

/// The cells of a run from those of its single pairs.
fn expected(
    algorithm: &Algorithm,
    run: &[RunPair],
    rig: Option<Rig>,
    beyond_m: f64,
) -> Vec<Vec<(bool, f64)>> {
    let table = algorithm.safe_choice().unwrap().unwrap().table;
    let time = table.time.clone().unwrap();
    let tolerance = Tolerance::new(CellRule::default(), rig.as_ref(), 0.25, 16 * 21);
    let mut single = algorithm.build().unwrap();
    let near = algorithm.with("target", &Value::Choice("near")).unwrap();
    let mut near = near.build().unwrap();
    let mut states = [State::default(); 15];
    let mut last: Option<&RunPair> = None;
    let mut all = Vec::new();
    for run_pair in run {
        single.reset();
        let alone = cells(&mut *single, run_pair, rig);
        let nearest = cells(&mut *near, run_pair, rig);
        let continues = last.is_some_and(|last| match (last.stamp_ns, run_pair.stamp_ns) {
            (Some(a), Some(b)) => a < b && b <= a + 1000 * MS,
            (None, None) => run_pair.sequence == last.sequence + 1,
            _ => false,
        });
        if !continues {
            states = [State::default(); 15];
        }
        last = Some(run_pair);
        let mut decided = Vec::new();
        for ((cell, nearest), state) in alone.iter().zip(nearest).zip(&mut states) {
            let Some(evidence) = cell.evidence else {
                *state = State::default();
                decided.push((false, f64::NAN));
                continue;
            };
            let (b, c) = (evidence.report, table.score(&evidence));
            let (mut score, mut least) = (c, table.least_score);
            if b == 0 {
                *state = State::default();
            } else {
                let e = c.clamp(0, 14_000);
                let [lo, hi] = tolerance.ends(b as usize).map(i64::from);
                let is_nearer = |b: i64, metres: f64| {
                    let depth_m = rig.and_then(|rig| rig.depth_m(b as f64 / 8.0));
                    b > 0 && depth_m.is_some_and(|z| z < metres)
                };
                let is_clear_nearer = is_nearer(b, 0.75);
                let is_hiding =
                    !is_clear_nearer && is_nearer(nearest.evidence.unwrap().report, 0.5);
                let least_of = |score: i64, least: i64| {
                    let near_least = table.near_least_score.filter(|_| is_nearer(b, beyond_m));
                    let near_least = near_least.filter(|_| score >= least || !is_hiding);
                    near_least.unwrap_or(least)
                };
                least = least_of(c, least);
                let (mut g, agrees) = match state.v {
                    0 => (0, false),
                    v if lo <= v && v <= hi => (time.agrees.score(state.s), true),
                    v if b < v => (time.farther.score(state.s), false),
                    _ => (time.nearer.score(state.s), false),
                };
                if is_clear_nearer {
                    g = g.max(0);
                }
                if state.v != 0 {
                    (score, least) = (c + g, least_of(c + g, time.least_score));
                }
                let is_apart = match (state.added, run_pair.stamp_ns) {
                    (Some(a), Some(now)) => now - a >= 400 * MS,
                    _ => true,
                };
                *state = match (agrees, is_apart) {
                    (true, true) => State {
                        v: b,
                        s: (state.s - (state.s >> 3) + e).min(14_000),
                        added: run_pair.stamp_ns,
                    },
                    (true, false) => State {
                        v: b,
                        s: state.s.max(e),
                        ..*state
                    },
                    (false, _) => State {
                        v: b,
                        s: e,
                        added: run_pair.stamp_ns,
                    },
                };
            }
            let probability = 1.0 / (1.0 + (-score as f64 / 1000.0).exp());
            let may_be_far = evidence.features[1] >= 500 && evidence.features[5] >= 200;
            let is_reported = b > 0 || may_be_far;
            let probability = if is_reported { probability } else { f64::NAN };
            decided.push((score >= least && is_reported, probability));
        }
        all.push(decided);
    }
    all
}

fn got(cells: &[Cell]) -> Vec<(bool, f64)> {
    let verdict = |cell: &Cell| (cell.depth.is_some(), cell.probability.unwrap_or(f64::NAN));
    cells.iter().map(verdict).collect()
}

fn same(got: &[(bool, f64)], expected: &[(bool, f64)]) -> bool {
    let is_same = |((a, p), (b, q)): (&(bool, f64), &(bool, f64))| {
        a == b && (p.is_nan() && q.is_nan() || (p - q).abs() < 1e-12)
    };
    got.iter().zip(expected).all(is_same)
}

#[test]
fn the_past_of_a_cell_is_that_of_the_specification() {
    let algorithm = algorithm();
    let ten_hz: Vec<_> = (0..40).map(|i| Some(1 + 100 * i)).collect();
    let two_hz: Vec<_> = (0..20).map(|i| Some(500 * i)).collect();
    // Repeated, backward, absent, and a gap of more than a second.
    let broken = [0, 100, 100, 200, 150, 250, 1250, 2251, 2300, 2400].map(Some);
    let mut mixed: Vec<_> = broken.to_vec();
    mixed.extend([None, None, None, Some(3000), Some(3100)]);
    let unstamped = vec![None; 12];
    for stamps in [ten_hz, two_hz, mixed, unstamped] {
        let run = run(&stamps);
        for (rig, beyond_m) in [(None, None), (Some(rig()), None), (Some(rig()), Some(0.6))] {
            let expected = expected(&algorithm, &run, rig, beyond_m.unwrap_or(2.0));
            let cells = CellRule::Distance {
                tolerance_m: 0.1,
                tolerance_percent: 20.0,
                obstacle_m: 0.5,
                clear_m: 0.75,
                beyond_m,
            };
            let context = |run_pair| MatchContext {
                cells,
                ..context(run_pair, rig)
            };
            let singles: usize = expected.iter().flatten().filter(|cell| cell.0).count();
            assert!(singles > 20, "{singles}");
            for isa in Isa::available() {
                for threads in [1, 8] {
                    pool(threads).install(|| {
                        let mut matcher = algorithm.build_on(isa).unwrap();
                        for (run_pair, expected) in run.iter().zip(&expected) {
                            // Warm-up and rounds: each pair is matched once more.
                            for _ in 0..2 {
                                let context = context(run_pair);
                                let got = got(&decided(&mut *matcher, run_pair, &context));
                                assert!(
                                    same(&got, expected),
                                    "{isa} {threads} {:?}",
                                    run_pair.stamp_ns
                                );
                            }
                        }
                    });
                }
            }
        }
    }
}

/// 7 × 4 cells are decided at one size, and not small, in images of 400 and of 404 px.
#[test]
fn the_least_score_of_near_reports_is_that_of_narrow_images() {
    let mut model = V5Model::built_in();
    model.median.base -= 20_000;
    model.median.near_least_score = Some(-50_000);
    let algorithm: Algorithm = "v5:max_disparity=40".parse().unwrap();
    let algorithm = algorithm.with("model", &Value::file("m", model.to_bytes()));
    let algorithm = algorithm.unwrap();
    let known = |width: usize, confidence: f64| {
        let run_pair = RunPair {
            pair: pair(Scene::Noise, (width, 240), 6, 120, 0),
            sequence: 0,
            stamp_ns: None,
        };
        let mut context = context(&run_pair, Some(rig()));
        (context.grid.columns, context.grid.rows) = (7, 4);
        let algorithm = algorithm
            .with("confidence", &Value::Real(confidence))
            .unwrap();
        let cells = decided(&mut *algorithm.build().unwrap(), &run_pair, &context);
        cells.iter().filter(|cell| cell.depth.is_some()).count()
    };
    assert!(known(400, 0.0) > 14, "{}", known(400, 0.0));
    assert_eq!(known(404, 0.0), 0);
    // None if a confidence is given.
    assert_eq!(known(400, 0.8), 0);
}

#[test]
fn a_pair_after_a_reset_is_the_pair_alone() {
    let algorithm = algorithm();
    let run = run(&(0..8).map(|i| Some(100 * i)).collect::<Vec<_>>());
    let mut matcher = algorithm.build().unwrap();
    assert!(matcher.has_run_memory());
    let mut differs = false;
    for run_pair in &run {
        let followed = cells(&mut *matcher, run_pair, None);
        let alone = cells(&mut *algorithm.build().unwrap(), run_pair, None);
        differs |= followed != alone;
    }
    assert!(differs, "the past counts");
    matcher.reset();
    let alone = cells(&mut *algorithm.build().unwrap(), &run[7], None);
    assert_eq!(cells(&mut *matcher, &run[7], None), alone);
    // A pair of another size, also where the half images are alike, of another grid, rig or rule.
    let odd = RunPair {
        pair: pair(Scene::Noise, (151, 60), 6, 120, 0),
        ..run[1]
    };
    let with = |change: &dyn Fn(&mut MatchContext<'static>)| {
        let mut context = context(&run[1], None);
        change(&mut context);
        context
    };
    let cases = [
        (&odd, with(&|_| {})),
        (&run[1], with(&|context| context.rig = Some(rig()))),
        (&run[1], with(&|context| context.grid.columns = 4)),
        (
            &run[1],
            with(&|context| context.cells = CellRule::Disparity { tolerance_px: 3.0 }),
        ),
    ];
    let same = decided(
        &mut *followed(&algorithm, &run[0]),
        &run[1],
        &context(&run[1], None),
    );
    let alone = decided(
        &mut *algorithm.build().unwrap(),
        &run[1],
        &context(&run[1], None),
    );
    assert_ne!(same, alone);
    for (run_pair, context) in cases {
        let alone = decided(&mut *algorithm.build().unwrap(), run_pair, &context);
        let after = decided(&mut *followed(&algorithm, &run[0]), run_pair, &context);
        assert_eq!(after, alone, "{context:?}");
    }
    let algorithm: Algorithm = "v5:target=near".parse().unwrap();
    assert!(!algorithm.build().unwrap().has_run_memory());
}

#[test]
fn the_nearer_surface_of_a_small_cell_is_that_of_the_second_table() {
    let mut model = V5Model::built_in();
    let mut table = model.near.clone();
    table.slack = 100;
    table.least_score = 500;
    let plain = V5Model {
        near_small: None,
        ..model.clone()
    };
    let nearest = V5Model {
        near: table.clone(),
        ..plain.clone()
    };
    model.near_small = Some(table.clone());
    let with_model = |mut model: V5Model, least_score| {
        model.near.least_score = least_score;
        let algorithm: Algorithm = "v5:max_disparity=40".parse().unwrap();
        let file = Value::file("m", model.to_bytes());
        algorithm.with("model", &file).unwrap()
    };
    let (algorithm, plain) = (with_model(model, 1500), with_model(plain, 1500));
    let near = with_model(nearest, 500);
    let near = near.with("target", &Value::Choice("near")).unwrap();
    let rig = rig();
    let tolerance = Tolerance::new(CellRule::default(), Some(&rig), 0.25, 16 * 21);
    let confident = algorithm.with("confidence", &Value::Real(0.97)).unwrap();
    let (mut shown, mut hidden, mut flags, mut kept, mut doubtful) = (0, 0, 0, 0, 0);
    for run_pair in &run(&[None; 16]) {
        let nearest = cells(&mut *near.build().unwrap(), run_pair, Some(rig));
        let before = cells(&mut *plain.build().unwrap(), run_pair, Some(rig));
        let now = cells(&mut *algorithm.build().unwrap(), run_pair, Some(rig));
        for ((cell, before), near) in now.iter().zip(&before).zip(&nearest) {
            let evidence = near.evidence.unwrap();
            let (report, score) = (evidence.report, table.score(&evidence));
            let [farthest, _] = tolerance.ends(report as usize);
            let is_second = before.depth.is_none()
                || 2 * before.evidence.unwrap().report < report + i64::from(farthest);
            let px = report as f64 / 8.0;
            let is_close = rig.depth_m(px).is_some_and(|z| z < 0.5);
            let least = if is_close { 1500 } else { 500 };
            let is_wide = report > 0 && evidence.features[6] >= 13;
            let is_seen = is_wide && score >= least;
            doubtful += usize::from(is_wide && score >= 500 && !is_seen);
            let expected = (is_seen && is_second).then(|| (px, rig.depth_m(px).unwrap()));
            let surface = cell
                .surface
                .map(|surface| (surface.px.into(), surface.distance_m));
            assert_eq!(surface, expected);
            let is_near = match expected {
                Some((_, z)) => z < 0.5 && before.depth.is_none(),
                None => before.near.is_some(),
            };
            assert_eq!(cell.near.is_some(), is_near);
            if expected.is_none() {
                assert_eq!(cell.near, before.near);
            }
            shown += usize::from(expected.is_some());
            hidden += usize::from(is_seen && !is_second);
            flags += usize::from(is_near && expected.is_some());
            kept += usize::from(is_near && expected.is_none());
            // Nothing else changes.
            let rest = Cell {
                surface: None,
                near: before.near,
                ..*cell
            };
            assert_eq!(rest, *before);
        }
        // A confidence is that of the map alone.
        let fewer = cells(&mut *confident.build().unwrap(), run_pair, Some(rig));
        for (cell, fewer) in now.iter().zip(&fewer) {
            assert!(cell.depth.is_some() || cell.surface == fewer.surface);
        }
        let without = cells(&mut *algorithm.build().unwrap(), run_pair, None);
        assert!(
            without
                .iter()
                .all(|cell| cell.surface.is_none() && cell.near.is_none())
        );
    }
    assert!(
        [shown, hidden, flags, kept, doubtful]
            .iter()
            .all(|count| *count > 0),
        "{shown} {hidden} {flags} {kept} {doubtful}"
    );
}

#[test]
fn an_unknown_cell_with_something_near_is_flagged() {
    // Nearly all cells are unknown.
    let algorithm = algorithm().with("confidence", &Value::Real(0.999)).unwrap();
    let near: Algorithm = algorithm.with("target", &Value::Choice("near")).unwrap();
    let near_table = algorithm.safe_choice().unwrap().unwrap().near.unwrap();
    let rig = rig();
    let mut flags = 0;
    for run_pair in &run(&[None; 16]) {
        let mut matcher = algorithm.build().unwrap();
        let nearest = cells(&mut *near.build().unwrap(), run_pair, Some(rig));
        for (cell, near) in cells(&mut *matcher, run_pair, Some(rig))
            .iter()
            .zip(&nearest)
        {
            let evidence = near.evidence.unwrap();
            let distance_m = rig.depth_m(evidence.report as f64 / 8.0);
            let is_near = near_table.score(&evidence) >= near_table.least_score
                && evidence.report > 0
                && distance_m.is_some_and(|z| z < 0.5);
            let expected = near.probability.filter(|_| cell.depth.is_none() && is_near);
            assert_eq!(cell.near, expected);
            flags += usize::from(cell.near.is_some());
        }
        let without = cells(&mut *algorithm.build().unwrap(), run_pair, None);
        assert!(without.iter().all(|cell| cell.near.is_none()));
    }
    assert!(flags > 0);
}
