//! `svl score`.

use super::fixture::{Fixture, assert_says, datasets};

#[test]
fn scores_the_arena_and_writes_the_whole_report() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 20);
    let text = fixture.run("score short.toml");
    assert_says(&text, &["v3", "reports/arena/index.html"]);
    for file in ["summary", "verdicts", "rows", "cells", "checkpoints"] {
        for ending in ["csv", "parquet"] {
            assert!(
                fixture
                    .path(&format!("reports/arena/{file}.{ending}"))
                    .is_file(),
                "{file}.{ending}"
            );
        }
    }
    let json = fixture.json_file("reports/arena/summary.json");
    assert_eq!(json["algorithms"][0]["pairs"], 40);
    let html = fixture.text("reports/arena/index.html");
    assert!(html.contains("<svg") && !html.contains("http://localhost"));
    assert!(
        fixture
            .path("reports/arena/run-1.rrd")
            .metadata()
            .unwrap()
            .len()
            > 100_000
    );

    // A second time: from the cache, and nothing of it is matched.
    let recordings = || {
        std::fs::read_dir(fixture.path("recordings"))
            .unwrap()
            .count()
    };
    assert_eq!(recordings(), 2);
    let again = fixture.run("score short.toml -q --rerun none");
    assert_says(
        &again,
        &["matched  nothing: all results were in the report"],
    );
    fixture.run("score short.toml -q --force");
    assert_eq!(recordings(), 2);
    assert!(fixture.path("reports/arena/run-2.rrd").exists());
}

#[test]
fn a_sweep_is_scored_as_so_many_algorithms_and_plotted_as_one() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 2);
    let sweep = "score short.toml --algo bm:uniqueness=0..20/10 --algo v3 --json";
    let json = fixture.json(sweep);
    let labels: Vec<_> = json["algorithms"]
        .as_array()
        .unwrap()
        .iter()
        .map(|a| a["algorithm"].clone())
        .collect();
    assert_eq!(
        labels,
        [
            "bm:uniqueness=0",
            "bm:uniqueness=10",
            "bm:uniqueness=20",
            "v3"
        ]
    );
    let html = fixture.text("reports/arena/index.html");
    assert!(html.contains("bm: uniqueness = 0") && !html.contains("v3: "));
    // The algorithm's colours follow its values. A heat map needs two parameters.
    let colors = ["rgb(0 114 178)", "rgb(213 94 0)"];
    let swatch = |(value, color): (&str, &str)| {
        format!("<span><i style=\"background: {color}\"></i>{value}</span>")
    };
    assert_says(
        &html,
        &[
            "bm: uniqueness:",
            &swatch(("0", colors[0])),
            &swatch(("20", colors[1])),
        ],
    );
    assert!(!html.contains("id=\"heat\""));
    // The page is as wide as its table, whose columns are those of the parameters, too.
    assert_says(&html, &["body { max-width: 85rem; }"]);
    let grid = "bm:uniqueness=0/20,block_size=5/9/13";
    fixture.run(&format!(
        "score short.toml -q --algo {grid} --algo v3 -o grid"
    ));
    let html = fixture.text("grid/index.html");
    let words = ["bm: right minus wrong, %", "body { max-width: 94rem; }"];
    assert_says(&html, &words);
    let (_, heat) = html.split_once("id=\"heat\"").unwrap();
    let (heat, _) = heat.split_once("</table>").unwrap();
    assert_eq!(
        (
            heat.matches("<td title=\"bm:").count(),
            heat.matches("<td></td>").count()
        ),
        (6, 1)
    );
    // A part of the grid leaves cells empty.
    fixture.run(&format!(
        "score short.toml -q --algo {grid} --sample 5 -o part"
    ));
    let html = fixture.text("part/index.html");
    let (_, heat) = html.split_once("id=\"heat\"").unwrap();
    let (heat, _) = heat.split_once("</table>").unwrap();
    assert_eq!(
        (
            heat.matches("<td title=\"bm:").count(),
            heat.matches("<td></td>").count()
        ),
        (5, 2)
    );
    let many = "score short.toml --algo bm:uniqueness=0..100/1,max_disparity=16..64/1";
    fixture
        .svl(many)
        .failed(2, &["4949 algorithms", "at most 1000", "--sample"]);
    fixture.fails("score short.toml --algo bm:uniqueness=0..9 => 2: FROM..TO/STEP");
}

