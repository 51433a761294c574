//! Ticks of axes.

/// Ticks of a logarithmic axis from `low` to `high`: at the powers of ten where it spans
/// many, else at their 1, 2 and 5, in a narrow range at more digits.
pub(crate) fn log_ticks(low: f64, high: f64) -> Vec<f64> {
    let decades = || low.log10().floor() as i32..=high.log10().ceil() as i32;
    let within = |digits: &[f64]| -> Vec<f64> {
        let ticks = decades().flat_map(|d| digits.iter().map(move |digit| digit * 10f64.powi(d)));
        ticks.filter(|t| (low..=high).contains(t)).collect()
    };
    if decades().count() > 4 {
        return within(&[1.0]);
    }
    // The halves and tenths: 1.0, 1.1, …
    let tenths: Vec<_> = (10..100).map(|i| f64::from(i) / 10.0).collect();
    let finer = [
        &[1.0, 2.0, 5.0][..],
        &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0],
        &[
            1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0,
        ],
    ];
    let enough = |ticks: &Vec<f64>| ticks.len() >= 3;
    let found = finer.into_iter().map(within).find(enough);
    found.unwrap_or_else(|| {
        let ticks = within(&tenths);
        let every = ticks.len().div_ceil(8).max(1);
        ticks.into_iter().step_by(every).collect()
    })
}

/// Ticks of a linear axis from `low` to `high`: four to eight at multiples of 1, 2 or 5
/// times a power of ten; of whole values at whole numbers alone.
pub(crate) fn linear_ticks(low: f64, high: f64, is_whole: bool) -> Vec<f64> {
    let most = 8.0;
    let rough = (high - low) / most;
    let decade = 10f64.powf(rough.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * decade);
    let step = steps.into_iter().find(|step| *step >= rough);
    let step = step.unwrap_or(rough).max(if is_whole { 1.0 } else { 0.0 });
    let (first, last) = (
        (low / step - 1e-9).ceil() as i64,
        (high / step + 1e-9).floor() as i64,
    );
    // Divided where the step is a fraction: 3 × 0.1 is not 0.3.
    let at = |i: i64| {
        if step < 1.0 {
            i as f64 / (1.0 / step).round()
        } else {
            i as f64 * step
        }
    };
    (first..=last).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_axes_of_whole_values_have_whole_ticks() {
        assert_eq!(linear_ticks(0.0, 2.0, true), [0.0, 1.0, 2.0]);
        assert_eq!(linear_ticks(0.0, 1.0, true), [0.0, 1.0]);
        assert_eq!(
            linear_ticks(0.0, 1.0, false),
            [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
        );
        assert_eq!(linear_ticks(-0.04, 61.0, false).len(), 7);
    }

    #[test]
    fn logarithmic_axes_have_some_ticks_and_not_many() {
        assert_eq!(log_ticks(0.3, 12.0), [0.5, 1.0, 2.0, 5.0, 10.0]);
        assert_eq!(
            log_ticks(0.5, 20_000.0),
            [1.0, 10.0, 100.0, 1000.0, 10_000.0]
        );
        assert_eq!(log_ticks(1.3, 4.5), [1.5, 2.0, 3.0, 4.0]);
        assert_eq!(log_ticks(1.33, 1.72), [1.4, 1.5, 1.6, 1.7]);
        assert_eq!(log_ticks(0.72, 1.125), [0.8, 0.9, 1.0]);
    }
}
