//! The files of `examples/robot/`: valid, and their commands publish.
#![cfg(unix)]

use super::heard;
use super::robot::{self, Fault, Robot};
use crate::cli::fixture::Fixture;
use crate::common::{python, repository, skip};
use std::process::{Command, Stdio};

const SVL: &str = "/usr/bin/svl";

/// Runs the command of an example against a robot until its cloud was heard, and interrupts it as
/// systemd and ROS do.
#[track_caller]
fn assert_publishes(n: u16, command: &[&str]) {
    let robot = Robot::start(n, Fault::None);
    let publish = robot.source("/svl");
    let mut svl = Command::new(assert_cmd::cargo::cargo_bin!("svl"))
        .args(command)
        .env("ROS_DOMAIN_ID", robot::domain(n).to_string())
        .env("ROS_LOCALHOST_ONLY", "1")
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    heard(&publish, &["/svl/points"], |_| true);
    let interrupt = Command::new("kill")
        .args(["-INT", &svl.id().to_string()])
        .status();
    assert!(interrupt.unwrap().success());
    // A busy machine may lose images.
    let code = svl.wait().unwrap().code();
    assert!(matches!(code, Some(0 | 4)), "{code:?}");
}

#[test]
fn the_service_is_valid_and_publishes() {
    let text = std::fs::read_to_string(repository().join("examples/robot/svl.service")).unwrap();
    let command = text
        .lines()
        .find_map(|line| line.strip_prefix("ExecStart="));
    let words: Vec<_> = command.unwrap().split_whitespace().collect();
    assert_eq!(words[0], SVL);
    assert_publishes(15, &words[1..]);
    // systemd wants a program that is there.
    let svl = assert_cmd::cargo::cargo_bin!("svl");
    let text = text.replace(SVL, &svl.display().to_string());
    let fixture = Fixture::new();
    let file = fixture.write("svl.service", text);
    let verify = Command::new("systemd-analyze")
        .args(["verify", "--man=no"])
        .arg(file)
        .output();
    let Ok(verify) = verify else {
        skip("no systemd-analyze");
        return;
    };
    // It warns of a wrong value, and exits with 0.
    let said = String::from_utf8_lossy(&verify.stderr);
    assert!(
        verify.status.success() && !said.contains("svl.service"),
        "{said}"
    );
}

#[test]
fn the_launch_file_is_valid_and_publishes() {
    let file = repository().join("examples/robot/svl.launch.py");
    let arguments = ["left:=/cam0/image_rect", "right:=/cam1/image_rect"].map(Into::into);
    let args = [file.into_os_string()].into_iter().chain(arguments);
    let Some(output) = python("launch_file.py", "json", args) else {
        return;
    };
    let words: Vec<String> = serde_json::from_slice(&output).unwrap();
    let words: Vec<_> = words.iter().map(String::as_str).collect();
    assert_eq!(words[..2], ["svl", "replay"]);
    assert_publishes(16, &words[1..]);
}
