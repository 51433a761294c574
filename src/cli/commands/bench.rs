//! `svl bench`: the speed of the algorithms, side by side.

use crate::cli::shared::filters::FilterArgs;
use crate::cli::shared::terminal::{print_value, style};
use crate::cli::shared::{progress, usage};
use anyhow::{Context, bail};
use serde::Serialize;
use std::time::{Duration, Instant};
use svl::arena::{Arena, ArenaConfig};
use svl::matcher::{Algorithm, MATCHERS, MatchContext, MatchOutput, Matcher, Value, find};
use svl::report::table::{Table, TableColumn, TerminalStyle};
use svl::runs::refuse_recorded;
use svl::statistics::nearest_rank;
use svl::stereo::{RectifiedPair, StereoPair};
use svl::train::with_filters;
use svl::{BuildInfo, counted, slow_profile};

/// Measure the speed of algorithms, matching only
///
/// Every algorithm matches the same pair of the arena, in turns, so that a slow moment of the
/// machine affects all of them. Times are of one machine at one moment: compare them within a run,
/// by their medians.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl bench
  svl bench --algo v3 --algo v3:smoothing_sigma=0 --size 640x480
  svl bench --max-disparity 128 --threads 2 --json
  svl bench --threads 1,2,4   what more threads gain
  SVL_ISA=avx2 svl bench      as a CPU without AVX-512 would; or portable")]
pub(crate) struct Args {
    /// Algorithm, as NAME[:key=value,…]; repeatable [default: all of svl's own]
    #[arg(long, value_name = "ALGO", value_parser = algorithm, help_heading = "Input")]
    algo: Vec<(Algorithm, bool)>,
    #[command(flatten)]
    filters: FilterArgs,
    /// Size of the images
    #[arg(
        long, value_name = "WxH", default_value = "320x240", value_parser = size,
        help_heading = "Input"
    )]
    size: (usize, usize),
    /// Disparities 0..=N, for algorithms that do not set their own
    #[arg(
        long, value_name = "N", default_value_t = 80, help_heading = "Input",
        value_parser = usage::within(0..=1024u16)
    )]
    max_disparity: u16,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// Default number of threads: speeds are compared per core.
pub(super) const THREADS: u16 = 1;

/// Shortest time spent on each algorithm.
const MIN_TIME: Duration = Duration::from_secs(2);
/// Smallest and largest number of matchings of each algorithm.
const ROUNDS: std::ops::RangeInclusive<usize> = 5..=1000;

fn size(text: &str) -> Result<(usize, usize), String> {
    usage::two(text, 'x')
        .filter(|(w, h)| (32..=4096).contains(w) && (32..=4096).contains(h))
        .ok_or("expected WxH, each 32..=4096".into())
}

/// An algorithm's figures. Times in milliseconds, by nearest rank.
#[derive(Clone, Serialize)]
struct Figures {
    algo: String,
    width: usize,
    height: usize,
    disparities: u32,
    threads: usize,
    isa: &'static str,
    runs: usize,
    min_ms: f64,
    median_ms: f64,
    p95_ms: f64,
    p99_ms: f64,
    /// Million disparity evaluations a second: width · height · disparities over the median time.
    mde_per_s: f64,
}

pub(super) fn run(args: &Args, threads: &[u16]) -> anyhow::Result<()> {
    let algorithms = match &args.algo[..] {
        // Programs are measured only when they are named.
        [] => {
            let matching = MATCHERS.iter().filter(|spec| spec.matches_images());
            matching
                .map(|spec| algorithm(spec.name))
                .collect::<Result<_, _>>()?
        }
        named => named.to_vec(),
    };
    let algorithms = algorithms.into_iter().map(|(algorithm, has_own_range)| {
        refuse_recorded(std::slice::from_ref(&algorithm))?;
        if has_own_range {
            return Ok(algorithm);
        }
        with_range(algorithm, args.max_disparity)
    });
    let algorithms = algorithms.collect::<svl::Result<Vec<_>>>()?;
    let algorithms = with_filters(algorithms, &args.filters.models()?);
    let pair = pair(args.size)?;
    if threads.len() < 2 {
        let figures = measure(&algorithms, &pair)?;
        return print_value(args.json, &figures, || anyhow::Ok(text(&figures, style())));
    }
    let by_threads = threads.iter().map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads((*threads).into());
        pool.build()?.install(|| measure(&algorithms, &pair))
    });
    let figures = by_threads.collect::<anyhow::Result<Vec<_>>>()?;
    print_value(args.json, &figures.concat(), || {
        anyhow::Ok(scaling(&figures, style()))
    })
}

/// The medians by number of threads, and how many times as fast each is as the first.
fn scaling(by_threads: &[Vec<Figures>], style: TerminalStyle) -> String {
    let heads = by_threads
        .iter()
        .map(|own| counted(own[0].threads as u64, "thread"));
    let heads: Vec<_> = heads.collect();
    let mut table = Table::new("", "algorithm");
    for (group, from) in [("median, ms", 0), ("times as fast", 1)] {
        let columns = heads[from..]
            .iter()
            .map(|head| TableColumn::new(group, head));
        table.columns.extend(columns);
    }
    for (i, first) in by_threads[0].iter().enumerate() {
        let medians = by_threads.iter().map(|own| own[i].median_ms);
        let gains = medians
            .clone()
            .skip(1)
            .map(|ms| format!("{:.2}", first.median_ms / ms));
        let medians = medians.map(|ms| format!("{ms:.3}"));
        table.push(&first.algo, medians.chain(gains));
    }
    let Figures {
        width, height, isa, ..
    } = by_threads[0][0];
    format!("{width}x{height}, {isa}\n{}", table.terminal(style))
}

