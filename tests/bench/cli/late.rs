//! Cells of answers that arrive late: `svl score --latency`.

use super::fixture::Fixture;

fn arena() -> Fixture {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 40);
    fixture
}

const SCORE: &str = "score short.toml --algo v3 --algo truth --rerun none";

#[test]
fn an_answer_at_once_is_scored_as_its_pair_and_no_other_number_changes() {
    let fixture = arena();
    fixture.transcript(&format!(
        "{SCORE} -o plain
        {SCORE} -o late --latency 0ms => late, %"
    ));
    let summary = |report: &str| fixture.json_file(&format!("{report}/summary.json"));
    let (plain, late) = (summary("plain"), summary("late"));
    for (before, own) in [0, 1].map(|i| (&plain["algorithms"][i], &late["algorithms"][i])) {
        for key in ["right", "wrong", "unknown"] {
            let name = format!("{key}_late");
            assert_eq!(own[key], own[&name], "{own}");
            assert_eq!(own[key], before[key]);
            assert!(before[&name].is_null());
            let count = |own: &serde_json::Value| own.as_f64().unwrap();
            let all = &own["areas"]["all"];
            let cells = [
                &all[format!("cells_{key}")],
                &all[format!("cells_{key}_late")],
            ];
            assert_eq!(count(cells[0]), count(cells[1]), "{all}");
        }
    }
    assert_eq!(plain["best"], late["best"]);
    for table in ["cells", "accuracy", "verdicts"] {
        let text = |report: &str| fixture.text(&format!("{report}/{table}.csv"));
        assert_eq!(text("plain"), text("late"), "{table}");
    }
}

#[test]
fn late_answers_are_in_tables_gates_and_comparisons() {
    let fixture = arena();
    let gate = "[[gate]]\nalgorithm = \"truth\"\nmetric = \"wrong_late\"\nmax = 0.001\n";
    let text = fixture
        .text("short.toml")
        .replacen("[source]", &format!("{gate}[source]"), 1);
    fixture.write(
        "gated.toml",
        text.replacen("[cells]", "[cells]\nlatency_ms = 500", 1),
    );
    fixture.transcript(&format!(
        "{SCORE} -o late --latency 500ms => late, % | !latency is known
        {SCORE} -o half --latency 250ms
        cat late/index.html => late, %
        cat late/summary.md => late, %
        compare half late => late, points
        score gated.toml --algo truth --rerun none -q -o gated --gate => 3: \
        truth: cells wrong on arrival | on arrival, at most 0.1 %
        score gated.toml --algo truth --print-scenario => latency_ms = 500
        {SCORE} -o measured --latency measured => 0~ late cells: v3 | by their median time on this
        cat measured/summary.json => /algorithms/0/right_late > 0.5
        {SCORE} -o part --latency measured --shard 1/1
        report part -o whole => 0~ v3, truth: no late cells, as no latency is known"
    ));
    let wrong = |report: &str| {
        let summary = fixture.json_file(&format!("{report}/summary.json"));
        summary["algorithms"][1]["wrong_late"].as_f64().unwrap()
    };
    assert!(wrong("half") > 0.05 && wrong("late") > 0.05);
}

#[test]
fn a_latency_that_cannot_be_is_refused_and_one_without_cells_is_told() {
    let fixture = arena();
    let cells = |key: &str| {
        let text = fixture.text("short.toml");
        fixture.write(
            "cells.toml",
            text.replacen("[cells]", &format!("[cells]\n{key}"), 1),
        );
    };
    let expected = "expected `measured`, or 0 to 10000 milliseconds, as 80ms";
    fixture.write("small.toml", super::drive::courses(""));
    fixture.transcript(&format!(
        "score short.toml --latency=-1ms => 2: {expected}
        score short.toml --latency 10001ms => 2: {expected}
        score short.toml --latency nanms => 2: {expected}
        score short.toml --latency 80 => 2: {expected}
        score small.toml --latency 80ms => 2: drive.latency_ms
        {SCORE} -o none --latency 9s => 2: {expected}
        {SCORE} -o none --latency 9000ms => 0~ --latency: no cell is scored late, as that needs"
    ));
    for (key, words) in [
        (
            "latency_ms = -1",
            "cells.latency_ms = -1 is outside 0 ..= 10000",
        ),
        (
            "latency_ms = \"fast\"",
            "expected milliseconds, or a table of them by algorithm, or",
        ),
        (
            "latency_ms = { smg = 5 }",
            "cells.latency_ms: unknown algorithm 'smg' (did you mean",
        ),
    ] {
        cells(key);
        fixture.transcript(&format!(
            "score cells.toml --algo v3 => 1: cells.toml | {words}"
        ));
    }
    cells("latency_ms = { v3 = 120.5 }");
    fixture.transcript(
        "score cells.toml --algo v3 --algo truth --rerun none -o each => late, % => 0~ \
        truth: no late cells, as no latency is known; latency_ms under [cells] sets it",
    );
}
