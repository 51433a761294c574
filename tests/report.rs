//! Tables, summaries and pages, from hand-made rows.

use polars::prelude::{DataFrame, ParquetReader, SerReader};
use std::fs::File;
use std::path::Path;
use svl::Error;
use svl::overlay::{Nearness, marks};
use svl::report::html::{Figure, Page, Rank, Shot};
use svl::report::{CellRow, CheckpointRow, Record, Row, Summary, Table, Tables};
use svl::score::Verdict;
use svl::stereo::{Cell, CellDepth, DepthGrid, GridShape};

/// A pair with truth that took `total_us`.
fn row(algorithm: &str, sequence: u64, total_us: u64) -> Row {
    Row {
        run_id: "run-1".into(),
        scenario: "arena, \"2007\"".into(),
        sequence,
        stamp_ns: 33_333_333 * sequence,
        name: String::new(),
        seed: Some(7),
        pair_hash: "58d0".into(),
        algorithm: algorithm.into(),
        parameters_hash: "9f3c".into(),
        smoothing_us: 100,
        texture_us: 200,
        matching_us: 300,
        checks_us: 400,
        total_us,
        coverage: 0.1 + 0.2,
        bad1: Some(0.04),
        bad2: Some(0.02),
        invalid: Some(0.5),
        cells_right: Some(12),
        cells_wrong: Some(1),
        cells_unknown: Some(2),
        missed_obstacles: Some(1),
        false_obstacles: Some(0),
        result_hash: "00ff".into(),
    }
}

/// A pair without truth.
fn blind(algorithm: &str, total_us: u64) -> Row {
    Row {
        seed: None,
        bad1: None,
        bad2: None,
        invalid: None,
        cells_right: None,
        cells_wrong: None,
        cells_unknown: None,
        missed_obstacles: None,
        false_obstacles: None,
        ..row(algorithm, 0, total_us)
    }
}

fn cell(algorithm: &str, column: u32, verdict: Verdict) -> CellRow {
    CellRow {
        run_id: "run-1".into(),
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
        missed_obstacle: verdict == Verdict::Wrong,
        false_obstacle: false,
    }
}

/// `passed` of `frames` in one run; the best frame passes when any does, the worst when all do.
fn checkpoint(number: u32, name: &str, algorithm: &str, (passed, frames): (u64, u64)) -> CheckpointRow {
    let shown = frames > 0;
    CheckpointRow {
        run_id: "run-1".into(),
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
    }
}

fn summary(rows: Vec<Row>, checkpoints: Vec<CheckpointRow>) -> Summary {
    let folder = tempfile::tempdir().unwrap();
    let mut tables = Tables::create(folder.path()).unwrap();
    rows.into_iter().for_each(|row| tables.push(row, []).unwrap());
    checkpoints.into_iter().for_each(|row| tables.push_checkpoint(row).unwrap());
    tables.finish().unwrap()
}

/// Two algorithms, one with a long name and no truth, on three checkpoints.
fn example() -> Summary {
    let rows = vec![row("v3", 0, 5_000), row("v3", 1, 7_500), blind("sgm:paths=8,p1=7,p2=86", 12_340)];
    let names = ["opening", "close obstacle", "never seen"];
    let passed = [[(4, 4), (1, 4)], [(0, 4), (2, 4)], [(0, 0), (0, 0)]];
    let algorithms = ["v3", "sgm:paths=8,p1=7,p2=86"];
    let checkpoints = names.iter().zip(passed).zip(1..).flat_map(|((name, passed), number)| {
        algorithms.iter().zip(passed).map(move |(algorithm, passed)| checkpoint(number, name, algorithm, passed))
    });
    summary(rows, checkpoints.collect())
}

fn csv_rows<R: Record>(path: &Path) -> Vec<R> {
    csv::Reader::from_path(path).unwrap().deserialize().map(Result::unwrap).collect()
}

fn parquet(path: &Path) -> DataFrame {
    ParquetReader::new(File::open(path).unwrap()).finish().unwrap()
}

