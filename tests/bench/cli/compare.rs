//! `svl compare`.

use super::fixture::{Fixture, assert_says, datasets};

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
    let line = text
        .lines()
        .find(|line| line.starts_with("wrong cells"))
        .unwrap();
    assert!(line.ends_with("better"), "{line}");
    // Times from different moments are not compared.
    let time = text
        .lines()
        .find(|line| line.contains("median time"))
        .unwrap();
    assert!(
        time.contains("x .. ") && !time.contains("better") && !time.contains("WORSE"),
        "{time}"
    );
}

#[test]
fn equal_runs_are_equal_and_json_says_all() {
    let fixture = scored(&["v3 --algo bm", "v1 --algo v3"]);
    let json = fixture.json("compare 0 1 --json");
    let v3 = &json[0]["algorithms"][0];
    assert_eq!(
        (v3["pairs"].as_u64(), v3["equal_results"].as_u64()),
        (Some(80), Some(80))
    );
    let judgements = v3["metrics"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|m| m["metric"] != "time")
        .map(|m| &m["judgement"]);
    assert!(
        judgements.into_iter().all(|judgement| judgement == "equal"),
        "{v3}"
    );
    assert_eq!(json[0]["only_in_base"], serde_json::json!(["bm"]));
    assert_eq!(json[0]["only_in_other"], serde_json::json!(["v1"]));
}

#[test]
fn runs_with_other_cell_rules_are_not_compared() {
    let fixture = scored(&["v1"]);
    let text = fixture.text("short.toml");
    let text = text.replace("seeds = [1, 2]", "seeds = [2]");
    let text = text.replace("[cells]\n", "[cells]\ntolerance_m = 0.2\n");
    fixture.write("one.toml", text);
    fixture.run("score one.toml -q --algo v1 -o 1");
    let text = fixture.run("compare 0 1");
    assert_says(
        &text,
        &[
            "not comparable: scored differently (cells.tolerance_m: 0.1 and 0.2)",
            "not compared: 40 pairs of v1 in one report alone",
        ],
    );
    fixture.run("score one.toml -q --algo v3 -o 2");
    let text = fixture.run("compare 0 2");
    assert_says(&text, &["v1 → v3", "0 with equal results"]);
    assert!(
        ["  better\n", "  WORSE\n", "  differs\n"]
            .iter()
            .all(|word| !text.contains(word)),
        "{text}"
    );
    // Checkpoints are summed over the runs that both have, so equal results are equal there too.
    let json = fixture.json("compare 0 1 --json");
    let checkpoints = json[0]["algorithms"][0]["checkpoints"].as_array().unwrap();
    assert!(
        checkpoints.iter().all(|c| c["judgement"] == "equal"),
        "{checkpoints:?}"
    );
}

