//! Learned gaps of v5 against their oracle.

use crate::matchers::allocations;
use crate::oracle::gaps::Gaps;
use crate::oracle::scenes::{Scene, pair, pool};
use crate::oracle::v5::V5;
use svl_core::kernel::{GAP_TENSORS, GAP_WEIGHTS, Isa};
use svl_core::matcher::{Algorithm, GapWeights, MatchContext, MatchOutput, V5Model, Value};
use svl_core::stereo::{CellEvidence, RectifiedPair, StereoPair};

/// A model whose network prefers something, in a file, with its weights.
fn network(seed: u64, folder: &tempfile::TempDir) -> (String, Vec<i32>) {
    let mut state = seed;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        ((state >> 40) as f32 / f32::from(u16::MAX) / 256.0 - 0.5) * 2.0
    };
    let mut weights = [0.0; GAP_WEIGHTS];
    weights
        .iter_mut()
        .for_each(|weight| *weight = 0.5 * random());
    let model = V5Model {
        network: Some(GapWeights::rounded(&weights).unwrap()),
        ..V5Model::built_in()
    };
    let path = folder.path().join(format!("{seed}.safetensors"));
    let bytes = model.to_bytes();
    assert_eq!(V5Model::from_bytes(&bytes).unwrap(), model);
    let tensors = &bytes[bytes.len() - 4 * GAP_WEIGHTS..];
    let weights = tensors
        .as_chunks()
        .0
        .iter()
        .map(|b| i32::from_le_bytes(*b))
        .collect();
    std::fs::write(&path, bytes).unwrap();
    (path.display().to_string(), weights)
}

fn cells(algorithm: &Algorithm, isa: Isa, threads: usize, pair: &StereoPair) -> MatchOutput {
    pool(threads).install(|| {
        let mut output = MatchOutput::new().unwrap();
        let mut matcher = algorithm.build_on(isa).unwrap();
        // The second time in memory already used.
        for _ in 0..2 {
            output.begin();
            let (pair, context) = (RectifiedPair::assume(pair), MatchContext::default());
            matcher.compute(pair, &context, &mut output).unwrap();
        }
        output
    })
}

#[test]
fn votes_are_those_of_the_oracle_on_every_instruction_set() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        (Scene::Noise, (150, 61), 6, 60, 80),
        (Scene::Noise, (97, 140), -9, 150, 31),
        (Scene::Faint, (131, 70), 9, 2, 80),
        (Scene::Periodic, (90, 64), 5, 9, 17),
        (Scene::BlackAndWhite, (64, 48), 3, 0, 2),
        (Scene::Noise, (12, 9), 1, 9, 80),
        (Scene::Noise, (10, 6), 1, 9, 80),
    ];
    for (i, (scene, size, shift, noise, max_disparity)) in cases.into_iter().enumerate() {
        let pair = pair(scene, size, shift, noise, i as u64);
        let v5 = V5 {
            max_disparity,
            slack: 100,
            ..V5::default()
        };
        let (path, weights) = network(1 + i as u64, &folder);
        let text = format!("v5:max_disparity={max_disparity},model={path}");
        let algorithm: Algorithm = text.parse().unwrap();
        let half = v5.steps(&pair);
        let quarter = V5 {
            max_disparity: max_disparity / 2,
            ..v5.clone()
        };
        let quarter = quarter.quarter_steps(&half);
        let oracle = Gaps {
            weights: &weights,
            v5: &v5,
            half: &half,
            quarter: &quarter,
        };
        let expected = if half.seen.contains(&true) {
            oracle.evidence(&v5.tolerance_px(2.0), (5, 3))
        } else {
            vec![None; 15]
        };
        let expected = expected.into_iter().map(|numbers| {
            let [report, target, features @ ..] = numbers?;
            Some(CellEvidence {
                report,
                target,
                features,
                plain: 0,
            })
        });
        let expected: Vec<_> = expected.collect();
        for isa in Isa::available() {
            for threads in [1, 2] {
                let output = cells(&algorithm, isa, threads, &pair);
                let got = output.grid.unwrap().into_cells();
                let fitted = |own| CellEvidence { plain: 0, ..own };
                let got = got.iter().map(|cell| cell.evidence.map(fitted));
                let got: Vec<_> = got.collect();
                assert_eq!(got, expected, "{scene:?} {size:?} {isa} {threads}");
            }
        }
    }
}

