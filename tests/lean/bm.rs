//! bm against its oracle on images of every kind, and against OpenCV itself on real scenes.

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
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn equals_the_oracle(pair in pairs(sizes()), bm in matchers()) {
        contract::equals(&bm.text(), &bm.compute(&pair), &pair)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]

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

/// The results of OpenCV's StereoBM on the real scenes.
#[test]
fn equals_opencv() {
    let Some(folder) = common::datasets() else {
        return;
    };
    let index = std::fs::read_to_string(folder.join("index.tsv")).unwrap();
    let scratch = tempfile::tempdir().unwrap();
    let file = |name: &str| scratch.path().join(name);
    for line in index.lines().skip(1) {
        let fields: Vec<&str> = line.split('\t').collect();
        let pair = common::pair(&folder.join(fields[0]), fields[1], fields[2]);
        let (width, height) = pair.size();
        std::fs::write(
            file("pair"),
            pair.left()
                .pixels()
                .chain(pair.right().pixels())
                .collect::<Vec<_>>(),
        )
        .unwrap();
        for block in [9, 15] {
            let sizes = [width, height, 80, block].map(|n| n.to_string());
            let files = [file("pair"), file("disparity")].map(|path| path.display().to_string());
            let args = sizes.into_iter().chain(files);
            if common::python("stereo_bm.py", "cv2, numpy", args).is_none() {
                return;
            }
            let bytes = std::fs::read(file("disparity")).unwrap();
            let expected = bytes
                .as_chunks::<2>()
                .0
                .iter()
                .map(|&b| f32::from(i16::from_le_bytes(b)) / 16.0);
            let algorithm = format!("svs:max_disparity=79,block_size={block}");
            let map = common::run(&algorithm, Isa::available().next().unwrap(), &pair);
            // OpenCV writes one less than the lowest disparity if it found none.
            let got = map
                .disparity()
                .pixels()
                .map(|d| if d.is_finite() { d } else { -1.0 });
            let differing = got
                .zip(expected)
                .filter(|(got, expected)| got != expected)
                .count();
            println!(
                "{} {block}x{block}: {differing} of {} pixels differ",
                fields[0],
                width * height
            );
            assert_eq!(differing, 0, "{} {algorithm}", fields[0]);
        }
    }
}
