//! Scenarios that are read, and the errors of wrong ones.

use super::*;
use crate::judge::AreaChoice;

fn parse(text: &str) -> Result<Scenario> {
    Scenario::parse(text, Path::new("s.toml"))
}

const MINIMAL: &str = "name = \"m\"\ndescription = \"\"\nalgorithms = \
                       [\"v3\"]\n[cells]\njudge = \"distance\"\n[source]\nkind = \"arena\"\n";

#[test]
fn errors_name_no_types_of_rust() {
    for (line, words) in [
        (
            "[grid]\nrows = \"3\"",
            "string \"3\", expected a whole number, 0 or more",
        ),
        (
            "[grid]\nrows = -1",
            "integer `-1`, expected a whole number, 0 or more",
        ),
        (
            "[[gate]]\n[arena]\nrobot = 3",
            "integer `3`, expected a table",
        ),
        ("[arena.world]\nblocks = {}", "a table, expected a list"),
        (
            "[arena.world]\nwidth_m = true",
            "boolean `true`, expected a number",
        ),
    ] {
        let error = parse(&format!("{MINIMAL}{line}\n"))
            .unwrap_err()
            .to_string();
        assert!(error.contains(words), "{line}: {error}");
    }
}

#[test]
fn random_worlds_have_no_keys_of_their_own_and_no_drives() {
    let error = |text: &str| parse(text).unwrap_err().to_string();
    let own = error(&format!(
        "{MINIMAL}[arena]\nrandom = \"worlds\"\nsensor.gain_db = 1.0\n"
    ));
    assert!(own.contains("arena.sensor"), "{own}");
    let drive = MINIMAL.replace("\"arena\"", "\"drive\"");
    let driven = error(&format!("{drive}[arena]\nrandom = \"worlds\"\n"));
    assert!(driven.contains("arena.random belongs to"), "{driven}");
}

#[test]
fn omitted_keys_have_the_thesis_defaults() {
    // A name and a source suffice.
    let scenario = parse("name = \"m\"\n[source]\nkind = \"arena\"\n").unwrap();
    assert_eq!(scenario.algorithms[0].label(), "v5");
    assert_eq!(scenario.cells, CellRule::default());
    assert_eq!((scenario.grid.columns, scenario.grid.rows), (5, 3));
    assert_eq!(
        scenario.source,
        ScenarioSource::Arena {
            config: Box::default(),
            seeds: vec![1]
        }
    );
}

#[test]
fn every_key_is_documented() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scenario.md");
    // The published crate does not include docs/.
    let Ok(docs) = std::fs::read_to_string(docs) else {
        return;
    };
    let cells = "[cells]\njudge = \"distance\"\nzz = 1\n";
    let checkpoint = "[[checkpoint]]\nnumber = 1\nname = \"a\"\n";
    let expected_cell = format!("{checkpoint}frames = [0, 1]\n[[checkpoint.cell]]\nzz = 1\n");
    let sections = [
        "zz = 1\n".to_owned(),
        "[grid]\nzz = 1\n".to_owned(),
        cells.to_owned(),
        cells.replace("distance", "disparity"),
        "source = { zz = 1 }\n".to_owned(),
        format!("{checkpoint}zz = 1\n"),
        expected_cell,
        "[[gate]]\nzz = 1\n".to_owned(),
        "[[filter]]\nzz = 1\n".to_owned(),
        "[[stress]]\nzz = 1\n".to_owned(),
        "[drive]\nzz = 1\n".to_owned(),
        "[drive.steering]\nzz = 1\n".to_owned(),
        "[arena]\nzz = 1\n".to_owned(),
        "[arena.rig]\nzz = 1\n".to_owned(),
        "[arena.sensor]\nzz = 1\n".to_owned(),
        "[arena.robot]\nzz = 1\n".to_owned(),
        "[arena.world]\nzz = 1\n".to_owned(),
        "[arena.world]\nblocks = [{ zz = 1 }]\n".to_owned(),
        "[arena.world]\nballs = [{ zz = 1 }]\n".to_owned(),
        "[arena.robot]\npath = [{ zz = 1 }]\n".to_owned(),
    ];
    for section in sections {
        let error = parse(&section).unwrap_err().to_string();
        // unknown field `zz`, expected one of `columns`, `rows`, …
        let (_, keys) = error.split_once("expected ").expect(&error);
        let keys: Vec<_> = keys.split('`').skip(1).step_by(2).collect();
        assert!(!keys.is_empty(), "{error}");
        for key in keys {
            let is_told = docs.split(|c: char| !c.is_alphanumeric() && c != '_');
            assert!(
                is_told.into_iter().any(|word| word == key),
                "{section}: {key}"
            );
        }
    }
}

