//! Shared helpers: real scenes, and running an algorithm.

use proptest::test_runner::Config as ProptestConfig;
use std::ffi::OsStr;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use svl_core::kernel::Isa;
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, Matcher};
use svl_core::stereo::{DisparityMap, Gray, RectifiedPair, Rgb, StereoPair};

/// The root of the repository, for a test program of any package.
pub(crate) fn repository() -> &'static Path {
    let mut folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    folders
        .find(|folder| folder.join("scenarios").is_dir())
        .unwrap()
}

/// Notes that a test, or a part of it, was skipped: on its output, and as a line of the file that
/// `SVL_SKIPPED` names, which `.ci/run` counts.
#[allow(dead_code, reason = "each test binary uses its part of this module")]
pub(crate) fn skip(reason: &str) {
    println!("skipped: {reason}");
    if let Some(path) = std::env::var_os("SVL_SKIPPED") {
        let file = File::options().append(true).create(true).open(path);
        // One write per line: tests run side by side.
        file.unwrap()
            .write_all(format!("{reason}\n").as_bytes())
            .unwrap();
    }
}

/// The data sets, from `SVL_DATASETS` or next to the repository; `None`, with a note, if there are
/// none.
#[allow(dead_code, reason = "each test binary uses its part of this module")]
pub fn datasets() -> Option<PathBuf> {
    let folder = std::env::var_os("SVL_DATASETS")
        .map_or_else(|| repository().join("../shared/datasets"), PathBuf::from);
    if folder.is_dir() {
        Some(folder)
    } else {
        skip("no data sets");
        None
    }
}

/// The pair of a scene.
#[allow(dead_code, reason = "each test binary uses its part of this module")]
pub(crate) fn scene(name: &str) -> Option<StereoPair> {
    Some(pair(&datasets()?.join(name), "im0.png", "im1.png"))
}

/// The pair of two files in `folder`.
#[allow(dead_code, reason = "each test binary uses its part of this module")]
pub(crate) fn pair(folder: &Path, left: &str, right: &str) -> StereoPair {
    let grey = |file: &str| {
        let image = image::open(folder.join(file)).unwrap();
        let (width, height) = (image.width() as usize, image.height() as usize);
        if image.color().has_color() {
            let rgb = image.to_rgb8().as_raw().as_chunks().0.to_vec();
            Gray::from_color(&Rgb::from_vec(width, height, rgb).unwrap())
        } else {
            Gray::from_vec(width, height, image.to_luma8().into_raw()).unwrap()
        }
    };
    StereoPair::new(grey(left), grey(right)).unwrap()
}

/// The result of `algorithm`, written as on the command line, on `isa`.
#[allow(dead_code, reason = "each test binary uses its part of this module")]
pub(crate) fn run(algorithm: &str, isa: Isa, pair: &StereoPair) -> DisparityMap {
    let mut output = MatchOutput::new().unwrap();
    let mut matcher = algorithm
        .parse::<Algorithm>()
        .unwrap()
        .build_on(isa)
        .unwrap();
    compute(&mut *matcher, pair, &mut output).unwrap();
    output.disparity
}

/// Matches a pair that needs no context.
#[allow(dead_code, reason = "each test binary uses its part of this module")]
pub(crate) fn compute(
    matcher: &mut dyn Matcher,
    pair: &StereoPair,
    output: &mut MatchOutput,
) -> svl_core::Result<()> {
    output.begin();
    matcher.compute(
        RectifiedPair::assume(pair),
        &MatchContext::default(),
        output,
    )
}

/// Asserts that `text` contains all these words.
#[allow(dead_code, reason = "each test binary uses its part of this module")]
#[track_caller]
pub fn assert_says(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "'{word}' is not in: {text}");
    }
}

/// The output of a script in `tests/python`; `None`, with a note, if Python lacks these modules.
#[allow(dead_code, reason = "each test binary uses its part of this module")]
pub fn python<A: AsRef<OsStr>>(
    script: &str,
    modules: &str,
    args: impl IntoIterator<Item = A>,
) -> Option<Vec<u8>> {
    let python = std::env::var("SVL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let import = format!("import {modules}");
    let asked = Command::new(&python).args(["-c", &import]).output();
    if !asked.is_ok_and(|output| output.status.success()) {
        skip(&format!("no Python with {modules}; SVL_PYTHON names one"));
        return None;
    }
    let folder = repository().join("tests/python");
    let mut command = Command::new(&python);
    let output = command
        .arg(folder.join(script))
        .args(args)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    Some(output.stdout)
}

/// True in `.ci/nightly`, which sets `SVL_CASES` to "all".
#[allow(dead_code, reason = "each test binary uses its part of this module")]
pub(crate) fn is_nightly() -> bool {
    std::env::var_os("SVL_CASES").is_some_and(|cases| cases == "all")
}

/// Configuration of a property test with `all` cases in `.ci/nightly`, a quarter of them otherwise.
#[allow(dead_code, reason = "each test binary uses its part of this module")]
pub(crate) fn cases(all: u32) -> ProptestConfig {
    ProptestConfig::with_cases(if is_nightly() { all } else { all.div_ceil(4) })
}

/// Step through the places of a file that a test damages: `all` in `.ci/nightly`, five times that
/// otherwise.
#[allow(dead_code, reason = "each test binary uses its part of this module")]
pub(crate) fn step(all: usize) -> usize {
    if is_nightly() { all } else { 5 * all }
}