#[test]
fn csv_and_parquet_hold_what_was_pushed() {
    let folder = tempfile::tempdir().unwrap();
    let rows = vec![row("v3", 0, 5_000), blind("bm", 1)];
    let cells = vec![cell("v3", 0, Verdict::Right), cell("v3", 1, Verdict::Unknown), cell("v3", 2, Verdict::NoTruth)];
    let checkpoints = vec![checkpoint(1, "opening", "v3", (3, 4)), checkpoint(2, "corner", "v3", (0, 0))];
    let mut tables = Tables::create(folder.path()).unwrap();
    tables.push(rows[0].clone(), cells.clone()).unwrap();
    tables.push(rows[1].clone(), []).unwrap();
    checkpoints.iter().for_each(|row| tables.push_checkpoint(row.clone()).unwrap());
    tables.finish().unwrap();

    let file = |name: &str| folder.path().join(name);
    assert_eq!(csv_rows::<Row>(&file("rows.csv")), rows);
    assert_eq!(csv_rows::<CellRow>(&file("cells.csv")), cells);
    assert_eq!(csv_rows::<CheckpointRow>(&file("checkpoints.csv")), checkpoints);
    assert!(parquet(&file("rows.parquet")).equals_missing(&Row::frame(&rows).unwrap()));
    assert!(parquet(&file("cells.parquet")).equals_missing(&CellRow::frame(&cells).unwrap()));
    assert!(parquet(&file("checkpoints.parquet")).equals_missing(&CheckpointRow::frame(&checkpoints).unwrap()));
}

#[test]
fn the_heads_of_the_tables_are_fixed() {
    let heads = [Row::COLUMNS, CellRow::COLUMNS, CheckpointRow::COLUMNS].map(|columns| columns.join("\n"));
    insta::assert_snapshot!("columns", heads.join("\n\n"));
}

#[test]
fn a_single_table_goes_by_its_extension() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rows.csv");
    let mut table = Table::create(&path).unwrap();
    table.push([row("v3", 0, 5_000)]).unwrap();
    table.finish().unwrap();
    assert_eq!(csv_rows::<Row>(&path), [row("v3", 0, 5_000)]);
    let error = Table::<Row>::create(&folder.path().join("rows.xlsx")).err().unwrap();
    assert!(error.to_string().ends_with("rows.xlsx: a table is a .csv or a .parquet file"), "{error}");
}

#[test]
fn a_crash_keeps_the_rows() {
    let folder = tempfile::tempdir().unwrap();
    let mut tables = Tables::create(folder.path()).unwrap();
    tables.push(row("v3", 0, 5_000), [cell("v3", 0, Verdict::Wrong)]).unwrap();
    // Not even dropped: what is on disk now is all there is after a kill.
    std::mem::forget(tables);
    assert_eq!(csv_rows::<Row>(&folder.path().join("rows.csv")), [row("v3", 0, 5_000)]);
    assert_eq!(csv_rows::<CellRow>(&folder.path().join("cells.csv")), [cell("v3", 0, Verdict::Wrong)]);
}

#[test]
fn a_folder_that_cannot_be_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let error = Tables::create(&file.join("report")).err().unwrap();
    assert!(matches!(&error, Error::Io { path, .. } if path == &file.join("report")), "{error}");
    assert!(!error.to_string().contains('\n'));
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_with_the_file() {
    for name in ["rows.csv", "rows.parquet"] {
        let folder = tempfile::tempdir().unwrap();
        let full = folder.path().join(name);
        std::os::unix::fs::symlink("/dev/full", &full).unwrap();
        let error = Table::create(&full)
            .and_then(|mut table| table.push([row("v3", 0, 5_000)]).and_then(|()| table.finish()))
            .unwrap_err();
        let Error::Io { path, cause } = &error else { panic!("{error:?}") };
        assert_eq!((path, cause.kind()), (&full, std::io::ErrorKind::StorageFull));
        assert!(!error.to_string().contains('\n'));
    }
}

