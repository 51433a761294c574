//! `svl compare`.

use super::fixture::{Fixture, assert_says, datasets};
use super::transcript::{assert_words, plain};
use serde_json::Value;
use std::cmp::Ordering::{Equal, Greater, Less};

/// The number of equal results of the first algorithm, in the JSON of a comparison.
const EQUAL: &str = "/0/algorithms/0/equal_results";

/// The edit of a scenario that scores cells by another rule.
const OTHER_TOLERANCE: [&str; 2] = ["[cells]\n", "[cells]\ntolerance_m = 0.2\n"];

/// A short arena scored by each of these algorithms, once for all tests, in a folder of that
/// number.
fn scored(algorithms: &[&str]) -> Fixture {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 40);
    for (i, names) in algorithms.iter().enumerate() {
        fixture.write_made("r", &format!("short arena by {names}"), |fixture| {
            fixture.write_recorded_arena("short.toml", 40);
            fixture.run(&format!(
                "score short.toml -q --rerun none -o r --algo {names}"
            ));
        });
        std::fs::rename(fixture.path("r"), fixture.path(&i.to_string())).unwrap();
    }
    fixture
}

#[test]
fn one_algorithm_each_is_compared_whatever_it_is_called() {
    let fixture = scored(&["v1", "v3"]);
    let text = fixture.run("compare 0 1");
    assert_says(&text, &["v1 → v3: 80 pairs, 0 with equal results"]);
    let wrong = text.lines().find(|line| line.starts_with("wrong cells"));
    assert!(wrong.unwrap().ends_with("better"), "{text}");
    // Times from different moments are not compared.
    let time = text.lines().find(|line| line.contains("median time"));
    assert_words(time.unwrap(), "x ..  | !better | !WORSE");
}

#[test]
fn equal_runs_are_equal_and_json_says_all() {
    let fixture = scored(&["v3 --algo bm", "v1 --algo v3"]);
    fixture.transcript(
        "compare 0 1 --json => /0/algorithms/0/pairs = 80 | /0/algorithms/0/equal_results = 80 \
         | /0/only_in_base = [\"bm\"] | /0/only_in_other = [\"v1\"]",
    );
    let json = fixture.json("compare 0 1 --json");
    let metrics = json[0]["algorithms"][0]["metrics"].as_array().unwrap();
    let is_equal = |m: &Value| m["metric"] == "time" || m["judgement"] == "equal";
    assert!(metrics.iter().all(is_equal), "{json}");
}

