//! v5 against its oracle, and the oracle against known answers of other implementations.

use crate::common;
use crate::common::cases;
use crate::oracle::scenes::{Scene, pairs, pool};
use crate::oracle::v5::{Evidence, MEDIAN, NEAR, Steps, V5, score};
use proptest::prelude::*;
use svl_core::depth::decision::{self, LevelTables, VerdictTable};
use svl_core::kernel::Isa;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, V5Model, Value};
use svl_core::stereo::{CellRule, CellState, Gray, Reason, RectifiedPair, Rig, StereoPair};

impl V5 {
    /// The matcher with a model of these tables, and without a network.
    fn algorithm(&self, target: &'static str) -> Algorithm {
        let Self {
            max_disparity,
            out,
            p1,
            p2,
            edge,
            unique,
            jump,
            slack,
            rank,
            allowance,
        } = self;
        let table = |rank, (base, features): crate::oracle::v5::Table| {
            let mut steps: [decision::Steps; 9] = Default::default();
            for (steps, feature_steps) in steps.iter_mut().zip(features) {
                *steps = decision::Steps(feature_steps.to_vec());
            }
            VerdictTable {
                rank,
                slack: *slack,
                least_score: 1099,
                near_least_score: None,
                base,
                steps,
                time: None,
            }
        };
        let median = table(50, MEDIAN);
        let model = V5Model {
            network: None,
            levels: LevelTables {
                finest: median.clone(),
                middle: median.clone(),
                coarsest: median.clone(),
                small: median.clone(),
            },
            median,
            near: table(75, NEAR),
            near_small: None,
            ..V5Model::built_in()
        };
        assert_eq!(*rank, if target == "near" { 75 } else { 50 });
        let text = format!(
            "v5:max_disparity={max_disparity},out={out},p1={p1},p2={p2},edge={edge},\
             unique={unique},jump={jump},allowance_px={allowance},target={target}"
        );
        let algorithm: Algorithm = text.parse().unwrap();
        let model = Value::file("model", model.to_bytes());
        algorithm.with("model", &model).unwrap()
    }

    /// Checks map and grid of the matcher on every instruction set and two thread counts.
    fn agrees(
        &self,
        target: &'static str,
        pair: &StereoPair,
        rig: Option<Rig>,
    ) -> Result<(), TestCaseError> {
        let algorithm = self.algorithm(target);
        let expected = self.steps(pair);
        let tolerance = match &rig {
            Some(rig) => self.tolerance_m(rig.focal_px() * rig.baseline_m(), rig.doffs_px()),
            None => self.tolerance_px(2.0),
        };
        let table = if target == "near" { NEAR } else { MEDIAN };
        for isa in Isa::available() {
            for threads in [1, 2] {
                let output = pool(threads).install(|| {
                    let mut output = MatchOutput::new().unwrap();
                    let mut matcher = algorithm.build_on(isa).unwrap();
                    let context = MatchContext {
                        rig,
                        cells: CellRule::default(),
                        ..MatchContext::default()
                    };
                    // The second time in memory already used.
                    for _ in 0..2 {
                        output.begin();
                        let pair = RectifiedPair::assume(pair);
                        matcher.compute(pair, &context, &mut output).unwrap();
                    }
                    output
                });
                let words = format!("{algorithm:?} {isa} {threads}");
                same_map(&output, &expected, pair.left().width())
                    .map_err(|why| TestCaseError::fail(format!("{words}: {why}")))?;
                self.same_cells(&output, &expected, &tolerance, table, &words)?;
            }
        }
        Ok(())
    }

