//! Random histories of a report's folder: whatever was done to it, the report is that of a fresh
//! run.

use super::fixture::Fixture;
use fastrand::Rng;
use std::collections::BTreeSet;
use std::process::{Command, Stdio};
use std::time::Duration;

/// The histories by default and in `.ci/nightly`; the variable `SVL_HISTORIES` has another number
/// of them, and `SVL_HISTORY` the first.
const HISTORIES: [std::ops::Range<u64>; 2] = [1..2, 0..20];

/// Commands of a history.
const STEPS: usize = 6;

/// The algorithms; of one name the last is another one.
const ALGORITHMS: [&str; 6] = [
    "bm:max_disparity=8",
    "v3:max_disparity=8",
    "sgm:max_disparity=8",
    // Each pair depends on all before it.
    "v5:max_disparity=8",
    "a=bm:max_disparity=8,block_size=5",
    "a=bm:max_disparity=8,block_size=9",
];

/// Where the pairs come from.
#[derive(Clone, Copy, PartialEq)]
enum Pairs {
    /// Two folders of images, which may be changed.
    Folders,
    /// The arena with truth and poses.
    Arena,
}

struct History {
    fixture: Fixture,
    random: Rng,
    pairs: Pairs,
    algorithms: BTreeSet<&'static str>,
    stress: bool,
    /// What was done, for the message of a failure.
    log: Vec<String>,
    fresh: usize,
}

impl History {
    fn new(seed: u64) -> Self {
        let mut random = Rng::with_seed(seed);
        let fixture = Fixture::new();
        let pairs = match seed % 3 {
            0 => Pairs::Arena,
            _ => Pairs::Folders,
        };
        match pairs {
            Pairs::Arena => drop(fixture.write_recorded_arena("short.toml", 70)),
            Pairs::Folders => {
                for (folder, count) in [("one", 150), ("two", 20)] {
                    (0..count).for_each(|i| write_pair(&fixture, folder, i, i % 5));
                }
            }
        }
        let first = ALGORITHMS[random.usize(..4)];
        Self {
            fixture,
            random,
            pairs,
            algorithms: BTreeSet::from([first]),
            stress: false,
            log: Vec::new(),
            fresh: 0,
        }
    }

    /// The command that scores, without its folder.
    fn score(&self) -> Vec<String> {
        let what: &[_] = match self.pairs {
            Pairs::Folders => &["one", "two"],
            Pairs::Arena => &["short.toml"],
        };
        let mut line = vec!["score"];
        line.extend(what);
        line.extend(["-q", "--rerun", "none"]);
        for algorithm in &self.algorithms {
            line.extend(["--algo", algorithm]);
        }
        if self.stress {
            line.extend(["--stress", "noise=8"]);
        }
        line.into_iter().map(str::to_owned).collect()
    }

    fn run(&mut self, more: &[&str]) {
        let mut line = self.score();
        line.extend(more.iter().map(|word| (*word).to_owned()));
        self.log.push(line.join(" "));
        let line: Vec<_> = line.iter().map(String::as_str).collect();
        let ran = self.fixture.svl(&line);
        assert_eq!(ran.code, Some(0), "{}\n{}", self.log.join("\n"), ran.stderr);
    }

