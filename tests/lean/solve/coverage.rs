//! Coverage of the standard deviations: parameters deviate from the truth by as much as they
//! predict.
//!
//! Every parameter of every rig counts: 18 intrinsics, 6 extrinsics, and the baseline. For a table
//! by parameter: `cargo test --release --test lean solve::coverage -- --nocapture --test-threads
//! 1`.

use super::simulated::{Simulated, Spoil, turn_deg};
use std::time::{Duration, Instant};
use svl_calibrate::{CameraEstimate, Estimated, Solution, solve};
use svl_core::stereo::{DistortionModel, Intrinsics};

/// Deviation of every parameter from the truth, in standard deviations.
fn deviations(solution: &Solution, simulated: &Simulated) -> Vec<(String, f64)> {
    let truth = &simulated.truth;
    let mut all: Vec<(String, Estimated, f64)> = Vec::new();
    let mut camera_parameters = |side: &str, camera: &CameraEstimate, truth: &Intrinsics| {
        let pairs = camera.parameters.0.iter().copied().zip(truth.parameters());
        all.extend(
            pairs.map(|((name, estimate), truth)| (format!("{side} {name}"), estimate, truth)),
        );
    };
    camera_parameters("left", &solution.left, truth.left());
    camera_parameters("right", &solution.right, truth.right());
    let (turn, shift) = (
        turn_deg(truth.right_from_left()),
        truth.right_from_left().translation.vector,
    );
    for (i, axis) in ["x", "y", "z"].into_iter().enumerate() {
        all.push((
            format!("rotation {axis}"),
            solution.rotation_deg[i],
            turn[i],
        ));
        all.push((format!("T {axis}"), solution.translation[i], shift[i]));
    }
    all.push(("baseline".to_owned(), solution.baseline, truth.baseline()));
    all.into_iter()
        .map(|(name, estimate, truth)| (name, (estimate.value - truth) / estimate.deviation))
        .collect()
}

/// Fractions of parameters within 1, 1.96 and 3 standard deviations, and number of views
/// wrongly refused or used. Prints a table by parameter.
fn shares(
    model: DistortionModel,
    rigs: u64,
    noise_px: Option<f64>,
    spoilt: fn(u64) -> usize,
) -> ([f64; 3], usize) {
    let mut spent = Duration::ZERO;
    let mut all: Vec<Vec<(String, f64)>> = Vec::new();
    let mut misjudged = 0;
    for seed in 0..rigs {
        let simulated = Simulated::new(model, seed, noise_px, spoilt(seed));
        let begin = Instant::now();
        let solution = solve(
            &simulated.board,
            simulated.truth.left().size(),
            model,
            &simulated.views,
        );
        spent += begin.elapsed();
        let solution = solution.unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        for (view, spoilt) in solution.views.iter().zip(&simulated.spoilt) {
            // A view with a few outlying corners keeps the others.
            let wrong = spoilt.is_some_and(|spoil| spoil != Spoil::Corners);
            misjudged += usize::from(wrong != view.refused.is_some());
        }
        all.push(deviations(&solution, &simulated));
    }
    let within = |numbers: &mut dyn Iterator<Item = f64>| {
        let numbers: Vec<f64> = numbers.collect();
        [1.0, 1.96, 3.0]
            .map(|n| numbers.iter().filter(|z| z.abs() <= n).count() as f64 / numbers.len() as f64)
    };
    for (i, (name, _)) in all[0].iter().enumerate() {
        let shares = within(&mut all.iter().map(|rig| rig[i].1));
        println!("{name:12} {shares:.3?}");
        // Each parameter is within its own 95 % interval.
        assert!(shares[1] >= 0.9, "{model} {name}: {shares:?}");
    }
    let shares = within(&mut all.iter().flatten().map(|(_, z)| *z));
    println!("{rigs} rigs in {spent:.1?}: {shares:.4?}; {misjudged} views misjudged");
    (shares, misjudged)
}

/// A normal distribution has 68.3, 95.0 and 99.7 % within. The parameters of one rig are
/// correlated, so the fractions vary more than those of independent numbers.
fn check(model: DistortionModel, spoilt: fn(u64) -> usize, noise_px: Option<f64>) {
    let ([one, _, three], misjudged) = shares(model, 200, noise_px, spoilt);
    assert!(
        (0.64..0.72).contains(&one),
        "{one}: deviations too small or too wide"
    );
    assert!(three >= 0.99, "{three}");
    // At the edge of a fisheye, a board may be behind the camera of the first estimate.
    let most = if model == DistortionModel::Equidistant {
        15
    } else {
        2
    };
    assert!(
        misjudged <= most,
        "{misjudged} good views refused or bad ones used"
    );
}

#[test]
fn deviations_are_right() {
    check(DistortionModel::PlumbBob, |_| 0, None);
}

#[test]
#[ignore = "200 rigs, a quarter of a minute: in .ci/nightly"]
fn deviations_are_right_with_outliers_and_noise_of_a_pixel() {
    check(
        DistortionModel::PlumbBob,
        |seed| 1 + seed as usize % 3,
        Some(1.0),
    );
}

#[test]
fn deviations_of_fisheyes_are_right() {
    check(DistortionModel::Equidistant, |_| 0, None);
}

#[test]
#[ignore = "200 rigs, a quarter of a minute: in .ci/nightly"]
fn deviations_of_fisheyes_are_right_with_outliers() {
    check(
        DistortionModel::Equidistant,
        |seed| 1 + seed as usize % 3,
        Some(0.5),
    );
}
