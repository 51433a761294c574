//! Programs that break the exec protocol: each gets a specific message, in time.

use super::fixture::{pair, start};

#[test]
fn a_crash_is_told_with_its_last_words_and_the_program_is_started_again_three_times() {
    let body = r#"
line, _ = pair()
sys.stderr.write("loading\n\nTraceback\nValueError: no such thing\n")
put(b'{"seq":')
sys.exit(7)
"#;
    let Some(mut plugin) = start(body, "") else {
        return;
    };
    for _ in 0..4 {
        plugin.fails(&[
            "exit status: 7",
            "{\\\"seq\\\":",
            "ValueError: no such thing",
        ]);
    }
    plugin.fails(&["failed 4 times", "not started again"]);
    plugin.fails(&["not started again"]);
}

#[test]
fn after_a_crash_the_next_pair_is_matched() {
    let body = r#"
line, _ = pair()
if line["seq"] % 2: answer(line)
os._exit(1)
"#;
    let Some(mut plugin) = start(body, "") else {
        return;
    };
    plugin.compute(&pair(12, 5)).unwrap();
    plugin.fails(&["ended (exit status: 1) before it answered"]);
    plugin.compute(&pair(12, 5)).unwrap();
}

#[test]
fn a_program_that_dies_in_its_disparities_is_told() {
    let Some(mut plugin) = start(
        "line, _ = pair()\nput(b'{\"seq\":1,\"millis\":0}\\n' + bytes(100))",
        "",
    ) else {
        return;
    };
    plugin.fails(&[
        "exit status: 0",
        "after 100 bytes of disparities",
        "12x5 pixels are 240",
    ]);
}

#[test]
fn a_hang_ends_at_the_timeout() {
    let Some(mut plugin) = start(
        "pair()\nsys.stderr.write('thinking')\nsys.stderr.flush()\ntime.sleep(60)",
        ",timeout_s=8",
    ) else {
        return;
    };
    plugin.fails(&["timed out after 8s", "nothing received", "thinking"]);
}

#[test]
fn a_program_that_reads_nothing_ends_at_the_timeout() {
    let Some(mut plugin) = start("time.sleep(60)", ",timeout_s=0.5") else {
        return;
    };
    let error = plugin.compute(&pair(1500, 1000)).err().unwrap().to_string();
    assert!(
        error.contains("timed out after 500ms: nothing received"),
        "{error}"
    );
}

#[test]
fn too_little_ends_at_the_timeout_with_the_numbers() {
    let Some(mut plugin) = start(
        "line, _ = pair()\nput(b'{\"seq\":1,\"millis\":0}\\n' + bytes(100))\ntime.sleep(60)",
        ",timeout_s=8",
    ) else {
        return;
    };
    plugin.fails(&[
        "timed out after 8s",
        "121 bytes received",
        "its line and 240",
    ]);
}

#[test]
fn too_much_is_refused() {
    let Some(mut plugin) = start(
        "line, _ = pair()\nanswer(line, [0.0] * 60 + [1.0])\npair()",
        "",
    ) else {
        return;
    };
    // Python's own check would reject a wrong count.
    let body = "line, _ = pair()\nput(b'{\"seq\":1,\"millis\":0}\\n' + bytes(244))\npair()";
    plugin.fails(&["struct.error"]);
    let Some(mut plugin) = start(body, "") else {
        return;
    };
    plugin.fails(&["4 bytes", "after its reply for 12x5 pixels"]);
}

#[test]
fn garbage_is_shown() {
    for (reply, words) in [
        (
            r"b'hello \xff world\n'",
            ["\"hello \\xff world\"", "expected"],
        ),
        (r"b'\n'", ["\"\"", "EOF while parsing"]),
        (
            r"b'x' * 10**6",
            ["\"xxx", "no end of line within 65536 bytes"],
        ),
        (r#"b'{"seq":2,"millis":1}\n'"#, ["seq", "asked for seq 1"]),
        (r#"b'{"seq":1}\n'"#, ["neither millis", "nor error"]),
        (
            r#"b'{"seq":1,"millis":-5}\n'"#,
            ["neither millis", "nor error"],
        ),
        (
            r#"b'{"seq":1,"millis":1,"preparing_millis":2}\n'"#,
            ["preparing_millis is not 0 to millis", "expected"],
        ),
        (
            r#"b'{"seq":1,"millis":1}\n' + b'\xff' * 240"#,
            ["the disparity NaN at (0, 0)", "none is +inf"],
        ),
    ] {
        let Some(mut plugin) = start(&format!("pair()\nput({reply})\ntime.sleep(60)"), "") else {
            return;
        };
        plugin.fails(&words);
    }
}

#[test]
fn closed_pipes_are_told() {
    let Some(mut plugin) = start(
        "pair()\nsys.stdout.close()\nos.close(1)\ntime.sleep(60)",
        "",
    ) else {
        return;
    };
    plugin.fails(&["closed its output"]);
    let body = "os.close(0)\nopen(sys.argv[0] + '.closed', 'w').close()\ntime.sleep(60)";
    let Some(mut plugin) = start(body, "") else {
        return;
    };
    plugin.wait_for("closed");
    plugin.fails(&["does not read its input"]);
}

#[test]
fn cells_that_no_grid_has_are_told() {
    for (cells, words) in [
        ("[None] * 14", "gave 14 cells, but the grid has 15"),
        (
            "[{'disparity_px': 1, 'probability': 1.5}] * 15",
            "gave cell 0 a probability that is not 0 to 1",
        ),
        ("[{'disparity': 1}] * 15", "unknown field `disparity`"),
        ("[1] * 15", "expected struct"),
    ] {
        let body = format!("line, _ = pair()\nanswer(line, None, millis=1, cells={cells})");
        let Some(mut plugin) = start(&body, "") else {
            return;
        };
        plugin.fails(&[words]);
    }
}

#[test]
fn a_program_that_says_what_it_is_wrongly_is_told() {
    for (hello, words) in [
        (
            r#"{"hello":{"batch":65}}"#,
            "wants 65 pairs at once; at most 64",
        ),
        (r#"{"hello":{"colour":true}}"#, "unknown field `colour`"),
        (r#"{"hello":{}}"#, "identified itself twice"),
    ] {
        let body = format!("while True:\n    pair()\n    put(b'{hello}\\n')");
        let Some(mut plugin) = start(&body, "") else {
            return;
        };
        plugin.fails(&[words]);
    }
}

/// Processes started by a failed program end with it.
#[cfg(target_os = "linux")]
#[test]
fn a_program_is_ended_with_what_it_started() {
    let body = r#"
import subprocess
child = subprocess.Popen(["sleep", "60"], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
line, _ = pair()
put(json.dumps({"hello": {"name": str(child.pid)}}).encode() + b"\n")
answer(pair()[0])
pair()
put(b"garbage\n")
time.sleep(60)
"#;
    let Some(mut plugin) = start(body, "") else {
        return;
    };
    plugin.compute(&pair(12, 5)).unwrap();
    let pid = plugin.program().unwrap().name.unwrap();
    let state = || std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    assert!(state().contains("(sleep)"));
    plugin.fails(&["garbage"]);
    // Gone, or a zombie until its new parent has seen its end.
    let is_over = || state().is_empty() || state().contains(") Z ");
    let began = std::time::Instant::now();
    while !is_over() {
        assert!(began.elapsed().as_secs() < 30, "{}", state());
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
}
