//! The plug-in protocol, with programs that keep it and programs that break it.
#![cfg(feature = "exec")]

use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};
use svl::Error;
use svl::matcher::{Algorithm, Matcher, Value};
use svl::stereo::{DisparityMap, Gray, Reason, StereoPair};
use svl::timing::Clock;

/// What every program below begins with: it reads a pair as `line` and `images`.
const PRELUDE: &str = r#"
import json, os, struct, sys, time
source, target = sys.stdin.buffer, sys.stdout.buffer
def pair():
    line = json.loads(source.readline() or sys.exit())
    return line, source.read(2 * line["width"] * line["height"])
def put(bytes):
    target.write(bytes)
    target.flush()
def answer(line, values=None, **other):
    count = line["width"] * line["height"]
    reply = json.dumps({"seq": line["seq"], **(other or {"millis": 1.5})}).encode() + b"\n"
    put(reply + struct.pack("<%df" % count, *(values or [0.0] * count)))
"#;

/// A matcher that is a program of the test.
struct Plugin {
    matcher: Box<dyn Matcher>,
    map: DisparityMap,
    // Last, so that the program is ended before its file goes.
    _folder: tempfile::TempDir,
}

fn python() -> Option<PathBuf> {
    let python = PathBuf::from(std::env::var_os("SVL_PYTHON").unwrap_or_else(|| "python3".into()));
    let found = Command::new(&python).arg("--version").output().is_ok_and(|output| output.status.success());
    if !found {
        println!("skipped: no Python; name one in SVL_PYTHON");
    }
    found.then_some(python)
}

/// The program with that body; nothing where there is no Python.
fn plugin(body: &str, settings: &str) -> Option<Plugin> {
    let python = python()?;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a program, with a comma.py");
    std::fs::write(&file, format!("{PRELUDE}{body}")).unwrap();
    let text = format!("exec:command={} '{}'{settings}", python.display(), file.display());
    let matcher = text.parse::<Algorithm>().unwrap().build().unwrap();
    Some(Plugin { matcher, map: DisparityMap::new(1, 1).unwrap(), _folder: folder })
}

fn pair(width: usize, height: usize) -> StereoPair {
    let left = Gray::from_fn(width, height, |x, y| (7 * x + 13 * y) as u8).unwrap();
    let right = Gray::from_fn(width, height, |x, y| (7 * x + 13 * y + 1) as u8).unwrap();
    StereoPair::new(left, right).unwrap()
}

impl Plugin {
    fn compute(&mut self, pair: &StereoPair) -> svl::Result<Clock> {
        let mut clock = Clock::start();
        self.matcher.compute(pair, &mut self.map, &mut clock).map(|()| clock)
    }

    /// It fails within a few seconds, in one line with all these words.
    #[track_caller]
    fn fails(&mut self, words: &[&str]) {
        let start = Instant::now();
        let error = self.compute(&pair(12, 5)).err().expect("a failure");
        assert!(matches!(error, Error::Program { .. }));
        let line = error.to_string();
        assert!(start.elapsed() < Duration::from_secs(5), "{:?}: {line}", start.elapsed());
        for word in [&["a program, with a comma.py"], words].concat() {
            assert!(line.contains(word), "'{word}' is not in: {line}");
        }
        assert!(!line.contains('\n') && line.len() < 1000, "{line}");
    }
}

#[test]
fn pixels_go_and_disparities_come() {
    // Left pixels are the disparities; a right pixel of 8 is none.
    let body = r#"
while True:
    line, images = pair()
    assert (line["min_disparity"], line["max_disparity"]) == (-3, 17), line
    n = len(images) // 2
    answer(line, [float("inf") if images[n + i] == 8 else images[i] + 0.25 for i in range(n)])
"#;
    let Some(mut plugin) = plugin(body, ",min_disparity=-3,max_disparity=17") else { return };
    for (width, height) in [(12, 5), (1, 1), (33, 40), (12, 5)] {
        let pair = pair(width, height);
        let clock = plugin.compute(&pair).unwrap();
        assert_eq!(plugin.map.size(), (width, height));
        for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
            let (left, right) = (pair.left().get(x, y), pair.right().get(x, y));
            let expected = if right == 8 { Err(Reason::Unmatched) } else { Ok(f32::from(left) + 0.25) };
            assert_eq!(plugin.map.at(x, y), expected, "({x}, {y}) of {width}x{height}");
        }
        assert!(clock.times().total() <= Duration::from_micros(1500), "the program's own time: {:?}", clock.times());
    }
}

#[test]
fn a_large_pair_fits_through_the_pipes() {
    let Some(mut plugin) = plugin("while True: answer(pair()[0])", "") else { return };
    plugin.compute(&pair(1500, 1000)).unwrap();
    assert_eq!(plugin.map.valid(), 1_500_000);
}

