//! Losses of a run: reported, allowed by `--allow-loss`, and added up over shards.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says, pgm};
use super::shard::snakemake;
use crate::recording::bag::{self, Message, ros_image};
use serde_json::Value;

const SIZE: (usize, usize) = (24, 16);

/// Images of both cameras at these numbers, thirty a second; `seed` changes the pixels.
pub(super) fn messages(
    lefts: impl Iterator<Item = u64>,
    rights: impl Iterator<Item = u64>,
    seed: usize,
) -> Vec<Message> {
    let pixel = |i: usize| (i * i + seed) % 251;
    let pixels = [0, 2].map(|shift| -> Vec<u8> {
        let pixels = (0..SIZE.0 * SIZE.1).map(|i| pixel(i + shift) as u8);
        pixels.collect()
    });
    let image = |topic, i: u64, pixels| {
        let stamp_ns = 1_000_000_000 + i * 33_333_333;
        ros_image(topic, stamp_ns, SIZE, "mono8", pixels)
    };
    let lefts = lefts.map(|i| image("/cam0/image_rect", i, &pixels[0]));
    let mut messages: Vec<_> = lefts
        .chain(rights.map(|i| image("/cam1/image_rect", i, &pixels[1])))
        .collect();
    messages.sort_by_key(|message| message.log_time);
    messages
}

/// Writes these images into a bag.
pub(super) fn write_bag(
    fixture: &Fixture,
    name: &str,
    lefts: impl Iterator<Item = u64>,
    rights: impl Iterator<Item = u64>,
    seed: usize,
) {
    let folder = tempfile::tempdir().unwrap();
    let written = bag::write(folder.path(), &messages(lefts, rights, seed));
    std::fs::copy(written, fixture.path(name)).unwrap();
}

const SCORE: &str = "--algo v3:max_disparity=8 --rerun none -q";

#[test]
fn cameras_that_start_and_stop_apart_lose_nothing() {
    let fixture = Fixture::new();
    write_bag(&fixture, "bag.mcap", 0..40, 9..52, 0);
    let score = fixture.json(&format!("score bag.mcap {SCORE} --json"));
    assert_eq!(score["state"], "complete");
    assert_eq!(score["incomplete"], Value::Null);
    let missing = &score["missing"];
    assert_eq!(
        ["pairs", "outside", "unpaired"].map(|key| missing[key].as_u64()),
        [Some(31), Some(9 + 12), Some(0)]
    );
    let page = fixture.text("reports/bag/index.html");
    assert_says(&page, &["21 images outside the overlap of both cameras"]);
    let told = "21 images outside the overlap of both cameras";
    let ran = fixture.svl("replay bag.mcap --algo v3:max_disparity=8");
    assert_says(&ran.stdout, &[told]);
    assert!(!ran.stderr.contains("dropped"), "{}", ran.stderr);
    ran.done();
    let ran = fixture.svl("record bag.mcap -o own.mcap");
    assert_says(&ran.stderr, &[told]);
    ran.done();
    let ran = fixture.svl("record bag.mcap -o quiet.mcap -q");
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(0), ""));
    // Recordings of svl have no such images any more.
    let own = fixture.json(&format!("score own.mcap {SCORE} --json"));
    assert_eq!(own["missing"]["outside"], 0);
}

#[test]
fn perturbations_lose_no_image_again() {
    let fixture = Fixture::new();
    let rights = (0..12).filter(|i| ![4, 6].contains(i));
    write_bag(&fixture, "bag.mcap", 0..12, rights, 0);
    let line = format!("score bag.mcap {SCORE} --stress noise --allow-loss 2 --json");
    let score = fixture.json(&line);
    let missing = &score["missing"];
    assert_eq!([&missing["unpaired"], &missing["pairs"]], [2, 10]);
    assert_eq!(score["state"], "complete");
}