#[test]
fn runs_without_common_data_are_not_compared() {
    let fixture = scored(&["v3 --algo bm", "v1 --algo v2"]);
    let wrong = "
        compare 0 1 => 4: nothing was compared: 0 and 1: no algorithm in common (v3, bm; v1, v2)
        compare 0 1 --json => 4: nothing was compared: 0 and 1: no algorithm in common
        compare 0 missing => 1: missing: is not a report
        compare 0 => 2: see --help
    ";
    fixture.fails(wrong);
    fixture.write_short_arena("other.toml", 40);
    let text = fixture.text("other.toml");
    fixture.write("other.toml", text.replace("seeds = [1, 2]", "seeds = [3]"));
    fixture.run("score other.toml -q --algo v3 -o 2");
    fixture.fails("compare 0 2 => 4: no pair in common | other scenarios, seeds");
    // Parts that are not compared come first, also beside others that are.
    let some = fixture.svl("compare 0 2 0#v3");
    assert!(
        some.stdout
            .starts_with("not comparable: 0 and 2: no pair in common"),
        "{}",
        some.stdout
    );
    assert!(
        some.stdout
            .contains("\nnot compared: bm, only in 0\nbefore 0\n"),
        "{}",
        some.stdout
    );
    some.failed(4, &["nothing was compared: 0 and 2"]);
    let summary = fixture.text("2/summary.json");
    fixture.write(
        "2/summary.json",
        summary.replacen(
            "\"complete\",\n  \"incomplete\": null",
            "\"failed\",\n  \"incomplete\": \"stopped\"",
            1,
        ),
    );
    assert_says(&fixture.run("compare 2 2"), &["2 is incomplete: stopped"]);
    fixture.write("0/rows.csv", "run_id,scenario\na,b\n");
    fixture.svl("compare 0 1").failed(1, &["0/rows.csv"]);
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
    let score = |out: &str, program: &str, more: &[&str]| {
        fixture.write("program.sh", program);
        let line = [
            "score",
            "pairs",
            "-q",
            "--rerun",
            "none",
            "--allow-loss",
            "100%",
            "-o",
        ];
        let some = ["--algo", "some=exec:command=sh program.sh"];
        fixture.run(&[&line[..], &[out], &some, more].concat());
    };
    let bm = ["--algo", "bm:max_disparity=8"];
    score("a", &refusing(99), &bm);
    score("b", &refusing(3), &bm);
    score("c", "exit 1", &bm);
    score("alone", "exit 1", &[]);
    // The loss is allowed; a report without any pair tells nothing.
    fixture.run("compare a#some b#some --fail-on worse:unrivalled");
    for other in ["c", "alone"] {
        let none = fixture.svl(&format!("compare a#some {other}#some --fail-on worse"));
        none.failed(3, &["some: pairs: no pair in common"]);
    }
    for (other, pairs) in [("b", "1 pair"), ("c", "5 pairs"), ("alone", "5 pairs")] {
        let words =
            format!("failed on {pairs} that the base has results for, as allow_loss allows");
        for format in ["", " --markdown"] {
            // Markdown escapes underscores.
            let compared = fixture.svl(&format!("compare a {other}{format}"));
            let text = compared.stdout.replace('\\', "");
            let text: Vec<_> = text.split_whitespace().collect();
            assert_says(&text.join(" "), &[&words]);
            if other == "alone" {
                assert_says(&text.join(" "), &["no pair of both; some failed"]);
                compared.failed(4, &["nothing was compared"]);
            } else {
                assert!(compared.stderr.is_empty(), "{}", compared.stderr);
            }
        }
        let json = fixture.svl(&format!("compare a {other} --json")).stdout;
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        let failed = json[0]["algorithms"][0]["newly_failed"].to_string();
        assert!(pairs.starts_with(&failed), "{json}");
    }
    // Losses of an algorithm refuse no gate of another one.
    fixture.write("program.sh", refusing(3));
    let line = "score pairs -q --rerun none -o lossy --algo"
        .split(' ')
        .collect();
    let lossy = [line, vec!["some=exec:command=sh program.sh"], bm.to_vec()].concat();
    fixture
        .svl(&lossy)
        .failed(4, &["some failed on 1 of 5 pairs"]);
    let gate = |label: &str| format!("compare a#{label} lossy#{label} --fail-on worse:unrivalled");
    fixture.run(&gate("bm:max_disparity=8"));
    fixture
        .svl(&gate("some"))
        .failed(3, &["lossy#some: is incomplete"]);
    // The reverse is not worse: the common pairs are equal.
    fixture.run("compare b a --fail-on worse");
    // Having nothing to compare does not count as equal.
    fixture
        .svl("compare c#some alone#some --fail-on worse")
        .failed(3, &["c#some: has no result of some"]);
    fixture
        .svl("compare c c --fail-on worse")
        .failed(3, &["some: pairs: no pair in common"]);
}

#[test]
fn algorithms_of_a_report_and_mapped_ones_are_compared() {
    let fixture = scored(&["v3 --algo bm", "v3:smoothing_sigma=0 --algo bm"]);
    let text = fixture.run("compare 0#v3 0#bm");
    assert_says(&text, &["v3 → bm: ", "before 0#v3", "thread"]);
    assert!(!text.contains("Different:"), "{text}");
    // Other parameters change the label, and not what it is compared with.
    let text = fixture.run("compare 0 1");
    assert_says(&text, &["v3 → v3:smoothing_sigma=0 ", "\nbm  "]);
    assert!(!text.contains("not compared"), "{text}");
    // One that is mapped away from its namesake is not dropped in silence.
    let text = fixture.run("compare 0 0 --map v3=bm");
    let left_out = "not compared: v3, bm, whose namesake --map names";
    assert_says(&text, &[left_out, "v3 → bm: "]);
    let page = fixture.run("compare 0#v3 0#bm --markdown");
    assert_says(&page, &["| wrong cells |", "|---|---:|"]);
    assert!(
        page.starts_with("**") && page.lines().count() <= 10,
        "{page}"
    );
    fixture.fails(
        "
        compare 0#v3 1#bm 1#v3:smoothing_sigma=0 --map v3=v3 => 1: --map v3=v3: expected BASE=OTHER
        compare 0#v4 0 => 1: 0#v4: the report has no algorithm 'v4'; it has v3, bm
        compare 0 1 --map v3=v4 => 1: --map v3=v4: expected BASE=OTHER
        compare 0 1 --fail-on better => 2: expected worse
        compare 0 1 --fail-on worse:nothing => 2: there is no metric 'nothing' | columns metrics
        ",
    );
}

