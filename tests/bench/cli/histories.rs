//! Random histories of a report's folder: whatever was done to it, the report is that of a fresh
//! run.
#![cfg(unix)]

use super::fixture::{Fixture, Ran};
use super::results::{assert_same_report, replace_with_time};
use fastrand::Rng;
use std::collections::BTreeSet;
use std::process::{Command, Stdio};
use std::time::Duration;

/// The histories by default and in `.ci/nightly`; the variable `SVL_HISTORIES` has another number
/// of them, and `SVL_HISTORY` the first.
const HISTORIES: [std::ops::Range<u64>; 2] = [0..4, 0..40];

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
    /// Algorithms whose results were ever written.
    written: Vec<&'static str>,
    /// Options of the runs.
    stress: bool,
    range: &'static str,
    crop: &'static str,
    truth: bool,
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
                for (folder, count) in FOLDERS {
                    for i in 0..count {
                        write_pair(&fixture, folder, i, i % 5);
                        write_truth(&fixture, folder, i, i % 5);
                    }
                }
            }
        }
        let first = ALGORITHMS[random.usize(..4)];
        Self {
            fixture,
            random,
            pairs,
            algorithms: BTreeSet::from([first]),
            written: vec![first],
            stress: false,
            range: "",
            crop: "",
            truth: false,
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
        line.extend(self.range.split_whitespace());
        line.extend(self.crop.split_whitespace());
        if self.truth {
            line.extend(["--truth", "../truth/*.npy:disparity=1"]);
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
        match self.random.u8(..16) {
            0..3 => self.kill(),
            3 | 4 => {
                let algorithm = ALGORITHMS[self.random.usize(..ALGORITHMS.len())];
                self.algorithms.retain(|own| label(own) != label(algorithm));
                self.algorithms.insert(algorithm);
                self.written.push(algorithm);
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
            6 | 7 if self.pairs == Pairs::Folders => self.change_file(),
            8 => {
                let shards = self.random.usize(2..4);
                for i in 1..=shards {
                    let shard = format!("{i}/{shards}");
                    // Shards of other options than the folder's are refused without it.
                    let force: &[_] = if i == 1 { &["--force"] } else { &[] };
                    self.run(&[&["--shard", &shard, "-o", "r"], force].concat());
                }
            }
            9 => {
                let n = self.log.len();
                let parts: Vec<_> = (1..=2).map(|i| format!("p{n}-{i}")).collect();
                for (i, part) in parts.iter().enumerate() {
                    self.run(&["--shard", &format!("{}/2", i + 1), "-o", part]);
                }
                self.log.push("parts".to_owned());
                self.fixture
                    .run(&format!("report {} -o r -q", parts.join(" ")));
            }
            10 => self.stress = !self.stress,
            11 => self.range = *self.random.choice(&["", "--every 3", "--to 1.5"]).unwrap(),
            12 if self.pairs == Pairs::Folders => match self.random.bool() {
                true => self.crop = *self.random.choice(&["", "--crop 4,0,40,36"]).unwrap(),
                false => self.truth = !self.truth,
            },
            13 => self.race(),
            14 => self.fill(),
            _ => {
                let again = *self.random.choice(&["--force", "--times"]).unwrap();
                self.run(&["-o", "r", again]);
            }
        }
    }

    /// Changes an image or a truth: written anew, or put in its place with its time.
    fn change_file(&mut self) {
        let (folder, count) = *self.random.choice(&FOLDERS).unwrap();
        let (i, shift) = (self.random.usize(..count), self.random.usize(..7));
        let (is_truth, is_kept) = (self.random.bool(), self.random.bool());
        self.log.push(format!(
            "pair {i} of {folder} has shift {shift}; truth: {is_truth}, time kept: {is_kept}"
        ));
        let paths = match is_truth {
            true => vec![truth_path(folder, i)],
            false => ["left", "right"]
                .map(|side| image_path(folder, side, i))
                .to_vec(),
        };
        let before: Vec<_> = paths.iter().map(|path| self.fixture.bytes(path)).collect();
        let stored = tempfile::tempdir().unwrap();
        for (n, path) in paths.iter().enumerate() {
            std::fs::rename(self.fixture.path(path), stored.path().join(n.to_string())).unwrap();
        }
        match is_truth {
            true => write_truth(&self.fixture, folder, i, shift),
            false => write_pair(&self.fixture, folder, i, shift),
        }
        for (n, path) in paths.iter().enumerate().filter(|_| is_kept) {
            let new = self.fixture.bytes(path);
            assert_eq!(new.len(), before[n].len());
            std::fs::rename(stored.path().join(n.to_string()), self.fixture.path(path)).unwrap();
            replace_with_time(&self.fixture.path(path), &new);
        }
    }

    /// Two processes at once: one of them may find the folder taken.
    fn race(&mut self) {
        let mut line = self.score();
        line.extend(["-o".to_owned(), "r".to_owned()]);
        self.log.push(format!("twice at once: {}", line.join(" ")));
        let line: Vec<_> = line.iter().map(String::as_str).collect();
        let [one, two] = std::thread::scope(|scope| {
            let both = [0, 1].map(|_| scope.spawn(|| self.fixture.svl(&line)));
            both.map(|ran| ran.join().unwrap())
        });
        let is_good = |ran: &Ran| ran.code == Some(0) || ran.stderr.contains("another svl writes");
        assert!(
            is_good(&one) && is_good(&two),
            "{}\n{}",
            one.stderr,
            two.stderr
        );
    }

    /// A command that may write no file larger than that.
    fn fill(&mut self) {
        let kib = self.random.u64(1..200);
        let line = self.score().join("' '");
        self.log
            .push(format!("'{line}' with files up to {kib} KiB"));
        let svl = assert_cmd::cargo::cargo_bin!("svl").display();
        let text = format!("trap '' XFSZ; ulimit -f {kib}; exec {svl} '{line}' -o r");
        let mut bash = Command::new("bash");
        let bash = bash.args(["-c", &text]).current_dir(self.fixture.path(""));
        let ran = bash.output().unwrap();
        let said = String::from_utf8_lossy(&ran.stderr);
        assert!(matches!(ran.status.code(), Some(0 | 1 | 4)), "{said}");
        assert!(!said.contains("panicked"), "{said}");
    }

    /// Compares the report with that of a fresh run.
    fn compare(&mut self) {
        let prune: &[_] = if self.random.bool() {
            &["--prune"]
        } else {
            &[]
        };
        self.run(&[&["-o", "r"], prune].concat());
        // Algorithms of earlier commands with the same options stand behind those asked for.
        let manifest = self.fixture.json_file("r/manifest.json");
        let labels = manifest["algorithms"].as_array().unwrap().iter();
        let labels: Vec<_> = labels.map(|own| own["label"].as_str().unwrap()).collect();
        let own: Vec<_> = self.algorithms.iter().map(|own| label(own)).collect();
        assert_eq!(labels[..own.len()], own, "{}", self.log.join("\n"));
        assert!(prune.is_empty() || labels.len() == own.len());
        self.fresh += 1;
        let fresh = format!("fresh-{}", self.fresh);
        let mut more = vec!["-o", &fresh];
        let earlier: Vec<_> = labels[own.len()..]
            .iter()
            .map(|own| self.written(own))
            .collect();
        for algorithm in &earlier {
            more.extend(["--algo", algorithm.as_str()]);
        }
        self.run(&more);
        if self.random.bool() {
            self.log.push("report".to_owned());
            self.fixture.run("report r");
        }
        assert_same_report(&self.fixture, ["r", &fresh], &self.log.join("\n"));
    }

    /// The last algorithm that was written so, by its label.
    fn written(&self, name: &str) -> String {
        let mut written = self.written.iter().rev();
        let found = written.find(|own| label(own) == name);
        (*found.unwrap()).to_owned()
    }
}

fn label(algorithm: &str) -> &str {
    if algorithm.starts_with("a=") {
        "a"
    } else {
        algorithm
    }
}

/// The folders of pairs, with the number of their pairs.
const FOLDERS: [(&str, usize); 2] = [("one", 150), ("two", 20)];

fn image_path(folder: &str, side: &str, i: usize) -> String {
    format!("{folder}/{side}/{i:03}.pgm")
}

fn write_pair(fixture: &Fixture, folder: &str, i: usize, shift: usize) {
    let [left, right] = ["left", "right"].map(|side| image_path(folder, side, i));
    fixture.write_pair(&left, &right, (48, 36), shift);
}

/// Both folders have the same truths: names are numbers.
fn truth_path(_: &str, i: usize) -> String {
    format!("truth/{i:03}.npy")
}

fn write_truth(fixture: &Fixture, folder: &str, i: usize, shift: usize) {
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (36, 48)}\n";
    let length = (header.len() as u16).to_le_bytes();
    let pixels = (shift as f32).to_le_bytes().repeat(48 * 36);
    let bytes = [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), &pixels].concat();
    fixture.write(&truth_path(folder, i), bytes);
}

parts! {
    // A report is that of a fresh run, whatever was done to its folder.
    |part| {
        let number = |name: &str, or: u64| {
            let text = std::env::var(name).ok();
            text.map_or(or, |text| text.parse().unwrap())
        };
        let default = &HISTORIES[usize::from(crate::common::is_nightly())];
        let first = number("SVL_HISTORY", default.start);
        let count = number("SVL_HISTORIES", default.end - default.start);
        for seed in (first..first + count).skip(part).step_by(4) {
            let mut history = History::new(seed);
            history.log.push(format!("history {seed}"));
            for _ in 0..STEPS {
                history.step();
            }
            history.compare();
        }
    };
    a_quarter_of_histories = 0, a_second_quarter = 1, a_third_quarter = 2, a_last_quarter = 3,
}
