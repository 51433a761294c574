//! `svl score --jobs`: the report is that of one thread, but for its times.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says};
use super::interrupt::wait_until;
use super::results::{assert_same_report, unit_files, write_program};
use std::process::{Command, Stdio};

/// Starts a command, and kills it as soon as the report `r` has that many units.
fn kill(fixture: &Fixture, line: &str, units: usize) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("svl"));
    let command = command.current_dir(fixture.path(""));
    let command = command.args(line.split_whitespace()).args(["-o", "r"]);
    let mut killed = command.stderr(Stdio::null()).spawn().unwrap();
    wait_until(&mut killed, || {
        unit_files(fixture, "r", ".unit").len() >= units
    });
    killed.kill().unwrap();
    killed.wait().unwrap();
}

#[test]
fn a_report_by_jobs_is_that_of_one_thread() {
    let fixture = Fixture::new();
    fixture.write_recorded_arena("short.toml", 70);
    let line = "score short.toml --seeds 1 --algo v3 --algo v5 --algo bm --stress noise=8 \
                --rerun none -q";
    fixture.run(&format!("{line} -o plain"));
    for jobs in [1, 2, 7] {
        let report = format!("by-{jobs}");
        fixture.run(&format!("{line} --jobs {jobs} -o {report}"));
        assert_same_report(&fixture, ["plain", &report], &report);
    }
    let times = fixture.column("by-2/rows.csv", "total_us");
    assert!(times.iter().all(String::is_empty), "{times:?}");
    let words = "not measured with --jobs";
    for file in ["manifest.json", "summary.json"] {
        assert_eq!(fixture.json_file(&format!("by-2/{file}"))["times"], words);
    }
    for file in ["index.html", "summary.md"] {
        assert_says(&fixture.text(&format!("by-2/{file}")), &[words]);
    }
    // Killed, and resumed with other jobs and without.
    kill(&fixture, &format!("{line} --jobs 2"), 1);
    kill(&fixture, line, 4);
    kill(&fixture, &format!("{line} --jobs 7"), 7);
    let every = format!("{line} --jobs 2 --every 3");
    for shard in ["1/2", "2/2"] {
        fixture.run(&format!("{every} --shard {shard} -o shards"));
    }
    fixture.run(&format!("{every} -o every"));
    assert_same_report(&fixture, ["every", "shards"], "shards");
    fixture.run(&format!("{line} --jobs 2 -o r"));
    assert_same_report(&fixture, ["plain", "r"], "killed");
    // Times are measured where they are absent.
    fixture.run(&format!("{line} --times -o r"));
    let times = fixture.column("r/rows.csv", "total_us");
    assert!(times.iter().all(|us| !us.is_empty()), "{times:?}");
    assert_same_report(&fixture, ["plain", "r"], "measured");
}

#[test]
fn programs_maps_and_drives_are_those_without_jobs() {
    let fixture = Fixture::new();
    fixture.write("small.toml", super::drive::courses(""));
    write_program(&fixture, (80, 60));
    let drives = "score small.toml --drives none --algo p=exec:command=./answers.sh --algo truth \
                  --rerun none -q";
    super::results::write_pairs(&fixture, "p");
    let maps = "score p --algo net=files:maps/*.npy --algo bm:max_disparity=8 --rerun none -q";
    for line in [drives, maps] {
        for (jobs, report) in [("", "plain"), (" --jobs 2", "jobs")] {
            fixture.run(&format!("{line}{jobs} --force -o {report}"));
        }
        assert_same_report(&fixture, ["plain", "jobs"], line);
        let times = fixture.column("jobs/rows.csv", "total_us");
        assert!(times.iter().all(String::is_empty), "{line}: {times:?}");
    }
}

#[test]
fn jobs_that_cannot_be_are_refused_or_fewer() {
    let fixture = Fixture::recorded();
    fixture.write_short_arena("short.toml", 2);
    fixture.fails(
        "score run.mcap --jobs 0 => 2: --jobs | 1 to 1024
         score run.mcap --jobs 2 --repeat 3 => 2: --repeat
         score run.mcap --jobs 2 --times => 2: --times
         score run.mcap --jobs 2 --threads 2 => 2: --jobs and --threads
         --threads 2 score run.mcap --jobs 2 => 2: --jobs and --threads
         score ros2: --jobs 2 --to 1 => 2: ros2: | --jobs is for recordings
         score run.mcap --jobs 2 --latency measured => 2: run.mcap | measured latency | --jobs
         score arena --jobs 2 --gate => 2: gate in line | times | --jobs",
    );
    let ran = fixture.svl("score run.mcap --algo bm --jobs 900 --rerun none -o r");
    assert_says(&ran.stderr, &["--jobs 900: fewer, for", "core"]);
    ran.done();
}
