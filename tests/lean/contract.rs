//! The contract between a matcher and its oracle: the same result on every instruction set and
//! thread count, with all possible reasons and no others.

use crate::common;
use crate::oracle::scenes::{Scene, difference, pair, pool};
use proptest::prelude::*;
use svl_core::kernel::Isa;
use svl_core::matcher::MATCHERS;
use svl_core::stereo::{DisparityMap, Reason, StereoPair};

/// `algorithm` gives the `expected` map on every instruction set, on one thread and on two.
pub(crate) fn equals(
    algorithm: &str,
    expected: &DisparityMap,
    pair: &StereoPair,
) -> Result<(), TestCaseError> {
    for isa in Isa::available() {
        for threads in [1, 2] {
            let got = pool(threads).install(|| common::run(algorithm, isa, pair));
            let context = format!("{algorithm} on {isa}, {threads} threads");
            prop_assert_eq!(difference(&got, expected), None, "{}", context);
        }
    }
    Ok(())
}

/// `algorithm` gives the same result on several threads as on one.
pub(crate) fn threads_do_not_matter(
    algorithm: &str,
    pair: &StereoPair,
) -> Result<(), TestCaseError> {
    let isa = Isa::available().next().unwrap();
    let on = |threads| pool(threads).install(|| common::run(algorithm, isa, pair));
    let one = on(1);
    for threads in [2, 3, 8] {
        let several = on(threads);
        prop_assert_eq!(difference(&several, &one), None, "{}", algorithm);
        prop_assert_eq!(one.hash(), several.hash());
    }
    Ok(())
}

/// The generators of scenes would be worthless if some reason never occurred in them.
#[test]
fn every_reason_occurs_and_no_other() {
    use Reason::{Ambiguous, Border, Inconsistent, SelfCheck, Unmatched, Untextured, Valid};
    for spec in MATCHERS.iter().filter(|spec| spec.matches_images()) {
        let (settings, reasons) = match spec.name {
            "dp" => ("max_disparity=20", &[Valid][..]),
            "v1" => (
                "max_disparity=20",
                &[Valid, Border, Ambiguous, Inconsistent][..],
            ),
            "v2" => (
                "max_disparity=20,spread_threshold=4",
                &[Valid, Border, Untextured, Ambiguous, Inconsistent][..],
            ),
            "v3" => (
                "max_disparity=20",
                &[Valid, Border, Untextured, SelfCheck][..],
            ),
            "v4" => (
                "max_disparity=20",
                &[Valid, Border, Untextured, SelfCheck, Unmatched][..],
            ),
            "v5" => (
                "max_disparity=20",
                &[Valid, Border, Ambiguous, Inconsistent][..],
            ),
            "bm" => (
                "max_disparity=20,symmetry_tolerance=0,block_size=5",
                &[Valid, Border, Untextured, Ambiguous, Inconsistent][..],
            ),
            "sgm" => (
                "max_disparity=20,min_disparity=2",
                &[Valid, Border, Ambiguous, Inconsistent][..],
            ),
            other => panic!("no reasons are expected of {other}"),
        };
        let algorithm = format!("{}:{settings}", spec.name);
        let noisy = Scene::ALL.map(|scene| (scene, 9));
        let mut occurring = [false; Reason::PIXELS.len()];
        for (scene, noise) in noisy.into_iter().chain([(Scene::Constant, 0)]) {
            let pair = pair(scene, (60, 20), 5, noise, 42);
            let tally = common::run(&algorithm, Isa::BASELINE, &pair).tally();
            Reason::PIXELS
                .iter()
                .for_each(|&reason| occurring[reason as usize] |= tally[reason as usize] > 0);
        }
        let expected = Reason::PIXELS.map(|reason| reasons.contains(&reason));
        assert_eq!(occurring, expected, "{algorithm}, {:?}", Reason::PIXELS);
    }
}
