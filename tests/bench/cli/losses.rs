//! Losses of a run: reported, allowed by `--allow-loss`, and added up over shards.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says, pgm};
use super::shard::snakemake;
use crate::recording::bag::{self, Message, ros_image};

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
    let told = "21 images outside the overlap of both cameras";
    // Recordings of svl have no such images any more.
    fixture.transcript(&format!(
        "score bag.mcap {SCORE} --json => /state = complete | /incomplete = null \
        | /missing/pairs = 31 | /missing/outside = 21 | /missing/unpaired = 0
        cat reports/bag/index.html => {told}
        replay bag.mcap --algo v3:max_disparity=8 => {told} => 0~ !dropped
        record bag.mcap -o own.mcap => 0~ {told}
        score own.mcap {SCORE} --json => /missing/outside = 0"
    ));
    let ran = fixture.svl("record bag.mcap -o quiet.mcap -q");
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(0), ""));
}

#[test]
fn perturbations_lose_no_image_again() {
    let fixture = Fixture::new();
    let rights = (0..12).filter(|i| ![4, 6].contains(i));
    write_bag(&fixture, "bag.mcap", 0..12, rights, 0);
    fixture.transcript(&format!(
        "score bag.mcap {SCORE} --stress noise --allow-loss 2 --json => /state = complete \
        | /missing/unpaired = 2 | /missing/pairs = 10"
    ));
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
    fixture.transcript(&format!(
        "score bag.mcap {SCORE} --json => /missing/pairs = 17 | /missing/unreadable = 2 \
        | /missing/unpaired = 1 => 4~
        score bag.mcap {SCORE} --allow-loss 2 -o two => 4~"
    ));
}

#[test]
fn images_without_partners_outside_the_range_are_no_losses() {
    let fixture = Fixture::new();
    // Two right images of 0.50 and 0.53 s are lacking.
    let rights = (0..60).filter(|i| ![15, 16].contains(i));
    write_bag(&fixture, "bag.mcap", 0..60, rights, 0);
    for (range, lost) in [
        ("", 2),
        ("--from 0.4", 2),
        ("--from 0.52", 1),
        ("--from 0.55", 0),
        ("--from 0.8 --to 1.5", 0),
        ("--to 0.49", 0),
        ("--to 0.51", 1),
    ] {
        let code = if lost > 0 { 4 } else { 0 };
        fixture.transcript(&format!(
            "score bag.mcap {SCORE} --json {range} --force => /missing/unpaired = {lost} => {code}~
            replay bag.mcap --algo v3:max_disparity=8 -q {range} => {code}~
            record bag.mcap -o own.mcap --force {range} => {code}~"
        ));
    }
    let record = "record bag.mcap -o own.mcap --force";
    fixture.transcript(&format!(
        "{record} --duration 0.49
        {record} --from 0.55 --duration 0.4
        {record} --duration 0.6 => 4~ 2 images had no partner"
    ));
}

#[test]
fn one_image_of_two_hundred_may_be_allowed() {
    let fixture = Fixture::new();
    let rights = (0..200).filter(|i| *i != 77);
    write_bag(&fixture, "bag.mcap", 0..200, rights, 0);
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
        let answer = match code {
            0 => "/missing/unpaired = 1 | /state = complete | /incomplete = null",
            _ => "/missing/unpaired = 1 | /state = lossy | /incomplete != null",
        };
        fixture.transcript(&format!(
            "score bag.mcap {SCORE} --json {allowed} => {answer} => {code}~
            replay bag.mcap --algo v3:max_disparity=8 -q --json {allowed} => {answer} => {code}~
            record bag.mcap -o own.mcap --force {allowed} => {code}~"
        ));
    }
    fixture.transcript(
        "
        replay bag.mcap --algo v3:max_disparity=8 --allow-loss 1% \
        => not scored: 1 image had no partner
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
    let write_scenario = |limit: &str| {
        fixture.write(
            "s.toml",
            format!(
                "name = \"s\"\nalgorithms = [\"v3:max_disparity=8\"]\n[source]\nkind = \
                 \"recording\"\nfiles = [\"bag.mcap\"]\nallow_loss = {limit}\n"
            ),
        )
    };
    for (limit, code) in [("1", 0), ("\"5%\"", 0), ("0", 4), ("\"4.9%\"", 4)] {
        write_scenario(limit);
        fixture.transcript(&format!(
            "score s.toml -q --rerun none => {code}~
            score s.toml --print-scenario => allow_loss =
            cat reports/s/manifest.json => /description/source/allow_loss = {limit}"
        ));
    }
    // An option replaces the key.
    fixture.run("score s.toml -q --rerun none --allow-loss 5%");
    write_scenario("\"much\"");
    fixture.fails("score s.toml => 1: s.toml | per cent as 1%");
    // Reports with other limits can be compared.
    write_scenario("1");
    fixture.transcript(
        "score s.toml -q --rerun none -o other
        compare reports/s other",
    );
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
    // One of six is 17 %.
    let failed = "m failed on 1 of 6 pairs";
    fixture.transcript(&format!(
        "{line} -o whole --json => /missing/algorithms/m/pairs = 6 \
        | /missing/algorithms/m/failed = 1 => 4~
        {line} --shard 1/2 -o p1
        {line} --shard 2/2 -o p2
        report p1 p2 -o all -q --json => /state = lossy => 4~ {failed}
        cat all/summary.md => {failed}"
    ));
    let [whole, merged] =
        ["whole", "all"].map(|report| fixture.json_file(&format!("{report}/summary.json")));
    for key in ["missing", "state", "incomplete", "pairs_hash"] {
        assert_eq!(merged[key], whole[key], "{key}");
    }
    for (limit, code, state) in [
        ("17%", 0, "complete"),
        ("16%", 4, "lossy"),
        ("1", 0, "complete"),
    ] {
        fixture.transcript(&format!(
            "report p1 p2 -o all -q --allow-loss {limit} => {code}~
            cat all/summary.json => /state = {state}"
        ));
    }
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
    // The name of a test has no values, so that it is the same test in every run.
    let line = "score two.toml --rerun none -q --gate --junit j.xml";
    let test = "name=\"v3:max_disparity=8: coverage, at least the limit\">";
    gated("0.01");
    fixture.transcript(&format!(
        "{line} => 4~
        cat j.xml => tests=\"2\" failures=\"1\" | {test}<system-out>
        {line} --allow-loss 20%
        cat j.xml => tests=\"2\" failures=\"0\" | {test}<system-out>"
    ));
    // A broken limit takes precedence over losses.
    gated("1.0");
    fixture.transcript(&format!(
        "{line} => 3~
        cat j.xml => tests=\"2\" failures=\"2\" \
        | {test}<failure message=\"v3:max_disparity=8: coverage"
    ));
}