#[test]
fn a_folder_with_anything_else_is_left_alone() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 2);
    fixture.write("mine/thesis.tex", "years of work");
    fixture.fails("score short.toml -o mine => 1: mine/thesis.tex | -o");
    fixture.write("file", "");
    fixture.fails("score short.toml -o file => 1: file: exists already, as something else");
}

#[test]
fn real_scenes_score_as_measured() {
    let Some(datasets) = datasets() else { return };
    let fixture = Fixture::new();
    let scenario = include_str!("../../../scenarios/middlebury.toml");
    fixture.write("middlebury.toml", scenario);
    let args = [
        "score",
        "middlebury.toml",
        "--data",
        &datasets.display().to_string(),
        "--json",
    ];
    let json = fixture.json(&args);
    let v3 = json["algorithms"]
        .as_array()
        .unwrap()
        .iter()
        .find(|a| a["algorithm"] == "v3")
        .unwrap();
    assert_eq!(v3["pairs"], 16);
    let coverage = v3["coverage"].as_f64().unwrap();
    assert!(
        (0.2..0.3).contains(&coverage),
        "the specification measured 0.25 on 21 scenes, here {coverage}"
    );
    // The result of v3 to the last cell and bit, so that any change of metric, truth or matcher is
    // detected.
    let cells =
        ["cells_right", "cells_wrong", "cells_unknown"].map(|key| v3[key].as_u64().unwrap());
    // Without a cell of Tsukuba, whose border without truth could hold half of another surface.
    assert_eq!(cells, [184, 22, 81]);
    // Scored by disparities: obstacles are not measured, so the number of missed ones is not 0.
    assert!(v3["missed"].is_null() && v3["false"].is_null());
    let page = fixture
        .path("reports/middlebury/index.html")
        .metadata()
        .unwrap()
        .len();
    assert!(page < 6_000_000, "the page has {page} bytes");
}

#[test]
fn a_gate_passes_v3_and_stops_a_worse_one() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 60);
    let text = fixture.text("short.toml");
    // A few frames have their own numbers.
    let limits = "[[gate]]\nalgorithm = \"v3\"\nmetric = \"passed\"\nmin = 0.9\n";
    fixture.write(
        "short.toml",
        format!("{}{limits}", &text[..text.find("[[gate]]").unwrap()]),
    );
    let text = fixture.run("score short.toml -q --gate --algo v3");
    assert_says(&text, &["pass          v3: frames passed 9"]);
    // Deliberately worse: near objects need more disparities than these.
    let gate = "score short.toml -q --gate --algo v3:max_disparity=24";
    let ran = fixture.svl(gate);
    assert_says(
        &ran.stdout,
        &["FAIL          v3:max_disparity=24: frames passed"],
    );
    let broken = "gate: v3:max_disparity=24: frames passed ";
    ran.failed(3, &[broken, ", at least 90.0 % (line "]);
    let json = fixture.svl(&format!("{gate} --json")).stdout;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["gate"][0]["state"], "fail", "{json}");
}

