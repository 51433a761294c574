//! The oracle of v5 against known answers of its specification.

#[allow(dead_code, reason = "each test program uses its part of this module")]
#[path = "../../lean/oracle/v5.rs"]
mod oracle;

use oracle::V5;
use svl::arena::{Arena, ArenaConfig};
use svl::depth::GridSettings;
use svl::depth::decision::{VerdictTable, probability};
use svl::matcher::{Algorithm, MatchContext, MatchOutput, V5Model, Value};
use svl::scenario::{Scenario, ScenarioSource};
use svl::score::TrueCells;
use svl::stereo::{Cell, CellRule, hash_words};

/// CRC-32 of every step for pairs of the arena, as given in the specification (section 3.11).
#[test]
fn the_oracle_gives_the_specification_s_answers() {
    fn crc<T: Copy, const N: usize>(values: &[T], bytes: impl Fn(T) -> [u8; N]) -> u32 {
        crc32fast::hash(&values.iter().flat_map(|&v| bytes(v)).collect::<Vec<_>>())
    }
    let known: [(u64, [u32; 9]); 3] = [
        (
            0,
            [
                0x48edd7ee, 0x7f2b6ff6, 0x34ea7937, 0xcacb594a, 0xb0a90212, 0xee305a78, 0xa73d7738,
                0x7edcf5c1, 0,
            ],
        ),
        (
            100,
            [
                0x48ad2f71, 0x4978a26c, 0xc8cd3032, 0xaa4a6b86, 0x00cf2b6d, 0x62356878, 0xcda01b10,
                0x2bc55a22, 0,
            ],
        ),
        (
            200,
            [
                0x89063527, 0xcb5bff3f, 0xad3a29f3, 0x132f7bd9, 0x5d967f30, 0x545933a6, 0x5f9fe900,
                0xf0e90a55, 0,
            ],
        ),
    ];
    let arena = Arena::new(&ArenaConfig::default(), 1).unwrap();
    let v5 = V5::default();
    let rig = arena.rig();
    let tolerance = v5.tolerance_m(rig.focal_px() * rig.baseline_m(), rig.doffs_px());
    let (lo, hi): (Vec<_>, Vec<_>) = tolerance.iter().copied().unzip();
    assert_eq!(crc(&lo, i32::to_le_bytes), 0xdf4d0067);
    assert_eq!(crc(&hi, i32::to_le_bytes), 0x6b0be4cf);
    for (number, known) in known.into_iter().step_by(crate::common::step(1)) {
        let steps = v5.steps(&arena.frame(number).unwrap().pair);
        let flags: Vec<u8> = steps.seen.iter().map(|&seen| seen.into()).collect();
        let evidence = v5.evidence(&steps, &tolerance, (5, 3)).concat();
        let got = [
            crc(&steps.half[0], u16::to_le_bytes),
            crc(&steps.census[0], u32::to_le_bytes),
            crc(&steps.costs, u8::to_le_bytes),
            crc(&steps.sums, u8::to_le_bytes),
            crc(&steps.disparity, i16::to_le_bytes),
            crc(&flags, u8::to_le_bytes),
            crc(&steps.filled, i16::to_le_bytes),
            crc(&evidence, i64::to_le_bytes),
        ];
        let words = |crcs: &[u32]| crcs.iter().map(|c| format!("{c:08x}")).collect::<Vec<_>>();
        assert_eq!(words(&got), words(&known[..8]), "pair {number}");
    }
}

/// A cell becomes near from one pair to the next, in a run of pieces from different places.
struct Sudden {
    /// The first of six pairs in which v5 finds it, and in which revision 3 does.
    found: [Option<usize>; 2],
}

/// Flags: whose nearest quarter is nearer than 0.5 m, farther than 0.75 m, and all with a truth.
#[derive(Default)]
struct Flags {
    near: usize,
    far: usize,
    all: usize,
}

