//! Programs that keep the exec protocol.

use super::fixture::{pair, python, start};
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput};
use svl_core::stereo::{Gray, Reason, RectifiedPair, Rgb, Rig, StereoPair};

#[test]
fn pixels_go_and_disparities_come() {
    // Left pixels are the disparities; a right pixel of 8 means none.
    let body = r#"
while True:
    line, images = pair()
    assert (line["min_disparity"], line["max_disparity"]) == (-3, 255), line
    assert line["channels"] == 1 and line["threads"] >= 1 and "batch" not in line, line
    n = len(images) // 2
    answer(line, [float("inf") if images[n + i] == 8 else images[i] + 0.25 for i in range(n)])
"#;
    let Some(mut plugin) = start(body, ",min_disparity=-3,max_disparity=255") else {
        return;
    };
    for (width, height) in [(12, 5), (1, 1), (33, 40), (12, 5)] {
        let pair = pair(width, height);
        let clock = plugin.compute(&pair).unwrap();
        assert_eq!(plugin.output.disparity.size(), (width, height));
        for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
            let (left, right) = (pair.left().get(x, y), pair.right().get(x, y));
            let expected = if right == 8 {
                Err(Reason::Unmatched)
            } else {
                Ok(f32::from(left) + 0.25)
            };
            assert_eq!(
                plugin.output.disparity.at(x, y),
                expected,
                "({x}, {y}) of {width}x{height}"
            );
        }
        assert!(
            clock.times().total() <= Duration::from_micros(1500),
            "the program's own time: {:?}",
            clock.times()
        );
    }
}

#[test]
fn a_large_pair_fits_through_the_pipes() {
    let Some(mut plugin) = start("while True: answer(pair()[0])", "") else {
        return;
    };
    plugin.compute(&pair(1500, 1000)).unwrap();
    assert_eq!(plugin.output.disparity.valid(), 1_500_000);
}

#[test]
fn an_error_reply_concerns_its_pair_alone() {
    let body = r#"
for seq in range(1, 20):
    line, _ = pair()
    if seq % 2: put(json.dumps({"seq": seq, "error": "too\ndark"}).encode() + b"\n")
    else: answer(line)
"#;
    let Some(mut plugin) = start(body, "") else {
        return;
    };
    for _ in 0..6 {
        plugin.fails(&["answered: too dark"]);
        plugin.compute(&pair(12, 5)).unwrap();
    }
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
    let Some(mut plugin) = start(body, "") else {
        return;
    };
    plugin.compute(&pair(12, 5)).unwrap();
    plugin.compute(&pair(12, 5)).unwrap();
    plugin.fails(&["exit status: 1", "ValueError: the end"]);
}

/// A dropped matcher leaves no program behind, not even one that ignores the end of its input.
#[cfg(target_os = "linux")]
#[test]
fn dropping_ends_the_program() {
    let body = r#"
line, _ = pair()
put(json.dumps({"hello": {"name": str(os.getpid())}}).encode() + b"\n")
answer(pair()[0])
time.sleep(60)
"#;
    let Some(mut plugin) = start(body, "") else {
        return;
    };
    plugin.compute(&pair(12, 5)).unwrap();
    let process = PathBuf::from("/proc").join(plugin.program().unwrap().name.unwrap());
    assert!(process.exists());
    drop(plugin);
    assert!(!process.exists());
}