#[test]
fn a_crash_is_told_with_its_last_words_and_the_program_is_started_again_three_times() {
    let body = r#"
line, _ = pair()
sys.stderr.write("loading\n\nTraceback\nValueError: no such thing\n")
put(b'{"seq":')
sys.exit(7)
"#;
    let Some(mut plugin) = plugin(body, "") else { return };
    for _ in 0..4 {
        plugin.fails(&["exit status: 7", "{\\\"seq\\\":", "ValueError: no such thing"]);
    }
    plugin.fails(&["failed 4 times", "given up"]);
    plugin.fails(&["given up"]);
}

#[test]
fn after_a_crash_the_next_pair_is_matched() {
    let body = r#"
line, _ = pair()
if line["seq"] % 2: answer(line)
os._exit(1)
"#;
    let Some(mut plugin) = plugin(body, "") else { return };
    plugin.compute(&pair(12, 5)).unwrap();
    plugin.fails(&["exit status: 1"]);
    plugin.compute(&pair(12, 5)).unwrap();
}

#[test]
fn a_program_that_dies_in_its_disparities_is_told() {
    let Some(mut plugin) = plugin("line, _ = pair()\nput(b'{\"seq\":1,\"millis\":0}\\n' + bytes(100))", "") else {
        return;
    };
    plugin.fails(&["exit status: 0", "after 100 bytes of disparities", "12x5 pixels are 240"]);
}

#[test]
fn a_hang_ends_at_the_timeout() {
    let Some(mut plugin) =
        plugin("pair()\nsys.stderr.write('thinking')\nsys.stderr.flush()\ntime.sleep(60)", ",timeout_s=1")
    else {
        return;
    };
    plugin.fails(&["did not answer within 1s", "nothing came", "thinking"]);
}

#[test]
fn a_program_that_reads_nothing_ends_at_the_timeout() {
    let Some(mut plugin) = plugin("time.sleep(60)", ",timeout_s=0.5") else { return };
    let error = plugin.compute(&pair(1500, 1000)).err().unwrap().to_string();
    assert!(error.contains("did not answer within 500ms: nothing came"), "{error}");
}

#[test]
fn too_little_ends_at_the_timeout_with_the_numbers() {
    let Some(mut plugin) =
        plugin("line, _ = pair()\nput(b'{\"seq\":1,\"millis\":0}\\n' + bytes(100))\ntime.sleep(60)", ",timeout_s=1")
    else {
        return;
    };
    plugin.fails(&["did not answer within 1s", "121 bytes came", "its line and 240"]);
}

#[test]
fn too_much_is_refused() {
    let Some(mut plugin) = plugin("line, _ = pair()\nanswer(line, [0.0] * 60 + [1.0])\npair()", "") else { return };
    // Python's own check would refuse a wrong count.
    let body = "line, _ = pair()\nput(b'{\"seq\":1,\"millis\":0}\\n' + bytes(244))\npair()";
    plugin.fails(&["struct.error"]);
    let Some(mut plugin) = self::plugin(body, "") else { return };
    plugin.fails(&["4 bytes", "after its reply for 12x5 pixels"]);
}