/// Reports, states and scores of an arena run, by a model without what this revision added to the
/// built-in one.
#[test]
fn a_model_of_an_earlier_revision_decides_as_before() {
    let mut earlier = V5Model::built_in();
    earlier.near_small = None;
    let levels = &mut earlier.levels;
    for table in [
        &mut earlier.median,
        &mut levels.finest,
        &mut levels.coarsest,
    ] {
        table.near_least_score = None;
    }
    let v5: Algorithm = "v5".parse().unwrap();
    let earlier = v5.with("model", &Value::file("m", earlier.to_bytes()));
    let mut hashes = Vec::new();
    for (factor, columns, rows) in [(1, 5, 3), (1, 24, 12), (2, 5, 3)] {
        let mut config = ArenaConfig::default();
        config.rig.width_px *= factor;
        config.rig.height_px *= factor;
        let arena = Arena::new(&config, 305).unwrap();
        for algorithm in [earlier.as_ref().unwrap(), &v5] {
            let mut matcher = algorithm.build().unwrap();
            let (mut hash, mut surfaces) = (0, 0);
            for number in (0..arena.frames()).step_by(20) {
                let frame = arena.frame(number).unwrap();
                let grid = GridSettings {
                    columns,
                    rows,
                    ..GridSettings::default()
                };
                let context = MatchContext {
                    sequence: number / 20,
                    ..MatchContext::for_frame(&frame, grid, CellRule::default())
                };
                let mut output = MatchOutput::new().unwrap();
                let pair = frame.rectified().unwrap();
                matcher.compute(pair, &context, &mut output).unwrap();
                let grid = output.grid.unwrap();
                hash = grid.hash(hash);
                for level in grid.levels().flatten() {
                    let report = level
                        .evidence
                        .map(|evidence| (evidence.report, level.scores));
                    hash = hash.rotate_left(7)
                        ^ u128::from(crc32fast::hash(format!("{report:?}").as_bytes()));
                }
                surfaces += grid
                    .iter()
                    .filter(|(_, cell)| cell.surface.is_some())
                    .count();
            }
            hashes.push((hash_words(hash), surfaces));
        }
    }
    let surfaces = hashes.iter().map(|(_, surfaces)| *surfaces > 0);
    let expected = [false, false, false, true, false, false];
    assert_eq!(surfaces.collect::<Vec<_>>(), expected);
    let known = [
        "h9c9fac458443dca5acef8b1771476e1d",
        "h05268d18d1eb66e732c1ee1aa0844adb",
        "h7863150930c9941714b23e9830fff7c9",
    ];
    assert_eq!([0, 2, 4].map(|i| &hashes[i].0), known);
}

/// Reports that are known by the least score of near ones alone: none is beyond 0.75 m in a cell
/// whose nearest quarter reports less than 0.5 m. Such a cell is as before: a flag may name it.
#[test]
fn a_near_report_hides_no_nearer_quarter() {
    let v5: Algorithm = "v5".parse().unwrap();
    let built_in = V5Model::built_in();
    let least = built_in.median.near_least_score.unwrap();
    let median = VerdictTable {
        near_least_score: None,
        ..built_in.median.clone()
    };
    let earlier = V5Model { median, ..built_in };
    let earlier = Value::file("m", earlier.to_bytes());
    let earlier = v5.with("model", &earlier).unwrap();
    let near = v5.with("target", &Value::Choice("near")).unwrap();
    let mut matchers = [&v5, &earlier, &near].map(|algorithm| algorithm.build().unwrap());
    let arena = Arena::new(&ArenaConfig::default(), 3).unwrap();
    let rig = arena.rig();
    let (mut gained, mut withheld, mut flagged) = (0, 0, 0);
    for number in 15..30 {
        let frame = arena.frame(number).unwrap();
        let grid = GridSettings::default();
        let context = MatchContext {
            sequence: number,
            ..MatchContext::for_frame(&frame, grid, CellRule::default())
        };
        let [now, before, nearest] = matchers.each_mut().map(|matcher| {
            let mut output = MatchOutput::new().unwrap();
            let pair = frame.rectified().unwrap();
            matcher.compute(pair, &context, &mut output).unwrap();
            output.grid.unwrap().into_cells()
        });
        for ((now, before), nearest) in now.iter().zip(&before).zip(&nearest) {
            let depth_m = |cell: &Cell| {
                let report = cell.evidence.map_or(0, |evidence| evidence.report);
                rig.depth_m(report as f64 / 8.0).filter(|_| report > 0)
            };
            let (Some(own_m), Some(near_m)) = (depth_m(now), depth_m(nearest)) else {
                continue;
            };
            let hides = own_m >= 0.75 && near_m < 0.5;
            if hides {
                assert_eq!(now, before);
            }
            let is_probable = now.probability.is_some_and(|p| p >= probability(least));
            let is_withheld = hides && own_m < 2.0 && is_probable && now.depth.is_none();
            gained += usize::from(now.depth.is_some() && before.depth.is_none());
            withheld += usize::from(is_withheld);
            flagged += usize::from(is_withheld && now.near.is_some());
        }
    }
    assert!(
        gained > 0 && withheld > flagged && flagged > 0,
        "{gained} {withheld} {flagged}"
    );
}

/// The file of the built-in model without earlier pairs, with that slack.
fn without_past(slack: i64) -> Vec<u8> {
    let model = V5Model::built_in();
    let median = VerdictTable {
        slack,
        time: None,
        // Revision 3 has none.
        near_least_score: model
            .median
            .near_least_score
            .filter(|_| slack == model.median.slack),
        ..model.median.clone()
    };
    V5Model { median, ..model }.to_bytes()
}

/// The models that `docs/results/v5.sh` compares with the built-in one.
#[test]
#[ignore = "writes files for docs/results/v5.sh"]
fn models_of_single_pairs() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("reports/v5");
    for (name, slack) in [("single", 100), ("three", 10)] {
        let path = folder.join(format!("{name}.safetensors"));
        std::fs::write(path, without_past(slack)).unwrap();
    }
}

