//! Grey values: right image against truth, noise, misalignment, reproducibility.

use super::{clean, empty};
use rayon::prelude::*;
use svl::arena::{Arena, ArenaConfig};
use svl::rectify::AlignmentMeter;
use svl::stereo::{Frame, Gray, Visibility};

/// Median absolute difference between left pixels and the right pixels to which the truth plus
/// `error_px` maps them, in the rows that show walls and obstacles.
fn warp_difference(frame: &Frame, error_px: f32, wanted: Visibility) -> f32 {
    let truth = frame.truth.as_ref().unwrap();
    let visibility = truth.visibility.as_ref().unwrap();
    let mut differences = Vec::new();
    for y in 85..140 {
        let (left, right) = (frame.pair.left().row(y), frame.pair.right().row(y));
        for (x, &here) in left.iter().enumerate() {
            let at = x as f32 - truth.disparity.get(x, y) - error_px;
            if visibility.get(x, y) == wanted && (0.0..319.0).contains(&at) {
                let (i, f) = (at as usize, at.fract());
                let there = f32::from(right[i]) * (1.0 - f) + f32::from(right[i + 1]) * f;
                differences.push((f32::from(here) - there).abs());
            }
        }
    }
    differences.sort_by(f32::total_cmp);
    differences[differences.len() / 2]
}

#[test]
fn the_right_image_is_the_left_one_moved_by_the_truth() {
    let alike = clean();
    let mut config = ArenaConfig {
        rig: alike.rig,
        sensor: alike.sensor,
        ..ArenaConfig::default()
    };
    config.sensor.vignetting = 0.0;
    let arena = Arena::new(&config, 2).unwrap();
    for index in [9, 55, 89, 201, 240] {
        let frame = arena.frame(index).unwrap();
        let exact = warp_difference(&frame, 0.0, Visibility::Visible);
        assert!(
            exact <= 2.0,
            "frame {index}: visible pixels differ by {exact}"
        );
        for wrong in [-2.0, 2.0] {
            let off = warp_difference(&frame, wrong, Visibility::Visible);
            assert!(
                off > 4.0 * exact,
                "frame {index}: {off} at {wrong} px beside the truth, {exact} at it"
            );
        }
    }
    let hidden = warp_difference(&arena.frame(89).unwrap(), 0.0, Visibility::Occluded);
    assert!(
        hidden > 10.0,
        "occluded pixels differ by {hidden}: they match what hides them"
    );
}

#[test]
fn misalignment_moves_the_right_image_and_leaves_the_truth() {
    let straight = Arena::new(&clean(), 1).unwrap().frame(5).unwrap();
    let mut config = clean();
    config.rig.right_row_offset_px = 2.0;
    let moved = Arena::new(&config, 1).unwrap().frame(5).unwrap();
    assert_eq!(straight.truth, moved.truth);
    assert_eq!(straight.pair.left(), moved.pair.left());
    let difference = |rows: usize| -> u64 {
        let pairs = (80..150).flat_map(|y| {
            straight
                .pair
                .right()
                .row(y)
                .iter()
                .zip(moved.pair.right().row(y + rows))
        });
        pairs.map(|(a, b)| u64::from(a.abs_diff(*b))).sum()
    };
    // Vignetting stays with the sensor: a small difference remains.
    assert!(3 * difference(2) < difference(0) && 3 * difference(2) < difference(4));
}