#[test]
fn an_algorithm_is_summed_up() {
    let mut rows = vec![row("v3", 0, 4_000), row("bm", 0, 1), row("v3", 1, 2_000), blind("v3", 9_000)];
    rows[2].cells_wrong = Some(4);
    rows[2].bad1 = Some(0.08);
    let summary = summary(rows, Vec::new());
    assert_eq!(summary.algorithms.iter().map(|a| a.algorithm.as_str()).collect::<Vec<_>>(), ["v3", "bm"]);
    let v3 = &summary.algorithms[0];
    assert_eq!((v3.pairs, v3.cells_right, v3.cells_wrong, v3.cells_unknown), (3, Some(24), Some(5), Some(4)));
    assert_eq!((v3.missed_obstacles, v3.false_obstacles, v3.cells()), (Some(2), Some(0), Some(33)));
    // A pair without truth does not thin the means out.
    assert!((v3.bad1.unwrap() - 0.06).abs() < 1e-12 && (v3.bad2.unwrap() - 0.02).abs() < 1e-12);
    assert!((v3.coverage - 0.3).abs() < 1e-12 && (v3.invalid.unwrap() - 0.5).abs() < 1e-12);
    assert_eq!((v3.p50_ms, v3.p99_ms), (4.0, 9.0));
}

#[test]
fn percentiles_are_nearest_rank() {
    let of = |times: std::ops::RangeInclusive<u64>| {
        let summary = summary(times.rev().map(|ms| row("v3", ms, 1000 * ms)).collect(), Vec::new());
        (summary.algorithms[0].p50_ms, summary.algorithms[0].p99_ms)
    };
    assert_eq!(of(5..=5), (5.0, 5.0));
    assert_eq!(of(1..=4), (2.0, 4.0));
    assert_eq!(of(1..=100), (50.0, 99.0));
    assert_eq!(of(1..=101), (51.0, 100.0));
    assert_eq!(of(1..=200), (100.0, 198.0));
}

#[test]
fn a_checkpoint_is_summed_up_over_the_runs() {
    let runs = vec![
        checkpoint(2, "corner", "v3", (4, 4)),
        checkpoint(1, "opening", "bm", (0, 2)),
        checkpoint(1, "opening", "v3", (4, 4)),
        checkpoint(1, "opening", "v3", (1, 6)),
        checkpoint(2, "corner", "v3", (0, 0)),
    ];
    let summary = summary(vec![row("v3", 0, 1), row("bm", 0, 1)], runs);
    let told = summary
        .checkpoints
        .iter()
        .map(|c| (c.checkpoint, c.algorithm.as_str(), c.passed, c.frames, c.best_passed, c.worst_passed));
    let expected = [
        (1, "v3", 5, 10, Some(true), Some(false)),
        (1, "bm", 0, 2, Some(false), Some(false)),
        (2, "v3", 4, 4, Some(true), Some(true)),
    ];
    assert_eq!(told.collect::<Vec<_>>(), expected);
    assert_eq!(summary.checkpoints[0].share(), Some(0.5));
}

#[test]
fn the_terminal_table_fits_and_stays() {
    let text = example().to_string();
    assert!(text.lines().all(|line| line.chars().count() <= 100 && line == line.trim_end()), "{text}");
    insta::assert_snapshot!("terminal", text);
}

#[test]
fn many_algorithms_stand_in_blocks() {
    let algorithms = ["dp", "v1", "v2", "v3", "v4", "bm", "sgm"];
    let rows = algorithms.map(|a| row(a, 0, 1_000)).to_vec();
    let checkpoints = algorithms.map(|a| checkpoint(1, "opening between two obstacles", a, (1, 3))).to_vec();
    let text = summary(rows, checkpoints).to_string();
    assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    assert_eq!(text.matches("\ncheckpoint ").count(), 3);
    assert_eq!(text.matches("33.3").count(), 14);
}

#[test]
fn the_markdown_page_stays() {
    insta::assert_snapshot!("summary.md", example().markdown("arena | <b>"));
}

