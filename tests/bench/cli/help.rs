//! Help, completions and the man page.

use super::fixture::{Fixture, assert_says};

#[test]
fn help_tells_what_svl_is_for() {
    insta::assert_snapshot!(Fixture::new().run("--help"));
}

/// Wide enough or not, what svl broke into lines by hand stays so.
#[test]
fn no_terminal_breaks_the_text_below_the_options() {
    let fixture = Fixture::new();
    for command in ["record", "replay", "score", "match", "eval", "tune"] {
        let below = |columns: &str| {
            let text = fixture
                .svl_with(&[command, "--help"], &[("COLUMNS", columns)])
                .done();
            text.split("Examples:\n").nth(1).map(str::to_owned)
        };
        assert!(
            below("80").is_some() && below("80") == below("100"),
            "{command}"
        );
    }
}

#[test]
fn no_arguments_is_wrong_usage() {
    assert_eq!(Fixture::new().svl("").code, Some(2));
}

#[test]
fn completions_and_man_page() {
    let fixture = Fixture::new();
    assert_says(&fixture.run("completions bash"), &["_svl"]);
    assert_says(&fixture.run("man"), &[".TH svl"]);
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    let svl = assert_cmd::cargo::cargo_bin!("svl").display().to_string();
    for command in ["algos", "algos --json", "completions bash", "man", "--help"] {
        let shell = format!("{svl} {command} | true; exit ${{PIPESTATUS[0]}}");
        let output = std::process::Command::new("bash")
            .args(["-c", &shell])
            .output()
            .unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.success() && stderr.is_empty(),
            "{command}: {stderr}"
        );
    }
}
