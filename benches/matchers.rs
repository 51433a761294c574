//! Criterion's statistics of the matchers, and of the decisions on cells, on a pair of the arena,
//! one thread: how a change moved them.
//!
//! ```text
//! cargo bench                       # all of them
//! cargo bench -- 320x240/v3         # one
//! cargo bench -- --save-baseline a  # then, after a change: --baseline a
//! ```
//!
//! `svl bench` compares algorithms in one run, beside a peer; this compares one with itself over
//! time.

use criterion::{Criterion, Throughput};
use svl::arena::{Arena, ArenaConfig};
use svl::depth::{CellDecision, GridSettings, cells};
use svl::kernel::Isa;
use svl::matcher::{Algorithm, MATCHERS, MatchContext, MatchOutput, Value};
use svl::stereo::{CellRule, RectifiedPair, StereoPair};

/// Sizes with their disparities `0..=N`.
const SIZES: [(usize, usize, u16); 2] = [(320, 240, 80), (640, 480, 128)];

fn main() {
    let one_thread = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("one thread can be had");
    one_thread.install(|| {
        let mut criterion = Criterion::default().configure_from_args();
        for size in SIZES {
            matchers(&mut criterion, size);
        }
        instruction_sets(&mut criterion);
        decisions(&mut criterion);
        criterion.final_summary();
    });
}

/// Every matcher of svl's own, on the fastest instruction set.
fn matchers(criterion: &mut Criterion, size: (usize, usize, u16)) {
    let (width, height, max_disparity) = size;
    let pair = pair(width, height);
    let isa = Isa::available()
        .next()
        .expect("there is always the portable one");
    for spec in MATCHERS.iter().filter(|spec| spec.matches_images()) {
        bench(
            criterion,
            &format!("{width}x{height}"),
            spec.name,
            &pair,
            max_disparity,
            isa,
        );
    }
}

/// v3 on every instruction set of this machine.
fn instruction_sets(criterion: &mut Criterion) {
    let (width, height, max_disparity) = SIZES[0];
    let pair = pair(width, height);
    for isa in Isa::available() {
        bench(criterion, isa.name(), "v3", &pair, max_disparity, isa);
    }
}

/// The decisions on the cells of sgm's map.
fn decisions(criterion: &mut Criterion) {
    let (width, height, _) = SIZES[0];
    let pair = pair(width, height);
    let sgm: Algorithm = "sgm".parse().expect("it is registered");
    let matched = sgm.match_pair(RectifiedPair::assume(&pair), None);
    let map = matched.expect("the pair can be matched").disparity;
    let mut group = criterion.benchmark_group("decisions");
    for decision in [CellDecision::Median, CellDecision::Safe] {
        let settings = GridSettings {
            decision,
            ..GridSettings::default()
        };
        let rule = CellRule::Disparity { tolerance_px: 2.0 };
        group.bench_function(format!("{decision:?}"), |bencher| {
            bencher.iter(|| cells(map.disparity(), pair.left(), settings, rule, None));
        });
    }
    group.finish();
}

fn pair(width: usize, height: usize) -> StereoPair {
    let mut config = ArenaConfig::default();
    (config.rig.width_px, config.rig.height_px) = (width, height);
    let arena = Arena::new(&config, 1).expect("the default arena can be built");
    arena
        .frame(config.frames / 2)
        .expect("it has that frame")
        .pair
}

fn bench(
    criterion: &mut Criterion,
    group: &str,
    name: &str,
    pair: &StereoPair,
    max_disparity: u16,
    isa: Isa,
) {
    let algorithm: Algorithm = name.parse().expect("it is registered");
    let range = Value::Int(max_disparity.into());
    // An algorithm without a range has no such parameter.
    let algorithm = algorithm.with("max_disparity", &range).unwrap_or(algorithm);
    let mut matcher = algorithm
        .build_on(isa)
        .expect("the instruction set is available");
    let (width, height) = pair.size();
    let mut output = MatchOutput::new().expect("one pixel");
    let mut group = criterion.benchmark_group(group);
    group.throughput(Throughput::Elements((width * height) as u64));
    group.bench_function(name, |bencher| {
        bencher.iter(|| {
            matcher
                .compute(
                    RectifiedPair::assume(pair),
                    &MatchContext::default(),
                    &mut output,
                )
                .expect("the pair can be matched")
        });
    });
    group.finish();
}