#[test]
fn recordings_that_begin_alike_have_names_of_their_own() {
    let begin = "2026-11-29-warehouse-3-robot-7-front-left";
    let names = ["", "-1", "-2"].map(|end| short_name(&format!("{begin}{end}")));
    let mut lengths = names.iter().map(|name| name.chars().count());
    assert!(lengths.all(|length| length == MAX_NAME), "{names:?}");
    assert!(names[0] != names[1] && names[1] != names[2]);
    assert_eq!(short_name(&begin[..MAX_NAME]), begin[..MAX_NAME]);
}

#[test]
fn the_embedded_arena_is_whole() {
    let arena = Scenario::arena().unwrap();
    assert_eq!(arena.checkpoints.len(), 6);
}

#[test]
fn errors_name_line_and_column() {
    let error = parse(&MINIMAL.replace("kind", "kidn"))
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("s.toml: line 7, column 1: unknown field `kidn`"),
        "{error}"
    );
    assert!(!error.contains('\n'));
    let error = parse("name = [").unwrap_err().to_string();
    assert!(error.starts_with("s.toml: line 1, column 9: "), "{error}");
}

#[test]
fn contradictions_are_named() {
    for (from, to, word) in [
        ("\"m\"", "\"../m\"", "name"),
        ("[\"v3\"]", "[]", "algorithms"),
        ("\"v3\"", "\"v33\"", "did you mean 'v3'"),
        ("\"arena\"", "\"dataset\"", "scenes"),
        (
            "kind = \"arena\"",
            "kind = \"arena\"\nseeds = [1, 1]",
            "seeds",
        ),
        ("[source]", "[grid]\ncolumns = 0\n[source]", "columns"),
    ] {
        let error = parse(&MINIMAL.replacen(from, to, 1))
            .unwrap_err()
            .to_string();
        assert!(error.contains(word), "{to}: {error}");
    }
}

#[test]
fn cells_take_tolerances_and_distances() {
    let cells =
        |keys: &str| parse(&MINIMAL.replacen("\"distance\"", &format!("\"distance\"\n{keys}"), 1));
    assert_eq!(cells("").unwrap().cells, CellRule::default());
    let set = cells("tolerance_m = 0.05\nobstacle_m = 0.4\nclear_m = 0.9\nbeyond_m = 2")
        .unwrap()
        .cells;
    let expected = CellRule::Distance {
        tolerance_m: 0.05,
        tolerance_percent: 20.0,
        obstacle_m: 0.4,
        clear_m: 0.9,
        beyond_m: Some(2.0),
    };
    assert_eq!(set, expected);
    assert!(set.right_words().starts_with("within 0.05 m or 20 %"));
    for (keys, words) in [
        (
            "tolerance_m = 0",
            "cells.tolerance_m = 0: must be a positive number",
        ),
        (
            "tolerance_percent = -5",
            "cells.tolerance_percent = -5: must be",
        ),
        ("obstacle_m = inf", "cells.obstacle_m = inf: must be"),
        ("clear_m = nan", "cells.clear_m = NaN: must be"),
        (
            "clear_m = 0.5",
            "cells.obstacle_m = 0.5: must be below cells.clear_m = 0.5",
        ),
        (
            "beyond_m = 0.4",
            "cells.beyond_m = 0.4: must be above cells.obstacle_m = 0.5",
        ),
        ("beyond_m = nan", "cells.beyond_m = NaN: must be"),
        ("tolerance_px = 2", "tolerance_px"),
        ("obstacle_m = \"near\"", "expected a number"),
    ] {
        let error = cells(keys).unwrap_err().to_string();
        assert!(
            error.contains(words) && !error.contains('\n'),
            "{keys}: {error}"
        );
    }
}

#[test]
fn limits_are_checked_and_know_their_lines() {
    let gate = |limit: &str| parse(&format!("{MINIMAL}[[gate]]\nalgorithm = \"v3\"\n{limit}"));
    let scenario = gate("metric = \"time\"\nrelative_to = \"bm\"\nmax = 2").unwrap();
    assert_eq!(
        (scenario.gate[0].line, scenario.gate[0].max),
        (8, Some(2.0))
    );
    let floor = gate("metric = \"right\"\nmin = 0.5\narea = \"floor\"").unwrap();
    assert_eq!(floor.gate[0].area, Some(AreaChoice::Floor));
    // A bias has a sign.
    for bias in ["min = -0.1\nmax = 0.1", "max_magnitude = 0.1"] {
        let limit = &gate(&format!("metric = \"bias\"\n{bias}")).unwrap().gate[0];
        assert_eq!(limit.bounds(), [Some(-0.1), Some(0.1)]);
    }
    let minimum = |keys: &str| {
        let limit = &gate(&format!("metric = \"rmse\"\nmax = 1\n{keys}"))
            .unwrap()
            .gate[0];
        (limit.minimum().cases, limit.minimum().share)
    };
    assert_eq!(minimum(""), (1, Some(0.95)));
    assert_eq!(minimum("min_cases = 50\nmin_share = 0.5"), (50, Some(0.5)));
    assert!(gate("metric = \"right\"\nrelative_to = \"prior\"\nmin = 0").is_ok());
}

