//! Holm's correction: several tests at once, of which all but one in twenty times none is real by
//! chance (Holm, "A Simple Sequentially Rejective Multiple Test Procedure", 1979).

/// Limit of the probability that any test is real by chance.
pub const MAX_P: f64 = 0.05;

/// True for each test that is real, of their probabilities.
pub fn are_real(probabilities: &[f64]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]));
    let mut are_real = vec![false; order.len()];
    for (i, place) in order.iter().enumerate() {
        if probabilities[*place] > MAX_P / (order.len() - i) as f64 {
            break;
        }
        are_real[*place] = true;
    }
    are_real
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_is_tested_as_one_of_all() {
        assert_eq!(are_real(&[]), Vec::<bool>::new());
        assert_eq!(are_real(&[0.05]), [true]);
        // Limits of 1/60, 1/40 and 1/20.
        assert_eq!(are_real(&[0.04, 0.016, 0.024]), [true, true, true]);
        assert_eq!(are_real(&[0.04, 0.016, 0.026]), [false, true, false]);
        assert_eq!(are_real(&[0.02, 0.02, 0.02]), [false; 3]);
    }
}