#[test]
fn a_run_outside_of_what_v5_was_fitted_to_is_told() {
    let fixture = Fixture::new();
    fixture.run("record --frames 2 -o a.mcap");
    let told = |options: &str| {
        let ran = fixture.svl(&format!("score a.mcap --rerun none --force -o r {options}"));
        let words = "v5's probabilities were not fitted to ";
        let found = ran.stderr.split(words).nth(1).map(str::to_owned);
        found.map(|words| words.split(", which").next().unwrap_or_default().to_owned())
    };
    assert_eq!(told("--algo v5"), None);
    let narrow = "a tolerance below 20 % or 0.1 m";
    assert_eq!(told("--algo v5 --tolerance 10%").as_deref(), Some(narrow));
    // The table for small cells was fitted to both.
    assert_eq!(told("--algo v5 --tolerance 0.05m,10% --cells 24x12"), None);
    let tiny = "cells smaller than those of 24x12 at 320 px";
    assert_eq!(told("--algo v5 --cells 64x48").as_deref(), Some(tiny));
    let near = "cells smaller than those of 5x3 at 320 px";
    assert_eq!(
        told("--algo v5:target=near --cells 24x12").as_deref(),
        Some(near)
    );
    assert_eq!(told("--algo v5:target=near"), None);
}

#[test]
fn unmeasured_numbers_are_not_zero() {
    let fixture = Fixture::new();
    fixture.write_pair("data/scene/im0.pgm", "data/scene/im1.pgm", (80, 60), 5);
    for (name, truth, scored) in [("empty", f32::INFINITY, false), ("exact", 5.0, true)] {
        let numbers = std::iter::repeat_n(truth, 80 * 60).flat_map(f32::to_le_bytes);
        let head = b"Pf\n80 60\n-1.0\n".iter().copied();
        fixture.write(
            "data/scene/disp0.pfm",
            head.chain(numbers).collect::<Vec<_>>(),
        );
        fixture.write(
            "s.toml",
            "name = \"s\"\nalgorithms = [\"bm:max_disparity=16\"]\n[cells]\njudge = \"disparity\"\n\
             tolerance_px = 2\n[source]\nkind = \"dataset\"\nscenes = [\"scene\"]\n\
             [[gate]]\nalgorithm = \"bm\"\nmetric = \"wrong\"\nmax = 0\n",
        );
        let line = format!("score s.toml --data data --rerun none --gate -o {name} --json");
        let ran = fixture.svl(&line);
        let json = ran.json();
        let algorithm = &json["algorithms"][0];
        let state = &json["gate"][0]["state"];
        if scored {
            assert_eq!(
                (ran.code, state),
                (Some(0), &"pass".into()),
                "{}",
                ran.stderr
            );
            assert_eq!(
                (&algorithm["scored_pairs"], &algorithm["cells_wrong"]),
                (&1.into(), &0.into())
            );
            assert!(algorithm["scored_cells"].as_u64() > Some(9), "{algorithm}");
        } else {
            assert_eq!(
                (ran.code, state),
                (Some(3), &"not-measured".into()),
                "{}",
                ran.stderr
            );
            assert_eq!(
                (&algorithm["scored_pairs"], &algorithm["scored_cells"]),
                (&0.into(), &0.into())
            );
            assert!(
                algorithm["cells_wrong"].is_null() && algorithm["right"].is_null(),
                "{algorithm}"
            );
            let warning = "no cell of 1 pair has enough of a ground truth";
            assert_says(&ran.stderr, &[warning]);
            let manifest = fixture.text(&format!("{name}/manifest.json"));
            let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
            assert!(
                manifest["warnings"].to_string().contains(warning),
                "{manifest}"
            );
        }
    }
    fixture.write_short_arena("short.toml", 2);
    let text = fixture.text("short.toml");
    let text = text.replacen(
        "algorithm = \"v3\"",
        "algorithm = \"v1:max_disparity=9\"",
        1,
    );
    fixture.write("other.toml", text);
    fixture.fails("score other.toml -q --gate --algo v3 => 2: 'v1:max_disparity=9' is neither");
    // A name that only the command line defines.
    let text = fixture.text("short.toml");
    let text = text.replacen("algorithm = \"v3\"", "algorithm = \"mine\"", 1);
    fixture.write("named.toml", text);
    fixture.fails("score named.toml -q => 2: 'mine' is neither");
    let named = fixture.svl("score named.toml -q --gate --algo mine=v3 -o named --json");
    let json = named.json();
    // Two frames show no checkpoint: the limit is checked, not skipped.
    assert_eq!(json["gate"][0]["state"], "not-measured", "{}", named.stderr);
}

