//! What the lengths of a calibration file are in.

use super::document::Document;
use crate::error::{Error, Result};
use crate::stereo::LengthUnit;
use std::fmt;
use std::str::FromStr;

/// A unit of length, named `m`, `cm`, `mm`, `squares`, or `squares=0.025` for squares of that many
/// metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// So many metres.
    Metres(f64),
    /// Squares of a board that nobody measured.
    Squares,
}

/// The names a unit may have, for messages.
const UNITS: &str = "m, cm, mm, squares, squares=SIDE_IN_METRES";

impl Unit {
    pub(super) const METRE: Self = Self::Metres(1.0);
    pub(super) const MILLIMETRE: Self = Self::Metres(1e-3);

    /// What one of it is in the unit of a calibration.
    pub(super) fn in_calibration(self) -> (f64, LengthUnit) {
        match self {
            Self::Metres(metres) => (metres, LengthUnit::Metres),
            Self::Squares => (1.0, LengthUnit::Squares),
        }
    }

    /// The unit of a file that says it under `key`, where it does, else that which the user named.
    ///
    /// # Errors
    /// [`Error::Format`] when neither says it, or both do.
    pub(super) fn of(document: &Document, key: &str, named: Option<Self>) -> Result<Self> {
        let said = document
            .has(key)
            .then(|| document.text(key)?.parse().map_err(|e| document.wrong(e)))
            .transpose()?;
        match (said, named) {
            (None, None) => Err(document.wrong(format!(
                "does not say what its lengths are in; say it with `svl calibrate convert \
                 --unit`: {UNITS}"
            ))),
            (None, Some(unit)) | (Some(Self::Squares), Some(unit)) | (Some(unit), None) => Ok(unit),
            (Some(unit), Some(named)) if unit == named => Ok(unit),
            (Some(_), Some(_)) => Err(document.wrong(format!(
                "says itself what its lengths are in, at '{key}'; leave --unit out"
            ))),
        }
    }

    /// The unit that a format prescribes.
    ///
    /// # Errors
    /// [`Error::Format`] when the user named another.
    pub(super) fn fixed(self, document: &Document, named: Option<Self>) -> Result<Self> {
        match named {
            Some(named) if named != self => Err(document.wrong(format!(
                "has its lengths in {self} by its format; leave --unit out"
            ))),
            _ => Ok(self),
        }
    }
}

impl FromStr for Unit {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let side = |text: &str| {
            text.parse()
                .ok()
                .filter(|side: &f64| *side > 0.0 && *side < 10.0)
        };
        match name {
            "m" => Ok(Self::METRE),
            "cm" => Ok(Self::Metres(0.01)),
            "mm" => Ok(Self::MILLIMETRE),
            "squares" => Ok(Self::Squares),
            _ => name
                .strip_prefix("squares=")
                .and_then(side)
                .map(Self::Metres)
                .ok_or_else(|| {
                    Error::Invalid(format!(
                        "'{name}' is no unit of length; expected one of {UNITS}"
                    ))
                }),
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Metres(1.0) => f.write_str("m"),
            Self::Metres(0.01) => f.write_str("cm"),
            Self::Metres(0.001) => f.write_str("mm"),
            Self::Metres(side) => write!(f, "squares={side}"),
            Self::Squares => f.write_str("squares"),
        }
    }
}

/// The name of a calibration's unit in the files that svl writes.
pub(super) fn name(unit: LengthUnit) -> &'static str {
    match unit {
        LengthUnit::Metres => "m",
        LengthUnit::Squares => "squares",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for name in ["m", "cm", "mm", "squares", "squares=0.025"] {
            assert_eq!(name.parse::<Unit>().unwrap().to_string(), name);
        }
        for name in [
            "",
            "inch",
            "squares=",
            "squares=0",
            "squares=-1",
            "squares=nan",
            "squares=1e9",
        ] {
            assert!(
                name.parse::<Unit>()
                    .unwrap_err()
                    .to_string()
                    .contains("no unit of length"),
                "{name}"
            );
        }
    }
}
