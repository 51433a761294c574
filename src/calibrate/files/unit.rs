//! Unit of length of a calibration file.

use super::document::Document;
use std::fmt;
use std::str::FromStr;
use svl_core::stereo::LengthUnit;
use svl_core::{Error, Result};

/// A unit of length, named `m`, `cm`, `mm`, `squares`, or `squares=0.025` for squares of that many
/// metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FileUnit {
    /// A unit of this many metres.
    Metres(f64),
    /// Squares of a board whose size is unknown.
    Squares,
}

/// Valid names, for messages.
const UNITS: &str = "m, cm, mm, squares, squares=SIDE_IN_METRES";

impl FileUnit {
    pub(super) const METRE: Self = Self::Metres(1.0);
    pub(super) const MILLIMETRE: Self = Self::Metres(1e-3);

    /// The factor to the unit of a [`svl_core::stereo::StereoCalibration`], and that unit.
    pub(super) fn in_calibration(self) -> (f64, LengthUnit) {
        match self {
            Self::Metres(metres) => (metres, LengthUnit::Metres),
            Self::Squares => (1.0, LengthUnit::Squares),
        }
    }

    /// The unit that a file states under `key`, else the one the user named.
    ///
    /// # Errors
    /// [`Error::Format`] if neither does, or they differ.
    pub(super) fn stated(document: &Document, key: &str, named: Option<Self>) -> Result<Self> {
        let stated = document
            .has(key)
            .then(|| document.text(key)?.parse().map_err(|e| document.error(e)))
            .transpose()?;
        match (stated, named) {
            (None, None) => Err(document.error(format!(
                "does not state its unit of length; name it with `svl calibrate convert \
                 --unit`: {UNITS}"
            ))),
            (None, Some(unit)) | (Some(Self::Squares), Some(unit)) | (Some(unit), None) => Ok(unit),
            (Some(unit), Some(named)) if unit == named => Ok(unit),
            (Some(_), Some(_)) => Err(document.error(format!(
                "states its unit of length itself, at '{key}'; omit --unit"
            ))),
        }
    }

    /// This unit, which the format prescribes.
    ///
    /// # Errors
    /// [`Error::Format`] if the user named another.
    pub(super) fn fixed(self, document: &Document, named: Option<Self>) -> Result<Self> {
        match named {
            Some(named) if named != self => Err(document.error(format!(
                "has its lengths in {self} by its format; omit --unit"
            ))),
            _ => Ok(self),
        }
    }
}

impl FromStr for FileUnit {
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
                        "'{name}' is not a unit of length; expected one of {UNITS}"
                    ))
                }),
        }
    }
}

impl fmt::Display for FileUnit {
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
            assert_eq!(name.parse::<FileUnit>().unwrap().to_string(), name);
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
                name.parse::<FileUnit>()
                    .unwrap_err()
                    .to_string()
                    .contains("not a unit of length"),
                "{name}"
            );
        }
    }
}
