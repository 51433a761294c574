//! The steps of the GitHub Action, run by bash as GitHub runs them.

use super::cli::fixture::{Fixture, assert_says};
use std::collections::BTreeMap;
use std::fs::{Permissions, set_permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};
use svl_calibrate::yaml::{self, YamlNode};

fn table<'a>(node: &'a YamlNode, key: &str) -> Option<&'a YamlNode> {
    match node {
        YamlNode::Table(table) => table.get(key),
        _ => None,
    }
}

fn value<'a>(node: &'a YamlNode, key: &str) -> Option<&'a str> {
    match table(node, key) {
        Some(YamlNode::Value(text)) => Some(text),
        _ => None,
    }
}

/// A step of an action or of a workflow's job.
fn step_named<'a>(job: &'a YamlNode, name: &str) -> &'a YamlNode {
    let Some(YamlNode::List(steps)) = table(job, "steps") else {
        panic!("no steps");
    };
    let step = steps.iter().find(|step| value(step, "name") == Some(name));
    step.unwrap_or_else(|| panic!("no step {name}"))
}

/// A checkout of a pull request, in which steps run.
struct Job {
    fixture: Fixture,
    action: YamlNode,
    inputs: BTreeMap<&'static str, &'static str>,
}

impl Job {
    fn new(inputs: &[(&'static str, &'static str)]) -> Self {
        let text = include_str!("../../action.yml");
        Self {
            fixture: Fixture::new(),
            action: yaml::parse(text).unwrap(),
            inputs: inputs.iter().copied().collect(),
        }
    }

    /// The value of `${{ inputs.NAME }}`.
    fn input(&self, expression: &str) -> &str {
        let name = expression.strip_prefix("${{ inputs.").unwrap();
        let name = name.strip_suffix(" }}").unwrap();
        let declared = table(table(&self.action, "inputs").unwrap(), name);
        let default = || value(declared.unwrap(), "default").unwrap_or("");
        self.inputs.get(name).copied().unwrap_or_else(default)
    }

    fn step(&self, name: &str) -> Output {
        let step = step_named(table(&self.action, "runs").unwrap(), name);
        assert_eq!(value(step, "shell"), Some("bash"));
        let mut command = Command::new("bash");
        let folder = self.fixture.path("");
        let program = Path::new(env!("CARGO_BIN_EXE_svl")).parent().unwrap();
        let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
        command
            .args(["-eo", "pipefail", "-c", value(step, "run").unwrap()])
            .current_dir(&folder)
            .env("PATH", path)
            .env("GITHUB_ACTION_PATH", env!("CARGO_MANIFEST_DIR"))
            .env("RUNNER_TEMP", &folder);
        for file in ["STEP_SUMMARY", "OUTPUT", "PATH"] {
            command.env(format!("GITHUB_{file}"), self.fixture.path(file));
        }
        if let Some(YamlNode::Table(variables)) = table(step, "env") {
            for (name, node) in variables {
                let YamlNode::Value(expression) = node else {
                    panic!("{name}")
                };
                command.env(name, self.input(expression));
            }
        }
        command.output().unwrap()
    }

    /// Runs a step, which has to end with this code; returns what it printed.
    #[track_caller]
    fn ends(&self, name: &str, code: i32) -> String {
        let output = self.step(name);
        let text = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
        assert_eq!(
            output.status.code(),
            Some(code),
            "{name}: {}",
            text.concat()
        );
        text.concat()
    }
}

const SCENARIO: &str = "name = \"two\"\nalgorithms = [\"v3\"]\n\
                        [source]\nkind = \"recording\"\nfiles = [\"run.mcap\"]\n";
const GATE: &str = "[[gate]]\nalgorithm = \"v3\"\nmetric = \"coverage\"\nmin = ";

#[test]
fn a_pull_request_is_gated_and_compared_with_its_base() {
    let job = Job::new(&[
        ("scenario", "two.toml"),
        ("prepare", "svl -q record --frames 6 -o run.mcap --force"),
        ("arguments", "--rerun none"),
    ]);
    let scenario = |min: &str| format!("{SCENARIO}{GATE}{min}\n");
    // The base breaks its own limit, which does not matter.
    job.fixture.write(".svl-base/two.toml", scenario("1.0"));
    job.fixture.write("two.toml", scenario("0.01"));
    job.ends("score the base branch", 0);
    job.ends("score", 0);
    job.ends("summary", 0);
    let summary = job.fixture.text("STEP_SUMMARY");
    assert_says(&summary, &["| v3 |"]);
    let compared = job.fixture.text("svl-reports/compare.md");
    assert!(summary.ends_with(&compared) && !compared.is_empty());
    assert_says(
        &job.fixture.text("OUTPUT"),
        &["markdown=svl-reports/compare.md"],
    );
    assert!(job.fixture.path("svl-reports/gate.xml").is_file());
    // Other recordings have no pair in common: the summary of the pull request is left.
    let record = "record --frames 6 --seed 9 -q -o .svl-base/run.mcap --force";
    job.fixture.run(record);
    job.fixture
        .run("score -q --rerun none -o svl-reports/base --force .svl-base/two.toml");
    assert_says(&job.ends("summary", 0), &["::notice::no comparison"]);
    assert!(
        job.fixture
            .text("OUTPUT")
            .ends_with("markdown=svl-reports/head/summary.md\n")
    );
    // A broken limit fails the step; the summary is written all the same.
    job.fixture.write("two.toml", scenario("1.0"));
    job.ends("score", 3);
    job.ends("summary", 0);
}

