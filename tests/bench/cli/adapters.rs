//! The files of `adapters/` for programs behind `exec`: the Python module, the C++ header,
//! networks.
#![cfg(unix)]

use super::fixture::{Fixture, assert_says};
use crate::common::datasets;
use std::path::PathBuf;
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Python with these modules; `None`, with a note, unless it has all of them.
pub fn python_with(modules: &str) -> Option<String> {
    let python = std::env::var("SVL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let import = format!("import {modules}");
    let output = Command::new(&python).args(["-c", &import]).output();
    if !output.is_ok_and(|output| output.status.success()) {
        crate::common::skip(&format!("no Python with {modules}; SVL_PYTHON names one"));
        return None;
    }
    Some(python)
}

/// A program in Python that imports svl_bench.matcher, for `exec`.
fn program(python: &str, words: &str) -> String {
    format!("exec:command='env' 'PYTHONPATH={ROOT}/src/python' '{python}' {words}")
}

/// A program by a user of the module, with its errors.
const DECORATED: &str = r#"
import numpy as np
from svl_bench.matcher import matcher

@matcher(name="mine", version="3", color=True)
def mine(left, right, request):
    print("a library prints")
    assert left.shape == right.shape == (240, 320, 3), left.shape
    if request.sequence == 1:
        raise ValueError("no\nsuch texture")
    if request.sequence == 2:
        return np.zeros((2, 2))
    cells = [(5.0, 0.9)] + [None] * (request.grid[0] * request.grid[1] - 1)
    return np.where(left[..., 0] % 2 == 0, 5.0, np.nan), cells
"#;

#[test]
fn a_decorated_function_of_two_arrays_is_a_matcher() {
    let Some(python) = python_with("numpy") else {
        return;
    };
    let fixture = Fixture::new();
    fixture.write("mine.py", DECORATED);
    fixture.record("a.mcap", "--frames 4");
    let mine = format!("mine={}", program(&python, "mine.py"));
    let ran = fixture.svl(&[
        "score", "a.mcap", "--algo", &mine, "-o", "r", "--rerun", "none",
    ]);
    // Two of the four pairs fail, each with its own message.
    assert_eq!(ran.code, Some(4));
    let shape = "disparities of shape (2, 2), expected (240, 320)";
    assert_says(&ran.stderr, &["ValueError: no such texture", shape]);
    fixture.transcript(
        "cat r/summary.md => program: mine: mine 3, in colour, reports
        cat r/cells.csv => 2x ,0.9,
        cat r/manifest.json => /algorithms/0/program/name = mine \
        | /algorithms/0/program/color = true",
    );
}

#[test]
fn images_and_outputs_of_networks_have_many_forms() {
    let Some(python) = python_with("numpy") else {
        return;
    };
    let output = Command::new(&python)
        .arg(format!("{ROOT}/tests/python/matcher_test.py"))
        .env("PYTHONPATH", format!("{ROOT}/src/python"))
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(
        String::from_utf8_lossy(&output.stdout).trim(),
        "well",
        "{error}"
    );
}

#[test]
fn a_network_in_onnx_equals_its_twin_alone_and_in_batches() {
    let Some(python) = python_with("numpy, onnx, onnxruntime") else {
        return;
    };
    let fixture = Fixture::new();
    fixture.record("a.mcap", "--frames 5");
    fixture.write_pair("l.pgm", "r.pgm", (40, 20), 3);
    let tiny = format!("{ROOT}/tests/python/tiny_network.py");
    let wrote = Command::new(&python)
        .args([&tiny, "tiny.onnx"])
        .current_dir(fixture.path(""))
        .status();
    assert!(wrote.unwrap().success());
    let adapter = format!("'{ROOT}/adapters/svl_onnx.py' tiny.onnx --multiple 1");
    let algorithms = [
        format!("net={},max_disparity=16", program(&python, &adapter)),
        format!(
            "batch={},max_disparity=16",
            program(&python, &(adapter + " --batch 2"))
        ),
        format!(
            "twin={},max_disparity=16",
            program(&python, &format!("'{tiny}'"))
        ),
    ];
    let mut line = vec!["score", "a.mcap", "-o", "r", "--rerun", "none", "--json"];
    for algorithm in &algorithms {
        line.extend(["--algo", algorithm]);
    }
    let summary = fixture.json(&line);
    let hash = |i: usize| summary["algorithms"][i]["results_hash"].as_str().unwrap();
    assert_eq!((hash(0), hash(1)), (hash(2), hash(2)));
    let programs = &summary["programs"];
    assert_eq!(programs[0]["name"], "tiny");
    assert_eq!(
        (&programs[0]["batch"], &programs[1]["batch"]),
        (&1.into(), &2.into())
    );
    assert_eq!(programs[0]["model"].as_str().unwrap().len(), 32);
    assert_eq!(programs[0]["device"], "CPU");
    let ask = "import onnxruntime as o\nprint(*o.get_available_providers())";
    let providers = Command::new(&python).args(["-c", ask]).output().unwrap();
    let on_cuda = format!("'{ROOT}/adapters/svl_onnx.py' tiny.onnx --multiple 1 --device cuda");
    let on_cuda = program(&python, &on_cuda);
    let line = [
        "-q", "match", "l.pgm", "r.pgm", "-o", "d.pfm", "--algo", &on_cuda,
    ];
    if String::from_utf8_lossy(&providers.stdout).contains("CUDAExecutionProvider") {
        fixture.run(&line);
    } else {
        let cure = "no CUDA here: pip install onnxruntime-gpu";
        fixture.svl(&line).failed(1, &[cure]);
    }
    for (words, told) in [
        ("none.onnx", "none.onnx: no such file"),
        ("a.mcap", "a.mcap: "),
        (
            "tiny.onnx --output depth",
            "no output depth; there are disparity",
        ),
    ] {
        let net = program(&python, &format!("'{ROOT}/adapters/svl_onnx.py' {words}"));
        let ran = fixture.svl(&[
            "-q", "match", "l.pgm", "r.pgm", "-o", "d.pfm", "--algo", &net,
        ]);
        ran.failed(1, &[told]);
    }
}

/// The rows of docs/networks.md, on networks with their inputs and outputs and random weights.
#[test]
fn networks_that_people_know_run_by_the_options_of_their_rows() {
    let Some(python) = python_with("numpy, onnx, onnxruntime") else {
        return;
    };
    let fixture = Fixture::new();
    fixture.record("a.mcap", "--frames 2");
    let wrote = Command::new(&python)
        .arg(format!("{ROOT}/tests/python/known_networks.py"))
        .arg(format!("{ROOT}/docs/networks.md"))
        .current_dir(fixture.path(""))
        .output()
        .unwrap();
    let (rows, error) = (String::from_utf8(wrote.stdout).unwrap(), wrote.stderr);
    assert!(
        wrote.status.success(),
        "{}",
        String::from_utf8_lossy(&error)
    );
    let rows: Vec<_> = rows
        .lines()
        .filter_map(|row| row.split_once('\t'))
        .collect();
    assert_eq!(rows.len(), 7, "{rows:?}");
    for (i, (name, options)) in rows.iter().enumerate() {
        let net = |options: &str| {
            let adapter = format!("'{ROOT}/adapters/svl_onnx.py' {name}.onnx {options}");
            program(&python, &adapter)
        };
        // Two runs, and one without the row's options.
        let algorithms = [
            format!("one={},max_disparity=255", net(options)),
            format!("two={},max_disparity=255", net(options)),
            format!("bare={},max_disparity=255", net("")),
        ];
        let report = format!("r{i}");
        let mut line = vec![
            "score", "a.mcap", "-o", &report, "--rerun", "none", "--json",
        ];
        for algorithm in &algorithms {
            line.extend(["--algo", algorithm]);
        }
        let ran = fixture.svl(&line);
        assert!(matches!(ran.code, Some(0 | 4)), "{name}: {}", ran.stderr);
        let summary: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        let found = |label: &str| {
            let rows = summary["algorithms"].as_array().unwrap();
            let own = rows.iter().find(|own| own["algorithm"] == label);
            own.unwrap_or_else(|| panic!("{name}: no {label}: {summary}"))
                .clone()
        };
        let (one, two) = (found("one"), found("two"));
        assert_eq!(one["results_hash"], two["results_hash"], "{name}");
        assert!(one["coverage"].as_f64().unwrap() > 0.1, "{name}: {one}");
        let bare = found("bare")["results_hash"].clone();
        // The arena is grey: the order of colours changes nothing.
        let is_equal = ["", "--channels bgr"].contains(options);
        assert_eq!(one["results_hash"] == bare, is_equal, "{name}");
    }
}

/// A real network on four pairs.
#[test]
fn tinystereo_is_right_on_the_arena() {
    let Some(shared) = datasets().and_then(|folder| folder.parent().map(PathBuf::from)) else {
        return;
    };
    let model = shared.join("models/tinystereo.onnx");
    let Some(python) = python_with("numpy, onnxruntime").filter(|_| model.exists()) else {
        return;
    };
    let fixture = Fixture::new();
    let net = format!(
        "net={},max_disparity=127",
        program(
            &python,
            &format!(
                "'{ROOT}/adapters/svl_onnx.py' '{}' --multiple 16",
                model.display()
            )
        )
    );
    fixture.record("a.mcap", "--frames 60");
    let line = [
        "score", "a.mcap", "--every", "15", "--algo", &net, "-o", "r", "--json",
    ];
    let summary = fixture.json(&line);
    let right = summary["algorithms"][0]["cells_right"].as_f64().unwrap();
    assert!(right > 0.9, "{right}");
}

/// A program in C++ with colour, cells, an error and a name.
const CPP: &str = r#"
#include "svl_matcher.hpp"
#include <stdexcept>

int main() {
  svl::Hello hello;
  hello.name = "mine \"in\" C++";
  hello.color = true;
  return svl::serve(hello, [](const svl::Pair& pair, svl::Answer& answer) {
    std::puts("a library prints");
    if (pair.channels != 3 || pair.max_disparity != 80 || pair.rig.focal_px < 100)
      throw std::runtime_error("wrong request");
    static int calls = 0;
    // The first two are of the first pair.
    if (++calls == 4) throw std::runtime_error("no \"such\" texture");
    for (int i = 0; i < pair.width * pair.height; i++)
      if (pair.left[3 * i] % 2 == 0) answer.disparity[i] = 5;
    answer.disparity[0] = NAN;
    answer.cells.resize(pair.columns * pair.rows);
    answer.cells[0] = {5.0f, 0.9f};
  });
}
"#;

#[test]
fn a_header_makes_a_program_in_cpp() {
    let fixture = Fixture::new();
    fixture.write("mine.cpp", CPP);
    let header = fixture.run("algos exec --example cpp");
    fixture.write("svl_matcher.hpp", header);
    let flags = "-std=c++17 -Wall -Wextra -Werror -O2 -o mine mine.cpp";
    let built = Command::new("c++")
        .args(flags.split(' '))
        .current_dir(fixture.path(""))
        .output();
    let Ok(built) = built else {
        crate::common::skip("no C++ compiler");
        return;
    };
    assert!(
        built.status.success(),
        "{}",
        String::from_utf8_lossy(&built.stderr)
    );
    fixture.record("a.mcap", "--frames 4");
    fixture.transcript(
        "score a.mcap --algo mine=exec:command=./mine -o r --rerun none \
        => 4~ answered: no \"such\" texture
        cat r/summary.md => mine: mine \"in\" C++, 1 thread, in colour, reports
        cat r/cells.csv => 3x ,0.9,",
    );
}

#[test]
fn torch_script_and_an_entry_are_matchers() {
    let Some(python) = python_with("numpy, torch") else {
        return;
    };
    let fixture = Fixture::new();
    fixture.record("a.mcap", "--frames 2");
    fixture.write(
        "entry.py",
        "import torch\n\
         class Net(torch.nn.Module):\n    \
             def forward(self, left, right):\n        \
                 return [-0.125 * left[:, :1, ::2, ::2], -0.25 * left[:, :1]]\n\
         def load(model=None): return Net()\n\
         if __name__ == '__main__': torch.jit.script(Net()).save('net.pt')\n",
    );
    let wrote = Command::new(&python)
        .arg("entry.py")
        .current_dir(fixture.path(""))
        .status();
    assert!(wrote.unwrap().success());
    let net = |words: &str| {
        let words = format!("'{ROOT}/adapters/svl_torch.py' {words} --channels grey --negative");
        program(&python, &words)
    };
    let (script, entry) = (net("net.pt"), net("--entry entry:load"));
    let line = [
        "score", "a.mcap", "--algo", &script, "--algo", &entry, "-o", "r", "--json",
    ];
    let summary = fixture.json(&line);
    let algorithms = summary["algorithms"].as_array().unwrap();
    assert_eq!(algorithms.len(), 2, "{summary}");
    assert_eq!(algorithms[0]["results_hash"], algorithms[1]["results_hash"]);
    assert_eq!(summary["programs"][0]["device"], "CPU");
}

#[test]
fn examples_are_the_files_of_adapters() {
    let fixture = Fixture::new();
    for (kind, file) in [
        ("python", "matcher.py"),
        ("cpp", "cpp/svl_matcher.hpp"),
        ("onnx", "svl_onnx.py"),
        ("torch", "svl_torch.py"),
        ("opencv", "opencv.py"),
    ] {
        let text = std::fs::read_to_string(format!("{ROOT}/adapters/{file}")).unwrap();
        let printed = fixture.run(&format!("algos exec --example {kind}"));
        assert_eq!(printed.trim_end(), text.trim_end(), "{kind}");
    }
    fixture.fails(
        "algos v3 --example cpp => 2: --example needs | svl algos exec --example KIND\n\
         algos exec --example java => 2: java | python",
    );
    // It is a slow matcher, too.
    if let Some(python) = python_with("numpy") {
        fixture.record("a.mcap", "--frames 1");
        let printed = fixture.run("algos exec --example python");
        fixture.write("svl_bench/matcher.py", printed);
        let example = format!("slow=exec:command='{python}' svl_bench/matcher.py,max_disparity=40");
        let summary = fixture.json(&["replay", "a.mcap", "--algo", &example, "--json"]);
        assert_eq!(summary["programs"][0]["name"], "example");
    }
}