/// A pair that cannot be read has both images: it is no reason for an unpaired one.
#[test]
fn unreadable_pairs_hide_no_unpaired_images() {
    let fixture = Fixture::new();
    let pixels = [7; SIZE.0 * SIZE.1];
    let image = |topic, i: u64| {
        let broken = topic == "/cam0/image_rect" && [3, 4].contains(&i);
        let pixels = if broken { &pixels[..50] } else { &pixels[..] };
        ros_image(topic, 1_000_000_000 + i * 33_333_333, SIZE, "mono8", pixels)
    };
    let pair = |i| ["/cam0/image_rect", "/cam1/image_rect"].map(|topic| image(topic, i));
    let mut messages: Vec<_> = (0..20).flat_map(pair).collect();
    // The left image of pair 9 is missing.
    messages.remove(18);
    bag::write(&fixture.path(""), &messages);
    let score = fixture.svl(&format!("score bag.mcap {SCORE} --json"));
    assert_eq!(score.code, Some(4), "{}", score.stderr);
    let missing = &score.json()["missing"];
    assert_eq!(
        ["pairs", "unreadable", "unpaired"].map(|key| missing[key].as_u64()),
        [Some(17), Some(2), Some(1)]
    );
    let allowed = fixture.svl(&format!("score bag.mcap {SCORE} --allow-loss 2 -o two"));
    assert_eq!(allowed.code, Some(4), "{}", allowed.stderr);
}

#[test]
fn images_without_partners_outside_the_range_are_no_losses() {
    let fixture = Fixture::new();
    // Two right images of 0.50 and 0.53 s are lacking.
    write_bag(
        &fixture,
        "bag.mcap",
        0..60,
        (0..60).filter(|i| ![15, 16].contains(i)),
        0,
    );
    for (range, lost) in [
        ("", 2),
        ("--from 0.4", 2),
        ("--from 0.52", 1),
        ("--from 0.55", 0),
        ("--from 0.8 --to 1.5", 0),
        ("--to 0.49", 0),
        ("--to 0.51", 1),
    ] {
        let code = Some(if lost > 0 { 4 } else { 0 });
        let score = fixture.svl(&format!("score bag.mcap {SCORE} --json {range} --force"));
        assert_eq!(score.json()["missing"]["unpaired"], lost, "{range}");
        let replay = format!("replay bag.mcap --algo v3:max_disparity=8 -q {range}");
        let record = format!("record bag.mcap -o own.mcap --force {range}");
        for ran in [score, fixture.svl(&replay), fixture.svl(&record)] {
            assert_eq!(ran.code, code, "{range}: {}", ran.stderr);
        }
    }
    let record = "record bag.mcap -o own.mcap --force";
    fixture.run(&format!("{record} --duration 0.49"));
    fixture.run(&format!("{record} --from 0.55 --duration 0.4"));
    let ran = fixture.svl(&format!("{record} --duration 0.6"));
    assert_eq!(ran.code, Some(4), "{}", ran.stderr);
    assert_says(&ran.stderr, &["2 images had no partner"]);
}

#[test]
fn one_image_of_two_hundred_may_be_allowed() {
    let fixture = Fixture::new();
    write_bag(
        &fixture,
        "bag.mcap",
        0..200,
        (0..200).filter(|i| *i != 77),
        0,
    );
    // One of 200 pairs read is 0.5 %.
    for (allowed, code) in [
        ("", 4),
        ("--allow-loss 0", 4),
        ("--allow-loss 0.4%", 4),
        ("--allow-loss 0.5%", 0),
        ("--allow-loss 1", 0),
        // Per cent of all pairs read, not of those selected.
        ("--allow-loss 0.5% --every 20", 0),
    ] {
        let score = format!("score bag.mcap {SCORE} --json {allowed}");
        let replay = "replay bag.mcap --algo v3:max_disparity=8 -q --json";
        for line in [score, format!("{replay} {allowed}")] {
            let ran = fixture.svl(&line);
            assert_eq!(ran.code, Some(code), "{line}: {}", ran.stderr);
            let answer = ran.json();
            assert_eq!(answer["missing"]["unpaired"], 1);
            let state = if code == 0 { "complete" } else { "lossy" };
            assert_eq!(answer["state"], state);
            assert_eq!(answer["incomplete"].is_null(), code == 0);
        }
        let ran = fixture.svl(&format!("record bag.mcap -o own.mcap --force {allowed}"));
        assert_eq!(ran.code, Some(code), "{}", ran.stderr);
    }
    let ran = fixture.svl("replay bag.mcap --algo v3:max_disparity=8 --allow-loss 1%");
    assert_says(&ran.stdout, &["not scored: 1 image had no partner"]);
    fixture.fails(
        "
        score bag.mcap --allow-loss -1 => 2: --allow-loss | per cent as 1%
        replay bag.mcap --allow-loss 101% => 2: --allow-loss | per cent as 1%
        calibrate check bag.mcap --allow-loss 1 => 2: --allow-loss
        calibrate board bag.mcap -o c.xml --yes --allow-loss 1 => 2: --allow-loss
        ",
    );
}

