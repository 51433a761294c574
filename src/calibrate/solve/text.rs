//! Numbers and units of a calibration as text.

use super::solution::{Estimated, Solution};
use std::fmt::{Display, Formatter, Result};

impl Display for Estimated {
    /// As `533.42 ± 0.34`: two significant digits of the standard deviation, and as many decimals
    /// of the value.
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let Self { value, deviation } = self;
        // The cast saturates at 0.
        let digits = if *deviation > 0.0 {
            (1.0 - deviation.log10().floor()).min(9.0) as usize
        } else {
            9
        };
        f.pad(&format!("{value:.digits$} ± {deviation:.digits$}"))
    }
}

impl Solution {
    /// The symbol of [`Solution::unit`].
    pub fn unit_sign(&self) -> &'static str {
        if self.unit == "metres" {
            "m"
        } else {
            "squares"
        }
    }
}
