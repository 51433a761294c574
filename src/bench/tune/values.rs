//! Values that a setting reached.

use svl_score::judge::{METRICS, Metric};

/// The metrics of a setting over some pairs, by their places in [`METRICS`]. Times are in
/// milliseconds, scaled by the ratio of the reference's time in its first run to that in the same
/// run, so that runs at different moments can be compared.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialValues([Option<f64>; METRICS.len()]);

impl Default for TrialValues {
    fn default() -> Self {
        Self([None; METRICS.len()])
    }
}

impl TrialValues {
    pub fn from_fn(value: impl Fn(&'static Metric) -> Option<f64>) -> Self {
        Self(std::array::from_fn(|i| value(&METRICS[i])))
    }

    pub fn get(&self, metric: &Metric) -> Option<f64> {
        self.0[place(metric.name)]
    }

    /// # Panics
    /// When no metric of [`METRICS`] has that name.
    pub fn set(&mut self, name: &str, value: Option<f64>) {
        self.0[place(name)] = value;
    }
}

fn place(name: &str) -> usize {
    let place = METRICS.iter().position(|metric| metric.name == name);
    place.expect("a metric of METRICS")
}