#[test]
fn worse_metrics_fail_and_are_in_junits_xml() {
    let fixture = scored(&["v3", "v3"]);
    fixture.run("compare 0 1 --fail-on worse --junit equal.xml");
    let xml = fixture.text("equal.xml");
    let words = [
        "failures=\"0\"",
        "name=\"v3: pairs\"><system-out>80 pairs, 80 with equal results</system-out>",
        "name=\"v3: wrong cells\"><system-out>",
    ];
    assert_says(&xml, &words);
    // A matcher that reports nearly nothing loses right cells on every pair.
    let fixture = scored(&["v3", "v3:max_disparity=4"]);
    let failing = "compare 0 1 --fail-on worse:right --junit worse.xml";
    fixture
        .svl(failing)
        .failed(3, &["right cells: became worse"]);
    let words = [
        "failures=\"1\"",
        "name=\"v3 → v3:max_disparity=4: right cells\"><failure",
    ];
    assert_says(&fixture.text("worse.xml"), &words);
    fixture.fails("compare 0 1 --fail-on worse --junit worse.xml => 1: worse.xml: exists already");
    // The tests of several reports have different names.
    fixture.run("compare 0 0 0#v3 --fail-on worse:right --junit several.xml");
    let words = ["name=\"0: v3: pairs\"", "name=\"0#v3: v3: pairs\""];
    assert_says(&fixture.text("several.xml"), &words);
    // Two pairs tell nothing: a CI server must not take that for passed.
    fixture.write_short_arena("tiny.toml", 2);
    fixture.run("score tiny.toml --algo v3 --algo v1 --rerun none -q -o few");
    let few = "compare few#v3 few#v1 --fail-on worse --junit few.xml";
    fixture.svl(few).failed(3, &["too few independent pairs"]);
    let xml = fixture.text("few.xml");
    assert!(
        xml.contains("skipped=\"0\"") && !xml.contains("failures=\"0\""),
        "{xml}"
    );
}

#[test]
fn checkpoints_of_few_frames_have_values_and_no_interval() {
    let fixture = scored(&["v3", "v3:max_disparity=4"]);
    let json = fixture.json("compare 0 1 --json");
    let checkpoints = json[0]["algorithms"][0]["checkpoints"].as_array().unwrap();
    let few = |c: &&serde_json::Value| c["judgement"] == "too-few";
    let found = checkpoints.iter().find(few).expect("80 frames show few");
    assert!(found["interval"].is_null() && found["base"].is_number());
    let words = "too few frames";
    fixture.run("compare 0 1 -o page.html");
    let junit = "compare 0 1 --fail-on worse:passed --junit few.xml";
    assert_says(&fixture.svl(junit).stdout, &[words]);
    let texts = [
        fixture.run("compare 0 1 --columns all"),
        fixture.text("page.html"),
        fixture.text("few.xml"),
    ];
    for text in &texts {
        assert_says(text, &[words]);
    }
}

