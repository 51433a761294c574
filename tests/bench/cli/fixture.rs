//! A temporary folder per test, the program under test, and input images.

pub use crate::common::{assert_says, datasets};

use assert_cmd::Command;
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use tempfile::TempDir;

pub struct Fixture {
    folder: TempDir,
}

impl Fixture {
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    /// A folder with a recording of twelve frames.
    pub fn recorded() -> Self {
        let fixture = Self::new();
        fixture.record("run.mcap", "--frames 12");
        fixture
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs `svl` with these arguments in the folder.
    pub fn svl(&self, line: &(impl CommandLine + ?Sized)) -> Ran {
        self.svl_with(line, &[])
    }

    /// The output of `svl` with these arguments; it must succeed.
    #[track_caller]
    pub fn run(&self, line: &(impl CommandLine + ?Sized)) -> String {
        self.svl(line).done()
    }

    /// Runs `svl` with these arguments and environment variables besides.
    pub fn svl_with(&self, line: &(impl CommandLine + ?Sized), variables: &[(&str, &str)]) -> Ran {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("svl"));
        command.envs(variables.iter().copied());
        let output = command
            .current_dir(self.folder.path())
            .args(line.arguments())
            .timeout(std::time::Duration::from_secs(1800))
            .output();
        let output = output.unwrap();
        let ran = Ran {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        };
        // Whatever is in names of the case.
        for text in [&ran.stdout, &ran.stderr] {
            assert_eq!(*text, svl::printable(text), "what controls a terminal");
        }
        ran
    }

    /// The JSON output of this command.
    #[track_caller]
    pub fn json(&self, line: &(impl CommandLine + ?Sized)) -> serde_json::Value {
        serde_json::from_str(&self.run(line)).unwrap()
    }

    /// The JSON in this file.
    #[track_caller]
    pub fn json_file(&self, name: &str) -> serde_json::Value {
        serde_json::from_slice(&self.bytes(name)).unwrap()
    }

    /// Every line of `table`, `COMMAND => CODE: WORDS | WORDS`, fails with this code and one line
    /// that contains all these words, as in a [`Fixture::transcript`].
    #[track_caller]
    pub fn fails(&self, table: &str) {
        self.transcript(table);
    }

    /// Two sources, each with its options, have the same cells and scores, to the digit.
    #[track_caller]
    pub fn assert_same(&self, sources: [&str; 2]) {
        let [a, b] = sources.map(|source| {
            self.run(&format!("record {source} -o same.mcap --force"));
            self.run("replay same.mcap --algo v3 --algo sgm --cells cells.csv --force");
            let cells = self.text("cells.csv");
            // Without the identity of the run and the name of its source.
            let cells = cells.lines().filter_map(|line| line.splitn(3, ',').nth(2));
            cells.map(str::to_owned).collect::<Vec<_>>()
        });
        assert!(a.len() > 1, "no cells");
        assert_eq!(a, b);
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    pub fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        path
    }

