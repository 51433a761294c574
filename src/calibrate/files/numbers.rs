//! Numbers as text that every reader of these formats parses as floats.

use nalgebra::{Matrix, RawStorage};

/// The shortest text that parses to the same number, with a point and a signed exponent: a YAML 1.1
/// reader interprets `1e-7` as text and `0` as an integer.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        None => text,
        Some((digits, power)) => {
            let point = if digits.contains('.') { "" } else { ".0" };
            let sign = if power.starts_with('-') { "" } else { "+" };
            format!("{digits}{point}e{sign}{power}")
        }
    }
}

/// Numbers separated by `, `.
pub(super) fn listed(values: &[f64]) -> String {
    svl_core::joined(values.iter().map(|&v| number(v)))
}

/// Numbers separated by spaces.
pub(super) fn spaced(values: &[f64]) -> String {
    values
        .iter()
        .map(|&v| number(v))
        .collect::<Vec<_>>()
        .join(" ")
}

/// Elements row by row.
pub(super) fn rows<R: nalgebra::Dim, C: nalgebra::Dim, S: RawStorage<f64, R, C>>(
    matrix: &Matrix<f64, R, C, S>,
) -> Vec<f64> {
    matrix
        .row_iter()
        .flat_map(|row| row.iter().copied().collect::<Vec<_>>())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_floats_to_every_reader() {
        for (value, text) in [
            (0.0, "0.0"),
            (-1.0, "-1.0"),
            (1e-7, "1.0e-7"),
            (2.5e-9, "2.5e-9"),
            (1e20, "1.0e+20"),
        ] {
            assert_eq!(number(value), text);
            assert_eq!(text.parse::<f64>().unwrap(), value);
        }
        assert_eq!(
            rows(&nalgebra::Matrix2x3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)),
            [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
        );
    }
}