#[test]
fn the_metrics_of_cells_are_compared_as_the_reports_have_them() {
    let fixture = scored(&["v3", "v1"]);
    let columns = "bias_m rmse_m median_error_m abs_rel noise_m flicker".split(' ');
    let names = "bias rmse median_error abs_rel noise flicker".split(' ');
    let json = fixture.json("compare 0 1 --json");
    let changes = json[0]["algorithms"][0]["metrics"].as_array().unwrap();
    let reports = ["0", "1"].map(|folder| fixture.text(&format!("{folder}/summary.csv")));
    for (name, column) in names.zip(columns) {
        let change = changes.iter().find(|c| c["metric"] == name).unwrap();
        for (key, report) in ["base", "other"].iter().zip(&reports) {
            let mut lines = report.lines().map(|line| line.split(','));
            let place = lines.next().unwrap().position(|own| own == column).unwrap();
            let expected: f64 = lines.next().unwrap().nth(place).unwrap().parse().unwrap();
            let value = change[*key].as_f64().unwrap();
            assert!(
                (value - expected).abs() < 1e-6,
                "{name}: {value} {expected}"
            );
        }
        let [low, high] = [0, 1].map(|i| change["interval"][i].as_f64());
        let difference = change["difference"].as_f64().unwrap();
        let is_within = low
            .zip(high)
            .map(|(low, high)| low <= difference && difference <= high);
        // Too few cells are at rest in two successive pairs.
        let is_over_time = ["noise", "flicker"].contains(&name);
        assert!(is_within.unwrap_or(is_over_time), "{change}");
    }
    // v1 reports wrong distances where v3 reports none, so all errors are larger.
    let failing = fixture.svl("compare 0 1 --fail-on worse:abs_rel");
    failing.failed(3, &["mean relative error of distances: became worse"]);
    fixture.run("compare 1 0 --fail-on worse:abs_rel --fail-on worse:flicker");
    // Nearer to 0 is better, from either side.
    let bias = changes.iter().find(|c| c["metric"] == "bias").unwrap();
    let [before, after] = ["base", "other"].map(|key| bias[key].as_f64().unwrap().abs());
    let difference = bias["difference"].as_f64().unwrap();
    assert!((after - before - difference).abs() < 1e-9, "{bias}");
    let opposite = if difference > 0.0 { "better" } else { "worse" };
    assert_ne!(bias["judgement"], opposite);
    // Without cells all else is compared, and what is not is said.
    std::fs::remove_file(fixture.path("1/cells.csv")).unwrap();
    let text = fixture.run("compare 0 1 -o x.html");
    let expected = "not compared: errors of distances: 1 has no cells.csv; `svl report 1` makes it";
    let text: Vec<_> = text.split_whitespace().collect();
    assert_says(&text.join(" "), &[expected, "wrong cells"]);
    assert_says(&fixture.text("x.html"), &["A report has no table of cells"]);
    let failing = fixture.svl("compare 0 1 --fail-on worse:rmse");
    failing.failed(3, &["RMSE of distances: is not measured in both reports"]);
    // Nor beside a metric that both measure.
    let failing = fixture.svl("compare 0 1 --fail-on worse:rmse --fail-on worse:false");
    failing.failed(3, &["RMSE of distances: is not measured in both reports"]);
}