    /// A textured pair as PGM files: the right image shows the left one `shift` pixels further
    /// left.
    pub fn write_pair(
        &self,
        left: &str,
        right: &str,
        (width, height): (usize, usize),
        shift: usize,
    ) {
        let texture = |x: usize, y: usize| {
            let mixed =
                ((x * 7919 + y * 104_729 + 12_345) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            (mixed >> 56) as u8
        };
        let image = |dx: usize| {
            (0..width * height)
                .map(|i| texture(i % width + dx, i / width))
                .collect::<Vec<u8>>()
        };
        self.write(left, pgm(width, height, &image(0)));
        self.write(right, pgm(width, height, &image(shift)));
    }

    /// EuRoC's folder `mav0`, with two raw pairs of 64x48, fx = 60 px and a baseline of 0.1 m.
    pub fn write_euroc(&self, fy: &str) {
        for (camera, right) in [("cam0", "0.0"), ("cam1", "0.1")] {
            let sensor = format!(
                "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, \
                 {right}, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n\
                 resolution: [64, 48]\ncamera_model: pinhole\n\
                 intrinsics: [60.0, {fy}, 32.0, 24.0]\n\
                 distortion_model: radial-tangential\n\
                 distortion_coefficients: [-0.1, 0.01, 0.0, 0.0]\n"
            );
            self.write(&format!("mav0/{camera}/sensor.yaml"), sensor);
            let csv = "#timestamp [ns],filename\n50000000,a.pgm\n100000000,b.pgm\n";
            self.write(&format!("mav0/{camera}/data.csv"), csv);
        }
        for name in ["a", "b"] {
            let image = |camera: &str| format!("mav0/{camera}/data/{name}.pgm");
            self.write_pair(&image("cam0"), &image("cam1"), (64, 48), 3);
        }
    }

    /// The arena with few frames, as a scenario file.
    pub fn write_short_arena(&self, name: &str, frames: u64) -> PathBuf {
        self.write(name, short_arena(frames))
    }

    /// Same as [`Fixture::write_short_arena`], with the recordings of its two runs, which are
    /// simulated once for all tests.
    pub fn write_recorded_arena(&self, name: &str, frames: u64) -> PathBuf {
        self.write_made("recordings", &format!("arena of {frames}"), |fixture| {
            fixture.write_short_arena("short.toml", frames);
            fixture.run("score short.toml --algo truth --rerun none -q");
        });
        self.write_short_arena(name, frames)
    }

    /// A recording of `svl record WHAT`, which is made once for all tests.
    pub fn record(&self, name: &str, what: &str) {
        self.write_recording(name, what, String::new());
    }

    /// A recording of a run of [`Fixture::write_short_arena`], which is made once for all tests.
    pub fn record_short_arena(&self, name: &str, frames: u64, seed: u64) {
        let what = format!("short.toml --seed {seed}");
        self.write_recording(name, &what, short_arena(frames));
    }

    /// Writes a recording, of this scenario in `short.toml` if it names that.
    fn write_recording(&self, name: &str, what: &str, scenario: String) {
        let files = made("made", &format!("record {what}\n{scenario}"), |fixture| {
            fixture.write("short.toml", scenario);
            std::fs::create_dir(fixture.path("made")).unwrap();
            fixture.run(&format!("record {what} -q -o made/a.mcap"));
        });
        self.write(name, &files.get().unwrap()[0].1);
    }

    /// Writes the files below `folder` that `make` leaves there, once for all tests with that
    /// `key`.
    pub fn write_made(&self, folder: &str, key: &str, make: impl FnOnce(&Self)) {
        for (path, bytes) in made(folder, key, make).get().unwrap() {
            self.write(path.to_str().unwrap(), bytes);
        }
    }

    /// Writes a file as another one, with the first text of each pair replaced by the second.
    #[track_caller]
    pub fn edit(&self, from: &str, to: &str, edits: &[[&str; 2]]) {
        let mut text = self.text(from);
        for [old, new] in edits {
            assert!(text.contains(old), "{old} is not in: {text}");
            text = text.replacen(old, new, 1);
        }
        self.write(to, text);
    }

    /// The cells of a column of a table.
    #[track_caller]
    pub fn column(&self, table: &str, name: &str) -> Vec<String> {
        let mut table = csv::Reader::from_path(self.path(table)).unwrap();
        let heads = table.headers().unwrap();
        let place = heads.iter().position(|head| head == name).unwrap();
        let lines = table.records().map(Result::unwrap);
        lines.map(|line| line[place].to_owned()).collect()
    }
}

/// Files by their names.
type Files = Vec<(PathBuf, Vec<u8>)>;

/// The files below `folder` that `make` leaves there, which is run once for all tests with that
/// `key`.
fn made(folder: &str, key: &str, make: impl FnOnce(&Fixture)) -> Arc<OnceLock<Files>> {
    static MADE: Mutex<BTreeMap<String, Arc<OnceLock<Files>>>> = Mutex::new(BTreeMap::new());
    let files = Arc::clone(MADE.lock().entry(key.to_owned()).or_default());
    files.get_or_init(|| {
        let fixture = Fixture::new();
        make(&fixture);
        let mut files = Files::new();
        add_files(&fixture.path(folder), Path::new(folder), &mut files);
        files
    });
    files
}

/// The scenario of the arena with few frames in each of two runs.
fn short_arena(frames: u64) -> String {
    let text = include_str!("../../../scenarios/arena.toml");
    let lines = text
        .lines()
        .map(|line| match line.split('=').next().map(str::trim) {
            Some("frames") => format!("frames = {frames}"),
            Some("seeds") => "seeds = [1, 2]".to_owned(),
            _ => line.to_owned(),
        });
    lines.collect::<Vec<_>>().join("\n")
}

/// Adds the files of a folder, and of those in it, with their paths in `name`.
fn add_files(folder: &Path, name: &Path, files: &mut Files) {
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let (path, name) = (entry.path(), name.join(entry.file_name()));
        if path.is_dir() {
            add_files(&path, &name, files);
        } else {
            files.push((name, std::fs::read(path).unwrap()));
        }
    }
}

