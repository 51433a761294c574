//! Hand-made rows.

use polars::prelude::{DataFrame, ParquetReader, SerReader};
use std::fs::File;
use std::path::Path;
use svl::manifest::Manifest;
use svl::report::{CellRow, CheckpointRow, ReportTables, ResultParts, Results, Row, Shown};
use svl::score::{CellArea, MetricValues, Verdict};
use svl::stereo::CellState;

/// A pair with truth that took `total_us`.
pub fn row(algorithm: &str, sequence: u64, total_us: u64) -> Row {
    Row {
        session: "run-1".into(),
        scenario: "arena, \"2007\"".into(),
        sequence,
        stamp_ns: 33_333_333 * sequence,
        name: String::new(),
        seed: Some(7),
        algorithm: algorithm.into(),
        pair_hash: "58d0".into(),
        parameters_hash: "9f3c".into(),
        width: 320,
        height: 240,
        disparities: Some(81),
        smoothing_us: Some(100),
        texture_us: Some(200),
        matching_us: Some(300),
        checks_us: Some(400),
        total_us: Some(total_us),
        metrics: MetricValues::from([
            ("coverage", 0.1 + 0.2),
            ("bad1", 0.04),
            ("bad2", 0.02),
            ("invalid", 0.5),
            ("right", 12.0),
            ("wrong", 1.0),
            ("unknown", 2.0),
            ("near", 3.0),
            ("missed", 1.0),
            ("false", 0.0),
        ]),
        result_hash: "00ff".into(),
        truth: Some("exact".into()),
        run: None,
        filters_us: None,
        stress: None,
        input_hash: "1f2e".into(),
    }
}

/// A pair without truth.
pub fn blind(algorithm: &str, total_us: u64) -> Row {
    Row {
        seed: None,
        disparities: None,
        metrics: MetricValues::from([("coverage", 0.1 + 0.2)]),
        truth: None,
        ..row(algorithm, 0, total_us)
    }
}

pub fn cell(algorithm: &str, column: u32, verdict: Verdict) -> CellRow {
    CellRow {
        scenario: "arena".into(),
        sequence: 0,
        seed: Some(1),
        algorithm: algorithm.into(),
        column,
        row: 0,
        valid_share: 1.0 / 3.0,
        median_px: Some(20.0),
        p20_px: Some(18.0),
        p80_px: Some(22.0),
        distance_m: (verdict != Verdict::Unknown).then_some(0.8),
        true_median_px: Some(36.0),
        true_distance_m: Some(0.4),
        verdict,
        area: Some(CellArea::Obstacle),
        missed: verdict == Verdict::Wrong,
        r#false: false,
        run: Some("own.mcap".into()),
        state: Some(match verdict {
            Verdict::Unknown => CellState::Unknown,
            _ => CellState::Known,
        }),
        probability: (verdict == Verdict::Right).then_some(0.75),
        near_probability: None,
        stress: None,
        true_points: None,
        level: 0,
        near_distance_m: None,
        near_px: None,
        surface_probability: None,
        free_m: None,
    }
}

/// `passed` of `frames` in one run; the best frame passes if any does, the worst if all do.
pub fn checkpoint(
    number: u32,
    name: &str,
    algorithm: &str,
    (passed, frames): (u64, u64),
) -> CheckpointRow {
    let shown = frames > 0;
    CheckpointRow {
        scenario: "arena".into(),
        seed: Some(7),
        checkpoint: number,
        name: name.into(),
        algorithm: algorithm.into(),
        frames,
        passed,
        share: shown.then(|| passed as f64 / frames as f64),
        best_sequence: shown.then_some(3),
        best_passed: shown.then_some(passed > 0),
        worst_sequence: shown.then_some(4),
        worst_passed: shown.then_some(passed == frames),
        run: None,
        stress: None,
    }
}

pub fn summary(rows: Vec<Row>, checkpoints: Vec<CheckpointRow>) -> Results {
    Results::from_rows(&rows.into_iter().collect(), &checkpoints, None)
}

/// The results of rows with their leads; where `truth` is, it is no competitor, and has 2.5 MB.
pub fn found(rows: Vec<Row>, checkpoints: Vec<CheckpointRow>) -> Results {
    let mut manifest = Manifest::new("test", &["truth".parse().unwrap()]).unwrap();
    manifest.profile = None;
    manifest.algorithms[0].memory_bytes = Some(2_500_000);
    let tables = ReportTables {
        rows: rows.into_iter().collect(),
        checkpoints,
        ..ReportTables::default()
    };
    let parts = ResultParts {
        manifest: Some(&manifest),
        ..ResultParts::default()
    };
    Results::new(&tables, parts, Shown::default()).unwrap()
}

/// Two algorithms, one with a long name and no truth, on three checkpoints.
pub fn example() -> Results {
    let rows = vec![
        row("v3", 0, 5_000),
        row("v3", 1, 7_500),
        blind("sgm:paths=8,p1=7,p2=86", 12_340),
    ];
    let names = ["opening", "close obstacle", "never seen"];
    let passed = [[(4, 4), (1, 4)], [(0, 4), (2, 4)], [(0, 0), (0, 0)]];
    let algorithms = ["v3", "sgm:paths=8,p1=7,p2=86"];
    let checkpoints = names
        .iter()
        .zip(passed)
        .zip(1..)
        .flat_map(|((name, passed), number)| {
            algorithms
                .iter()
                .zip(passed)
                .map(move |(algorithm, passed)| checkpoint(number, name, algorithm, passed))
        });
    summary(rows, checkpoints.collect())
}

pub fn parquet(path: &Path) -> DataFrame {
    ParquetReader::new(File::open(path).unwrap())
        .finish()
        .unwrap()
}