#[test]
fn noise_is_that_of_photons_and_amplifier() {
    let mut config = empty();
    let noisy = Arena::new(&config, 1).unwrap().frame(2).unwrap();
    config.sensor.noise = false;
    let silent = Arena::new(&config, 1).unwrap().frame(2).unwrap();
    let grey_per_e = 255.0 / config.sensor.full_scale_e;
    let (mut sum, mut square, mut n) = (0.0, 0.0, 0.0);
    for (a, b) in noisy
        .pair
        .left()
        .pixels()
        .zip(silent.pair.left().pixels())
        .filter(|(_, b)| (40..220).contains(b))
    {
        let electrons = f64::from(b) / grey_per_e;
        let expected = (electrons + config.sensor.read_noise_e.powi(2)).sqrt() * grey_per_e;
        let deviation = (f64::from(a) - f64::from(b)) / expected;
        (sum, square, n) = (sum + deviation, square + deviation * deviation, n + 1.0);
    }
    let (mean, sigma) = (sum / n, f64::sqrt(square / n));
    assert!(n > 50_000.0 && mean.abs() < 0.03, "mean {mean} of {n}");
    // Quantization adds a little.
    assert!((0.97..1.10).contains(&sigma), "{sigma}");
}

#[test]
fn a_frame_depends_on_configuration_seed_and_index_only() {
    let config = ArenaConfig::default();
    let arena = Arena::new(&config, 7).unwrap();
    let again = Arena::new(&config, 7).unwrap();
    let indices = [130, 3, 279];
    let alone = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let forwards: Vec<Frame> =
        alone.install(|| indices.iter().map(|&i| arena.frame(i).unwrap()).collect());
    let backwards: Vec<Frame> = indices
        .par_iter()
        .rev()
        .map(|&i| again.frame(i).unwrap())
        .collect();
    assert!(forwards.iter().eq(backwards.iter().rev()));
    let other = Arena::new(&config, 8).unwrap().frame(130).unwrap();
    assert_ne!(other.pair, forwards[0].pair);
    assert_ne!(other.pose, forwards[0].pose);
    assert_ne!(forwards[0].pair.left(), forwards[0].pair.right());
    assert!(arena.frame(280).is_err());
}

#[test]
fn walls_are_textured_and_the_floor_is_weaker() {
    let frame = Arena::new(&ArenaConfig::default(), 1)
        .unwrap()
        .frame(201)
        .unwrap();
    // The slanted wall fills the middle rows, floor the lowest.
    let (forest, floor) = (
        spread(frame.pair.left(), 100..140),
        spread(frame.pair.left(), 200..240),
    );
    assert!((20.0..70.0).contains(&forest), "{forest}");
    assert!(
        (2.0..0.4 * forest).contains(&floor),
        "{floor}, forest {forest}"
    );
}

/// Standard deviation of grey values in some rows.
fn spread(image: &Gray, rows: std::ops::Range<usize>) -> f64 {
    let values: Vec<f64> = rows
        .flat_map(|y| image.row(y))
        .map(|&v| f64::from(v))
        .collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

/// The misalignment measured from the images is that of the rig.
#[test]
fn rows_are_as_far_apart_as_rectification_left_them() {
    for (lower_px, roll_deg) in [(0.25, 0.05), (0.0, 0.0), (-0.8, 0.0), (0.0, 0.6)] {
        let mut config = ArenaConfig::default();
        (config.rig.right_row_offset_px, config.rig.right_roll_deg) = (lower_px, roll_deg);
        let arena = Arena::new(&config, 1).unwrap();
        let mut meter = AlignmentMeter::new();
        (0..280)
            .step_by(40)
            .for_each(|index| meter.add(&arena.frame(index).unwrap().pair));
        let found = meter.alignment().unwrap();
        assert!(
            (found.median_px - lower_px).abs() < 0.1,
            "{lower_px} px, {roll_deg} degrees: {found:?}"
        );
        // For parts whose centres are two thirds of the width apart.
        let [left, _, right] = found.parts_px[1].map(|part| part.unwrap());
        let turned = ((right - left) / (2.0 / 3.0 * 320.0)).atan().to_degrees();
        assert!(
            (turned - roll_deg).abs() < 0.06,
            "{turned} for {roll_deg} degrees: {found:?}"
        );
        assert_eq!(
            found.is_off(),
            lower_px < -0.5 || roll_deg > 0.5,
            "{found:?}"
        );
    }
}