/// Pieces of eight pairs from different places as one run without a reset, as
/// `docs/results/v5.md` describes: the pairs in which obstacles that appear are found.
fn sudden(config: &ArenaConfig, seed: u64, flags: &mut Flags) -> Vec<Sudden> {
    const PIECE: u64 = 8;
    let arena = Arena::new(config, seed).unwrap();
    let mut random = fastrand::Rng::with_seed(seed);
    let mut pieces: Vec<_> = (0..arena.frames() / PIECE).collect();
    random.shuffle(&mut pieces);
    let rule = CellRule::default();
    let v5: Algorithm = "v5".parse().unwrap();
    let three = Value::file("three", without_past(10));
    let three = v5.with("model", &three).unwrap();
    let mut matchers = [v5.build().unwrap(), three.build().unwrap()];
    // Per pair and cell: whether the nearest quarter is far, whether it is near, and whether v5 and
    // revision 3 find it.
    let mut pairs: Vec<Vec<(bool, bool, [bool; 2])>> = Vec::new();
    let numbers = pieces
        .iter()
        .flat_map(|piece| piece * PIECE..(piece + 1) * PIECE);
    for (place, number) in numbers.enumerate() {
        let frame = arena.frame(number).unwrap();
        let grid = GridSettings::default();
        let context = MatchContext {
            sequence: place as u64,
            stamp_ns: Some(100_000_000 * (place as u64 + 1)),
            ..MatchContext::for_frame(&frame, grid, rule)
        };
        let truth = TrueCells::new(&frame, grid.shape(), rule).unwrap();
        let near: Vec<_> = truth.near().collect();
        let judged = [0, 1].map(|i| {
            let mut output = MatchOutput::new().unwrap();
            let pair = frame.rectified().unwrap();
            matchers[i].compute(pair, &context, &mut output).unwrap();
            let mut grid = output.grid.unwrap();
            for (cell, near) in grid.cells_mut().zip(&near).filter(|_| i == 0) {
                if let (Some(_), Some(near)) = (cell.near, near) {
                    let distance_m = near.distance_m.unwrap_or(f64::INFINITY);
                    flags.all += 1;
                    flags.near += usize::from(distance_m < 0.5);
                    flags.far += usize::from(distance_m > 0.75);
                }
            }
            if i == 1 {
                // Revision 3 has no flags.
                grid.cells_mut().for_each(|cell| cell.near = None);
            }
            truth.judge(&frame, &grid)
        });
        let cells = near.iter().enumerate().map(|(cell, near)| {
            let distance_m = near.as_ref().map(|near| near.distance_m);
            let is_far = distance_m.is_some_and(|z| z.is_none_or(|z| z > 0.75));
            let is_near = distance_m.flatten().is_some_and(|z| z < 0.5);
            (is_far, is_near, [0, 1].map(|i| judged[i][cell].near.found))
        });
        pairs.push(cells.collect());
    }
    let mut events = Vec::new();
    for start in (PIECE as usize..pairs.len()).step_by(PIECE as usize) {
        for cell in 0..pairs[0].len() {
            let after = &pairs[start..start + 6];
            let is_event = pairs[start - 1][cell].0 && after.iter().all(|pair| pair[cell].1);
            if is_event {
                let found = |i: usize| after.iter().position(|pair| pair[cell].2[i]);
                events.push(Sudden {
                    found: [found(0), found(1)],
                });
            }
        }
    }
    events
}

/// Figures for `docs/results/v5.md`; `docs/results/v5.sh` runs it.
#[test]
#[ignore = "takes minutes, and prints figures"]
fn sudden_obstacles() {
    let read = |name: &str, frames, rate_hz| {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let scenario = Scenario::read(&path.join("scenarios").join(name)).unwrap();
        match scenario.source {
            ScenarioSource::Arena { config, .. } => ArenaConfig {
                frames,
                rate_hz,
                ..*config
            },
            _ => panic!("{name} is simulated"),
        }
    };
    for (name, config, seeds) in [
        ("arena", read("arena.toml", 280, 10.0), 7101..=7110),
        ("worlds", read("worlds.toml", 120, 10.0), 7201..=7220),
        ("shapes", read("shapes.toml", 24, 2.0), 7301..=7320),
    ] {
        let mut flags = Flags::default();
        let events = seeds.flat_map(|seed| sudden(&config, seed, &mut flags));
        let events: Vec<_> = events.collect();
        let first = |i: usize| {
            events
                .iter()
                .filter(|event| event.found[i] == Some(0))
                .count()
        };
        let later = events.iter().filter(|event| match event.found {
            [Some(v5), Some(three)] => v5 > three + 1,
            [None, Some(three)] => three < 5,
            _ => false,
        });
        println!(
            "{name}: {} events; found in the first pair: v5 {}, revision 3 {}; later by more than \
             one pair: {}",
            events.len(),
            first(0),
            first(1),
            later.count()
        );
        let Flags { near, far, all } = flags;
        println!("{name}: {all} flags; nearest quarter below 0.5 m {near}, beyond 0.75 m {far}");
    }
}
