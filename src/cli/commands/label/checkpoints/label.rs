//! The label of a cell, as it is typed, shown and written.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use svl::score::CellExpectation;

/// Largest accepted distance, metres.
const MAX_DISTANCE_M: f64 = 1000.0;

/// The expectation of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub(super) enum CellLabel {
    /// Measured or seen by a person.
    Seen(CellExpectation),
    /// Given by the truth of the source.
    Must,
}

impl CellLabel {
    /// The label of a cell without an obstacle.
    pub(super) const FREE: Self = Self::Seen(CellExpectation::Free);
}

/// Syntax of a label.
pub(super) const FORMS: &str = "a distance in metres (0.43 or 0.43+-0.05), <0.5 or near 0.5, \
                                >1.2 or far 1.2, free, must, none";

/// The text that clears a cell.
pub(super) const NONE: &str = "none";

impl FromStr for CellLabel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let after = |words: [&str; 2]| words.iter().find_map(|word| text.strip_prefix(word));
        let seen = match (text, after(["<", "near "]), after([">", "far "])) {
            ("must", ..) => return Ok(Self::Must),
            ("free", ..) => CellExpectation::Free,
            (_, Some(number), _) => CellExpectation::Nearer(metres(number)?),
            (_, _, Some(number)) => CellExpectation::Farther(metres(number)?),
            _ => {
                let parts = text.split_once("+-").or(text.split_once('±'));
                let tolerance_m = parts.map(|(_, tolerance)| metres(tolerance));
                CellExpectation::Distance {
                    tolerance_m: tolerance_m.transpose()?,
                    distance_m: metres(parts.map_or(text, |(distance, _)| distance))?,
                    tolerance_percent: None,
                }
            }
        };
        Ok(Self::Seen(seen))
    }
}

fn metres(text: &str) -> Result<f64, String> {
    let text = text.trim();
    match text.trim_end_matches('m').trim_end().parse::<f64>() {
        Ok(metres) if metres > 0.0 && metres <= MAX_DISTANCE_M => Ok(metres),
        Ok(_) => Err(format!(
            "'{text}': a distance is above 0 m and at most {MAX_DISTANCE_M} m"
        )),
        Err(_) => Err(format!("'{text}' is not a distance; type {FORMS}")),
    }
}

impl TryFrom<String> for CellLabel {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<CellLabel> for String {
    fn from(label: CellLabel) -> Self {
        label.to_string()
    }
}

/// The label as it is typed.
impl fmt::Display for CellLabel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Must => f.write_str("must"),
            Self::Seen(CellExpectation::Free) => f.write_str("free"),
            Self::Seen(CellExpectation::Nearer(m)) => write!(f, "<{m}"),
            Self::Seen(CellExpectation::Farther(m)) => write!(f, ">{m}"),
            Self::Seen(CellExpectation::Distance {
                distance_m,
                tolerance_m,
                ..
            }) => match tolerance_m {
                Some(tolerance_m) => write!(f, "{distance_m}+-{tolerance_m}"),
                None => write!(f, "{distance_m}"),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_read_as_they_are_shown() {
        for text in ["0.43", "0.43+-0.05", "<0.5", ">1.2", "free", "must"] {
            assert_eq!(text.parse::<CellLabel>().unwrap().to_string(), text);
        }
        for (typed, shown) in [
            ("near 0.5", "<0.5"),
            ("far 2 m", ">2"),
            ("1m", "1"),
            ("1 ± 0.1", "1+-0.1"),
        ] {
            assert_eq!(typed.parse::<CellLabel>().unwrap().to_string(), shown);
        }
    }

    #[test]
    fn invalid_distances_are_refused() {
        for (typed, words) in [
            ("abc", "'abc' is not a distance; type a distance in metres"),
            ("", "is not a distance"),
            ("<", "is not a distance"),
            ("0", "above 0 m"),
            ("-1", "above 0 m"),
            ("nan", "above 0 m"),
            ("inf", "above 0 m"),
            (">1001", "at most 1000 m"),
            ("1+-0", "above 0 m"),
        ] {
            let error = typed.parse::<CellLabel>().unwrap_err();
            assert!(error.contains(words), "{typed}: {error}");
        }
    }
}
