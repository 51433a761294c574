//! `svl score --shard` and `svl report -o`: workflows, and parts that do not make a whole.

use super::fixture::{Fixture, assert_says};
use super::results::{assert_same_report, unit_files};
use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The command that runs the workflow with these values of `--config`; `None` without Snakemake.
fn workflow(fixture: &Fixture, config: &[&str]) -> Option<Command> {
    let python = std::env::var_os("SVL_PYTHON").unwrap_or_else(|| "python3".into());
    let snakemake = |arguments: &[&str]| {
        let mut command = Command::new(&python);
        command.args(["-m", "snakemake"]).args(arguments);
        command.current_dir(fixture.path(""));
        command
    };
    if !snakemake(&["--version"]).output().unwrap().status.success() {
        crate::common::skip("no Snakemake");
        return None;
    }
    let file = format!("{}/examples/cluster/Snakefile", env!("CARGO_MANIFEST_DIR"));
    let svl = format!("svl={}", assert_cmd::cargo::cargo_bin!("svl").display());
    let run = ["-s", &file, "--cores", "2", "--nolock", "--config", &svl];
    Some(snakemake(&[&run, config].concat()))
}

/// Runs the workflow.
pub(super) fn snakemake(fixture: &Fixture, config: &[&str]) -> Option<std::process::Output> {
    Some(workflow(fixture, config)?.output().unwrap())
}

#[test]
fn a_workflow_is_that_of_its_scenario_and_its_options_also_after_a_kill() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 4);
    let config = |args: &str| {
        [
            "scenario=short.toml",
            "shards=4",
            "out=s",
            &format!("args={args}"),
        ]
        .map(str::to_owned)
    };
    let run = |args: &str| {
        let config = config(args);
        let config: Vec<_> = config.iter().map(String::as_str).collect();
        let ran = snakemake(&fixture, &config).unwrap();
        assert!(
            ran.status.success(),
            "{}",
            String::from_utf8_lossy(&ran.stderr)
        );
    };
    let compare = |args: &str, what: &str| {
        fixture.run(&format!("score short.toml {args} -q -o {what}"));
        assert_same_report(&fixture, ["s/short/all", what], what);
    };
    let args = "--algo v3 --algo bm --rerun none";
    let first = config(args);
    let first: Vec<_> = first.iter().map(String::as_str).collect();
    let Some(mut command) = workflow(&fixture, &first) else {
        return;
    };
    // Killed as its first shard is whole, and looked at.
    let command = command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut killed = command.process_group(0).spawn().unwrap();
    let began = Instant::now();
    while unit_files(&fixture, "s/short/part-1-of-4", ".unit").is_empty() {
        assert!(began.elapsed() < Duration::from_secs(120), "it never began");
        std::thread::sleep(Duration::from_millis(20));
    }
    let group = format!("-{}", killed.id());
    let kill = Command::new("kill").args(["-KILL", "--", &group]).status();
    assert!(kill.unwrap().success());
    killed.wait().unwrap();
    fixture
        .svl("report s/short/part-1-of-4")
        .failed(4, &["not whole"]);
    run(args);
    compare(args, "whole");
    let sessions = || unit_files(&fixture, "s/short/all", ".json").len();
    let before = sessions();
    run(args);
    assert_eq!(sessions(), before);
    let args = "--algo sgm:max_disparity=32 --every 2 --rerun none";
    run(args);
    compare(args, "other-options");
    fixture.write_short_arena("short.toml", 6);
    run(args);
    compare(args, "other-scenario");
}

#[test]
fn parts_that_do_not_make_a_whole_are_refused() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 4);
    let line = "score short.toml --algo v3 --algo bm -q --rerun none";
    for i in 1..=2 {
        fixture.run(&format!("{line} --shard {i}/2 -o p{i}"));
    }
    fixture.run(&format!("{line} --algo v1 --shard 2/2 -o other"));
    fixture.run(&format!("{line} --seeds 1 --shard 2/2 -o seeds"));
    fixture.run(&format!("{line} -o whole"));
    std::fs::create_dir(fixture.path("empty")).unwrap();
    fixture.fails(
        "
        report p1 p2 -o p1 => 2: -o p1: is in the part p1
        report p1 p2 -o p1/all/new => 2: -o p1/all/new: is in the part p1
        report p1 p2 -o ok --figures p2/fig => 2: --figures p2/fig: is in the part p2
        report p1 p2 ./p1 -o ok => 2: ./p1: this part is named twice
        report p1 -o all => 1: 1 run incomplete, from seed 2 on | shard 1/2
        report p1 other -o all => 1: other: is not of the same run as p1 | algorithms
        report p1 seeds -o all => 1: seeds: is not of the same run | source.seeds: 1, 2 and 1
        report p1 nothing -o all => 2: nothing: no such folder
        report p1 empty -o all => 1: empty: is not a report
        report p1 p2 => 2: -o FOLDER
        score short.toml --shard 3/2 -o x => 2: I from 1 to N
        score short.toml --shard 1/2 => 2: -o
        ",
    );
    // Edited, of the same size.
    let units = unit_files(&fixture, "p2", ".unit");
    let unit = &units[0];
    let whole = fixture.text(unit);
    fixture.write(unit, whole.replace("right", "wrong"));
    fixture.fails("report p1 p2 -o all => 1: .unit: was changed after it was written");
    // The state after an interrupted copy.
    let kept: Vec<_> = whole.lines().take(20).collect();
    fixture.write(unit, kept.join("\n") + "\n");
    fixture.fails("report p1 p2 -o all => 1: .unit: was changed after it was written");
    // The same command matches again what is damaged.
    let ran = fixture.svl(&format!("{line} --shard 2/2 -o p2").replace("-q ", ""));
    assert_eq!(ran.code, Some(0));
    assert_says(&ran.stderr, &[".unit: was cut or edited"]);
    fixture.run("report p1 p2 -o all -q");
    assert_same_report(&fixture, ["all", "whole"], "damaged and matched again");
    // The page escapes the slash.
    assert_says(&fixture.text("all/index.html"), &["threads, shard 2"]);
}