#[test]
fn garbage_is_shown() {
    for (reply, words) in [
        (r"b'hello \xff world\n'", ["\"hello \\xff world\"", "expected"]),
        (r"b'\n'", ["\"\"", "EOF while parsing"]),
        (r"b'x' * 10**6", ["\"xxx", "no end of line within 65536 bytes"]),
        (r#"b'{"seq":2,"millis":1}\n'"#, ["seq", "asked for seq 1"]),
        (r#"b'{"seq":1}\n'"#, ["neither millis", "nor error"]),
        (r#"b'{"seq":1,"millis":-5}\n'"#, ["neither millis", "nor error"]),
        (r#"b'{"seq":1,"millis":1}\n' + b'\xff' * 240"#, ["the disparity NaN at (0, 0)", "none is +inf"]),
    ] {
        let Some(mut plugin) = plugin(&format!("pair()\nput({reply})\ntime.sleep(60)"), "") else { return };
        plugin.fails(&words);
    }
}

#[test]
fn an_error_reply_concerns_its_pair_alone() {
    let body = r#"
for seq in range(1, 20):
    line, _ = pair()
    if seq % 2: put(json.dumps({"seq": seq, "error": "too\ndark"}).encode() + b"\n")
    else: answer(line)
"#;
    let Some(mut plugin) = plugin(body, "") else { return };
    for _ in 0..6 {
        plugin.fails(&["answered: too dark"]);
        plugin.compute(&pair(12, 5)).unwrap();
    }
}

#[test]
fn closed_pipes_are_told() {
    let Some(mut plugin) = plugin("pair()\nsys.stdout.close()\nos.close(1)\ntime.sleep(60)", "") else { return };
    plugin.fails(&["closed its output"]);
    let Some(mut plugin) = self::plugin("os.close(0)\ntime.sleep(60)", "") else { return };
    std::thread::sleep(Duration::from_millis(300));
    plugin.fails(&["does not read its input"]);
}

#[test]
fn a_flood_on_stderr_neither_blocks_nor_grows() {
    let body = r#"
while True:
    line, _ = pair()
    if line["seq"] == 3: raise ValueError("the end")
    for _ in range(5000): sys.stderr.write("x" * 999 + "\n")
    answer(line)
"#;
    let Some(mut plugin) = plugin(body, "") else { return };
    plugin.compute(&pair(12, 5)).unwrap();
    plugin.compute(&pair(12, 5)).unwrap();
    plugin.fails(&["exit status: 1", "ValueError: the end"]);
}

/// A dropped matcher leaves no program behind, not even one that ignores the end of its input.
#[cfg(target_os = "linux")]
#[test]
fn dropping_ends_the_program() {
    let body = "line, _ = pair()\nanswer(line, [float(os.getpid())] * 60)\ntime.sleep(60)";
    let Some(mut plugin) = plugin(body, "") else { return };
    plugin.compute(&pair(12, 5)).unwrap();
    let process = PathBuf::from(format!("/proc/{}", plugin.map.at(0, 0).unwrap()));
    assert!(process.exists());
    drop(plugin);
    assert!(!process.exists());
}

#[test]
fn what_cannot_be_started_is_told_before_the_first_pair() {
    let error = |text: &str| text.parse::<Algorithm>().and_then(|a| a.build()).err().unwrap().to_string();
    let missing = error("exec:command=no-such-program --fast");
    assert!(
        missing.contains("program `no-such-program --fast` cannot be started") && !missing.contains('\n'),
        "{missing}"
    );
    assert!(error("exec").contains("exec:command=PROGRAM"));
    assert!(error("exec:command=it's").contains("closes its quotes"));
}

#[test]
fn a_command_with_commas_stands_in_quotes() {
    let command = |text: &str| {
        let algorithm: Algorithm = text.parse().unwrap();
        let again: Algorithm = format!("exec:{}", algorithm.parameters()).parse().unwrap();
        assert_eq!(algorithm.parameters(), again.parameters(), "written and read again");
        assert_eq!(algorithm.parameters().int("max_disparity"), 64, "{text}");
        let command = algorithm.parameters().iter().find(|(name, _)| *name == "command").unwrap().1;
        match command {
            Value::Text(command) => command.clone(),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(command("exec:command=python3 a.py --x=1:2,max_disparity=64"), "python3 a.py --x=1:2");
    assert_eq!(command("exec:command='python3 a.py 1,2',max_disparity=64"), "python3 a.py 1,2");
    assert_eq!(command("exec:max_disparity=64,command=python3 'a b.py' \"1,2\""), "python3 'a b.py' \"1,2\"");
    assert_eq!(command("exec:command=\"python3 'a, b.py'\",max_disparity=64"), "python3 'a, b.py'");
}

#[test]
fn the_example_adapter_matches() {
    let Some(python) = python() else { return };
    if !Command::new(&python).args(["-c", "import cv2, numpy"]).output().is_ok_and(|o| o.status.success()) {
        println!("skipped: {} has no cv2 and numpy", python.display());
        return;
    }
    let texture =
        |x: usize, y: usize| ((x * 7919 + y * 104_729 + x * y * 31) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let side = |shift: usize| Gray::from_fn(160, 60, |x, y| (texture(x + shift, y) >> 56) as u8).unwrap();
    let pair = StereoPair::new(side(0), side(11)).unwrap();
    let adapter = concat!(env!("CARGO_MANIFEST_DIR"), "/adapters/opencv.py");
    for method in ["bm", "bm --block 15 --uniqueness 5 --texture 0", "sgbm", "sgbm --block 5 --speckle-window 50"] {
        let text = format!("exec:command={} '{adapter}' {method},max_disparity=40", python.display());
        let mut map = DisparityMap::new(1, 1).unwrap();
        let mut matcher = text.parse::<Algorithm>().unwrap().build().unwrap();
        for _ in 0..2 {
            matcher.compute(&pair, &mut map, &mut Clock::start()).unwrap();
            let right = map.disparity().pixels().filter(|d| (d - 11.0).abs() <= 0.5).count();
            assert!(right > 4000 && right * 20 > map.valid() * 19, "{method}: {right} of {} valid", map.valid());
        }
    }
    let text = format!("exec:command={} '{adapter}' bm --block 8", python.display());
    let mut matcher = text.parse::<Algorithm>().unwrap().build().unwrap();
    let error = matcher.compute(&pair, &mut DisparityMap::new(1, 1).unwrap(), &mut Clock::start()).unwrap_err();
    assert!(error.to_string().contains("answered: OpenCV"), "{error}");
}