#[test]
fn a_gate_that_judges_nothing_does_not_pass() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 2);
    fixture.fails("score short.toml -q --gate --algo dp => 2: none of the scenario's limits");
    let text = fixture.text("short.toml");
    fixture.write("none.toml", &text[..text.find("[[gate]]").unwrap()]);
    fixture.fails("score none.toml --gate => 2: has no [[gate]]");
    fixture.write("bad.toml", text.replace("max = 0.04", "max = 7.5"));
    fixture.fails("score bad.toml --gate => 1: gate in line | 5 % is 0.05");
}

#[test]
fn truth_is_the_best_line_and_checks_the_checkpoints() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 60);
    let json = fixture.json("score short.toml -q --json --algo truth --algo v3 -o both");
    let right = |i: usize| {
        let all = &json["algorithms"][i]["areas"]["all"];
        all["cells_right"].as_u64().unwrap()
    };
    assert!(right(0) > 1790 && right(1) < right(0), "{json}");
    // An algorithm that does not see an obstacle does not miss it.
    assert_says(
        &fixture.text("both/index.html"),
        &["near found %", "near missed"],
    );
    fixture.run("score short.toml -q --check");
    assert!(fixture.path("reports/arena-check/index.html").exists());
    // A range in which no obstacle is visible.
    let near = "score short.toml --algo truth:max_disparity=8 --algo bm:max_disparity=8 -o near";
    assert_says(
        &fixture.svl(near).stderr,
        &["truth:max_disparity=8, bm:max_disparity=8: max_disparity sees nothing nearer than"],
    );
    // Nothing is that near.
    let impossible = "[[checkpoint]]\nnumber = 7\nname = \"impossible\"\nframes = [0, 3]\n\
                      [[checkpoint.cell]]\nat = [2, 1]\nnearer_m = 0.05\n\n[[checkpoint]]";
    let text = fixture.text("short.toml");
    let text = text.replacen("[[checkpoint]]", impossible, 1);
    fixture.write("wrong.toml", text);
    let wrong = "score wrong.toml -q --check -o wrong => 3: \
                 even the truth fails checkpoint 7 impossible in 8 of 8 frames";
    fixture.fails(wrong);
    fixture.write_pair("left/1.pgm", "right/1.pgm", (64, 48), 4);
    let without = "
        score . --check -q -o none => 3: no checkpoint is scored
        score short.toml --check --gate => 2: cannot be used with
    ";
    fixture.fails(without);
}

#[test]
fn other_seeds_are_scored_and_said() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 2);
    fixture.run("score short.toml -q --seeds 7,9..10 --algo v3 --rerun none -o r");
    let rows = fixture.text("r/rows.csv");
    let mut rows = csv::Reader::from_reader(rows.as_bytes());
    let seed = rows
        .headers()
        .unwrap()
        .iter()
        .position(|head| head == "seed")
        .unwrap();
    let seeds: Vec<_> = rows
        .records()
        .map(|row| row.unwrap()[seed].to_owned())
        .collect();
    assert_eq!(seeds, ["7", "7", "9", "9", "10", "10"]);
    let page = fixture.text("r/index.html");
    assert_says(&page, &["seeds 7, 9, 10"]);
}

#[test]
fn a_limit_names_an_algorithm_by_its_label() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 4);
    let gate = "[[gate]]\nalgorithm = \"fast\"\nmetric = \"wrong\"\nmax = 0.99\n";
    let text = fixture.text("short.toml");
    let is_own = |line: &&str| !line.starts_with("algorithms = ");
    let rest: Vec<_> = text
        .lines()
        .filter(is_own)
        .take_while(|line| *line != "[[gate]]")
        .collect();
    let named = "algorithms = [\"fast=v3:max_disparity=48\"]";
    let text = [&[named], &rest[..], &[gate]].concat();
    fixture.write("label.toml", text.join("\n"));
    let text = fixture.run("score label.toml -q --gate -o r --rerun none");
    assert_says(&text, &["pass", "fast: "]);
}

