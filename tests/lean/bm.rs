//! bm against its oracle on images of every kind, and against OpenCV itself on real scenes.

use crate::common::cases;
use crate::oracle::bm::Bm;
use crate::oracle::scenes::pairs;
use crate::{common, contract};
use proptest::prelude::*;
use svl_core::kernel::Isa;

impl Bm {
    fn text(&self) -> String {
        let Self {
            min,
            max,
            log,
            block_size,
            texture_threshold,
            uniqueness,
            ..
        } = self;
        let Self {
            symmetry_tolerance,
            speckle_size,
            speckle_range,
            ..
        } = self;
        let prefilter = if *log { "log" } else { "xsobel" };
        format!(
            "bm:min_disparity={min},max_disparity={max},prefilter={prefilter},\
             block_size={block_size},texture_threshold={texture_threshold},\
             uniqueness={uniqueness},symmetry_tolerance={symmetry_tolerance},\
             speckle_size={speckle_size},speckle_range={speckle_range}"
        )
    }
}

fn sizes() -> impl Strategy<Value = (usize, usize)> {
    prop_oneof![
        4 => (9usize..=90, 5usize..=24),
        1 => (1usize..=12, 1usize..=12),
        1 => (120usize..=150, 5usize..=9),
        1 => (31usize..=60, 31usize..=36),
    ]
}

fn matchers() -> impl Strategy<Value = Bm> {
    let ends = prop_oneof![4 => (-20i32..=20, 0i32..=40), 1 => (-1024i32..=1024, 0i32..=2048)];
    let block = prop::sample::select(vec![5, 5, 7, 9, 9, 31]);
    let tests = (
        prop::sample::select(vec![0, 10, 900, 30_000]),
        prop::sample::select(vec![0, 15, 100]),
    );
    let checks = (
        -1i32..=3,
        prop::sample::select(vec![0usize, 1, 7, 60]),
        0i32..=3,
    );
    (ends, any::<bool>(), block, tests, checks).prop_map(
        |((min, span), log, block_size, tests, checks)| Bm {
            min,
            max: (min + span).min(1024),
            log,
            block_size,
            texture_threshold: tests.0,
            uniqueness: tests.1,
            symmetry_tolerance: checks.0,
            speckle_size: checks.1,
            speckle_range: checks.2,
        },
    )
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn equals_the_oracle(pair in pairs(sizes()), bm in matchers()) {
        contract::equals(&bm.text(), &bm.compute(&pair), &pair)?;
    }
}

proptest! {
    #![proptest_config(cases(30))]

    #[test]
    fn threads_do_not_matter(pair in pairs((40usize..=80, 30usize..=90)), bm in matchers()) {
        contract::threads_do_not_matter(&bm.text(), &pair)?;
    }
}

#[test]
fn a_window_without_a_centre_is_refused() {
    let error = "bm:block_size=10"
        .parse::<svl_core::matcher::Algorithm>()
        .unwrap()
        .build()
        .map(|_| ())
        .unwrap_err();
    assert!(error.to_string().contains("block_size=10"), "{error}");
}

/// Parameters that OpenCV's StereoBM has too.
#[derive(Clone, Copy)]
struct Settings {
    block: usize,
    min_disparity: i32,
    /// -1 for no check.
    symmetry_tolerance: i32,
}

/// The pixels of the real scenes on which bm differs from OpenCV's StereoBM by scene, and their
/// number; `None` without the scenes or without Python.
fn differing_from_opencv(settings: Settings) -> Option<Vec<(String, usize, usize)>> {
    let Settings {
        block,
        min_disparity,
        symmetry_tolerance,
    } = settings;
    let folder = common::datasets()?;
    let index = std::fs::read_to_string(folder.join("index.tsv")).unwrap();
    let scratch = tempfile::tempdir().unwrap();
    let file = |name: &str| scratch.path().join(name);
    let algorithm = format!(
        "svs:min_disparity={min_disparity},max_disparity={},block_size={block},\
         symmetry_tolerance={symmetry_tolerance}",
        min_disparity + 79
    );
    let mut scenes = Vec::new();
    let step = if common::is_nightly() { 1 } else { 4 };
    for line in index.lines().skip(1).step_by(step) {
        let fields: Vec<&str> = line.split('\t').collect();
        let pair = common::pair(&folder.join(fields[0]), fields[1], fields[2]);
        let (width, height) = pair.size();
        let pixels = pair.left().pixels().chain(pair.right().pixels());
        std::fs::write(file("pair"), pixels.collect::<Vec<_>>()).unwrap();
        let sizes = [width, height, 80, block].map(|n| n.to_string());
        let options = [min_disparity, symmetry_tolerance].map(|n| n.to_string());
        let files = [file("pair"), file("disparity")].map(|path| path.display().to_string());
        let args = sizes.into_iter().chain(options).chain(files);
        common::python("stereo_bm.py", "cv2, numpy", args)?;
        let bytes = std::fs::read(file("disparity")).unwrap();
        let expected = bytes.as_chunks::<2>().0.iter();
        let expected = expected.map(|&b| f32::from(i16::from_le_bytes(b)) / 16.0);
        let map = common::run(&algorithm, Isa::available().next().unwrap(), &pair);
        // OpenCV writes one less than the lowest disparity if it found none.
        let none = (min_disparity - 1) as f32;
        let found = map.disparity().pixels();
        let found = found.map(|d| if d.is_finite() { d } else { none });
        let differing = found.zip(expected).filter(|(a, b)| a != b).count();
        let name = fields[0];
        println!("{name} {algorithm}: {differing} of {width}x{height} pixels differ");
        scenes.push((name.to_owned(), differing, width * height));
    }
    Some(scenes)
}

/// The results of OpenCV's StereoBM on the real scenes, a quarter of them but in `.ci/nightly`.
#[test]
fn equals_opencv() {
    for block in [9, 15] {
        let settings = Settings {
            block,
            min_disparity: 0,
            symmetry_tolerance: -1,
        };
        for (scene, differing, _) in differing_from_opencv(settings).into_iter().flatten() {
            assert_eq!(differing, 0, "{scene} {block}x{block}");
        }
    }
}

/// The sizes of the departures in `docs/algorithms.md`, in per cent of all pixels and of the worst
/// scene's.
#[test]
#[ignore = "all scenes, half a minute: in .ci/nightly"]
fn departures_from_opencv_are_as_small_as_documented() {
    for (min_disparity, symmetry_tolerance, all, worst) in [
        (0, 0, 0.009, 0.04),
        (8, -1, 0.001, 0.004),
        (-16, -1, 0.30, 0.84),
    ] {
        let settings = Settings {
            block: 9,
            min_disparity,
            symmetry_tolerance,
        };
        let Some(scenes) = differing_from_opencv(settings) else {
            return;
        };
        let per_cent = |differing: usize, pixels: usize| 100.0 * differing as f64 / pixels as f64;
        let sum =
            |count: fn(&(String, usize, usize)) -> usize| scenes.iter().map(count).sum::<usize>();
        let found = per_cent(sum(|scene| scene.1), sum(|scene| scene.2));
        let shares = scenes
            .iter()
            .map(|(_, differing, pixels)| per_cent(*differing, *pixels));
        let found_worst = shares.fold(0.0, f64::max);
        let name = format!("{min_disparity} {symmetry_tolerance}: {found} {found_worst}");
        println!("{name}");
        assert!(found <= all && found_worst <= worst, "{name}");
        assert!(found > 0.0, "{name}: no departure any more");
    }
}
