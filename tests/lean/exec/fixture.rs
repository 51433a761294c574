//! A matcher whose program the test writes.

use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};
use svl_core::Error;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, Matcher, ProgramRecord};
use svl_core::stereo::{Gray, RectifiedPair, StereoPair};
use svl_core::timing::Clock;

/// Beginning of every program below: it reads a pair as `line` and `images`.
const PRELUDE: &str = r#"
import json, os, struct, sys, time
source, target = sys.stdin.buffer, sys.stdout.buffer
def pair():
    line = json.loads(source.readline() or sys.exit())
    return line, source.read(2 * line["channels"] * line["width"] * line["height"])
def put(bytes):
    target.write(bytes)
    target.flush()
def answer(line, values=None, **other):
    count = line["width"] * line["height"]
    reply = json.dumps({"seq": line["seq"], **(other or {"millis": 1.5})}).encode() + b"\n"
    put(reply + struct.pack("<%df" % count, *(values or [0.0] * count)))
"#;

const PROGRAM: &str = "a program, with a comma.py";

/// A matcher whose program is part of the test.
pub(crate) struct Plugin {
    matcher: Box<dyn Matcher>,
    pub(crate) output: MatchOutput,
    // Last, so that the program ends before its file is deleted.
    folder: tempfile::TempDir,
}

pub(crate) fn python() -> Option<PathBuf> {
    let python = PathBuf::from(std::env::var_os("SVL_PYTHON").unwrap_or_else(|| "python3".into()));
    let found = Command::new(&python)
        .arg("--version")
        .output()
        .is_ok_and(|output| output.status.success());
    if !found {
        crate::common::skip("no Python; SVL_PYTHON names one");
    }
    found.then_some(python)
}

/// The program with that body; `None` without Python.
pub(crate) fn start(body: &str, settings: &str) -> Option<Plugin> {
    let python = python()?;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(PROGRAM);
    std::fs::write(&file, format!("{PRELUDE}{body}")).unwrap();
    let text = format!(
        "exec:command={} '{}'{settings}",
        python.display(),
        file.display()
    );
    let matcher = text.parse::<Algorithm>().unwrap().build().unwrap();
    Some(Plugin {
        matcher,
        output: MatchOutput::new().unwrap(),
        folder,
    })
}

pub(crate) fn pair(width: usize, height: usize) -> StereoPair {
    let left = Gray::from_fn(width, height, |x, y| (7 * x + 13 * y) as u8).unwrap();
    let right = Gray::from_fn(width, height, |x, y| (7 * x + 13 * y + 1) as u8).unwrap();
    StereoPair::new(left, right).unwrap()
}

impl Plugin {
    pub(crate) fn compute(&mut self, pair: &StereoPair) -> svl_core::Result<Clock> {
        self.compute_with(pair, &MatchContext::default())
    }

    pub(crate) fn compute_with(
        &mut self,
        pair: &StereoPair,
        context: &MatchContext,
    ) -> svl_core::Result<Clock> {
        self.output.begin();
        self.matcher
            .compute(RectifiedPair::assume(pair), context, &mut self.output)?;
        Ok(std::mem::replace(&mut self.output.clock, Clock::start()))
    }

    pub(crate) fn program(&self) -> Option<ProgramRecord> {
        self.matcher.program()
    }

    pub(crate) fn batch(&self) -> usize {
        self.matcher.batch()
    }

    /// Announces the pair that many times.
    pub(crate) fn announce(&mut self, pair: &StereoPair, times: usize) {
        let pair = (RectifiedPair::assume(pair), MatchContext::default());
        self.matcher.announce(&vec![pair; times]);
    }

    /// Waits until the program has created the file of its own name with that extension.
    #[track_caller]
    pub(crate) fn wait_for(&self, ending: &str) {
        let file = self.folder.path().join(format!("{PROGRAM}.{ending}"));
        let start = Instant::now();
        while !file.exists() {
            assert!(
                start.elapsed() < Duration::from_secs(60),
                "no {}",
                file.display()
            );
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Asserts failure within a few seconds, in one line with all these words.
    #[track_caller]
    pub(crate) fn fails(&mut self, words: &[&str]) {
        let start = Instant::now();
        let error = self.compute(&pair(12, 5)).err().expect("a failure");
        assert!(matches!(error, Error::Program { .. }));
        let line = error.to_string();
        // The programs sleep for a minute.
        assert!(
            start.elapsed() < Duration::from_secs(50),
            "{:?}: {line}",
            start.elapsed()
        );
        for word in [&[PROGRAM], words].concat() {
            assert!(line.contains(word), "'{word}' is not in: {line}");
        }
        assert!(!line.contains('\n') && line.len() < 1000, "{line}");
    }
}