#[test]
fn a_scenario_allows_losses_and_its_description_says_so() {
    let fixture = Fixture::new();
    write_bag(&fixture, "bag.mcap", 0..20, (0..20).filter(|i| *i != 7), 0);
    let scenario = |limit: &str| {
        format!(
            "name = \"s\"\nalgorithms = [\"v3:max_disparity=8\"]\n[source]\nkind = \
             \"recording\"\nfiles = [\"bag.mcap\"]\nallow_loss = {limit}\n"
        )
    };
    for (limit, code) in [("1", 0), ("\"5%\"", 0), ("0", 4), ("\"4.9%\"", 4)] {
        fixture.write("s.toml", scenario(limit));
        let ran = fixture.svl("score s.toml -q --rerun none");
        assert_eq!(ran.code, Some(code), "{limit}: {}", ran.stderr);
        let printed = fixture.run("score s.toml --print-scenario");
        assert_says(&printed, &["allow_loss = "]);
        let manifest = fixture.json_file("reports/s/manifest.json");
        let kept = manifest["description"]["source"]["allow_loss"].to_string();
        assert_eq!(kept, limit);
    }
    // An option replaces the key.
    fixture.run("score s.toml -q --rerun none --allow-loss 5%");
    fixture.write("s.toml", scenario("\"much\""));
    fixture.fails("score s.toml => 1: s.toml | per cent as 1%");
    // Reports with other limits can be compared.
    fixture.write("s.toml", scenario("1"));
    fixture.run("score s.toml -q --rerun none -o other");
    fixture.run("compare reports/s other --fail-on worse");
}

/// Answers pairs of 40x20 pixels with zeros, except those whose first pixel is 7, with an error.
const SORTS_OUT: &str = r#"
while read -r line; do
  seq=${line#*'"seq":'}
  seq=${seq%%[,\}]*}
  first=$(head -c 1 | od -An -tu1)
  head -c 1599 >/dev/null
  if [ $first -eq 7 ]; then
    echo "{\"seq\":$seq,\"error\":\"seven\"}"
  else
    echo "{\"seq\":$seq,\"millis\":1}"
    head -c 3200 /dev/zero
  fi
done
"#;

/// Two folders of three pairs, of which the program fails on one.
fn with_a_bad_pair() -> Fixture {
    let fixture = Fixture::new();
    fixture.write("m.sh", SORTS_OUT);
    for (run, pair) in (0..2).flat_map(|run| (0..3).map(move |pair| (run, pair))) {
        let first = if (run, pair) == (1, 1) { 7 } else { 9 };
        for (side, shift) in [("left", 0), ("right", 2)] {
            let mut pixels: Vec<u8> = (shift..shift + 800)
                .map(|i| (i * (i + pair + 3 * run) % 251) as u8)
                .collect();
            pixels[0] = first;
            let name = format!("run{run}/{side}/{pair}.pgm");
            fixture.write(&name, pgm(40, 20, &pixels));
        }
    }
    let text = "name = \"two\"\nalgorithms = [\"m=exec:command='sh m.sh'\", \
                \"v3:max_disparity=8\"]\n[source]\nkind = \"recording\"\nfiles = [\"run*\"]\n";
    fixture.write("two.toml", text);
    fixture
}

