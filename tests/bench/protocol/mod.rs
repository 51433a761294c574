//! The metric protocols: small maps computed by hand, invariants, and real maps with known scores.

mod always;
mod kitti;
mod known;
mod middlebury;

use svl::score::protocol::{Numbers, Protocol, ProtocolImage};
use svl::stereo::Plane;

pub const NO: f32 = f32::INFINITY;

/// A map of these rows.
pub fn map<T: Copy>(rows: &[&[T]]) -> Plane<T> {
    Plane::from_vec(rows[0].len(), rows.len(), rows.concat()).unwrap()
}

pub fn image<'a>(estimate: &'a Plane<f32>, truth: &'a Plane<f32>) -> ProtocolImage<'a> {
    ProtocolImage {
        estimate,
        truth,
        mask: None,
        foreground: None,
        max_disparity: None,
    }
}

#[track_caller]
pub fn numbers(protocol: Protocol, image: &ProtocolImage) -> Numbers {
    protocol.score(image).unwrap().numbers()
}

/// All of these have these values.
#[track_caller]
pub fn assert_numbers(numbers: &Numbers, expected: &[(&str, Option<f64>)]) {
    for (name, value) in expected {
        assert!(
            numbers.iter().any(|number| number.name == *name),
            "there is no {name}"
        );
        let same = match (numbers.get(name), value) {
            (Some(a), Some(b)) => (a - b).abs() < 1e-9,
            (a, b) => a == *b,
        };
        assert!(
            same,
            "{name}: got {:?}, expected {value:?}",
            numbers.get(name)
        );
    }
}