#[test]
fn a_parameter_that_a_pull_request_changes_is_compared() {
    let job = Job::new(&[
        ("scenario", "two.toml"),
        ("prepare", "svl -q record --frames 60 -o run.mcap --force"),
        ("arguments", "--rerun none"),
    ]);
    let scenario = |v3: &str| {
        let gate = format!("{GATE}0.01\n");
        SCENARIO.replace("[\"v3\"]", &format!("[\"{v3}\", \"bm\"]")) + &gate
    };
    job.fixture.write(".svl-base/two.toml", scenario("v3"));
    job.fixture
        .write("two.toml", scenario("v3:max_disparity=8"));
    for step in ["score the base branch", "score", "summary"] {
        job.ends(step, 0);
    }
    let comment = job.fixture.text("svl-reports/compare.md");
    let first = comment.lines().next().unwrap();
    assert!(
        first.starts_with("**worse**: v3 → v3:max\\_disparity=8 right cells "),
        "{comment}"
    );
}

#[test]
fn a_base_without_the_scenario_is_no_error() {
    let job = Job::new(&[("scenario", "new.toml"), ("reports", "made/reports")]);
    job.fixture.write(".svl-base/README.md", "");
    assert_says(
        &job.ends("score the base branch", 0),
        &["::notice::", "new.toml"],
    );
    assert_says(&job.ends("score", 1), &["new.toml"]);
    job.ends("summary", 0);
    assert_eq!(job.fixture.text("OUTPUT"), "markdown=\n");
    // A script that the pull request adds is not in its base.
    let mut job = job;
    job.inputs.insert("prepare", "bash fetch.sh");
    job.fixture.write(".svl-base/new.toml", SCENARIO);
    assert_says(&job.ends("score the base branch", 0), &["::warning::"]);
    job.inputs.remove("prepare");
    // A base that cannot be scored does not hide the result of the pull request.
    job.fixture.write(".svl-base/new.toml", "name = 3\n");
    assert_says(&job.ends("score the base branch", 0), &["::warning::"]);
}

#[test]
fn the_example_workflow_edits_its_own_comment() {
    let workflow = yaml::parse(include_str!("../../examples/ci/stereo.yml")).unwrap();
    let job = table(table(&workflow, "jobs").unwrap(), "score").unwrap();
    let comment = value(step_named(job, "comment"), "run").unwrap();
    let fixture = Fixture::new();
    fixture.write("summary.md", "| v3 |\n");
    // A `gh` that logs its arguments, and lists the comment that the file `found` names.
    fixture.write(
        "gh",
        "#!/bin/sh\necho \"$@\" >> calls\ncase $* in *paginate*) cat found;; esac\n",
    );
    set_permissions(fixture.path("gh"), Permissions::from_mode(0o755)).unwrap();
    for (found, call) in [
        ("", "pr comment 3 "),
        ("7\n", "api -X PATCH repos/a/b/issues/comments/7 "),
    ] {
        fixture.write("found", found);
        fixture.write("calls", "");
        let path = format!(
            "{}:{}",
            fixture.path("").display(),
            std::env::var("PATH").unwrap()
        );
        let status = Command::new("bash")
            .args(["-eo", "pipefail", "-c", comment])
            .current_dir(fixture.path(""))
            .envs([
                ("PATH", path.as_str()),
                ("NUMBER", "3"),
                ("REPOSITORY", "a/b"),
            ])
            .envs([("MARKDOWN", "summary.md"), ("RUNNER_TEMP", ".")])
            .status();
        assert!(status.unwrap().success());
        let calls = fixture.text("calls");
        let own = "startswith(\"<!-- svl stereo -->\")";
        assert_says(
            &calls,
            &["api --paginate repos/a/b/issues/3/comments", own, call],
        );
        assert_eq!(calls.lines().count(), 2, "{calls}");
        assert_eq!(fixture.text("comment.md"), "<!-- svl stereo -->\n| v3 |\n");
    }
}

#[test]
fn its_actions_are_pinned_and_its_inputs_are_declared() {
    let text = include_str!("../../action.yml");
    for line in text.lines().filter(|line| line.contains("uses: ")) {
        let commit = line.split_once('@').unwrap().1.split(' ').next().unwrap();
        assert!(commit.len() == 40 && commit.bytes().all(|b| b.is_ascii_hexdigit()));
    }
    let job = Job::new(&[]);
    for used in text.split("inputs.").skip(1) {
        let name = used
            .split(|c: char| !c.is_ascii_lowercase())
            .next()
            .unwrap();
        assert!(
            table(table(&job.action, "inputs").unwrap(), name).is_some(),
            "{name}"
        );
    }
}