/// The map itself stays as it is, and so do the seven other features' places.
#[test]
fn gaps_change_cells_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = network(3, &folder);
    let pair = pair(Scene::Noise, (150, 60), 6, 150, 7);
    let with: Algorithm = format!("v5:model={path}").parse().unwrap();
    let without = V5Model {
        network: None,
        ..V5Model::built_in()
    };
    let without = Value::file("model", without.to_bytes());
    let plain = Algorithm::default().with("model", &without).unwrap();
    let [plain, with] = [plain, with].map(|algorithm| {
        let output = cells(&algorithm, Isa::BASELINE, 1, &pair);
        (output.disparity, output.grid.unwrap().into_cells())
    });
    assert_eq!(plain.0, with.0);
    for (plain, with) in plain.1.iter().zip(&with.1) {
        let [plain, with] = [plain, with].map(|cell| cell.evidence.unwrap().features);
        assert_eq!(plain[7..], [CellEvidence::NOT_MEASURED; 2]);
        assert!(with[7..].iter().all(|value| (0..=1000).contains(value)));
    }
}

#[test]
fn nothing_is_allocated_after_the_first_pair() {
    let pair = pair(Scene::Noise, (150, 60), 6, 150, 7);
    let algorithm: Algorithm = "v5".parse().unwrap();
    let count = pool(1).install(|| {
        let mut matcher = algorithm.build().unwrap();
        let mut output = MatchOutput::new().unwrap();
        let mut before = 0;
        for _ in 0..3 {
            let (pair, context) = (RectifiedPair::assume(&pair), MatchContext::default());
            output.begin();
            matcher.compute(pair, &context, &mut output).unwrap();
            before = if before == 0 { allocations() } else { before };
        }
        allocations() - before
    });
    assert_eq!(count, 0);
}

#[test]
fn other_files_are_refused_before_a_pair_is_matched() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = network(5, &folder);
    let good = std::fs::read(&path).unwrap();
    let refused = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let algorithm: Algorithm = format!("v5:model={path}").parse().unwrap();
        let error = algorithm.build().err().unwrap();
        assert!(error.is_usage());
        let text = error.to_string();
        assert!(
            !text.contains('\n') && text.contains("svl train v5"),
            "{text}"
        );
        text
    };
    let changed = |from: &str, to: &str| {
        let at = good.windows(from.len()).position(|w| w == from.as_bytes());
        let mut bytes = good.clone();
        bytes[at.unwrap_or_else(|| panic!("{from}"))..][..to.len()].copy_from_slice(to.as_bytes());
        refused(&bytes)
    };
    for (from, to, reason) in [
        ("\"v5\":\"3\"", "\"v5\":\"2\"", "version '2'"),
        ("\"v5\":\"3\"", "\"v6\":\"3\"", "no 'v5'"),
        ("\"near\":", "\"neer\":", "no 'near'"),
        (
            "[[2500,452]",
            "[[2500,-52]",
            "time.agrees: its scores must begin at 0",
        ),
        (
            "[102,941]",
            "[ 12,941]",
            "steps.margin: its values do not rise",
        ),
        ("score.weight", "skore.weight", "no tensor 'score.weight'"),
        ("[16,17]", "[17,16]", "expected I32 [16, 17]"),
    ] {
        let text = changed(from, to);
        assert!(text.contains(reason), "{text}");
    }
    for length in (0..good.len()).step_by(97) {
        refused(&good[..length]);
    }
    let mut flipped = good.clone();
    *flipped.last_mut().unwrap() ^= 1;
    assert!(refused(&flipped).contains("is damaged, by its checksum"));
    // Too large for 16 bits; and all of a layer's at their limit.
    let data = good.len() - 4 * GAP_WEIGHTS;
    let mut wide = good.clone();
    wide[data..][..4].copy_from_slice(&70_000_i32.to_le_bytes());
    assert!(refused(&wide).contains("'pixel.weight' has a weight beyond 16 bits"));
    let mut most = good.clone();
    let (mut at, mut tensors) = (data, GAP_TENSORS.iter());
    tensors
        .by_ref()
        .take_while(|tensor| tensor.0 != "choice.weight")
        .for_each(|tensor| {
            at += 4 * tensor.1[0] * tensor.1[1];
        });
    for weight in most[at..][..4 * 2 * 16 * 24].as_chunks_mut::<4>().0 {
        *weight = 32_767_i32.to_le_bytes();
    }
    most[good.len() - 4..].copy_from_slice(&i32::MIN.to_le_bytes());
    assert!(refused(&most).contains("could overflow"));
}