#[test]
fn shards_that_miss_something_are_merged() {
    let fixture = with_a_bad_pair();
    let line = "score two.toml --rerun none -q";
    let whole = fixture.svl(&format!("{line} -o whole --json"));
    assert_eq!(whole.code, Some(4), "{}", whole.stderr);
    let whole = whole.json();
    let failed = &whole["missing"]["algorithms"]["m"];
    assert_eq!(
        (&failed["pairs"], &failed["failed"]),
        (&6.into(), &1.into())
    );
    let shard = |i: u8, more: &str| {
        let ran = fixture.svl(&format!("{line} --shard {i}/2 -o p{i} {more}"));
        assert!(ran.code.is_some(), "{}", ran.stderr);
        ran.code
    };
    assert_eq!((shard(1, ""), shard(2, "")), (Some(0), Some(0)));
    let merged = fixture.svl("report p1 p2 -o all -q --json");
    assert_eq!(merged.code, Some(4), "{}", merged.stderr);
    assert_says(&merged.stderr, &["m failed on 1 of 6 pairs"]);
    let merged = merged.json();
    for key in ["missing", "state", "incomplete", "pairs_hash"] {
        assert_eq!(merged[key], whole[key], "{key}");
    }
    assert_eq!(merged["state"], "lossy");
    assert_says(
        &fixture.text("all/summary.md"),
        &["m failed on 1 of 6 pairs"],
    );
    // One of six is 17 %.
    let allowed = |limit: &str| {
        let ran = fixture.svl(&format!("report p1 p2 -o all -q --allow-loss {limit}"));
        (
            ran.code,
            fixture.json_file("all/summary.json")["state"].clone(),
        )
    };
    assert_eq!(allowed("17%"), (Some(0), "complete".into()));
    assert_eq!(allowed("16%"), (Some(4), "lossy".into()));
    assert_eq!(allowed("1"), (Some(0), "complete".into()));
}

#[test]
#[ignore = "starts Snakemake twice: in .ci/nightly"]
fn a_workflow_whose_shard_misses_a_pair_ends_with_the_report() {
    let fixture = with_a_bad_pair();
    let config = ["scenario=two.toml", "shards=2", "out=s"];
    let Some(ran) = snakemake(&fixture, &[&config[..], &["args=--rerun none"]].concat()) else {
        return;
    };
    assert!(!ran.status.success());
    assert_says(
        &String::from_utf8_lossy(&ran.stderr),
        &["svl: ", " failed on 1 of "],
    );
    let state = || fixture.json_file("s/two/all/summary.json")["state"].clone();
    assert_eq!(state(), "lossy");
    let args = "args=--rerun none --allow-loss 20%";
    let ran = snakemake(&fixture, &[&config[..], &[args]].concat()).unwrap();
    assert!(
        ran.status.success(),
        "{}",
        String::from_utf8_lossy(&ran.stderr)
    );
    assert_eq!(state(), "complete");
}

#[test]
fn missing_pairs_are_a_test_of_junits_xml() {
    let fixture = with_a_bad_pair();
    let text = fixture.text("two.toml");
    let gated = |min: &str| {
        let limit = "[[gate]]\nalgorithm = \"v3:max_disparity=8\"\nmetric = \"coverage\"\n";
        fixture.write("two.toml", format!("{text}{limit}min = {min}\n"))
    };
    gated("0.01");
    let line = "score two.toml --rerun none -q --gate --junit j.xml";
    // The name of a test has no values, so that it is the same test in every run.
    let says = |counts: &str, inside: &str| {
        let test = format!("name=\"v3:max_disparity=8: coverage, at least the limit\">{inside}");
        assert_says(&fixture.text("j.xml"), &[counts, &test]);
    };
    assert_eq!(fixture.svl(line).code, Some(4));
    says("tests=\"2\" failures=\"1\"", "<system-out>");
    fixture.run(&format!("{line} --allow-loss 20%"));
    says("tests=\"2\" failures=\"0\"", "<system-out>");
    // A broken limit takes precedence over losses.
    gated("1.0");
    assert_eq!(fixture.svl(line).code, Some(3));
    let failure = "<failure message=\"v3:max_disparity=8: coverage ";
    says("tests=\"2\" failures=\"2\"", failure);
}
