//! Invariants of the metric protocols, for any map.

use super::{NO, image, numbers};
use proptest::prelude::*;
use svl::score::protocol::{NumberUnit, Protocol, ProtocolImage};
use svl::stereo::{Plane, Visibility};

/// A disparity of 0 up to 60 in sixteenths, or none.
fn disparity() -> impl Strategy<Value = f32> {
    prop_oneof![1 => Just(NO), 3 => (0u16..960).prop_map(|d| f32::from(d) / 16.0)]
}

/// Estimate, truth and mask of one size, with at least one scored pixel.
fn maps() -> impl Strategy<Value = (Plane<f32>, Plane<f32>, Plane<Visibility>)> {
    let pixel = (
        disparity(),
        disparity(),
        prop::sample::select(vec![0u8, 128, 255]),
    );
    ((60usize..64), prop::collection::vec(pixel, 64..400)).prop_map(|(width, mut pixels)| {
        pixels[0] = (pixels[0].0, 7.0, 255);
        let height = pixels.len() / width;
        pixels.truncate(width * height);
        let plane = |f: &dyn Fn(&(f32, f32, u8)) -> f32| {
            Plane::from_vec(width, height, pixels.iter().map(f).collect()).unwrap()
        };
        let codes = Plane::from_vec(width, height, pixels.iter().map(|p| p.2).collect()).unwrap();
        (
            plane(&|p| p.0),
            plane(&|p| p.1),
            codes.map(Visibility::from_code),
        )
    })
}

/// Fractions of errors beyond increasing thresholds.
const SERIES: [&[&str]; 4] = [
    &["bad0.5", "bad1.0", "bad2.0", "bad4.0"],
    &["out1", "out2", "out3", "out4", "out5"],
    &["out1_dense", "out2_dense", "out3_dense"],
    &["out1_est", "out3_est", "out5_est"],
];

proptest! {
    #[test]
    fn the_truth_itself_has_no_errors((_, truth, mask) in maps()) {
        for protocol in Protocol::ALL {
            let image = ProtocolImage { mask: Some(&mask), ..image(&truth, &truth) };
            let numbers = protocol.score(&image).unwrap().numbers();
            for number in numbers.iter().filter(|n| n.unit != NumberUnit::Count) {
                let full = number.name.starts_with("density") || number.name == "coverage";
                let expected = if full { 100.0 } else { 0.0 };
                // Without a map of the objects there is neither background nor foreground.
                let unknown = number.name.starts_with("d1_bg") || number.name.starts_with("d1_fg");
                let expected = if unknown { None } else { Some(expected) };
                prop_assert_eq!(number.value, expected, "{} {}", protocol.name(), number.name);
            }
        }
    }

    #[test]
    fn shares_are_shares_and_fall_with_the_threshold((estimate, truth, mask) in maps()) {
        for protocol in Protocol::ALL {
            let image = ProtocolImage { mask: Some(&mask), ..image(&estimate, &truth) };
            let numbers = protocol.score(&image).unwrap().numbers();
            for number in numbers.iter().filter(|n| n.unit == NumberUnit::Percent) {
                let is_share = number.value.is_none_or(|v| (0.0..=100.0).contains(&v));
                prop_assert!(is_share, "{}", number.name);
            }
            for series in SERIES {
                let values: Vec<f64> = series.iter().filter_map(|name| numbers.get(name)).collect();
                prop_assert!(values.is_sorted_by(|a, b| a >= b), "{} {:?}", series[0], values);
            }
            let quantiles = ["a50", "a90", "a95", "a99"].iter().filter_map(|q| numbers.get(q));
            let quantiles = quantiles.collect::<Vec<_>>();
            prop_assert!(quantiles.is_sorted());
            let (density, dense) = (numbers.get("density"), numbers.get("density_dense"));
            prop_assert!(density <= dense);
            let colors = protocol.error_map(&image).unwrap();
            prop_assert_eq!(colors.len(), truth.width() * truth.height() * 3);
        }
    }

    #[test]
    fn rows_that_all_hold_something_are_filled_wholly(
        (estimate, truth, _) in maps(),
        at in 0usize..60,
    ) {
        let mut estimate = estimate;
        (0..estimate.height()).for_each(|y| estimate.set(at, y, 9.0));
        for protocol in [Protocol::Kitti12, Protocol::Kitti15] {
            let numbers = protocol.score(&image(&estimate, &truth)).unwrap().numbers();
            prop_assert_eq!(numbers.get("density_dense"), Some(100.0));
        }
    }

    #[test]
    fn a_repeated_map_scores_as_the_smaller_one(
        (small, truth, _) in maps(),
        scale in prop::sample::select(vec![2usize, 4]),
    ) {
        let (width, height) = (truth.width() * scale, truth.height() * scale);
        let repeated = |plane: &Plane<f32>, factor: f32| {
            Plane::from_fn(width, height, |x, y| factor * plane.get(x / scale, y / scale)).unwrap()
        };
        let factor = scale as f32;
        let truth = repeated(&truth, factor);
        let score = |estimate: &Plane<f32>| numbers(Protocol::Middeval3, &image(estimate, &truth));
        prop_assert_eq!(score(&small), score(&repeated(&small, factor)));
    }
}
