//! How cost grows: with the size of the images, disparities, threads, pairs, algorithms and shards,
//! each with the exponent of its growth. Prints tables and draws a figure.
//!
//! ```sh
//! cargo build --release
//! cargo run --release --example scale -- target/release/svl scale.svg
//! ```

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use svl::arena::{Arena, ArenaConfig};
use svl::matcher::{Algorithm, MatchContext, MatchOutput};
use svl::report::plot::{Axis, Chart, Series, SeriesStyle, two_columns};
use svl::stereo::{RectifiedPair, StereoPair};

type Failure = Box<dyn std::error::Error>;

/// A curve: what was varied, and the time it took.
pub type Curve = (String, Vec<(f64, f64)>);

const ALGORITHMS: [&str; 4] = ["v3", "v5", "bm", "sgm"];

/// The slope of a line through the logarithms, by least squares: `y` grows with this power of `x`.
pub fn exponent(points: &[(f64, f64)]) -> f64 {
    let logs: Vec<_> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let mean = |coordinate: fn(&(f64, f64)) -> f64| {
        logs.iter().map(coordinate).sum::<f64>() / logs.len() as f64
    };
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let cross: f64 = logs.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    cross / logs.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

/// A pair of the arena at that size.
pub fn pair(width: usize) -> Result<StereoPair, Failure> {
    let mut config = ArenaConfig::default();
    (config.rig.width_px, config.rig.height_px) = (width, width / 4 * 3);
    Ok(Arena::new(&config, 1)?.frame(config.frames / 2)?.pair)
}

/// Median time of a matching with disparities `0..count`, milliseconds.
pub fn matching_ms(
    name: &str,
    count: usize,
    pair: &StereoPair,
    threads: usize,
) -> Result<f64, Failure> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()?;
    let algorithm: Algorithm = format!("{name}:max_disparity={}", count - 1).parse()?;
    let mut matcher = algorithm.build()?;
    let mut output = MatchOutput::new()?;
    let mut times = Vec::new();
    let began = Instant::now();
    while times.len() < 5 || (began.elapsed() < Duration::from_millis(400) && times.len() < 99) {
        let start = Instant::now();
        let rectified = RectifiedPair::assume(pair);
        pool.install(|| matcher.compute(rectified, &MatchContext::default(), &mut output))?;
        times.push(start.elapsed().as_secs_f64() * 1.0e3);
    }
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

/// Wall time of a command of svl's, seconds.
fn svl_s(svl: &Path, folder: &Path, line: &str) -> Result<f64, Failure> {
    let start = Instant::now();
    let done = Command::new(svl)
        .args(line.split_whitespace())
        .current_dir(folder)
        .output()?;
    if done.status.success() {
        Ok(start.elapsed().as_secs_f64())
    } else {
        Err(String::from_utf8_lossy(&done.stderr).into())
    }
}

/// Prints a table of curves, and draws it.
fn panel(title: &str, x: &str, y: &str, curves: &[Curve]) -> Result<String, Failure> {
    println!("\n{title}: {y}");
    print!("{x:<24}");
    for (at, _) in curves
        .iter()
        .flat_map(|(_, points)| points.first().map(|_| points))
        .next()
        .into_iter()
        .flatten()
    {
        print!("{at:>10}");
    }
    println!("{:>10}", "exponent");
    let mut series = Vec::new();
    for (name, points) in curves {
        let power = exponent(points);
        print!("{name:<24}");
        points.iter().for_each(|(_, time)| print!("{time:>10.2}"));
        println!("{power:>10.2}");
        series.push(Series {
            name: format!("{name}, exponent {power:.2}"),
            form: SeriesStyle::Both,
            points: points.clone(),
        });
    }
    let axis = |label: &str| Axis {
        log: true,
        ..Axis::new(label)
    };
    let times = || curves.iter().flat_map(|(_, points)| points).map(|p| p.1);
    let (least, most) = (
        times().fold(f64::MAX, f64::min),
        times().fold(0.0, f64::max),
    );
    let chart = Chart {
        title: title.to_owned(),
        x: axis(x),
        // Room for the key.
        y: Axis {
            range: Some((0.8 * least, 4.0 * most)),
            ..axis(y)
        },
        series,
    };
    Ok(chart.svg())
}

/// A curve per algorithm.
fn time_curves(
    points: &[usize],
    mut time: impl FnMut(&str, usize) -> Result<(f64, f64), Failure>,
) -> Result<Vec<Curve>, Failure> {
    let curve = |name: &&str| {
        let points = points.iter().map(|&point| time(name, point));
        Ok(((*name).to_owned(), points.collect::<Result<_, Failure>>()?))
    };
    ALGORITHMS.iter().map(curve).collect()
}

/// All curves, as SVG.
fn figure(svl: &Path) -> Result<String, Failure> {
    let cores = std::thread::available_parallelism()?.get();
    let mut panels = Vec::new();
    let sizes = time_curves(&[160, 320, 640, 1280], |name, width| {
        let pixels = (width * width / 4 * 3) as f64;
        Ok((pixels, matching_ms(name, 64, &pair(width)?, 1)?))
    })?;
    panels.push(panel(
        "64 disparities, one thread",
        "pixels",
        "ms per pair",
        &sizes,
    )?);
    let vga = pair(640)?;
    let disparities = time_curves(&[32, 64, 128, 256], |name, count| {
        Ok((count as f64, matching_ms(name, count, &vga, 1)?))
    })?;
    panels.push(panel(
        "640 x 480, one thread",
        "disparities",
        "ms per pair",
        &disparities,
    )?);
    let powers = (0..).map(|i| 1 << i).take_while(|n| *n <= cores);
    let threads = time_curves(&powers.collect::<Vec<_>>(), |name, count| {
        Ok((count as f64, matching_ms(name, 128, &vga, count)?))
    })?;
    panels.push(panel(
        "640 x 480, 128 disparities",
        "threads",
        "ms per pair",
        &threads,
    )?);

    let folder = tempfile::tempdir()?;
    let run = |line: &str| svl_s(svl, folder.path(), line);
    run("record arena --frames 640 -q -o run.mcap")?;
    let score = "score run.mcap -q --rerun none -o r";
    let curve = |name: &str, points: &[usize], line: &dyn Fn(usize) -> String| {
        let point = |&point: &usize| Ok((point as f64, run(&line(point))?));
        let points = points.iter().map(point).collect::<Result<_, Failure>>()?;
        Ok::<Curve, Failure>((name.to_owned(), points))
    };
    let pairs = curve("svl score, sgm", &[40, 80, 160, 320, 640], &|pairs| {
        format!("{score} --algo sgm --every {}", 640 / pairs)
    })?;
    panels.push(panel("Whole runs, 320 x 240", "pairs", "s", &[pairs])?);
    let algorithms = curve("svl score, 80 pairs, sgm", &[1, 2, 4, 8, 16], &|count| {
        let to = 5 + count - 1;
        format!("{score} --algo sgm:uniqueness=5..{to}/1 --every 8")
    })?;
    panels.push(panel(
        "Whole runs, 320 x 240",
        "algorithms",
        "s",
        &[algorithms],
    )?);
    // The runs are rendered once.
    run("score arena --seeds 1..8 --algo bm -q --rerun none -o all")?;
    let mut shards: [Curve; 2] =
        ["all shards, one after the other", "svl report"].map(|name| (name.to_owned(), Vec::new()));
    for count in [1, 2, 4, 8] {
        let mut all_s = 0.0;
        for number in 1..=count {
            let shard = format!("--shard {number}/{count} -o p{number}");
            all_s += run(&format!(
                "score arena --seeds 1..8 --algo bm -q --rerun none {shard}"
            ))?;
        }
        let parts: Vec<_> = (1..=count).map(|number| format!("p{number}")).collect();
        let report_s = run(&format!("report {} -o all -q", parts.join(" ")))?;
        shards[0].1.push((count as f64, all_s));
        shards[1].1.push((count as f64, report_s));
    }
    panels.push(panel(
        "Eight runs of the arena, bm",
        "shards",
        "s",
        &shards,
    )?);
    let rows = std::fs::read_to_string(folder.path().join("all/rows.csv"))?;
    let pairs = (rows.lines().count() - 1) as f64;
    for table in ["rows", "cells"] {
        for kind in ["csv", "parquet"] {
            let path = folder.path().join(format!("all/{table}.{kind}"));
            let per_pair = path.metadata()?.len() as f64 / pairs;
            println!("{table}.{kind}: {per_pair:.0} bytes per pair and algorithm");
        }
    }
    Ok(two_columns(&panels))
}

pub fn main() -> Result<(), Failure> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [svl, file] = &arguments[..] else {
        return Err("usage: scale path/to/svl FIGURE.svg".into());
    };
    let machine = svl::manifest::Manifest::new("scale", &[])?.machine;
    println!("{}, {}", machine.processor, machine.isa);
    std::fs::write(file, figure(&Path::new(svl).canonicalize()?)?)?;
    Ok(())
}