#[test]
fn the_safe_choice_decides_the_cells_of_any_map() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("median.toml", 40);
    let median = fixture.text("median.toml");
    let safe = |decision: &str| {
        let with = format!("[grid]\ndecision = \"{decision}\"\n");
        median.replacen("[grid]\n", &with, 1)
    };
    fixture.write("safe.toml", safe("safe"));
    fixture.write("mean.toml", safe("mean"));
    let cells = |scenario: &str| {
        let json = fixture.json(&format!(
            "score {scenario} -q --json --algo sgm:speckle_size=0 --algo v5 -o {scenario}.report"
        ));
        let number = |i: usize, key: &str| json["algorithms"][i][key].as_u64().unwrap();
        [0, 1].map(|i| ["cells_right", "cells_wrong"].map(|key| number(i, key)))
    };
    let ([median_sgm, median_v5], [safe_sgm, safe_v5]) = (cells("median.toml"), cells("safe.toml"));
    assert_eq!(median_v5, safe_v5, "v5 decides by itself");
    assert!(
        2 * safe_sgm[1] < median_sgm[1] && 10 * safe_sgm[0] > 9 * median_sgm[0],
        "{median_sgm:?} {safe_sgm:?}"
    );
    // With a probability in every row of a cell that has a report.
    let table = fixture.text("safe.toml.report/cells.csv");
    let mut table = csv::Reader::from_reader(table.as_bytes());
    let heads = table.headers().unwrap().clone();
    let place = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let [algorithm, state, probability] = ["algorithm", "state", "probability"].map(place);
    let lines: Vec<_> = table.records().map(Result::unwrap).collect();
    let with = lines.iter().filter(|line| !line[probability].is_empty());
    assert!(10 * with.count() > 9 * lines.len());
    for line in lines {
        let has_report = &line[state] != "unknown";
        assert!(
            !has_report || !line[probability].is_empty(),
            "{}",
            &line[algorithm]
        );
    }
    fixture.fails("score mean.toml -q => 1: mean.toml: line | unknown variant `mean`");
}

#[test]
fn a_folder_is_a_report_only_with_its_manifest() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 2);
    fixture.write("site/index.html", "my homepage");
    let wrong = "
        score short.toml -o site => 1: site: contains files but no report.json | -o
        reproduce 5.5 -o site => 1: site: contains files but no reproduce.json
    ";
    fixture.fails(wrong);
    assert_eq!(fixture.text("site/index.html"), "my homepage");
}

#[test]
fn changed_pairs_are_read_again_up_to_an_error() {
    let fixture = Fixture::new();
    for scene in ["s", "t"] {
        std::fs::create_dir_all(fixture.path("d").join(scene)).unwrap();
        let [left, right] = [0, 1].map(|i| format!("d/{scene}/im{i}.pgm"));
        fixture.write_pair(&left, &right, (64, 48), 4);
    }
    let text = "name = \"m\"\ndescription = \"\"\nalgorithms = [\"v3\"]\n[cells]\njudge = \
                \"disparity\"\ntolerance_px = 2.0\n[source]\nkind = \"dataset\"\nscenes = \
                [\"s\", \"t\"]\n";
    fixture.write("m.toml", text);
    let score = || fixture.svl("score m.toml --data d -q");
    score().done();
    let rows = |folder: &str| fixture.text(&format!("reports/{folder}/rows.csv"));
    let earlier = rows("m");
    fixture.write_pair("other0.pgm", "d/t/im1.pgm", (32, 48), 4);
    score().failed(1, &["64x48", "32x48"]);
    assert!(!fixture.path("reports/m.earlier-1").exists());
    assert!(rows("m").lines().count() < earlier.lines().count());
}
