//! Do cells and checkpoints predict collisions? Compares a report of drives with one of recordings
//! of the same algorithms, and draws collisions against each metric.
//!
//! ```sh
//! cargo run --release --example collisions -- reports/drive reports/arena collisions.svg
//! ```

use std::path::Path;
use svl::report::plot::{Axis, Chart, Series, SeriesStyle, two_columns};
use svl::report::{DriveRow, read_rows};

type Failure = Box<dyn std::error::Error>;

/// A metric of an algorithm in a `summary.json`, lower being better.
type Predictor = (&'static str, fn(&serde_json::Value, &str) -> Option<f64>);

/// What may predict collisions: of the obstacle cells, per pair, and of the checkpoints' frames.
const PREDICTORS: [Predictor; 5] = [
    ("wrong cells, %", |s, a| share(s, a, "cells_wrong")),
    ("cells not right, %", |s, a| {
        Some(100.0 - share(s, a, "cells_right")?)
    }),
    ("unknown cells, %", |s, a| share(s, a, "cells_unknown")),
    ("missed per 100 pairs", |s, a| per_pair(s, a, "missed")),
    ("checkpoints failed, %", checkpoints_failed),
];

fn algorithm<'a>(summary: &'a serde_json::Value, label: &str) -> Option<&'a serde_json::Value> {
    let mut algorithms = summary["algorithms"].as_array()?.iter();
    algorithms.find(|a| a["algorithm"] == label)
}

fn share(summary: &serde_json::Value, label: &str, column: &str) -> Option<f64> {
    let summary_row = algorithm(summary, label)?;
    let columns = ["cells_right", "cells_wrong", "cells_unknown"];
    let all: f64 = columns
        .iter()
        .filter_map(|name| summary_row[*name].as_f64())
        .sum();
    Some(100.0 * summary_row[column].as_f64()? / all)
}

fn per_pair(summary: &serde_json::Value, label: &str, column: &str) -> Option<f64> {
    let summary_row = algorithm(summary, label)?;
    Some(100.0 * summary_row[column].as_f64()? / summary_row["pairs"].as_f64()?)
}

fn checkpoints_failed(summary: &serde_json::Value, label: &str) -> Option<f64> {
    let checkpoints = summary["checkpoints"].as_array()?;
    let own = checkpoints.iter().filter(|c| c["algorithm"] == label);
    let (mut passed, mut frames) = (0.0, 0.0);
    for checkpoint in own {
        passed += checkpoint["passed"].as_f64()?;
        frames += checkpoint["frames"].as_f64()?;
    }
    (frames > 0.0).then(|| 100.0 * (1.0 - passed / frames))
}

fn summary(report: &Path) -> Result<serde_json::Value, Failure> {
    let text = std::fs::read_to_string(report.join("summary.json"))?;
    Ok(serde_json::from_str(&text)?)
}

/// How well collisions on one half of the courses predict those on the other half: Kendall's tau-b,
/// the mean over many halvings. No metric of anything else can be expected to do much better.
fn between_halves(drive: &Path) -> Result<Option<f64>, Failure> {
    let table = drive.join("drives.csv");
    if !table.exists() {
        return Ok(None);
    }
    let rows: Vec<DriveRow> = read_rows(&table)?;
    let mut seeds: Vec<u64> = rows.iter().map(|row| row.seed).collect();
    let mut labels: Vec<&str> = rows.iter().map(|row| row.algorithm.as_str()).collect();
    seeds.sort_unstable();
    seeds.dedup();
    labels.sort_unstable();
    labels.dedup();
    labels.retain(|label| !is_end(label));
    let mut random = fastrand::Rng::with_seed(1);
    let mut taus = Vec::new();
    for _ in 0..200 {
        random.shuffle(&mut seeds);
        let half = &seeds[..seeds.len() / 2];
        let rate = |label: &str, first: bool| {
            let own = rows
                .iter()
                .filter(|row| row.algorithm == label && half.contains(&row.seed) == first);
            let (hits, way) = own.fold((0.0, 0.0), |(hits, way), row| {
                (hits + row.collisions as f64, way + row.driven_m)
            });
            hits / way
        };
        let both = labels
            .iter()
            .map(|label| (rate(label, true), rate(label, false)));
        taus.extend(kendall_tau_b(&both.collect::<Vec<_>>()));
    }
    Ok((!taus.is_empty()).then(|| taus.iter().sum::<f64>() / taus.len() as f64))
}

/// The two ends of the scale, which would make any metric look good.
fn is_end(label: &str) -> bool {
    ["truth", "blind"].contains(&label)
}