    fn same_cells(
        &self,
        output: &MatchOutput,
        steps: &Steps,
        tolerance: &[(i32, i32)],
        table: crate::oracle::v5::Table,
        words: &str,
    ) -> Result<(), TestCaseError> {
        let grid = output.grid.as_ref().unwrap();
        if steps.filled.iter().all(|&bin| bin < 0) || steps.size.0 < 5 || steps.size.1 < 3 {
            prop_assert!(
                grid.iter()
                    .all(|(_, cell)| cell.depth.is_none() || steps.size.0 < 5 || steps.size.1 < 3)
            );
            return Ok(());
        }
        let evidence = self.evidence(steps, tolerance, (5, 3));
        let is_outside = steps.size.0.div_ceil(2) * steps.size.1.div_ceil(4) / 15 < 8;
        for ((place, cell), evidence) in grid.iter().zip(evidence) {
            let rested_on = cell.evidence.unwrap();
            prop_assert_eq!(
                [rested_on.report, rested_on.target],
                [evidence[0], evidence[1]]
            );
            prop_assert_eq!(&rested_on.features[..6], &evidence[2..]);
            let (first, last) = tolerance[evidence[0] as usize];
            prop_assert_eq!(rested_on.features[6], i64::from(last - first + 1));
            // A narrow tolerance in cells smaller than those of the fit.
            let is_refused =
                table == MEDIAN && is_outside && evidence[0] > 0 && last - first + 1 < 14;
            let known = is_known(table, &evidence) && !is_refused;
            let reported = cell.depth.map(|depth| (8.0 * depth.median_px) as i64);
            prop_assert_eq!(
                reported,
                known.then_some(evidence[0]),
                "{} {:?} {:?}",
                words,
                place,
                evidence
            );
            let odds = score(table, &evidence) as f64 / 1000.0;
            let probability = 1.0 / (1.0 + (-odds).exp());
            let expected = (is_reported(&evidence) && !is_refused).then_some(probability);
            let apart = cell.probability.zip(expected).map(|(a, b)| (a - b).abs());
            prop_assert_eq!(cell.probability.is_some(), expected.is_some());
            prop_assert!(apart.is_none_or(|apart| apart < 1e-12), "{}", words);
        }
        Ok(())
    }
}

fn is_known(table: crate::oracle::v5::Table, evidence: &Evidence) -> bool {
    score(table, evidence) >= 1099 && is_reported(evidence)
}

/// True for a disparity above 0, and for 0 with support and texture.
fn is_reported(evidence: &Evidence) -> bool {
    evidence[0] > 0 || evidence[3] >= 500 && evidence[7] >= 200
}

/// The difference, if any.
fn same_map(output: &MatchOutput, steps: &Steps, width: usize) -> Result<(), String> {
    let (w, h) = steps.size;
    let map = &output.disparity;
    for y in 0..map.size().1 {
        for x in 0..width {
            let place = match w * h {
                0 => None,
                _ => Some((y / 2).min(h - 1) * w + (x / 2).min(w - 1)),
            };
            let expected = match place {
                None => Err(Reason::Border),
                Some(place) if steps.seen[place] => Ok(f32::from(steps.disparity[place]) / 8.0),
                Some(place) => {
                    // The winner at half size, whose fraction is at most half of it.
                    let best = (steps.disparity[place] + 8).div_euclid(16);
                    Err(if (place % w) < best as usize {
                        Reason::Border
                    } else if !steps.consistent[place] {
                        Reason::Inconsistent
                    } else {
                        Reason::Ambiguous
                    })
                }
            };
            let got = map.at(x, y);
            // A fraction of exactly one half may belong to either winner.
            let near_border = matches!((got, expected), (Err(a), Err(b)) if a != b)
                && steps.disparity[place.unwrap()].rem_euclid(16) == 8;
            if got != expected && !near_border {
                return Err(format!("at {x}, {y}: {got:?}, expected {expected:?}"));
            }
        }
    }
    Ok(())
}

fn arena_rig() -> Rig {
    let focal = 160.0 / 26_f64.to_radians().tan();
    Rig::new(focal, (160.0, 120.0), 0.044, 0.0).unwrap()
}

fn parameters() -> impl Strategy<Value = V5> {
    let penalties = prop_oneof![2 => (0..=12, 0..=27), 1 => Just((39, 0)), 1 => Just((0, 39))];
    let range = prop_oneof![1 => 0..=4_usize, 3 => 5..=90_usize, 1 => 91..=255_usize];
    let rest = (
        0..=24_u8,
        prop::sample::select(vec![1, 40, 1020]),
        prop::sample::select(vec![0, 1, 20, 65_535]),
        prop::sample::select(vec![0, 16, 4096]),
        prop::sample::select(vec![0, 10, 500]),
        prop::sample::select(vec![0.0, 0.25, 3.0]),
    );
    (penalties, range, rest).prop_map(|((p1, more), max_disparity, rest)| V5 {
        max_disparity,
        out: rest.0,
        p1,
        p2: (p1 + more).min(39),
        edge: rest.1,
        unique: rest.2,
        jump: rest.3,
        slack: rest.4,
        rank: 50,
        allowance: rest.5,
    })
}