#[test]
fn the_page_says_what_changed_on_which_frame_and_how_real_it_is() {
    let fixture = scored(&["v3 --algo bm", "v3:max_disparity=4 --algo bm"]);
    let shown = fixture.run("compare 0 1 -o page.html");
    assert_says(&shown, &["page   page.html\n"]);
    let page = fixture.text("page.html");
    let words = [
        "<strong class=\"worse\">worse</strong>: v3 → v3:max_disparity=4 right cells ",
        "v3 → v3:max_disparity=4",
        "real at 95\u{a0}% (Holm) over 80 pairs",
        "<td class=\"bad\">WORSE</td>",
        "Frames that changed most",
        "<p class=\"label\">truth</p>",
        " → unknown, true ",
        "class=\"changed\"",
        "80 pairs, 80 with equal results",
        "The results of all frames are equal.",
    ];
    assert_says(&page, &words);
    // Three frames became worse; three miss fewer obstacles, as nearly nothing is reported there.
    // Each is shown before, after and in truth.
    assert_eq!(page.matches("<section class=\"figure\">").count(), 6);
    assert_eq!(page.matches("role=\"img\"").count(), 18);
    let reason = |side: &str| {
        let (_, frames) = page.split_once(&format!("class=\"side\">{side}<")).unwrap();
        let (_, reason) = frames.split_once("</b>: ").unwrap();
        reason.split('<').next().unwrap()
    };
    assert!(reason("Worse").starts_with("right cells "));
    assert!(reason("Better").starts_with("missed near obstacles "));
    // The images that the folders lack are rendered again.
    assert!(!page.contains("stand alone"));
    assert!(!page.contains("<script") && !page.contains("http"));
    // Algorithms that are not compared come before all else, with the cure.
    fixture.run("score short.toml -q --algo v3:max_disparity=4 --algo sgm -o 2 --rerun none");
    fixture.run("compare 0 2 -o page.html --force");
    let page = fixture.text("page.html");
    let [verdict, not_compared, table] = ["</strong>", "not compared: bm", "<table>"]
        .map(|text| page.find(text).unwrap_or_else(|| panic!("{text}")));
    assert!(verdict < not_compared && not_compared < table);
    assert_says(
        &page,
        &["--map BASE=OTHER compares algorithms of other names"],
    );
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
        let text = fixture.run(&format!("compare 0 1{more}"));
        let text: Vec<_> = text.split_whitespace().collect();
        let text = text.join(" ");
        assert!(text.starts_with(first), "{text}");
        assert!(
            text.find(words) < text.find("not compared: v3, only in 0"),
            "{text}"
        );
    }
    let failing = fixture.svl("compare 0 1 --fail-on worse");
    failing.failed(3, &["v3: pairs: is not in 1"]);
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
        let text = fixture.run(&format!("compare 0 {other}"));
        let text: Vec<_> = text.split_whitespace().collect();
        assert!(text.join(" ").starts_with(&words), "{text:?}");
        let markdown = fixture.run(&format!("compare 0 {other} --markdown"));
        assert!(markdown.starts_with("**few in common**: "), "{markdown}");
        let failing = fixture.svl(&format!("compare 0 {other} --fail-on worse"));
        failing.failed(3, &["v3: pairs: ", " (--min-common)"]);
        // More pairs than those of the base are no loss.
        fixture.run(&format!("compare {other} 0"));
    }
    fixture.run("compare 0 half --fail-on worse --min-common 50%");
    fixture.fails("compare 0 half --min-common 0.9 => 2: expected a percentage, as 90%");
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
    let deciding = [
        "pairs",
        "right cells",
        "wrong cells",
        "missed near obstacles",
        "false near obstacles",
        "found near obstacles",
    ];
    assert_eq!(cases("worse"), deciding);
    let passed = cases("worse:passed");
    assert!(
        passed[1..]
            .iter()
            .all(|name| name.starts_with("checkpoint ")),
        "{passed:?}"
    );
    let json = fixture.json("compare 0 1 --json");
    assert!(json[0]["tested"].as_u64().unwrap() <= 5);
}

#[test]
fn a_metric_that_the_other_report_does_not_measure_fails() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 40);
    let text = fixture.text("short.toml");
    let limits = text.split("[[gate]]").next().unwrap();
    let gate = "[[gate]]\nalgorithm = \"v3\"\nmetric = \"missed\"\nmax = 0\n";
    let near = |near: &str| {
        let cells = format!("[cells]\nobstacle_m = {near}\nclear_m = 0.3\n");
        limits.replace("[cells]\n", &cells) + gate
    };
    // Nothing is nearer than a centimetre: nothing is missed, and that is no result.
    fixture.write("none.toml", near("0.01"));
    let ran = fixture.svl("score none.toml -q --gate --algo v3 --rerun none -o 0 --json");
    let json = ran.json();
    assert_eq!(json["gate"][0]["state"], "not-measured", "{json}");
    let v3 = &json["algorithms"][0];
    assert_eq!(
        (&v3["missed"], &v3["cases"]["missed"]["cells"]),
        (&serde_json::Value::Null, &0.into())
    );
    // The share stands under the name of its metric, with its cells.
    let [right, cells] =
        [&v3["right"], &v3["cases"]["right"]["cells"]].map(|n| n.as_f64().unwrap());
    assert_eq!(right * cells, v3["cells_right"].as_f64().unwrap());
    ran.failed(3, &["rests on 0 near obstacles, and needs 1 near obstacle"]);
    let failing = fixture.svl("compare 0 0 --fail-on worse:missed");
    failing.failed(
        3,
        &["missed near obstacles: is not measured: it rests on 0 near obstacles"],
    );
    fixture.run("compare 0 0 --fail-on worse");
}

