//! `svl score --shard` and `svl report -o`: workflows, and parts that do not make a whole.

use super::fixture::{Fixture, assert_says};
use super::interrupt::wait_until;
use super::results::{
    assert_same_report, change_all, change_map, change_pixels, unit_files, write_pairs,
};
use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};

/// The command that runs the workflow with these values of `--config`; `None` without Snakemake.
fn workflow(fixture: &Fixture, config: &[&str]) -> Option<Command> {
    let python = std::env::var_os("SVL_PYTHON").unwrap_or_else(|| "python3".into());
    let snakemake = |arguments: &[&str]| {
        let mut command = Command::new(&python);
        command.args(["-m", "snakemake"]).args(arguments);
        command.current_dir(fixture.path(""));
        command
    };
    let version = snakemake(&["--version"]).output();
    if !version.is_ok_and(|ran| ran.status.success()) {
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

/// The workflow of a scenario, in four shards, and a run of the same options.
struct Workflow<'a> {
    fixture: &'a Fixture,
    scenario: &'a str,
}

impl Workflow<'_> {
    fn command(&self, args: &str) -> Option<Command> {
        let scenario = format!("scenario={}.toml", self.scenario);
        let args = format!("args={args} --rerun none");
        workflow(self.fixture, &[&scenario, "shards=4", "out=s s", &args])
    }

    /// Kills the workflow as soon as a folder in its own has a unit; false without Snakemake.
    fn kill(&self, args: &str, folder: &str) -> bool {
        let Some(mut command) = self.command(args) else {
            return false;
        };
        let command = command.stdout(Stdio::null()).stderr(Stdio::null());
        let mut killed = command.process_group(0).spawn().unwrap();
        let folder = format!("s s/{}/{folder}", self.scenario);
        let has_units = || !unit_files(self.fixture, &folder, ".unit").is_empty();
        wait_until(&mut killed, has_units);
        let group = format!("-{}", killed.id());
        let kill = Command::new("kill").args(["-KILL", "--", &group]).status();
        assert!(kill.unwrap().success());
        !killed.wait().unwrap().success()
    }

    /// The workflow's report is that of a fresh run.
    fn check(&self, args: &str, what: &str) {
        let ran = self.command(args).unwrap().output().unwrap();
        let errors = String::from_utf8_lossy(&ran.stderr);
        assert!(ran.status.success(), "{what}: {errors}");
        let Self { fixture, scenario } = self;
        fixture.run(&format!(
            "score {scenario}.toml {args} --rerun none -q -o {what}"
        ));
        let report = format!("s s/{scenario}/all");
        assert_same_report(fixture, [&report, what], what);
    }
}

#[test]
fn a_workflow_is_that_of_its_scenario_and_its_options_also_after_a_kill() {
    let fixture = Fixture::new();
    fixture.write_short_arena("short.toml", 4);
    let workflow = Workflow {
        fixture: &fixture,
        scenario: "short",
    };
    let args = "--algo v3 --algo bm";
    // Killed as its first shard is complete, and looked at.
    if !workflow.kill(args, "part-1-of-4") {
        return;
    }
    fixture
        .svl(&["report", "s s/short/part-1-of-4"])
        .failed(4, &["incomplete", "joins all"]);
    workflow.check(args, "whole");
    let args = "--algo sgm:max_disparity=32 --every 2";
    workflow.check(args, "other-options");
    fixture.write_short_arena("short.toml", 6);
    workflow.check(args, "other-scenario");
}

#[test]
fn a_workflow_finds_files_that_changed_in_place() {
    let fixture = Fixture::new();
    write_pairs(&fixture, "p");
    fixture.write(
        "pairs.toml",
        "name = \"pairs\"\nalgorithms = [\"bm:max_disparity=8\"]\n[source]\n\
         kind = \"recording\"\nfiles = [\"p\"]\ntruth = \"../maps/*.npy:disparity=1\"\n",
    );
    let workflow = Workflow {
        fixture: &fixture,
        scenario: "pairs",
    };
    // The rule of the report alone is killed.
    if !workflow.kill("", "all") {
        return;
    }
    workflow.check("", "resumed");
    change_all(&fixture, "p/right", change_pixels);
    workflow.check("", "images");
    change_all(&fixture, "maps", change_map);
    workflow.check("", "truths");
}

#[test]
fn a_workflow_without_a_scenario_says_so() {
    let fixture = Fixture::new();
    for (config, name) in [("shards=4", "--config"), ("scenario=no.toml", "no.toml")] {
        let Some(ran) = snakemake(&fixture, &[config]) else {
            return;
        };
        let words = format!("{name}: no such scenario; name a file");
        assert_says(&String::from_utf8_lossy(&ran.stderr), &[&words]);
    }
}

#[test]
fn parts_that_do_not_make_a_whole_are_refused() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 4);
    let line = "score short.toml --algo v3 --algo bm --rerun none";
    fixture.transcript(&format!(
        "mkdir empty
        {line} -q --shard 1/2 -o p1
        {line} -q --shard 2/2 -o p2
        {line} -q --algo v1 --shard 2/2 -o other
        {line} -q --seeds 1 --shard 2/2 -o seeds
        {line} -q --ranges 2,4 --shard 2/2 -o ranged
        {line} -q -o whole
        report p1 p2 -o p1 => 2: -o p1: is in the part p1
        report p1 p2 -o p1/all/new => 2: -o p1/all/new: is in the part p1
        report p1 p2 -o ok --figures p2/fig => 2: --figures p2/fig: is in the part p2
        report p1 p2 ./p1 -o ok => 2: ./p1: this part is named twice
        report p1 -o all => 1: 1 run incomplete, from seed 2 on | shard 1/2
        report p1 other -o all => 1: other: is not of the same run as p1 | algorithms
        report p1 seeds -o all => 1: seeds: is not of the same run | source.seeds: 1, 2 and 1
        report p1 ranged -o all => 1: ranged: is not of the same run as p1 | ranges
        report p1 nothing -o all => 2: nothing: no such folder
        report p1 empty -o all => 1: empty: is not a report
        report p1 p2 => 2: -o FOLDER
        score short.toml --shard 3/2 -o x => 2: I from 1 to N
        score short.toml --shard 1/2 => 2: -o"
    ));
    // Edited, of the same size; the state after an interrupted copy.
    let units = unit_files(&fixture, "p2", ".unit");
    let whole = fixture.text(&units[0]);
    let kept: Vec<_> = whole.lines().take(20).collect();
    for damaged in [whole.replace("right", "wrong"), kept.join("\n") + "\n"] {
        fixture.write(&units[0], damaged);
        fixture.fails("report p1 p2 -o all => 1: .unit: was changed after it was written");
    }
    // The same command matches again what is damaged. The page escapes the slash.
    fixture.transcript(&format!(
        "{line} --shard 2/2 -o p2 => 0~ .unit: was cut or edited
        report p1 p2 -o all -q
        cat all/index.html => threads, shard 2"
    ));
    assert_same_report(&fixture, ["all", "whole"], "damaged and matched again");
    std::fs::remove_file(fixture.path(&units[0])).unwrap();
    let absent = units[0].strip_prefix("p2/").unwrap();
    fixture.fails(&format!(
        "report p1 p2 -o again => 1: {absent}: is in none of the parts, which are of all 2 shards"
    ));
}