/// Limits, and words of the error of each.
const REFUSED_LIMITS: &[(&str, &str)] = &[
    ("metric = \"wrong\"", "gate in line 8: needs min or max"),
    (
        "metric = \"rmse\"\nmin = -0.1",
        "gate in line 8: min = -0.1: expected a number, 0 or more",
    ),
    ("metric = \"wrong\"\nmax = 5", "5 % is 0.05"),
    (
        "metric = \"wrong\"\nmax = nan",
        "max = NaN: expected a share, 0 to 1",
    ),
    (
        "metric = \"bias\"\nmax = 0.1",
        "give min too, or max_magnitude",
    ),
    (
        "metric = \"bias\"\nmin = -0.1",
        "give max too, or max_magnitude",
    ),
    (
        "metric = \"bias\"\nmax_magnitude = -1",
        "max_magnitude = -1",
    ),
    (
        "metric = \"bias\"\nmax_magnitude = 1\nmin = 0",
        "stands alone",
    ),
    (
        "metric = \"rmse\"\nmax_magnitude = 1",
        "belongs to row_offset, bias;",
    ),
    (
        "metric = \"row_offset\"\nmax = 0.5",
        "max alone: give min too",
    ),
    (
        "metric = \"bias\"\nmax_magnitude = 0",
        "max_magnitude = 0: expected a number above 0",
    ),
    (
        "metric = \"bias\"\nmax = 0.1\nrelative_to = \"prior\"",
        "relative_to = \"prior\" belongs to right, wrong,",
    ),
    (
        "metric = \"near\"\nmax = 0\nrelative_to = \"prior\"",
        "relative_to = \"prior\" belongs to right",
    ),
    (
        "metric = \"missed\"\nmax = 1\nmin_cases = 18446744073709551615",
        "min_cases: expected 1 to 9223372036854775807",
    ),
    (
        "metric = \"wrong\"\nmax = 1",
        "a share, 0 to 1: 1 is always kept, 1 % is 0.01",
    ),
    (
        "metric = \"right\"\nmin = 0",
        "0 is always kept, 1 % is 0.01",
    ),
    (
        "metric = \"missed\"\nmin = 0",
        "min = 0: a number, 0 or more: 0 is always kept",
    ),
    (
        "metric = \"right\"\nrelative_to = \"prior\"\nmin = -1",
        "a share, -1 to 1: -1 is always kept",
    ),
    (
        "metric = \"missed\"\nmax = 1\nmin_cases = 0",
        "min_cases = 0: expected 1 or more",
    ),
    (
        "metric = \"rmse\"\nmax = 1\nmin_share = 0",
        "min_share = 0: expected a share, above 0",
    ),
    (
        "metric = \"rmse\"\nmax = 1\nmin_share = 2",
        "min_share = 2: expected a share",
    ),
    (
        "metric = \"missed\"\nmax = 1\nmin_share = 0.5",
        "belongs to bias, rmse",
    ),
    (
        "metric = \"wrong\"\nmin = 0.2\nmax = 0.1",
        "min is above max",
    ),
    ("metric = \"time\"\nmax = 5", "relative_to"),
    (
        "metric = \"wrong\"\nmax = 0.1\nrelative_to = \"v1\"",
        "absolute",
    ),
    ("metric = \"wrong\"\nmax = 0.1\ncheckpoint = 1", "passed"),
    (
        "metric = \"passed\"\nmin = 0.1\ncheckpoint = 1",
        "no checkpoint 1",
    ),
    (
        "metric = \"time\"\nmax = 1\nrelative_to = \"v3\"",
        "names the algorithm itself",
    ),
    (
        "metric = \"missed\"\nmax = 5\narea = \"floor\"",
        "gate in line 8: area belongs to right, wrong",
    ),
    (
        "metric = \"right\"\nmin = 0.5\narea = \"flor\"",
        "unknown variant `flor`",
    ),
    ("metric = \"wrnog\"\nmax = 1", "line 10"),
];

#[test]
fn limits_that_mean_nothing_are_refused() {
    let gate = |limit: &str| parse(&format!("{MINIMAL}[[gate]]\nalgorithm = \"v3\"\n{limit}"));
    for (limit, word) in REFUSED_LIMITS {
        let error = gate(limit).unwrap_err().to_string();
        assert!(error.contains(word), "{limit}: {error}");
    }
}