fn sizes() -> impl Strategy<Value = (usize, usize)> {
    prop_oneof![
        4 => (1usize..=70, 1usize..=40),
        1 => (250usize..=280, 1usize..=8),
        1 => (1usize..=8, 130usize..=150),
    ]
}

proptest! {
    #![proptest_config(cases(60))]

    #[test]
    fn equals_its_oracle(
        pair in pairs(sizes()),
        v5 in parameters(),
        near in any::<bool>(),
        has_rig in any::<bool>(),
    ) {
        let rig = has_rig.then(arena_rig);
        let (target, rank) = if near { ("near", 75) } else { ("median", 50) };
        V5 { rank, ..v5 }.agrees(target, &pair, rig)?;
    }
}

#[test]
fn equals_its_oracle_on_larger_images() {
    for (size, shift) in [((161, 121), 9), ((320, 51), 30)] {
        let pair = crate::oracle::scenes::pair(Scene::ALL[0], size, shift, 5, 7);
        V5::default()
            .agrees("median", &pair, Some(arena_rig()))
            .unwrap();
    }
}

/// Disparities and cells of real scenes, from an independent implementation in Python.
#[test]
fn equals_an_independent_implementation_on_real_scenes() {
    let Some(datasets) = common::datasets() else {
        return;
    };
    let expected = datasets.join("../expected/v5");
    for name in ["tsukuba", "cones", "oakd-stereodemo_toy"] {
        let folder = datasets.join(name.replace("stereodemo_", "stereodemo/"));
        let pair = common::pair(&folder, "im0.png", "im1.png");
        let v5 = V5::default();
        let steps = v5.steps(&pair);
        let bins = image::open(expected.join(format!("{name}.bins.png")))
            .unwrap()
            .into_luma16();
        let got = steps.seen.iter().zip(&steps.disparity);
        let got: Vec<u16> = got
            .map(|(&seen, &d)| if seen { d as u16 + 1 } else { 0 })
            .collect();
        assert_eq!(got, bins.into_raw(), "{name}");
        for (file, rank, table) in [("cells", 50, MEDIAN), ("near", 75, NEAR)] {
            let v5 = V5 {
                rank,
                ..V5::default()
            };
            let evidence = v5.evidence(&steps, &v5.tolerance_px(2.0), (6, 3));
            let text =
                std::fs::read_to_string(expected.join(format!("{name}.{file}.csv"))).unwrap();
            for (line, evidence) in text.lines().skip(1).zip(&evidence) {
                let mut known: Vec<i64> = line.split(',').map(|v| v.parse().unwrap()).collect();
                let is_known = known.pop().unwrap() == 1;
                let got: Vec<_> = evidence
                    .iter()
                    .copied()
                    .chain([score(table, evidence)])
                    .collect();
                assert_eq!(got, known[2..], "{name} {line}");
                // With at least a fifth of seen pixels, as in revision 1.
                let known = self::is_known(table, evidence) && evidence[4] >= 200;
                assert_eq!(known, is_known, "{name} {line}");
            }
        }
        v5.agrees("median", &pair, None).unwrap();
    }
}

/// The vignetting of both lenses is alike, so a near plain wall matches at 0 px.
#[test]
fn a_plain_wall_is_not_far() {
    let side = Gray::from_fn(320, 240, |x, y| {
        let [x, y] = [(x, 160.0), (y, 120.0)].map(|(at, half)| at as f64 / half - 1.0);
        (150.0 - 30.0 * (x * x + y * y)).round() as u8
    });
    let side = side.unwrap();
    let pair = StereoPair::new(side.clone(), side).unwrap();
    let mut output = MatchOutput::new().unwrap();
    let mut matcher = "v5".parse::<Algorithm>().unwrap().build().unwrap();
    let pair = RectifiedPair::assume(&pair);
    matcher
        .compute(pair, &MatchContext::default(), &mut output)
        .unwrap();
    let mut plain = 0;
    for (_, cell) in output.grid.unwrap().iter() {
        assert_eq!(cell.state(), CellState::Unknown);
        assert!(cell.probability.is_none_or(|p| p < 0.9), "{cell:?}");
        plain += usize::from(cell.reason == Some(Reason::Untextured));
    }
    assert!(plain > 7, "{plain}");
}