#[test]
fn a_trend_has_a_line_per_algorithm_with_its_intervals() {
    let fixture = scored(&["v3", "v3 --algo bm", "v3:max_disparity=4 --algo v3"]);
    fixture.run("compare 0 1 2 -o trend.html");
    let page = fixture.text("trend.html");
    let words = [
        "3 reports, the newest last",
        "over 80 pairs",
        "<h2>Reports</h2>",
        "<li>2</li>",
    ];
    assert_says(&page, &words);
    assert!(
        page.matches("<svg class=\"plot\"").count() >= 6 && !page.contains("<script"),
        "{page}"
    );
    fixture.run("compare 0 1 2 -o trend.json");
    let trend = fixture.json_file("trend.json");
    assert_eq!(trend["reports"], serde_json::json!(["0", "1", "2"]));
    let lines = trend["lines"].as_array().unwrap();
    let line = |metric: &str, label: &str| {
        let own = lines
            .iter()
            .find(|line| line["metric"] == metric && line["algorithm"] == label);
        own.unwrap()["points"].clone()
    };
    assert_eq!(
        (line("right", "v3")[0].clone(), &line("right", "bm")[0]),
        (line("right", "v3")[2].clone(), &serde_json::Value::Null)
    );
    let summary = fixture.json_file("0/summary.json");
    let point = &line("right", "v3")[0];
    assert_eq!(point["value"], summary["algorithms"][0]["right"]);
    assert_eq!(point["cases"], summary["algorithms"][0]["cases"]["right"]);
    let [low, high] = [0, 1].map(|i| point["interval"][i].as_f64().unwrap());
    assert!((low..high).contains(&point["value"].as_f64().unwrap()));
    // A report of other pairs empties no other's line.
    fixture.run("score arena --seeds 2 --every 20 --algo v3 --rerun none -o other -q");
    drop(fixture.svl("compare 0 other 1 -o other.json"));
    let trend = fixture.json_file("other.json");
    assert_eq!(trend["reports"], serde_json::json!(["0", "1"]));
    assert!(!trend["lines"].as_array().unwrap().is_empty());
    let cautions = trend["cautions"].to_string();
    assert!(
        cautions.contains("other is left out: it shares no pair"),
        "{cautions}"
    );
}

#[test]
fn frames_of_an_own_recording_are_shown_as_long_as_it_is_there() {
    let fixture = Fixture::new();
    fixture.run("record arena --frames 60 --seed 7 -o run.mcap -q");
    for (out, algorithm) in [("0", "v3"), ("1", "v3:max_disparity=8")] {
        fixture.run(&format!(
            "score run.mcap -q --algo {algorithm} --rerun none -o {out}"
        ));
    }
    let page = |name: &str| {
        fixture.run(&format!("compare 0 1 -q -o {name}"));
        fixture.text(name)
    };
    let whole = page("whole.html");
    assert!(whole.contains("<image id=") && !whole.contains("stand alone"));
    // Another recording under its name has other pixels.
    fixture.run("record arena --frames 60 --seed 8 -o run.mcap -q --force");
    assert_says(
        &page("without.html"),
        &["stand alone: their images are neither"],
    );
}

#[test]
fn other_pairs_before_each_pair_explain_a_history() {
    let fixture = Fixture::new();
    fixture.run("record arena --frames 60 --seed 7 -o run.mcap -q");
    for (out, options) in [("0", ""), ("1", "--every 5"), ("2", "--every 1 --to 1")] {
        let algorithms = "--algo v5 --algo v5:target=near --algo bm";
        fixture.run(&format!(
            "score run.mcap -q {algorithms} {options} --rerun none -o {out}"
        ));
    }
    let words = "the pairs before each pair differ, on which results of v5 depend: score both with \
                 equal --every";
    let plain = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let text = plain(fixture.run("compare 0 1"));
    let (sentences, _) = text.split_once("change right").unwrap();
    assert_says(sentences, &[words]);
    assert_says(&fixture.run("compare 0 1 --markdown"), &[words]);
    fixture.run("compare 0 1 -o page.html");
    assert_says(&fixture.text("page.html"), &[words]);
    let json = fixture.json("compare 0 1 --json");
    assert_says(&json[0]["cautions"].to_string(), &[words]);
    // The first of the pairs in common alone has the same past.
    let algorithms = json[0]["algorithms"].as_array().unwrap();
    let numbers = algorithms.iter().map(|own| {
        let number = |key: &str| own[key].as_u64().unwrap();
        (number("other_past"), number("pairs"))
    });
    assert_eq!(numbers.collect::<Vec<_>>(), [(11, 12), (0, 12), (0, 12)]);
    // Fewer pairs after the same ones change nothing.
    let text = plain(fixture.run("compare 0 2"));
    assert!(!text.contains("pairs before"), "{text}");
    assert_says(&text, &["equal to the bit"]);
}

