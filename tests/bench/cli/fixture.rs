//! A temporary folder per test, the program under test, and input images.

pub use crate::common::datasets;

use assert_cmd::Command;
use std::path::PathBuf;
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

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs `svl` with these arguments in the folder.
    pub fn svl(&self, args: &[&str]) -> Ran {
        self.svl_with(args, &[])
    }

    /// Runs `svl` with these arguments and environment variables besides.
    pub fn svl_with(&self, args: &[&str], variables: &[(&str, &str)]) -> Ran {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("svl"));
        command.envs(variables.iter().copied());
        let output = command
            .current_dir(self.folder.path())
            .args(args)
            .timeout(std::time::Duration::from_secs(300))
            .output();
        let output = output.unwrap();
        Ran {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
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

    /// The arena with few frames, as a scenario file.
    pub fn write_short_arena(&self, name: &str, frames: u64) -> PathBuf {
        let text = include_str!("../../../scenarios/arena.toml");
        let lines = text
            .lines()
            .map(|line| match line.split('=').next().map(str::trim) {
                Some("frames") => format!("frames = {frames}"),
                Some("seeds") => "seeds = [1, 2]".to_owned(),
                _ => line.to_owned(),
            });
        self.write(name, lines.collect::<Vec<_>>().join("\n"))
    }
}

pub struct Ran {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Ran {
    /// It succeeded; returns what it printed.
    #[track_caller]
    pub fn done(self) -> String {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        self.stdout
    }

    /// It failed with this code and one line that holds all these words; returns the line.
    #[track_caller]
    pub fn failed(self, code: i32, words: &[&str]) -> String {
        assert_eq!(self.code, Some(code), "{}{}", self.stdout, self.stderr);
        let lines: Vec<_> = self.stderr.lines().filter(|l| !l.is_empty()).collect();
        assert_eq!(lines.len(), 1, "one line, not:\n{}", self.stderr);
        for word in words {
            assert!(lines[0].contains(word), "'{word}' is not in: {}", lines[0]);
        }
        assert!(lines[0].starts_with("error: "), "{}", lines[0]);
        lines[0].to_owned()
    }
}

pub fn pgm(width: usize, height: usize, pixels: &[u8]) -> Vec<u8> {
    let mut bytes = format!("P5\n{width} {height}\n255\n").into_bytes();
    bytes.extend_from_slice(pixels);
    bytes
}