/// Arguments of `svl`: words separated by spaces, of which one that begins with `'` goes on to the
/// next `'`; or an array.
pub trait CommandLine {
    fn arguments(&self) -> Vec<&str>;
}

impl CommandLine for str {
    fn arguments(&self) -> Vec<&str> {
        let mut words = Vec::new();
        let mut rest = self.trim_start();
        while !rest.is_empty() {
            let (word, others) = match rest.strip_prefix('\'') {
                Some(quoted) => quoted.split_once('\'').expect("a closing quote"),
                None => rest.split_once(char::is_whitespace).unwrap_or((rest, "")),
            };
            words.push(word);
            rest = others.trim_start();
        }
        words
    }
}

impl CommandLine for String {
    fn arguments(&self) -> Vec<&str> {
        self.as_str().arguments()
    }
}

impl CommandLine for [&str] {
    fn arguments(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl<const N: usize> CommandLine for [&str; N] {
    fn arguments(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl CommandLine for Vec<&str> {
    fn arguments(&self) -> Vec<&str> {
        self.clone()
    }
}

pub struct Ran {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Ran {
    /// The JSON on standard output.
    #[track_caller]
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap()
    }

    /// Asserts success; returns the output.
    #[track_caller]
    pub fn done(self) -> String {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        self.stdout
    }

    /// Asserts failure with this code and one line that contains all these words; returns the line.
    #[track_caller]
    pub fn failed(self, code: i32, words: &[&str]) -> String {
        assert_eq!(self.code, Some(code), "{}{}", self.stdout, self.stderr);
        let line = self.error();
        assert_says(line, words);
        line.to_owned()
    }

    /// The only line on standard error, an error.
    #[track_caller]
    pub fn error(&self) -> &str {
        let lines: Vec<_> = self.stderr.lines().filter(|l| !l.is_empty()).collect();
        assert_eq!(lines.len(), 1, "one line, not:\n{}", self.stderr);
        assert!(lines[0].starts_with("error: "), "{}", lines[0]);
        lines[0]
    }
}

pub fn pgm(width: usize, height: usize, pixels: &[u8]) -> Vec<u8> {
    let mut bytes = format!("P5\n{width} {height}\n255\n").into_bytes();
    bytes.extend_from_slice(pixels);
    bytes
}

/// True if the program can be run; prints a note if not.
pub(crate) fn has(program: &str, args: &[&str]) -> bool {
    let found = Command::new(program).args(args).output();
    let found = found.is_ok_and(|output| output.status.success());
    if !found {
        crate::common::skip(&format!("no program {program}"));
    }
    found
}
