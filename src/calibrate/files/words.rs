//! Numbers as all readers take them.

use nalgebra::{Matrix, RawStorage};

/// The shortest text that reads back as the same number, with a point and a signed exponent: a YAML
/// 1.1 reader takes `1e-7` for text and Java's `0` for no float.
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

/// Numbers with a comma and a blank between.
pub(super) fn listed(values: &[f64]) -> String {
    values
        .iter()
        .map(|&v| number(v))
        .collect::<Vec<_>>()
        .join(", ")
}

/// Numbers with a blank between.
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
