//! The exact sign test of paired results: of the pairs that differ, each direction is as likely if
//! nothing changed (Dixon and Mood, "The Statistical Sign Test", 1946).

use crate::bootstrap::TestMethod;

/// Limit of the probability below which a difference is called real.
const MAX_P: f64 = 0.05;
/// With fewer courses that differ, even if all do so in one direction, it may be chance: 2 / 2⁵ is
/// above the limit.
const MIN_COURSES: usize = 6;

/// The test of drives over the courses of both reports.
pub const METHOD: TestMethod = TestMethod {
    name: "two-sided exact sign test over the courses that differ",
    resamples: None,
    seed: None,
    level: "95 %",
    block_length: None,
    fewest_blocks: MIN_COURSES,
};

/// True if so many changes in one direction and in the other are more than chance.
pub fn is_real(changes: [usize; 2]) -> bool {
    p_value(changes) < MAX_P
}

/// The probability of changes as uneven as these, or more so, if either direction is as likely.
fn p_value([up, down]: [usize; 2]) -> f64 {
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
        assert!(is_real([MIN_COURSES, 0]) && !is_real([MIN_COURSES - 1, 0]));
    }
}