#[test]
fn a_seed_of_the_arena_is_compared_with_its_recording() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 40);
    let score = "-q --rerun none --algo v3 -o";
    fixture.run(&format!("score short.toml --seeds 1 {score} seed"));
    let recordings = std::fs::read_dir(fixture.path("recordings")).unwrap();
    let mut files = recordings.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let file = files.find(|name| name.contains("seed1")).unwrap();
    std::fs::copy(
        fixture.path(&format!("recordings/{file}")),
        fixture.path("own.mcap"),
    )
    .unwrap();
    fixture.run(&format!("score own.mcap {score} own"));
    for folders in ["seed own", "own seed"] {
        let json = fixture.json(&format!("compare {folders} --json"));
        let own = &json[0]["algorithms"][0];
        assert_eq!(
            (&own["pairs"], &own["equal_results"]),
            (&40.into(), &40.into()),
            "{own}"
        );
        let bias = own["metrics"]
            .as_array()
            .unwrap()
            .iter()
            .find(|m| m["metric"] == "rmse");
        assert!(
            bias.is_some(),
            "errors are those of the cells of each report: {own}"
        );
    }
}

#[test]
fn scenes_are_compared_by_their_names() {
    let Some(data) = datasets() else { return };
    let fixture = Fixture::new();
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios/middlebury.toml");
    let score = |scenes: &str, out: &str| {
        let data = data.canonicalize().unwrap();
        fixture.run(&format!(
            "score {scenario} --data {} --scenes {scenes} --algo v3 -q --rerun none -o {out}",
            data.display()
        ));
    };
    score("tsukuba venus", "two");
    score("venus", "one");
    for folders in ["two one", "one two"] {
        let json = fixture.json(&format!("compare {folders} --json"));
        let own = &json[0]["algorithms"][0];
        assert_eq!(
            (&own["pairs"], &own["equal_results"]),
            (&1.into(), &1.into()),
            "{own}"
        );
    }
}

#[test]
fn checkpoints_over_other_pairs_are_not_compared_and_said_to_be() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 40);
    for (out, every) in [("0", 1), ("1", 2)] {
        let options = format!("--algo v3 --every {every} -q --rerun none -o {out}");
        fixture.run(&format!("score short.toml {options}"));
    }
    let words = ["not compared: checkpoints, which are counted over whole runs"];
    let text = fixture
        .run("compare 0 1")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert_says(&text, &words);
    assert!(!fixture.run("compare 0 0").contains(words[0]));
    fixture
        .svl("compare 0 1 --fail-on worse:unknown")
        .failed(2, &["'unknown' has no better direction"]);
}

#[test]
fn the_page_replaces_nothing_unasked() {
    let fixture = scored(&["v3", "v1"]);
    fixture.write("own.html", "mine");
    fixture.write(
        "other.toml",
        fixture
            .text("short.toml")
            .replace("seeds = [1, 2]", "seeds = [3]"),
    );
    fixture.run("score other.toml -q --algo v3 --rerun none -o 2");
    let wrong = "
        compare 0 1 -o own.html => 1: own.html: exists already | --force
        compare 0 1 -o page.txt => 2: page.txt: must end in .html
        compare 0 1 --junit x.txt --fail-on worse => 2: x.txt: must end in .xml
        compare 0 1 -o missing/page.html => 1: missing: no such folder; create it first
        compare 0 1 -o 0/index.html --force => 2: 0/index.html: is in the folder of a report
        compare 0 2 -o own.html --force => 4: nothing was compared
    ";
    fixture.fails(wrong);
    assert_eq!(fixture.text("own.html"), "mine");
    fixture.run("compare 0 1 -o own.html --force");
    assert!(fixture.text("own.html").starts_with("<!DOCTYPE html>"));
}
