//! The summary of a run, on the terminal and as Markdown.

use super::fixture::{blind, checkpoint, example, found, row, summary};
use svl::report::table::{TableCell, TerminalStyle};
use svl::report::{Best, Certainty, Results, Row, Unfit};
use svl::score::{ColumnChoice, Metric, MetricSource as _, MetricValues};

#[track_caller]
fn assert_near<const N: usize>(values: [Option<f64>; N], expected: [f64; N]) {
    let mut both = values.iter().zip(expected);
    let are_near = both.all(|(own, expected)| (own.unwrap() - expected).abs() < 1e-12);
    assert!(are_near, "{values:?}");
}

#[test]
fn an_algorithm_is_summed_up() {
    let mut rows = [("v3", 0, 4_000), ("bm", 0, 1), ("v3", 1, 2_000)]
        .map(|(name, sequence, us)| row(name, sequence, us))
        .to_vec();
    rows.push(blind("v3", 9_000));
    rows[2].metrics.set("wrong", Some(4.0));
    rows[2].metrics.set("bad1", Some(0.08));
    let summary = summary(rows, Vec::new());
    let names = summary.algorithms.iter().map(|a| a.algorithm.as_str());
    assert!(names.eq(["v3", "bm"]));
    let v3 = &summary.algorithms[0];
    let totals = ["right", "wrong", "unknown", "missed", "false"].map(|name| v3.totals.get(name));
    let expected = [24.0, 5.0, 4.0, 2.0, 0.0].map(Some);
    assert_eq!((v3.pairs, totals), (3, expected));
    // A pair without truth does not dilute the means.
    let means = ["bad1", "bad2", "coverage", "invalid"].map(|name| v3.totals.get(name));
    assert_near(means, [0.06, 0.02, 0.3, 0.5]);
    let right = v3.value(Metric::find("right").unwrap());
    assert_near([right], [24.0 / 33.0]);
    assert_eq!(
        (v3.p50_ms, v3.p95_ms, v3.p99_ms, v3.max_ms),
        (Some(4.0), Some(9.0), Some(9.0), Some(9.0))
    );
    // 4 ms for 76 800 pixels; among the pairs with known disparities the faster is the median.
    let per_gd = 1e3 * 2000.0 / (76_800.0 * 81.0);
    let per_size = [v3.time_per_mp_s, v3.time_per_gd_s];
    assert_near(per_size, [4000.0 / 76_800.0, per_gd]);
    assert!((v3.mde_per_s.unwrap() - 1e3 / per_gd).abs() < 1e-9);
    // Stages of 0.1 to 0.4 ms of 5 ms in the mean.
    assert_near([v3.smoothing_ms, v3.texture_ms], [0.1, 0.2]);
    assert_near([v3.matching_ms, v3.checks_ms], [0.3, 0.4]);
    assert_near([v3.other_ms], [4.0]);
}

#[test]
fn a_megabyte_is_a_million_bytes() {
    let summary = found(vec![row("truth", 0, 1)], Vec::new());
    assert_eq!(summary.algorithms[0].memory_mb, Some(2.5));
}