#[test]
fn an_empty_run_has_tables_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let summary = Tables::create(folder.path()).unwrap().finish().unwrap();
    assert_eq!(summary, Summary::default());
    assert_eq!(summary.to_string(), "No pairs.\n");
    assert_eq!(parquet(&folder.path().join("cells.parquet")).shape(), (0, CellRow::COLUMNS.len()));
    assert!(csv_rows::<Row>(&folder.path().join("rows.csv")).is_empty());
    assert!(page(summary, Vec::new()).contains("No pairs."));
}

fn page(summary: Summary, figures: Vec<Figure>) -> String {
    let identity = vec![("CPU".into(), "<script>alert(1)</script>".into())];
    let page = Page { title: "<b>".into(), description: "A & B.\n\nC.".into(), identity, summary, figures };
    page.render().unwrap()
}

/// A frame with a wrong cell, a right one and an unknown one.
fn shot(rank: Option<Rank>, left_png: &[u8]) -> Shot {
    let depth = CellDepth { median_px: 20.0, p20_px: 18.0, p80_px: 22.0, distance_m: Some(0.8) };
    let known = Cell { valid_share: 1.0, depth: Some(depth) };
    let unknown = Cell { valid_share: 0.0, depth: None };
    let drawn = |cells: [Cell; 3]| {
        let grid = DepthGrid::new(GridShape { columns: 3, rows: 1 }, cells.to_vec()).unwrap();
        marks(&grid, (30, 10), Nearness::new(40.0, 0.0))
    };
    let verdicts = [Verdict::Wrong, Verdict::Right, Verdict::Unknown];
    Shot {
        row: row("v3", 143, 5_000),
        cells: verdicts.into_iter().zip(0..).map(|(verdict, column)| cell("v3", column, verdict)).collect(),
        rank,
        passed: rank.map(|rank| rank == Rank::Best),
        left_png: left_png.to_vec(),
        size: (30, 10),
        estimate: drawn([known, known, unknown]),
        truth: Some(drawn([known; 3])),
        preview_png: rank.is_none().then(|| b"preview".to_vec()),
    }
}

#[test]
fn the_page_shows_every_figure_and_holds_every_image_once() {
    let figure = |title: &str, shots| Figure { title: title.into(), about: String::new(), shots };
    let figures = vec![
        figure("1 opening", vec![shot(Some(Rank::Worst), b"one"), shot(Some(Rank::Best), b"two")]),
        figure("teddy", vec![shot(None, b"one")]),
    ];
    let html = page(example(), figures);
    let count = |text: &str| html.matches(text).count();
    // "one", "two" and "preview" in base64; six overlays and a preview show them.
    assert_eq!(["data:image/png;base64,", "b25l\"", "dHdv\"", "cHJldmlldw==\""].map(count), [3, 1, 1, 1]);
    assert_eq!(["role=\"img\"", "href=\"#i0\"", "href=\"#i1\"", "href=\"#i2\""].map(count), [7, 4, 2, 1]);
    // Besides the legend: two known cells, an unknown and a wrong one per estimate, three known ones per truth.
    assert_eq!(["class=\"median\"", "class=\"dot\"", "href=\"#wrong\""].map(count), [16, 4, 4]);
    assert!(html.contains("<rect class=\"median\" x=\"2.5\" y=\"2.5\" width=\"5.0\" height=\"5.0\"/>"));
    assert!(html.contains("seed 7, frame 143") && html.contains("cells: 12 right, 1 wrong, 2 unknown"));
    assert!(html.contains("wrong: (0, 0) 0.80 m, truly 0.40 m, obstacle missed"));
}

#[test]
fn the_page_escapes_and_fetches_nothing() {
    let figure = Figure { title: "<u>".into(), about: "<i>".into(), shots: vec![shot(None, b"x")] };
    let html = page(example(), vec![figure]);
    for raw in ["<title><b>", "<h1><b>", "<script", "<u>", "<i>", "A & B", "http:", "https:", "url("] {
        assert!(!html.contains(raw), "{raw}");
    }
    for escaped in ["<h1>&lt;b&gt;</h1>", "&lt;script&gt;", "<h3>&lt;u&gt;</h3>", "<p>A &amp; B.</p>", "<p>C.</p>"] {
        assert!(html.contains(escaped), "{escaped}");
    }
}
