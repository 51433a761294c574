//! The summary of a run, on the terminal and as Markdown.

use super::fixture::{blind, checkpoint, example, row, summary};
use svl::score::Metric;

#[test]
fn an_algorithm_is_summed_up() {
    let mut rows = vec![
        row("v3", 0, 4_000),
        row("bm", 0, 1),
        row("v3", 1, 2_000),
        blind("v3", 9_000),
    ];
    rows[2].metrics.set("wrong", Some(4.0));
    rows[2].metrics.set("bad1", Some(0.08));
    let summary = summary(rows, Vec::new());
    assert_eq!(
        summary
            .algorithms
            .iter()
            .map(|a| a.algorithm.as_str())
            .collect::<Vec<_>>(),
        ["v3", "bm"]
    );
    let v3 = &summary.algorithms[0];
    assert_eq!(
        (
            v3.pairs,
            ["right", "wrong", "unknown"].map(|name| v3.totals.get(name))
        ),
        (3, [Some(24.0), Some(5.0), Some(4.0)])
    );
    assert_eq!(
        ["missed", "false"].map(|name| v3.totals.get(name)),
        [Some(2.0), Some(0.0)]
    );
    // A pair without truth does not thin the means out.
    for (name, mean) in [
        ("bad1", 0.06),
        ("bad2", 0.02),
        ("coverage", 0.3),
        ("invalid", 0.5),
    ] {
        assert!(
            (v3.totals.get(name).unwrap() - mean).abs() < 1e-12,
            "{name}"
        );
    }
    let right = v3.value(Metric::find("right").unwrap()).unwrap();
    assert!((right - 24.0 / 33.0).abs() < 1e-12);
    assert_eq!(
        (v3.p50_ms, v3.p95_ms, v3.p99_ms, v3.max_ms),
        (4.0, 9.0, 9.0, 9.0)
    );
    // 4 ms for 76 800 pixels; of the pairs with known disparities the faster is the median.
    assert!((v3.time_per_mp_s - 4000.0 / 76_800.0).abs() < 1e-12);
    let per_gd = 1e3 * 2000.0 / (76_800.0 * 81.0);
    assert!((v3.time_per_gd_s.unwrap() - per_gd).abs() < 1e-12);
    assert!((v3.mde_per_s.unwrap() - 1e3 / per_gd).abs() < 1e-9);
    // Stages of 0.1 to 0.4 ms of 5 ms in the mean.
    let stages = [
        v3.smoothing_ms,
        v3.texture_ms,
        v3.matching_ms,
        v3.checks_ms,
        v3.other_ms,
    ];
    assert!(
        stages
            .iter()
            .zip([0.1, 0.2, 0.3, 0.4, 4.0])
            .all(|(a, b)| (a - b).abs() < 1e-12),
        "{stages:?}"
    );
}

#[test]
fn percentiles_are_nearest_rank() {
    let of = |times: std::ops::RangeInclusive<u64>| {
        let summary = summary(
            times.rev().map(|ms| row("v3", ms, 1000 * ms)).collect(),
            Vec::new(),
        );
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
    let told = summary.checkpoints.iter().map(|c| {
        (
            c.checkpoint,
            c.algorithm.as_str(),
            c.passed,
            c.frames,
            c.best_passed,
            c.worst_passed,
        )
    });
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
    assert!(
        text.lines()
            .all(|line| line.chars().count() <= 100 && line == line.trim_end()),
        "{text}"
    );
    insta::assert_snapshot!("terminal", text);
}

#[test]
fn the_terminal_table_fits_into_its_width() {
    for width in [60, 80, 100, 160] {
        let text = format!("{:width$}", example());
        let widest = text.lines().map(|line| line.chars().count()).max();
        assert!(widest <= Some(width), "{width}:\n{text}");
    }
    assert_eq!(format!("{:100}", example()), example().to_string());
}

#[test]
fn many_algorithms_stand_in_lines_and_checkpoints_in_blocks() {
    let algorithms = [
        "dp",
        "v1",
        "v2",
        "v3",
        "v4",
        "bm",
        "sgm:paths=8,p1=7,p2=86,edge=256",
    ];
    let rows = algorithms.map(|a| row(a, 0, 1_000)).to_vec();
    let names = [
        "opening between two obstacles",
        "close border",
        "ball",
        "corner",
        "slanted wall",
        "bridge",
    ];
    let checkpoints = algorithms.iter().flat_map(|a| {
        names
            .iter()
            .zip(1..)
            .map(move |(name, i)| checkpoint(i, name, a, (1, 3)))
    });
    let text = summary(rows, checkpoints.collect()).to_string();
    assert!(
        text.lines().all(|line| line.chars().count() <= 100),
        "{text}"
    );
    assert_eq!(
        (
            text.matches("\nalgorithm ").count(),
            text.matches("\nv3 ").count()
        ),
        (3, 3),
        "{text}"
    );
    assert_eq!(
        (
            text.matches("✓✗  33.3").count(),
            text.matches("6/6 0/6  33.3").count()
        ),
        (42, 7)
    );
}

#[test]
fn a_run_without_truth_has_no_columns_of_it() {
    let text = summary(vec![blind("v3", 1_000), blind("bm", 500)], Vec::new()).to_string();
    let (table, notes) = text.split_once("\n\n").unwrap();
    for head in ["cells", "obstacles", "invalid", "px"] {
        assert!(!table.contains(head), "{head}: {text}");
    }
    assert!(table.contains("cover") && table.contains("p50"));
    assert!(
        notes.contains("no truth: right, wrong, unknown, missed, false,"),
        "{notes}"
    );
}

#[test]
fn the_markdown_page_stays() {
    insta::assert_snapshot!("summary.md", example().markdown("arena | <b>"));
}