#[test]
fn the_example_adapter_matches() {
    let Some(python) = python() else { return };
    if !Command::new(&python)
        .args(["-c", "import cv2, numpy"])
        .output()
        .is_ok_and(|o| o.status.success())
    {
        crate::common::skip("no Python with cv2, numpy; SVL_PYTHON names one");
        return;
    }
    let texture = |x: usize, y: usize| {
        ((x * 7919 + y * 104_729 + x * y * 31) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
    };
    let side =
        |shift: usize| Gray::from_fn(160, 60, |x, y| (texture(x + shift, y) >> 56) as u8).unwrap();
    let pair = StereoPair::new(side(0), side(11)).unwrap();
    let rectified = RectifiedPair::assume(&pair);
    let adapter = crate::common::repository().join("adapters/opencv.py");
    for method in [
        "bm",
        "bm --block 15 --uniqueness 5 --texture 0",
        "sgbm",
        "sgbm --block 5 --speckle-window 50",
    ] {
        let text = format!(
            "exec:command={} '{}' {method},max_disparity=40",
            python.display(),
            adapter.display()
        );
        let mut output = MatchOutput::new().unwrap();
        let mut matcher = text.parse::<Algorithm>().unwrap().build().unwrap();
        for _ in 0..2 {
            matcher
                .compute(rectified, &MatchContext::default(), &mut output)
                .unwrap();
            let map = &output.disparity;
            let right = map
                .disparity()
                .pixels()
                .filter(|d| (d - 11.0).abs() <= 0.5)
                .count();
            assert!(
                right > 4000 && right * 20 > map.valid() * 19,
                "{method}: {right} of {} valid",
                map.valid()
            );
        }
    }
    let text = format!(
        "exec:command={} '{}' bm --block 8",
        python.display(),
        adapter.display()
    );
    let mut matcher = text.parse::<Algorithm>().unwrap().build().unwrap();
    let error = matcher
        .compute(
            rectified,
            &MatchContext::default(),
            &mut MatchOutput::new().unwrap(),
        )
        .unwrap_err();
    assert!(
        error.to_string().contains("answered: error: OpenCV"),
        "{error}"
    );
}

#[test]
fn a_program_answers_cells_itself() {
    let body = r#"
line, _ = pair()
assert (line["columns"], line["rows"]) == (5, 3) and "rig" not in line, line
sure = {"disparity_px": 4, "probability": 0.75}
answer(line, None, millis=1.5, cells=[None, {"disparity_px": 12.5}] + 13 * [sure])
line, _ = pair()
answer(line)
line, _ = pair()
rig = {"focal_px": 300.0, "cx_px": 6.0, "cy_px": 2.0, "baseline_m": 0.1, "doffs_px": 0.0}
assert line["rig"] == rig, line
answer(line, None, millis=1.5, cells=15 * [{"disparity_px": 10}])
"#;
    let Some(mut plugin) = start(body, "") else {
        return;
    };
    let pair = pair(20, 12);
    plugin.compute(&pair).unwrap();
    let grid = plugin.output.grid.take().unwrap();
    let cell = |column: usize, row: usize| {
        let cell = grid.cell(column, row);
        (cell.depth.map(|depth| depth.median_px), cell.probability)
    };
    assert_eq!(cell(0, 0), (None, None));
    assert_eq!(cell(1, 0), (Some(12.5), None));
    assert_eq!(cell(4, 2), (Some(4.0), Some(0.75)));
    // Another pair, another answer: its cells are computed from its disparities.
    plugin.compute(&pair).unwrap();
    assert!(plugin.output.grid.is_none());
    let context = MatchContext {
        rig: Some(Rig::new(300.0, (6.0, 2.0), 0.1, 0.0).unwrap()),
        ..MatchContext::default()
    };
    plugin.compute_with(&pair, &context).unwrap();
    let grid = plugin.output.grid.take().unwrap();
    let distance = grid.cell(2, 1).depth.unwrap().distance_m;
    assert!((distance.unwrap() - 3.0).abs() < 1e-9, "{distance:?}");
}

#[test]
fn a_program_that_says_what_it_is_gets_what_it_wants() {
    // The first pair comes in grey, then again in colour; the answer is the red channel of the left
    // image.
    let body = r#"
line, _ = pair()
assert line["channels"] == 1, line
put(json.dumps({"hello": {"name": "my net", "version": "1.2", "device": "CPU", "threads": 3,
    "isa": "avx9", "model": "abc", "color": True}}).encode() + b"\n")
while True:
    line, images = pair()
    assert (line["channels"], line["seq"], line.get("name")) == (3, line["seq"], "motor"), line
    n = line["width"] * line["height"]
    red = [images[3 * i] for i in range(n)]
    answer(line, red, millis=1.5, preparing_millis=0.4)
"#;
    let Some(mut plugin) = start(body, ",max_disparity=255") else {
        return;
    };
    assert_eq!(plugin.program(), None);
    let pair = pair(12, 5);
    let red = Rgb::from_fn(12, 5, |x, y| [(10 * y + x) as u8, 77, 78]).unwrap();
    let color = [red.clone(), red];
    let context = MatchContext {
        name: Some("motor"),
        color: Some(&color),
        ..MatchContext::default()
    };
    for _ in 0..2 {
        plugin.compute_with(&pair, &context).unwrap();
        assert_eq!(plugin.output.disparity.at(3, 4), Ok(43.0));
    }
    // Without colours, three times the grey image.
    let grey = MatchContext {
        color: None,
        ..context
    };
    plugin.compute_with(&pair, &grey).unwrap();
    let left = f32::from(pair.left().get(3, 4));
    assert_eq!(plugin.output.disparity.at(3, 4), Ok(left));
    let program = plugin.program().unwrap();
    let words = program.words();
    let expected = "my net 1.2, CPU, 3 threads, avx9, model abc, in colour, reports 1.5 ms a pair, \
                    0.4 ms of it preparing, answers after";
    assert!(words.starts_with(expected), "{words}");
}

#[test]
fn several_pairs_go_at_once() {
    let body = r#"
line, _ = pair()
put(b'{"hello":{"batch":4}}\n')
line, _ = pair()
assert line["batch"] == 1, line
answer(line)
for count in (3, 2):
    lines = [pair()[0] for _ in range(count)]
    assert [line["batch"] for line in lines] == list(range(count, 0, -1)), lines
    for line in lines:
        if line["seq"] == 5: put(b'{"seq":5,"error":"too dark"}\n')
        else: answer(line, [float(line["seq"])] * 60)
line, _ = pair()
answer(line)
"#;
    let Some(mut plugin) = start(body, "") else {
        return;
    };
    let pair = pair(12, 5);
    plugin.compute(&pair).unwrap();
    assert_eq!(plugin.batch(), 4);
    for (count, first) in [(3, 3), (2, 6)] {
        plugin.announce(&pair, count);
        for sequence in first..first + count {
            let matched = plugin
                .compute(&pair)
                .map(|_| plugin.output.disparity.at(0, 0));
            match sequence {
                5 => assert!(matched.unwrap_err().to_string().contains("too dark")),
                _ => assert_eq!(matched.unwrap(), Ok(sequence as f32)),
            }
        }
    }
    plugin.compute(&pair).unwrap();
}

#[test]
fn disparities_outside_the_range_are_none_and_counted() {
    let body = r#"
while True: answer(pair()[0], [-0.6, -0.5, 0.0, 64.0, 64.5, 64.6] + [float("inf")] * 54)
"#;
    let Some(mut plugin) = start(body, ",max_disparity=64") else {
        return;
    };
    for pairs in 1..3 {
        plugin.compute(&pair(12, 5)).unwrap();
        assert_eq!(plugin.output.disparity.valid(), 4);
        let program = plugin.program().unwrap();
        assert_eq!(
            (program.out_of_range, program.disparities),
            (2 * pairs, 6 * pairs)
        );
        let warnings = program.warnings().join("; ");
        assert!(warnings.contains("are outside min_disparity"), "{warnings}");
    }
}

#[test]
fn times_that_do_not_fit_are_told() {
    for (millis, sleep, words) in [
        ("0.1", "0.2", "may omit work"),
        ("1e6", "0", "which is used"),
    ] {
        let body = format!(
            "while True:\n    line, _ = pair()\n    time.sleep({sleep})\n    answer(line, \
             millis={millis})"
        );
        let Some(mut plugin) = start(&body, "") else {
            return;
        };
        for pairs in 0..4 {
            let clock = plugin.compute(&pair(12, 5)).unwrap();
            assert!(clock.times().total() < Duration::from_secs(60));
            assert_eq!(plugin.program().unwrap().pairs, pairs);
        }
        let warnings = plugin.program().unwrap().warnings();
        assert!(
            warnings.len() == 1 && warnings[0].contains(words),
            "{warnings:?}"
        );
    }
}