/// An algorithm, and true if its text sets its range of disparities.
fn algorithm(text: &str) -> svl::Result<(Algorithm, bool)> {
    Ok((text.parse()?, text.contains("max_disparity=")))
}

/// The algorithm with that range of disparities, if it has one. It keeps the name that the user
/// gave it.
fn with_range(algorithm: Algorithm, max_disparity: u16) -> svl::Result<Algorithm> {
    if algorithm.spec().parameter("max_disparity").is_none() {
        return Ok(algorithm);
    }
    let ranged = algorithm.with("max_disparity", &Value::Int(max_disparity.into()))?;
    let name = algorithm.label().split(':').next().unwrap_or_default();
    // No label is an algorithm's own name.
    Ok(match find(name) {
        Ok(_) => ranged,
        Err(_) => ranged.called(algorithm.label().to_owned()),
    })
}

/// A pair of the arena at that size: textured walls, a plain floor, noise.
fn pair((width, height): (usize, usize)) -> anyhow::Result<StereoPair> {
    let mut config = ArenaConfig::default();
    (config.rig.width_px, config.rig.height_px) = (width, height);
    let arena = Arena::new(&config, 1).context("the pair for the measurement")?;
    Ok(arena.frame(config.frames / 2)?.pair)
}

fn measure(algorithms: &[Algorithm], pair: &StereoPair) -> anyhow::Result<Vec<Figures>> {
    progress::listen_for_interrupt();
    let mut output = MatchOutput::new()?;
    let mut entries = Vec::new();
    for algorithm in algorithms {
        let mut matcher = algorithm.build()?;
        // Warm-up: memory is allocated, caches and branches know the pair.
        (0..3).try_for_each(|_| time(&mut *matcher, pair, &mut output).map(drop))?;
        entries.push((algorithm, matcher, Vec::new()));
    }
    for round in 0..*ROUNDS.end() {
        for (_, matcher, times) in &mut entries {
            let spent: Duration = times.iter().sum();
            if spent < MIN_TIME || round < *ROUNDS.start() {
                times.push(time(&mut **matcher, pair, &mut output)?);
            }
            if progress::interrupted() {
                bail!("interrupted");
            }
        }
    }
    let isa = svl::kernel::isa()?.name();
    Ok(entries
        .into_iter()
        .map(|(algorithm, _, times)| figures(algorithm, pair.size(), isa, times))
        .collect())
}

fn time(
    matcher: &mut dyn Matcher,
    pair: &StereoPair,
    output: &mut MatchOutput,
) -> svl::Result<Duration> {
    let context = MatchContext::default();
    let began = Instant::now();
    matcher.compute(RectifiedPair::assume(pair), &context, output)?;
    Ok(began.elapsed())
}

fn figures(
    algorithm: &Algorithm,
    (width, height): (usize, usize),
    isa: &'static str,
    mut times: Vec<Duration>,
) -> Figures {
    times.sort_unstable();
    let rank = |share| nearest_rank(&times, share).unwrap_or_default();
    let ms = |share| rank(share).as_secs_f64() * 1e3;
    let disparities = algorithm.disparities().unwrap_or(1);
    Figures {
        algo: algorithm.label().to_owned(),
        width,
        height,
        disparities,
        threads: rayon::current_num_threads(),
        isa,
        runs: times.len(),
        min_ms: ms(0.0),
        median_ms: ms(0.5),
        p95_ms: ms(0.95),
        p99_ms: ms(0.99),
        mde_per_s: (width * height) as f64 * f64::from(disparities) / ms(0.5) / 1e3,
    }
}

fn text(figures: &[Figures], style: TerminalStyle) -> String {
    let Some(first) = figures.first() else {
        return String::new();
    };
    let (width, height, isa) = (first.width, first.height, first.isa);
    let threads = counted(first.threads as u64, "thread");
    let mut text = format!("{width}x{height}, {threads}, {isa}\n");
    if let Some(words) = slow_profile(BuildInfo::current().profile) {
        text += &format!("svl was {words}\n");
    }
    let table = Table::new("", "algorithm").with_columns(["disparities", "runs"]);
    let mut table = table.with_columns(["median, ms", "p95, ms", "p99, ms", "MDE/s"]);
    for f in figures {
        let [median, p95, p99] = [f.median_ms, f.p95_ms, f.p99_ms].map(|ms| format!("{ms:.3}"));
        let (disparities, runs) = (f.disparities.to_string(), f.runs.to_string());
        let speed = format!("{:.0}", f.mde_per_s);
        table.push(&f.algo, [disparities, runs, median, p95, p99, speed]);
    }
    text + &table.terminal(style)
}