#[test]
fn runs_with_other_cell_rules_are_not_compared() {
    let fixture = scored(&["v1"]);
    fixture.edit("short.toml", "one.toml", &[OTHER_TOLERANCE]);
    // Checkpoints are summed over the runs that both have, so equal results are equal there too.
    fixture.transcript(
        "score one.toml --seeds 2 -q --algo v1 -o 1
        compare 0 1 => not comparable: scored differently (cells.tolerance_m: 0.1 and 0.2) \
        | not compared: 40 pairs of v1 in one report alone
        score one.toml --seeds 2 -q --algo v3 -o 2
        compare 0 2 => v1 → v3 | 0 with equal results | !  better\\n | !  WORSE\\n | !  differs\\n
        compare 0 1 --json => /0/algorithms/0/checkpoints/*/judgement = equal",
    );
}

#[test]
fn runs_without_common_data_are_not_compared() {
    let fixture = scored(&["v3 --algo bm", "v1 --algo v2"]);
    fixture.transcript(
        "compare 0 1 => 4: nothing was compared: 0 and 1: no algorithm in common (v3, bm; v1, v2)
        compare 0 1 --json => 4: nothing was compared: 0 and 1: no algorithm in common
        compare 0 missing => 1: missing: is not a report
        compare 0 => 2: see --help
        score short.toml --seeds 3 -q --algo v3 -o 2
        compare 0 2 => 4: no pair in common | other scenarios, seeds",
    );
    // Parts that are not compared come first, also beside others that are.
    let some = fixture.svl("compare 0 2 0#v3");
    let first = "not comparable: 0 and 2: no pair in common";
    assert!(some.stdout.starts_with(first), "{}", some.stdout);
    assert_says(&some.stdout, &["\nnot compared: bm, only in 0\nbefore 0\n"]);
    some.failed(4, &["nothing was compared: 0 and 2"]);
    let whole = "\"complete\",\n  \"incomplete\": null";
    let stopped = "\"failed\",\n  \"incomplete\": \"stopped\"";
    fixture.edit("2/summary.json", "2/summary.json", &[[whole, stopped]]);
    fixture.write("0/rows.csv", "run_id,scenario\na,b\n");
    fixture.transcript(
        "compare 2 2 => 2 is incomplete: stopped
        compare 0 1 => 1: 0/rows.csv",
    );
}

/// Answers pairs of 40x20 pixels with zeros, but refuses the pair with that number.
#[cfg(unix)]
fn refusing(number: usize) -> String {
    r#"
i=0
while read -r line; do
  i=$((i+1))
  dd bs=1 count=1600 of=/dev/null 2>/dev/null
  if [ $i = NUMBER ]; then echo '{"seq":'$i',"error":"too dark"}'; continue; fi
  echo '{"seq":'$i',"millis":2}'
  head -c 3200 /dev/zero
done
"#
    .replace("NUMBER", &number.to_string())
}

#[cfg(unix)]
#[test]
fn pairs_that_fail_anew_are_worse() {
    let fixture = Fixture::new();
    for i in 0..5 {
        let [left, right] = ["left", "right"].map(|side| format!("pairs/{side}_{i}.pgm"));
        fixture.write_pair(&left, &right, (40, 20), 3 + i);
    }
    let score = "score pairs -q --rerun none --algo 'some=exec:command=sh program.sh'";
    let bm = "--algo bm:max_disparity=8";
    let scored = |out: &str, program: &str, more: &str| {
        fixture.write("program.sh", program);
        fixture.run(&format!("{score} --allow-loss 100% -o {out} {more}"));
    };
    scored("a", &refusing(99), bm);
    scored("b", &refusing(3), bm);
    scored("c", "exit 1", bm);
    scored("alone", "exit 1", "");
    // The loss is allowed; a report without any pair tells nothing.
    fixture.transcript(
        "compare a#some b#some
        compare a#some c#some --fail-on worse => 3: some: pairs: no pair in common
        compare a#some alone#some --fail-on worse => 3: some: pairs: no pair in common",
    );
    for (other, pairs) in [("b", "1 pair"), ("c", "5 pairs"), ("alone", "5 pairs")] {
        let words =
            format!("failed on {pairs} that the base has results for, as allow_loss allows");
        for format in ["", " --markdown"] {
            // Markdown escapes underscores.
            let compared = fixture.svl(&format!("compare a {other}{format}"));
            let text = compared.stdout.replace('\\', "");
            assert_words(&text, &words);
            if other == "alone" {
                assert_words(&text, "no pair of both; some failed");
                compared.failed(4, &["nothing was compared"]);
            } else {
                assert!(compared.stderr.is_empty(), "{}", compared.stderr);
            }
        }
        let json = fixture.svl(&format!("compare a {other} --json")).stdout;
        let failed = pairs.split(' ').next().unwrap();
        assert_words(&json, &format!("/0/algorithms/0/newly_failed = {failed}"));
    }
    // Losses of an algorithm refuse no gate of another one. The reverse is not worse: the common
    // pairs are equal. Having nothing to compare does not count as equal.
    fixture.write("program.sh", refusing(3));
    fixture.transcript(&format!(
        "{score} -o lossy {bm} => 4: some failed on 1 of 5 pairs
        compare a#bm:max_disparity=8 lossy#bm:max_disparity=8
        compare a#some lossy#some --fail-on worse => 3: lossy#some: is incomplete
        compare b a
        compare c#some alone#some --fail-on worse => 3: c#some: has no result of some
        compare c c --fail-on worse => 3: some: pairs: no pair in common"
    ));
}

#[test]
fn algorithms_of_a_report_and_mapped_ones_are_compared() {
    let fixture = scored(&["v3 --algo bm", "v3:smoothing_sigma=0 --algo bm"]);
    // Other parameters change the label, and not what it is compared with. One that is mapped away
    // from its namesake is not dropped in silence.
    fixture.transcript(
        "compare 0#v3 0#bm => v3 → bm:  | before 0#v3 | thread | !Different:
        compare 0 1 => v3 → v3:smoothing_sigma=0  | \\nbm   | !not compared
        compare 0 0 --map v3=bm => v3 → bm:  | not compared: v3, bm, whose namesake --map names
        compare 0#v3 1#bm 1#v3:smoothing_sigma=0 --map v3=v3 => 1: --map v3=v3: expected BASE=OTHER
        compare 0#v4 0 => 1: 0#v4: the report has no algorithm 'v4'; it has v3, bm
        compare 0 1 --map v3=v4 => 1: --map v3=v4: expected BASE=OTHER
        compare 0 1 --fail-on better => 2: expected worse
        compare 0 1 --fail-on worse:nothing => 2: there is no metric 'nothing' | columns metrics",
    );
    let page = fixture.run("compare 0#v3 0#bm --markdown");
    assert_says(&page, &["| wrong cells |", "|---|---:|"]);
    assert!(
        page.starts_with("**") && page.lines().count() <= 10,
        "{page}"
    );
}

#[test]
fn worse_metrics_fail_and_are_in_junits_xml() {
    let fixture = scored(&["v3", "v3"]);
    fixture.transcript(
        "compare 0 1 --fail-on worse --junit equal.xml
        cat equal.xml => failures=\"0\" \
        | name=\"v3: pairs\"><system-out>80 pairs, 80 with equal results</system-out> \
        | name=\"v3: wrong cells\"><system-out>",
    );
    // A matcher that reports nearly nothing loses right cells on every pair. The tests of several
    // reports have different names. Two pairs tell nothing: a CI server must not take that for
    // passed.
    let fixture = scored(&["v3", "v3:max_disparity=4"]);
    fixture.write_short_arena("tiny.toml", 2);
    fixture.transcript(
        "compare 0 1 --fail-on worse:right --junit worse.xml => 3: right cells: became worse
        cat worse.xml => failures=\"1\" | name=\"v3 → v3:max_disparity=4: right cells\"><failure
        compare 0 1 --fail-on worse --junit worse.xml => 1: worse.xml: exists already
        compare 0 0 0#v3 --fail-on worse:right --junit several.xml
        cat several.xml => name=\"0: v3: pairs\" | name=\"0#v3: v3: pairs\"
        score tiny.toml --algo v3 --algo v1 --rerun none -q -o few
        compare few#v3 few#v1 --fail-on worse --junit few.xml => 3: too few independent pairs
        cat few.xml => skipped=\"0\" | !failures=\"0\"",
    );
}

#[test]
fn checkpoints_of_few_frames_have_values_and_no_interval() {
    let fixture = scored(&["v3", "v3:max_disparity=4"]);
    let few = "/0/algorithms/0/checkpoints/too-few";
    fixture.transcript(&format!(
        "compare 0 1 --json => {few}/interval = null | {few}/base > -1
        compare 0 1 -o page.html
        cat page.html => too few frames
        compare 0 1 --columns all => too few frames"
    ));
    let junit = "compare 0 1 --fail-on worse:passed --junit few.xml";
    assert_words(&fixture.svl(junit).stdout, "too few frames");
    assert_words(&fixture.text("few.xml"), "too few frames");
}

#[test]
fn the_metrics_of_cells_are_compared_as_the_reports_have_them() {
    let fixture = scored(&["v3", "v1"]);
    let columns = "bias_m rmse_m median_error_m abs_rel noise_m flicker".split(' ');
    let names = "bias rmse median_error abs_rel noise flicker".split(' ');
    let json = fixture.json("compare 0 1 --json");
    let changes = json[0]["algorithms"][0]["metrics"].as_array().unwrap();
    for (name, column) in names.zip(columns) {
        let change = changes.iter().find(|c| c["metric"] == name).unwrap();
        for (key, folder) in ["base", "other"].iter().zip(["0", "1"]) {
            let report = fixture.column(&format!("{folder}/summary.csv"), column);
            let expected: f64 = report[0].parse().unwrap();
            let value = change[*key].as_f64().unwrap();
            assert!(
                (value - expected).abs() < 1e-6,
                "{name}: {value} {expected}"
            );
        }
        let [low, high] = [0, 1].map(|i| change["interval"][i].as_f64());
        let difference = change["difference"].as_f64().unwrap();
        let interval = low.zip(high);
        let is_within = interval.map(|(low, high)| low <= difference && difference <= high);
        // Too few cells are at rest in two successive pairs.
        let is_over_time = ["noise", "flicker"].contains(&name);
        assert!(is_within.unwrap_or(is_over_time), "{change}");
    }
    // Nearer to 0 is better, from either side.
    let bias = changes.iter().find(|c| c["metric"] == "bias").unwrap();
    let [before, after] = ["base", "other"].map(|key| bias[key].as_f64().unwrap().abs());
    let difference = bias["difference"].as_f64().unwrap();
    assert!((after - before - difference).abs() < 1e-9, "{bias}");
    let opposite = if difference > 0.0 { "better" } else { "worse" };
    assert_ne!(bias["judgement"], opposite);
    // v1 reports wrong distances where v3 reports none, so all errors are larger. Without cells all
    // else is compared, and what is not is said, also beside a metric that both measure.
    let unmeasured = "RMSE of distances: is not measured in both reports";
    fixture.transcript(&format!(
        "compare 0 1 --fail-on worse:abs_rel => 3: mean relative error of distances: became worse
        compare 1 0 --fail-on worse:abs_rel --fail-on worse:flicker
        rm 1/cells.csv
        compare 0 1 -o x.html => wrong cells \
        | not compared: errors of distances: 1 has no cells.csv; `svl report 1` makes it
        compare 0 1 --columns right,rmse => right cells | 1 has no cells.csv
        compare 0 1 --columns rmse,bias => !metric \
        => 4~ error: nothing was compared: errors of distances: 1 has no cells.csv; `svl report 1`
        cat x.html => A report has no table of cells
        compare 0 1 --fail-on worse:rmse => 3: {unmeasured}
        compare 0 1 --fail-on worse:rmse --fail-on worse:false => 3: {unmeasured}"
    ));
}

#[test]
fn the_page_says_what_changed_on_which_frame_and_how_real_it_is() {
    let fixture = scored(&["v3 --algo bm", "v3:max_disparity=4 --algo bm"]);
    // Each frame is shown before, after and in truth. The images that the folders lack are rendered
    // again. Of frames that both reports show are the pictures of disparities and errors.
    fixture.transcript(
        "compare 0 1 -o page.html => page   page.html\\n
        cat page.html => v3 → v3:max_disparity=4 \
        | <strong class=\"worse\">worse</strong>: v3 → v3:max_disparity=4 right cells  \
        | real at 95\u{a0}% (Holm) over 80 pairs | <td class=\"bad text\">WORSE</td> \
        | Frames that changed most | <p class=\"label\">truth</p> |  → unknown, true  \
        | class=\"changed\" | 80 pairs, 80 with equal results | points; exact \
        | The results of all frames are equal. | svg class=\"interval\" \
        | data-frame=\"1&#x2f; | data-is=\"worse | data-is=\"better \
        | aria-label=\"v3: disparity\" \
        | aria-label=\"v3:max_disparity=4: error\" \
        | has only the rows of this frame | !stand alone | !http",
    );
    let page = fixture.text("page.html");
    let reason = |change: &str| {
        let (_, reason) = page.split_once(&format!("\">{change}</span>: ")).unwrap();
        reason.split('<').next().unwrap()
    };
    assert!(reason("worse").starts_with("right cells "));
    assert!(reason("better").starts_with("missed near obstacles "));
    // The numbers are those of the rows.
    let counts = |key: &str| -> Vec<[f64; 3]> {
        let column = |name: &str| fixture.column(&format!("{key}/rows.csv"), name);
        let labels = column("algorithm");
        let columns = ["missed", "false", "cells_wrong", "cells_right"].map(column);
        let row = |i: usize| {
            columns
                .each_ref()
                .map(|cells| cells[i].parse::<f64>().unwrap())
        };
        let own = (0..labels.len()).filter(|i| labels[*i].starts_with("v3"));
        let harm = own
            .map(row)
            .map(|[missed, falsely, wrong, right]| [missed, falsely, wrong - right]);
        harm.collect()
    };
    let both = counts("0").into_iter().zip(counts("1"));
    let changes: Vec<_> = both.map(|(a, b)| b.partial_cmp(&a).unwrap()).collect();
    let count = |order| changes.iter().filter(|own| **own == order).count();
    let [better, equal, worse] = [Less, Equal, Greater].map(count);
    assert!(better > 0 && worse > 0 && better + equal + worse == 80);
    assert_words(
        &fixture.run("compare 0#v3 1#v3:max_disparity=4 --json"),
        &format!(
            "/0/algorithms/0/frames/better = {better} | /0/algorithms/0/frames/equal = {equal} \
             | /0/algorithms/0/frames/worse = {worse} | /0/algorithms/0/frames/unscored = 0"
        ),
    );
    let words = format!("{better} frames better, {equal} equal, {worse} worse");
    fixture.transcript(&format!(
        "compare 0#v3 1#v3:max_disparity=4 => {words}
        compare 0 1 --markdown => v3:max\\_disparity=4: {words} | points
        cat page.html => {worse} worse</button> | {better} better</button> | {equal} equal</button>"
    ));
    // Algorithms that are not compared come before all else, with the cure.
    fixture.transcript(
        "score short.toml -q --algo v3:max_disparity=4 --algo sgm -o 2 --rerun none
        compare 0 2 -o page.html --force
        cat page.html => --map BASE=OTHER compares algorithms of other names",
    );
    let page = fixture.text("page.html");
    let [verdict, not_compared, table] = ["</strong>", "not compared: bm", "<table>"]
        .map(|text| page.find(text).unwrap_or_else(|| panic!("{text}")));
    assert!(verdict < not_compared && not_compared < table);
}

#[test]
fn several_namesakes_are_not_compared_and_the_first_line_says_so() {
    let fixture = scored(&[
        "v3 --algo bm",
        "v3:max_disparity=4 --algo v3:max_disparity=8 --algo bm",
    ]);
    let words = "v3 was not compared: of v3:max_disparity=4, v3:max_disparity=8 any may be it; \
                 --map BASE=OTHER";
    for (more, first) in [("", "no change: "), (" --markdown", "**no change**: ")] {
        let text = plain(&fixture.run(&format!("compare 0 1{more}")));
        assert!(text.starts_with(first), "{text}");
        let [cure, rest] = [words, "not compared: v3, only in 0"].map(|words| text.find(words));
        assert!(cure < rest, "{text}");
    }
    fixture.fails("compare 0 1 --fail-on worse => 3: v3: pairs: is not in 1");
}

#[test]
fn few_pairs_in_common_are_the_first_line_and_fail() {
    let fixture = scored(&["v3"]);
    // 1 of 80 pairs, and one of two recordings.
    fixture.run("score short.toml -q --algo v3 -o one --rerun none --seeds 1 --every 40");
    fixture.run("score short.toml -q --algo v3 -o half --rerun none --seeds 1");
    for (other, pairs) in [("one", "1"), ("half", "40")] {
        let words = format!(
            "few in common: {pairs} of the base's 80 pairs of v3, fewer than 90 % (--min-common); \
             of these no change: the results of {pairs} pair"
        );
        let text = plain(&fixture.run(&format!("compare 0 {other}")));
        assert!(text.starts_with(&words), "{text:?}");
        let markdown = fixture.run(&format!("compare 0 {other} --markdown"));
        assert!(markdown.starts_with("**few in common**: "), "{markdown}");
        // More pairs than those of the base are no loss.
        fixture.transcript(&format!(
            "compare 0 {other} --fail-on worse => 3: v3: pairs:  |  (--min-common)
            compare {other} 0"
        ));
    }
    fixture.transcript(
        "compare 0 half --fail-on worse --min-common 50%
        compare 0 half --min-common 0.9 => 2: expected a percentage, as 90%",
    );
}

#[test]
fn checkpoints_are_tested_by_name_alone() {
    let fixture = scored(&["v3", "v3:max_disparity=4"]);
    let cases = |fail_on: &str| {
        let line = format!("compare 0 1 --fail-on {fail_on} --junit j.xml --force");
        let _ = fixture.svl(&line);
        let xml = fixture.text("j.xml");
        let names = xml.split("name=\"").skip(2);
        let names = names.filter_map(|rest| rest.split('"').next()?.split_once(": "));
        names.map(|(_, name)| name.to_owned()).collect::<Vec<_>>()
    };
    let deciding = "pairs, right cells, wrong cells, missed near obstacles, false near obstacles, \
                    found near obstacles";
    assert_eq!(cases("worse").join(", "), deciding);
    let passed = cases("worse:passed");
    let is_checkpoint = |name: &String| name.starts_with("checkpoint ");
    assert!(passed[1..].iter().all(is_checkpoint), "{passed:?}");
    fixture.transcript("compare 0 1 --json => /0/tested < 6");
}

#[test]
fn a_metric_that_the_other_report_does_not_measure_fails() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 40);
    let text = fixture.text("short.toml");
    let limits = text.split("[[gate]]").next().unwrap();
    let gate = "[[gate]]\nalgorithm = \"v3\"\nmetric = \"missed\"\nmax = 0\n";
    // Nothing is nearer than a centimetre: nothing is missed, and that is no result.
    let cells = "[cells]\nobstacle_m = 0.01\nclear_m = 0.3\n";
    fixture.write("none.toml", limits.replace("[cells]\n", cells) + gate);
    fixture.transcript(
        "score none.toml -q --gate --algo v3 --rerun none -o 0 --json \
        => /gate/0/state = not-measured | /algorithms/0/missed = null \
        | /algorithms/0/cases/missed/cells = 0 \
        => 3: rests on 0 near obstacles, and needs 1 near obstacle
        compare 0 0 --fail-on worse:missed \
        => 3: missed near obstacles: is not measured: it rests on 0 near obstacles
        compare 0 0 --fail-on worse",
    );
    // The share stands under the name of its metric, with its cells.
    let v3 = &fixture.json_file("0/summary.json")["algorithms"][0];
    let [right, cells] =
        [&v3["right"], &v3["cases"]["right"]["cells"]].map(|n| n.as_f64().unwrap());
    assert_eq!(right * cells, v3["cells_right"].as_f64().unwrap());
}

#[test]
fn a_trend_has_a_line_per_algorithm_with_its_intervals() {
    let fixture = scored(&["v3", "v3 --algo bm", "v3:max_disparity=4 --algo v3"]);
    fixture.transcript(
        "compare 0 1 2 -o trend.html
        cat trend.html => 3 reports, the newest last | over 80 pairs | <h2>Reports</h2> \
        | >3 2</th> | !<script | !other settings:
        compare 0 1 2 -o trend.json
        cat trend.json => /reports = [\"0\", \"1\", \"2\"]",
    );
    let page = fixture.text("trend.html");
    assert!(page.matches("<svg class=\"plot\"").count() >= 6, "{page}");
    let trend = fixture.json_file("trend.json");
    let lines = trend["lines"].as_array().unwrap();
    let right = |label: &str| {
        let is_own = |line: &&Value| line["metric"] == "right" && line["algorithm"] == label;
        let own = lines.iter().find(is_own);
        own.unwrap()["points"].clone()
    };
    let (v3, bm) = (right("v3"), right("bm"));
    assert_eq!((&v3[0], &bm[0]), (&v3[2], &Value::Null));
    let summary = fixture.json_file("0/summary.json");
    let point = &v3[0];
    assert_eq!(point["value"], summary["algorithms"][0]["right"]);
    assert_eq!(point["cases"], summary["algorithms"][0]["cases"]["right"]);
    let [low, high] = [0, 1].map(|i| point["interval"][i].as_f64().unwrap());
    assert!((low..high).contains(&point["value"].as_f64().unwrap()));
    // A report of other pairs empties no other's line, and one of other rules has a caution.
    fixture.write_short_arena("tiny.toml", 2);
    fixture.edit("tiny.toml", "tiny.toml", &[OTHER_TOLERANCE]);
    fixture.run("score tiny.toml --seeds 3 --algo v3 --rerun none -o other -q");
    drop(fixture.svl("compare 0 other 1 -o other.json"));
    fixture.transcript(
        "cat other.json => /reports = [\"0\", \"1\"] | /lines/# > 0 \
        | /cautions has other is left out: it shares no pair \
        | /cautions has other was scored differently (cells.tolerance_m: 0.1 and 0.2)",
    );
}

#[test]
fn a_line_of_a_trend_is_interrupted_where_settings_change() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 20);
    for (report, own) in [
        ("0", "v3"),
        ("1", "v3:max_disparity=8"),
        ("2", "v3:max_disparity=8"),
    ] {
        fixture.run(&format!(
            "score short.toml -q --rerun none -o {report} --algo own={own} --algo bm"
        ));
    }
    fixture.transcript(
        "compare 0 1 2 -o trend.json
        cat trend.json => /origins/# = 3
        compare 0 1 2 -o trend.html
        compare 2 1 0 -o back.json
        cat back.json => /cautions has not in the order of their dates",
    );
    let manifest = fixture.json_file("1/manifest.json");
    let began = manifest["began"].as_str().unwrap();
    let origin = &fixture.json_file("trend.json")["origins"][1];
    assert_eq!(origin["began"], began);
    assert_eq!(origin["git_revision"], manifest["git_revision"]);
    let date = began[..16].replace('T', " ");
    let page = fixture.text("trend.html");
    let trend = fixture.json_file("trend.json");
    let lines = trend["lines"].as_array().unwrap();
    let points = |label: &str| {
        let own = lines.iter().find(|line| line["algorithm"] == label);
        own.unwrap()["points"].as_array().unwrap()
    };
    let settings = |label| [0, 1, 2].map(|i| points(label)[i]["other_settings"].as_str());
    assert_eq!(settings("bm"), [None; 3]);
    let [None, Some(settings), None] = settings("own") else {
        panic!("{trend}");
    };
    assert!(
        settings.starts_with("max_disparity ") && settings.ends_with(" → 8"),
        "{settings}"
    );
    assert_words(&page, &format!("own: {settings} | >{date}</td>"));
    let right = page.split("aria-label=\"right cells, %\"").nth(1).unwrap();
    let right = right.split("</figure>").next().unwrap();
    let tips = |label: &str| right.matches(&format!("<title>{label}, {date}")).count();
    assert!(tips("own") > 0 && tips("bm") > 0, "{right}");
    assert_eq!(right.matches("other settings: max_disparity").count(), 1);
    // The line of bm has three points, that of the other one two.
    let lines = right.split("<polyline points=\"").skip(1);
    let lines = lines.filter(|line| line.contains("stroke-width=\"4\""));
    let lengths = lines.map(|line| line.split('"').next().unwrap().split(' ').count());
    let lengths: Vec<_> = lengths.collect();
    assert!(
        lengths.contains(&3) && lengths.iter().filter(|n| **n == 3).count() == 1,
        "{lengths:?}"
    );
}

#[test]
fn frames_of_another_programs_bag_are_decoded_again() {
    let fixture = Fixture::new();
    fixture.record("run.mcap", "arena --frames 90 --seed 7");
    // The reports keep few frames, and none where the folder of the units is gone.
    fixture.run("record run.mcap --ros2 -q -o bag.mcap");
    let truth = "--truth /truth/depth";
    fixture.run(&format!(
        "score bag.mcap {truth} -q --algo v3 --rerun none -o 0"
    ));
    fixture.run(&format!(
        "score bag.mcap {truth} -q --algo v3:max_disparity=8 --rerun none -o 1"
    ));
    for report in ["0", "1"] {
        std::fs::remove_dir_all(fixture.path(&format!("{report}/units"))).unwrap();
    }
    fixture.transcript(
        "compare 0 1 -q -o whole.html
        cat whole.html => <image id= | data:image/jpeg | !no image:
        mv bag.mcap elsewhere.mcap
        compare 0 1 -q -o moved.html
        cat moved.html => no image: bag.mcap is not there: it moved | !data:image/jpeg",
    );
}

#[test]
fn frames_of_an_own_recording_are_shown_as_long_as_it_is_there() {
    let fixture = Fixture::new();
    fixture.record("run.mcap", "arena --frames 60 --seed 7");
    // Another recording under its name has other pixels.
    fixture.record("other.mcap", "arena --frames 120 --seed 304");
    fixture.transcript(
        "score run.mcap -q --algo v3 --rerun none -o 0
        score run.mcap -q --algo v3:max_disparity=8 --rerun none -o 1
        compare 0 1 -q -o whole.html
        cat whole.html => <image id= | !no image:
        mv other.mcap run.mcap
        compare 0 1 -q -o without.html
        cat without.html => no image: run.mcap has other pixels there: it changed
        mv run.mcap elsewhere.mcap
        compare 0 1 -q -o moved.html
        cat moved.html => no image: run.mcap is not there: it moved",
    );
}

#[test]
fn other_pairs_before_each_pair_explain_a_history() {
    let fixture = Fixture::new();
    fixture.record("run.mcap", "arena --frames 60 --seed 7");
    let score = "score run.mcap -q --algo v5 --algo v5:target=near --algo bm --rerun none";
    let words = "the pairs before each pair differ, on which results of v5 depend: score both with \
                 equal --every";
    // Fewer pairs after the same ones change nothing.
    fixture.transcript(&format!(
        "{score} -o 0
        {score} --every 5 -o 1
        {score} --every 1 --to 1 -o 2
        compare 0 1 --markdown => {words}
        compare 0 1 -o page.html
        cat page.html => {words}
        compare 0 2 => !pairs before | equal to the bit"
    ));
    let text = plain(&fixture.run("compare 0 1"));
    let (sentences, _) = text.split_once("change right").unwrap();
    assert_says(sentences, &[words]);
    let json = fixture.json("compare 0 1 --json");
    assert_says(&json[0]["cautions"].to_string(), &[words]);
    // The first of the pairs in common alone has the same past.
    let algorithms = json[0]["algorithms"].as_array().unwrap();
    let numbers = algorithms.iter().map(|own| {
        let number = |key: &str| own[key].as_u64().unwrap();
        (number("other_past"), number("pairs"))
    });
    assert_eq!(numbers.collect::<Vec<_>>(), [(11, 12), (0, 12), (0, 12)]);
}

#[test]
fn a_seed_of_the_arena_is_compared_with_its_recording() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 40);
    let recordings = std::fs::read_dir(fixture.path("recordings")).unwrap();
    let mut files = recordings.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let file = files.find(|name| name.contains("seed1")).unwrap();
    fixture.transcript(&format!(
        "score short.toml --seeds 1 -q --rerun none --algo v3 -o seed
        cp recordings/{file} own.mcap
        score own.mcap -q --rerun none --algo v3 -o own"
    ));
    for folders in ["seed own", "own seed"] {
        // Errors are those of the cells of each report.
        fixture.transcript(&format!(
            "compare {folders} --json => {EQUAL} = 40 | /0/algorithms/0/pairs = 40 \
            | /0/algorithms/0/metrics/rmse/metric = rmse"
        ));
    }
}

#[test]
fn scenes_are_compared_by_their_names() {
    let Some(data) = datasets() else { return };
    let fixture = Fixture::new();
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/middlebury.toml");
    let data = data.canonicalize().unwrap();
    let score = format!(
        "score '{scenario}' --data '{}' --algo v3 -q --rerun none",
        data.display()
    );
    fixture.run(&format!("{score} --scenes tsukuba venus -o two"));
    fixture.run(&format!("{score} --scenes venus -o one"));
    for folders in ["two one", "one two"] {
        fixture.transcript(&format!(
            "compare {folders} --json => {EQUAL} = 1 | /0/algorithms/0/pairs = 1"
        ));
    }
}

#[test]
fn checkpoints_over_other_pairs_are_not_compared_and_said_to_be() {
    let fixture = scored(&["v3"]);
    let words = "not compared: checkpoints, which are counted over whole runs";
    fixture.transcript(&format!(
        "score short.toml --algo v3 --every 2 -q --rerun none -o 1
        compare 0 1 => {words}
        compare 0 0 => !{words}
        compare 0 1 --fail-on worse:unknown => 2: 'unknown' has no better direction"
    ));
}

#[test]
fn the_page_replaces_nothing_unasked() {
    let fixture = scored(&["v3", "v1"]);
    fixture.write("own.html", "mine");
    fixture.transcript(
        "score short.toml --seeds 3 -q --algo v3 --rerun none -o 2
        compare 0 1 -o own.html => 1: own.html: exists already | --force
        compare 0 1 -o page.txt => 2: page.txt: must end in .html
        compare 0 1 -q -o page.md
        cat page.md => wrong cells
        compare 0 1 --junit x.txt --fail-on worse => 2: x.txt: must end in .xml
        compare 0 1 -o missing/page.html => 1: missing: no such folder; create it first
        compare 0 1 -o 0/index.html --force => 2: 0/index.html: is in the folder of a report
        compare 0 2 -o own.html --force => 4: nothing was compared",
    );
    assert_eq!(fixture.text("own.html"), "mine");
    fixture.run("compare 0 1 -o own.html --force");
    assert!(fixture.text("own.html").starts_with("<!DOCTYPE html>"));
}
