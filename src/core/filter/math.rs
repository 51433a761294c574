//! Float functions by additions, multiplications and divisions alone: the system's own differ in
//! the last digits from machine to machine.

use std::f32::consts::{LN_2, SQRT_2};

/// `e^x`, relative error below 3e-7; `x` is clamped to -80..=80.
pub fn exp(x: f32) -> f32 {
    let x = x.clamp(-80.0, 80.0);
    let power = (x / LN_2).round();
    // ln 2 in two parts, the first exact in few digits.
    let r = (x - power * 0.693_359_4) + power * 2.121_944_4e-4;
    let series = 1.0
        + r * (1.0
            + r * (0.5
                + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0))))));
    series * f32::from_bits(((power as i32 + 127) << 23) as u32)
}

/// Hyperbolic tangent to within 3e-7.
pub fn tanh(x: f32) -> f32 {
    1.0 - 2.0 / (exp(2.0 * x) + 1.0)
}

/// The probability of log odds.
pub fn logistic(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// `ln(1 + x)` for `x >= 0`, to within 3e-7 of 1 plus itself.
pub(super) fn ln_1p(x: f32) -> f32 {
    let bits = (1.0 + x).to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let mantissa = f32::from_bits((bits & 0x007F_FFFF) | 0x3F80_0000);
    // Reduced to sqrt(1/2) .. sqrt(2), where the series is short.
    let high = mantissa > SQRT_2;
    let mantissa = if high { 0.5 * mantissa } else { mantissa };
    let exponent = exponent + i32::from(high);
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let square = t * t;
    let series = 1.0 + square * (1.0 / 3.0 + square * (0.2 + square * (1.0 / 7.0)));
    exponent as f32 * LN_2 + 2.0 * t * (series + square.powi(4) / 9.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_those_of_the_system() {
        for i in -2000..2000 {
            let x = i as f32 * 0.01;
            assert!((tanh(x) - x.tanh()).abs() < 4e-7, "tanh {x}");
            let odds = 1.0 / (1.0 + (-f64::from(x)).exp());
            assert!((f64::from(logistic(x)) - odds).abs() < 4e-7, "logistic {x}");
            let x = (x / 2.0).exp();
            let error = ln_1p(x) - x.ln_1p();
            assert!(error.abs() < 4e-7 * (1.0 + x.ln_1p()), "ln_1p {x}");
        }
        assert_eq!((tanh(1e9), tanh(-1e9), ln_1p(0.0)), (1.0, -1.0, 0.0));
    }
}