    /// A command that is killed after a random time.
    fn kill(&mut self) {
        let ms = self.random.u64(5..400);
        let mut line = self.score();
        line.extend(["-o".to_owned(), "r".to_owned()]);
        self.log
            .push(format!("{} killed after {ms} ms", line.join(" ")));
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("svl"));
        let command = command.current_dir(self.fixture.path("")).args(&line);
        let mut child = command
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(ms));
        let _ = child.kill();
        child.wait().unwrap();
    }

    fn step(&mut self) {
        match self.random.u8(..10) {
            0..3 => self.kill(),
            3 | 4 => {
                let algorithm = ALGORITHMS[self.random.usize(..ALGORITHMS.len())];
                let name = |text: &str| text.split('=').next().unwrap().to_owned();
                self.algorithms
                    .retain(|own| name(own) != name(algorithm) || !algorithm.starts_with("a="));
                self.algorithms.insert(algorithm);
                self.run(&["-o", "r"]);
            }
            5 => {
                if self.algorithms.len() > 1 {
                    self.algorithms.pop_first();
                }
                let prune: &[_] = if self.random.bool() {
                    &["--prune"]
                } else {
                    &[]
                };
                self.run(&[&["-o", "r"], prune].concat());
            }
            6 if self.pairs == Pairs::Folders => {
                let (folder, count) = *self.random.choice(&[("one", 150), ("two", 20)]).unwrap();
                let (i, shift) = (self.random.usize(..count), self.random.usize(..7));
                self.log
                    .push(format!("pair {i} of {folder} has shift {shift}"));
                write_pair(&self.fixture, folder, i, shift);
            }
            7 => {
                let shards = self.random.usize(2..4);
                for i in 1..=shards {
                    let shard = format!("{i}/{shards}");
                    // Shards of other options than the folder's are refused without it.
                    let force: &[_] = if i == 1 { &["--force"] } else { &[] };
                    self.run(&[&["--shard", &shard, "-o", "r"], force].concat());
                }
            }
            8 => {
                let n = self.log.len();
                let parts: Vec<_> = (1..=2).map(|i| format!("p{n}-{i}")).collect();
                for (i, part) in parts.iter().enumerate() {
                    self.run(&["--shard", &format!("{}/2", i + 1), "-o", part]);
                }
                self.log.push("parts".to_owned());
                self.fixture
                    .run(&format!("report {} -o r -q", parts.join(" ")));
            }
            9 => self.stress = !self.stress,
            _ => {
                let again = *self.random.choice(&["--force", "--times"]).unwrap();
                self.run(&["-o", "r", again]);
            }
        }
    }

    /// Compares the report with that of a fresh run.
    fn compare(&mut self) {
        self.run(&["-o", "r"]);
        self.fresh += 1;
        let fresh = format!("fresh-{}", self.fresh);
        self.run(&["-o", &fresh]);
        let order = if self.random.bool() { "r" } else { "fresh" };
        if order == "r" {
            self.log.push("report".to_owned());
            self.fixture.run("report r");
        }
        for (name, has_times) in [
            ("rows.csv", true),
            ("cells.csv", false),
            ("failures.csv", false),
            ("checkpoints.csv", false),
            ("verdicts.csv", false),
            ("algorithms.csv", false),
            ("summary.csv", true),
        ] {
            let [own, other] = ["r", &fresh].map(|folder| {
                let text = self.fixture.text(&format!("{folder}/{name}"));
                match has_times {
                    true => untimed(&text),
                    false => text,
                }
            });
            assert!(own == other, "{name} differs:\n{}", self.log.join("\n"));
        }
        let [own, other] = ["r", &fresh].map(|folder| {
            let page = self.fixture.text(&format!("{folder}/index.html"));
            let images = page.split("\"data:image/").skip(1);
            let images = images.map(|rest| rest.split('"').next().unwrap().to_owned());
            images.collect::<Vec<_>>()
        });
        assert!(own == other, "images differ:\n{}", self.log.join("\n"));
        let [own, other] = ["r", &fresh].map(|folder| {
            let text = self.fixture.text(&format!("{folder}/manifest.json"));
            let manifest: serde_json::Value = serde_json::from_str(&text).unwrap();
            let texts = manifest["warnings"].as_array().cloned().unwrap_or_default();
            let warnings = texts.iter().map(|text| text.as_str().unwrap().to_owned());
            let hashes = manifest["algorithms"].as_array().unwrap().iter();
            let hashes: Vec<_> = hashes.map(|own| own["results_hash"].clone()).collect();
            let text = self.fixture.text(&format!("{folder}/summary.json"));
            let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
            (
                warnings.collect::<BTreeSet<_>>(),
                hashes,
                manifest["pairs_hash"].clone(),
                summary["missing"].clone(),
                summary["state"].clone(),
            )
        });
        assert_eq!(own, other, "{}", self.log.join("\n"));
    }
}

fn write_pair(fixture: &Fixture, folder: &str, i: usize, shift: usize) {
    let [left, right] = ["left", "right"].map(|side| format!("{folder}/{side}_{i:03}.pgm"));
    fixture.write_pair(&left, &right, (48, 36), shift);
}

/// A table without the columns of times and of what belongs to a session.
fn untimed(text: &str) -> String {
    let mut lines = csv::Reader::from_reader(text.as_bytes());
    let heads = lines.headers().unwrap().clone();
    let but = ["_us", "_ms", "_s", "outliers", "memory_mb", "session"];
    let is_kept = |head: &str| but.iter().all(|ending| !head.ends_with(ending));
    let mut kept = String::new();
    for line in lines.records() {
        let line = line.unwrap();
        let cells = line.iter().zip(&heads).filter(|(_, head)| is_kept(head));
        let cells: Vec<_> = cells.map(|(cell, _)| cell).collect();
        kept += &(cells.join(",") + "\n");
    }
    kept
}

#[test]
fn a_report_is_that_of_a_fresh_run_whatever_was_done_to_its_folder() {
    let number = |name: &str, or: u64| {
        let text = std::env::var(name).ok();
        text.map_or(or, |text| text.parse().unwrap())
    };
    let default = &HISTORIES[usize::from(crate::common::is_nightly())];
    let first = number("SVL_HISTORY", default.start);
    let count = number("SVL_HISTORIES", default.end - default.start);
    for seed in first..first + count {
        let mut history = History::new(seed);
        history.log.push(format!("history {seed}"));
        for _ in 0..STEPS {
            history.step();
        }
        history.compare();
    }
}