/// Points with their labels; one cloud without names for the settings, which have no room.
fn point_series(points: &[(f64, f64, String)]) -> Vec<Series> {
    let series = points.iter().map(|(x, y, label)| Series {
        name: label.clone(),
        form: if label.contains(':') {
            SeriesStyle::Points
        } else {
            SeriesStyle::Named
        },
        points: vec![(*x, *y)],
    });
    let (named, settings): (Vec<_>, Vec<_>) = series.partition(|s| s.form == SeriesStyle::Named);
    let cloud = Series {
        name: "other settings".to_owned(),
        form: SeriesStyle::Points,
        points: settings.into_iter().flat_map(|s| s.points).collect(),
    };
    named.into_iter().chain([cloud]).collect()
}

/// Prints the rank correlations, and returns the figure as SVG.
///
/// # Errors
/// A report that cannot be read, or drives of fewer than three algorithms.
pub fn figure(drive: &Path, recordings: &Path) -> Result<String, Failure> {
    let (driven, scored) = (summary(drive)?, summary(recordings)?);
    let drives = driven["drives"].as_array().cloned().unwrap_or_default();
    let hits: Vec<_> = drives
        .iter()
        .filter_map(|d| Some((d["algorithm"].as_str()?, d["collisions_per_100m"].as_f64()?)))
        .filter(|(label, _)| !is_end(label))
        .collect();
    if hits.len() < 3 {
        return Err("fewer than three algorithms drove".into());
    }
    println!(
        "Kendall's tau-b of collisions per 100 m, {} algorithms",
        hits.len()
    );
    println!("{:<40} {:>10} {:>10}", "", "recordings", "own drives");
    let mut panels = Vec::new();
    for (name, value) in PREDICTORS {
        let points = |summary: &serde_json::Value| -> Vec<(f64, f64, String)> {
            let points = hits.iter();
            let point = |(label, hits): &(&str, f64)| {
                Some((value(summary, label)?, *hits, (*label).to_owned()))
            };
            points.filter_map(point).collect()
        };
        let tau = |points: &[(f64, f64, String)]| {
            let both: Vec<_> = points.iter().map(|(x, y, _)| (*x, *y)).collect();
            let tau = kendall_tau_b(&both);
            tau.map_or_else(|| "–".to_owned(), |tau| format!("{tau:+.2}"))
        };
        let (recorded, own) = (points(&scored), points(&driven));
        println!("{name:<40} {:>10} {:>10}", tau(&recorded), tau(&own));
        let chart = Chart {
            title: format!("tau {}", tau(&recorded)),
            x: Axis::new(name),
            y: Axis::new("collisions per 100 m"),
            series: point_series(&recorded),
        };
        panels.push(chart.svg());
    }
    if let Some(tau) = between_halves(drive)? {
        println!(
            "{:<40} {:>10} {tau:>+10.2}",
            "collisions on the other courses", ""
        );
    }
    Ok(two_columns(&panels))
}

/// Rank correlation of x and y over observations (x, y): −1 to 1, or `None` if no two differ in x
/// or none in y (Kendall, "The Treatment of Ties in Ranking Problems", Biometrika 33, 1945).
fn kendall_tau_b(observations: &[(f64, f64)]) -> Option<f64> {
    let sign = |d: f64| if d == 0.0 { 0.0 } else { d.signum() };
    let (mut net, mut differing_x, mut differing_y) = (0.0, 0.0, 0.0);
    for (i, a) in observations.iter().enumerate() {
        for b in &observations[..i] {
            let (x, y) = (sign(a.0 - b.0), sign(a.1 - b.1));
            net += x * y;
            differing_x += x.abs();
            differing_y += y.abs();
        }
    }
    let differing: f64 = differing_x * differing_y;
    (differing > 0.0).then(|| net / differing.sqrt())
}

pub fn main() -> Result<(), Failure> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [drive, recordings, file] = &arguments[..] else {
        return Err("usage: collisions DRIVE_REPORT RECORDINGS_REPORT FIGURE.svg".into());
    };
    std::fs::write(file, figure(Path::new(drive), Path::new(recordings))?)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::kendall_tau_b;

    #[test]
    fn tau_b_equals_values_computed_by_hand() {
        let up = [(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)];
        let down = up.map(|(x, y)| (x, -y));
        assert_eq!(
            [up, down].map(|o| kendall_tau_b(&o)),
            [Some(1.0), Some(-1.0)]
        );
        // Five concordant pairs, one discordant: 4/6.
        let one_off = [(1.0, 1.0), (2.0, 3.0), (3.0, 2.0), (4.0, 4.0)];
        assert_eq!(kendall_tau_b(&one_off), Some(4.0 / 6.0));
        // Concordant 4, x differs in 5, y in 5.
        let ties = [(1.0, 1.0), (1.0, 2.0), (2.0, 2.0), (3.0, 3.0)];
        assert_eq!(kendall_tau_b(&ties), Some(4.0 / 5.0));
        assert_eq!(kendall_tau_b(&[(1.0, 1.0), (1.0, 2.0)]), None);
    }
}