#[test]
fn percentiles_are_nearest_rank() {
    let percentiles = |times: std::ops::RangeInclusive<u64>| {
        let rows = times.rev().map(|ms| row("v3", ms, 1000 * ms));
        let summary = summary(rows.collect(), Vec::new());
        let v3 = &summary.algorithms[0];
        [v3.p50_ms, v3.p95_ms, v3.p99_ms].map(Option::unwrap)
    };
    assert_eq!(percentiles(5..=5), [5.0, 5.0, 5.0]);
    assert_eq!(percentiles(1..=4), [2.0, 4.0, 4.0]);
    assert_eq!(percentiles(1..=100), [50.0, 95.0, 99.0]);
    assert_eq!(percentiles(1..=101), [51.0, 96.0, 100.0]);
    assert_eq!(percentiles(1..=200), [100.0, 190.0, 198.0]);
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

/// The screen of a run; without colours unless `is_rich`.
fn screen(summary: &Results, width: usize, is_rich: bool) -> String {
    summary.terminal("arena", TerminalStyle { width, is_rich }, false)
}

/// A run of algorithms with right and wrong cells in tenths of a cell, and the number of passing
/// frames, out of ten, at three checkpoints.
fn run(algorithms: &[(&str, f64, f64, [u64; 3])]) -> Results {
    let mut rows = Vec::new();
    let mut checkpoints = Vec::new();
    for (place, (name, right, wrong, passed)) in algorithms.iter().enumerate() {
        for sequence in 0..60 {
            let mut row = row(name, sequence, 1_000 * (1 + place as u64));
            let cells = [
                ("right", *right),
                ("wrong", *wrong),
                ("unknown", 10.0 - right - wrong),
            ];
            for (metric, tenths) in cells {
                row.metrics.set(metric, Some((10.0 * tenths).round()));
            }
            row.metrics.set("missed", Some(wrong.round()));
            row.metrics.set("near", Some(10.0));
            row.metrics.set("found", Some(right.round()));
            row.metrics.set("false", Some(0.0));
            rows.push(row);
        }
        let names = ["opening", "ball", "corner"];
        for ((i, name_of), passed) in (1..).zip(names).zip(passed) {
            checkpoints.push(checkpoint(i, name_of, name, (*passed, 10)));
        }
    }
    found(rows, checkpoints)
}

const EIGHT: [(&str, f64, f64, [u64; 3]); 8] = [
    ("dp", 5.4, 4.6, [0, 0, 0]),
    ("v1", 4.2, 5.7, [0, 0, 0]),
    ("v2", 3.3, 0.6, [10, 0, 10]),
    ("v3", 3.8, 0.6, [10, 10, 9]),
    ("v4", 3.7, 0.4, [10, 10, 10]),
    ("v5", 9.2, 0.1, [10, 9, 10]),
    ("bm", 3.8, 1.2, [9, 0, 0]),
    ("sgm", 8.3, 1.1, [10, 9, 5]),
];

#[test]
fn the_answer_is_one_screen() {
    let summary = run(&EIGHT);
    for (width, is_rich) in [(80, true), (120, true), (80, false), (40, true)] {
        let text = screen(&summary, width, is_rich);
        let lines = text.lines().count();
        assert!(lines <= 21 || width < 80, "{width}:\n{text}");
        let plain = without_colors(&text);
        let widest = plain.lines().map(|line| line.chars().count()).max();
        assert!(widest <= Some(width), "{width}:\n{text}");
        let has_bars = text.contains('█');
        assert_eq!(has_bars, is_rich && width >= 80, "{width}:\n{text}");
        assert!(plain.lines().all(|line| line == line.trim_end()), "{text}");
    }
    insta::assert_snapshot!("screen_80", without_colors(&screen(&summary, 80, true)));
    insta::assert_snapshot!("screen_40", without_colors(&screen(&summary, 40, true)));
    insta::assert_snapshot!("screen_piped", screen(&summary, 100, false));
    insta::assert_snapshot!(
        "screen_one",
        without_colors(&screen(&run(&EIGHT[5..6]), 80, true))
    );
}

#[test]
fn the_first_twelve_of_a_hundred_algorithms_are_shown() {
    let names: Vec<String> = (0..100).map(|i| format!("bm:uniqueness={i}")).collect();
    let right = |i: usize| 9.0 - i as f64 / 20.0;
    let algorithms: Vec<_> = names
        .iter()
        .enumerate()
        .map(|(i, name)| (name.as_str(), right(i), 0.5, [10, 5, 0]))
        .collect();
    let mut summary = run(&algorithms);
    let text = without_colors(&screen(&summary, 80, true));
    insta::assert_snapshot!("screen_hundred", text);
    summary.shown.columns = ColumnChoice::All;
    let all = screen(&summary, 80, false);
    assert_eq!(
        all.matches("\nbm:uniqueness=99 ").count(),
        all.matches("\nalgorithm").count()
    );
}

/// The text without the codes of its colours.
fn without_colors(text: &str) -> String {
    let mut parts = text.split("\x1b[");
    let first = parts.next().unwrap_or_default().to_owned();
    let rest = parts.map(|part| part.split_once('m').map_or(part, |(_, text)| text));
    rest.fold(first, |text, part| text + part)
}

#[test]
fn all_columns_and_their_meanings_fit_into_the_width() {
    let mut summary = example();
    summary.shown.columns = ColumnChoice::All;
    for width in [60, 80, 100, 160] {
        let style = TerminalStyle::plain(width);
        let text = summary.terminal("arena", style, true);
        let widest = text.lines().map(|line| line.chars().count()).max();
        assert!(widest <= Some(width), "{width}:\n{text}");
    }
    let text = summary.terminal("arena", TerminalStyle::plain(80), true);
    insta::assert_snapshot!("all_columns", text);
}

#[test]
fn columns_are_those_that_are_named() {
    let mut summary = run(&EIGHT);
    summary.shown.columns = "missed,time".parse().unwrap();
    let heads = summary.headline().columns.into_iter();
    let heads: Vec<_> = heads.map(|column| column.head).collect();
    assert_eq!(heads, ["", "missed", "p50", "p99"]);
}

#[test]
fn the_best_is_as_sure_as_its_intervals() {
    let others = |summary: &Results| {
        let facts = |best: &Best| {
            let other = &best.others[0];
            (
                best.metric.name,
                best.algorithm.clone(),
                other.algorithm.clone(),
                other.certainty,
            )
        };
        let scored = summary.best.iter().filter(|b| b.metric.name != "time");
        scored.map(facts).collect::<Vec<_>>()
    };
    let best = |metric, best: &str, other: &str, certainty| {
        (metric, best.to_owned(), other.to_owned(), certainty)
    };
    // Equal counts are not a difference.
    let two = run(&[("v3", 6.0, 1.0, [1, 1, 1]), ("bm", 5.0, 1.0, [1, 1, 1])]);
    let expected = [
        best("right", "v3", "bm", Certainty::Clear),
        best("wrong", "v3", "bm", Certainty::NotToldApart),
        best("missed", "v3", "bm", Certainty::NotToldApart),
    ];
    assert_eq!(others(&two), expected);
    // Five pairs are too few blocks.
    let mut rows: Vec<_> = (0..5).map(|i| row("v3", i, 1)).collect();
    rows.extend((0..5).map(|i| row("bm", i, 1)));
    let few = found(rows, Vec::new());
    assert!(few.best.is_empty() && few.unfit.values().all(|own| *own == Unfit::TooFewPairs));
    let answer = few.answer().join(" ");
    assert!(answer.starts_with("Too few pairs to tell"), "{answer}");
    // An algorithm with more than 10 % wrong cells is not the best in anything.
    let wrong = run(&[("v1", 8.0, 2.0, [1, 1, 1]), ("v3", 6.0, 0.5, [1, 1, 1])]);
    let is_alone = |best: &Best| best.algorithm == "v3" && best.others.is_empty();
    assert_eq!(wrong.unfit["v1"], Unfit::Over("wrong", 10));
    assert_eq!(wrong.best.len(), 3, "one has no other to be faster than");
    assert!(wrong.best.iter().all(is_alone), "{:?}", wrong.best);
    let none = run(&[("v1", 8.0, 2.0, [1, 1, 1]), ("dp", 4.0, 5.0, [1, 1, 1])]);
    assert!(none.best.is_empty());
    assert_eq!(none.answer().len(), 1);
    // The marks stand where none is best, too.
    let table = none.headline();
    let right = table
        .columns
        .iter()
        .position(|column| column.head == "right");
    let marked = |row: &Vec<TableCell>| match &row[right.unwrap()] {
        TableCell::Text(text) => text.ends_with('x'),
        _ => false,
    };
    assert!(table.rows.iter().all(marked), "{table:?}");
}

#[test]
fn marks_tell_the_best_from_those_that_are_not_told_apart() {
    let summary = run(&[
        ("v5", 9.0, 0.5, [9, 9, 9]),
        ("v4", 6.0, 0.5, [10, 10, 10]),
        ("v1", 5.0, 3.0, [1, 1, 1]),
        ("v3", 4.0, 0.5, [1, 1, 1]),
    ]);
    let table = summary.headline();
    let cell = |algorithm: usize, head: &str| {
        let column = table.columns.iter().position(|column| column.head == head);
        match &table.rows[algorithm][column.unwrap()] {
            TableCell::Text(text) | TableCell::Alert(text) => text.clone(),
            TableCell::Time { mark, .. } => mark.clone(),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!([cell(0, "right"), cell(1, "right")], ["90.0*", "60.0 "]);
    assert_eq!([cell(0, "wrong"), cell(1, "wrong")], ["5.0*", "5.0="]);
    // Less than half of the near obstacles are found; more than 10 % are wrong.
    assert_eq!([cell(2, "right"), cell(2, "wrong")], ["40.0x", "5.0x"]);
    assert_eq!([cell(3, "right"), cell(3, "wrong")], ["50.0x", "30.0x"]);
    assert_eq!([cell(0, "p50"), cell(1, "p50")], ["*", " "]);
    let answer = summary.answer();
    let best = "Best: v5 by right 90.0 % (v4 60.0 %), wrong 5.0 % (= v4 5.0 %), missed 60 (= v4 \
                60); 60 pairs, 6000 cells.";
    assert_eq!(answer[0], best);
    let legend = summary.legend();
    let marks = "* best; = not told apart from it; x may not be best: under 50 % found (";
    assert!(legend[0].starts_with(marks), "{legend:?}");
    // Equal times are not a difference.
    let rows: Vec<_> = (0..120)
        .map(|i| row(["v5", "v3"][i % 2], i as u64 / 2, 1_000))
        .collect();
    let equal = found(rows, Vec::new());
    let fastest = equal.best.last().unwrap();
    assert_eq!(
        (fastest.metric.name, fastest.others[0].certainty),
        ("time", Certainty::NotToldApart)
    );
}

/// A data set by algorithms with shares of bad pixels and cover, and times in µs.
fn data_set(algorithms: [(&str, f64, f64, u64); 4]) -> Results {
    let rows = algorithms.iter().flat_map(|(name, bad2, coverage, us)| {
        (0..60).map(move |sequence| Row {
            metrics: MetricValues::from([
                ("bad2", *bad2),
                ("total_bad2", 1.0 - coverage * (1.0 - bad2)),
                ("coverage", *coverage),
            ]),
            ..row(name, sequence, *us)
        })
    });
    found(rows.collect(), Vec::new())
}

#[test]
fn the_best_of_a_data_set_need_not_be_the_fastest() {
    let summary = data_set([
        ("sgm", 0.02, 0.9, 9_000),
        ("bm", 0.05, 0.6, 1_000),
        ("v1", 0.4, 0.5, 10_000),
        ("truth", 0.0, 1.0, 1),
    ]);
    let best = summary.best.iter();
    let best: Vec<_> = best
        .map(|best| (best.metric.name, best.algorithm.as_str()))
        .collect();
    assert_eq!(best, [("total_bad2", "sgm"), ("time", "bm")]);
}

#[test]
fn neither_the_truth_nor_one_of_few_disparities_is_called_best() {
    let summary = data_set([
        ("truth", 0.0, 1.0, 1_000),
        ("few", 0.01, 0.05, 1_000),
        ("bm", 0.2, 0.6, 1_000),
        ("v3", 0.3, 0.5, 1_000),
    ]);
    // One of few disparities leaves most pixels out.
    assert_eq!(summary.best[0].algorithm, "bm");
}

#[test]
fn a_run_without_truth_has_no_columns_of_it() {
    let summary = summary(vec![blind("v3", 1_000), blind("bm", 500)], Vec::new());
    assert!(summary.scope_words().ends_with("no ground truth"));
    let heads = summary.headline().columns.into_iter();
    let heads: Vec<_> = heads.map(|column| column.head).collect();
    assert_eq!(heads, ["", "p50", "p99"]);
}

#[test]
fn the_markdown_page_stays() {
    insta::assert_snapshot!("summary.md", example().markdown("arena | <b>"));
}
