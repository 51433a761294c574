//! The exact sign test of paired results: of the pairs that differ, each direction is as likely if
//! nothing changed (Dixon and Mood, "The Statistical Sign Test", 1946).

use crate::bootstrap::{LEVEL, TestMethod};
use crate::holm::MAX_P;

/// The test of drives over the courses of both reports, as one of so many.
pub fn method(tests: usize) -> TestMethod {
    TestMethod {
        name: "two-sided exact sign test over the courses that differ",
        level: LEVEL,
        block_length: None,
        fewest_blocks: fewest_changes(tests),
    }
}

/// The fewest courses that differ, of one of so many tests: of fewer, even if all do so in one
/// direction, that may be chance.
pub fn fewest_changes(tests: usize) -> usize {
    let limit = MAX_P / tests.max(1) as f64;
    let is_enough = |changes: &usize| p_value([*changes, 0]) <= limit;
    (1..).find(is_enough).unwrap_or(usize::MAX)
}

/// The probability of changes as uneven as these, or more so, if either direction is as likely.
pub fn p_value([up, down]: [usize; 2]) -> f64 {
    let changes = up + down;
    let mut term = 0.5_f64.powi(changes as i32);
    let mut tail = 0.0;
    for i in 0..=up.min(down) {
        tail += term;
        term *= (changes - i) as f64 / (i + 1) as f64;
    }
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_binomial_tables_say() {
        let expected = [
            ([0, 0], 1.0),
            ([5, 0], 0.0625),
            ([0, 6], 0.03125),
            ([1, 8], 0.039_062_5),
            ([2, 8], 0.109_375),
            ([5, 15], 0.041_389_465),
            ([10, 10], 1.0),
        ];
        for (changes, p) in expected {
            assert!((p_value(changes) - p).abs() < 1e-8, "{changes:?}");
        }
        assert_eq!([1, 3, 6, 12].map(fewest_changes), [6, 7, 8, 9]);
    }
}
