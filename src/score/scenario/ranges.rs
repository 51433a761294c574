//! Ranges of true distances, by which errors are told apart.

use serde::{Deserialize, Serialize};
use std::str::FromStr;
use svl_core::Error;

/// Limit of the distances at which ranges end.
const MAX_ENDS: usize = 32;

/// A range of true distances, metres, written `0..8`, or `8..` without an end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct DistanceRange {
    /// The least distance.
    pub from_m: f64,
    /// Distances are nearer; absent without an end.
    pub to_m: Option<f64>,
}

impl DistanceRange {
    /// All distances.
    pub const ALL: Self = Self {
        from_m: 0.0,
        to_m: None,
    };

    pub fn has(self, true_m: f64) -> bool {
        self.from_m <= true_m && self.to_m.is_none_or(|to_m| true_m < to_m)
    }

    /// The distances at which it begins and ends.
    pub fn ends_m(self) -> impl Iterator<Item = f64> {
        let from_m = Some(self.from_m).filter(|from_m| *from_m > 0.0);
        from_m.into_iter().chain(self.to_m)
    }
}

impl FromStr for DistanceRange {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let read = || {
            let (from, to) = text.split_once("..")?;
            let to_m: Option<f64> = match to {
                "" => None,
                to => Some(to.parse().ok()?),
            };
            let range = Self {
                from_m: from.parse().ok()?,
                to_m,
            };
            let is_range = range.from_m >= 0.0 && range.from_m < to_m.unwrap_or(f64::INFINITY);
            (is_range && range.ends_m().all(f64::is_finite)).then_some(range)
        };
        read().ok_or_else(|| {
            Error::Invalid(format!(
                "'{text}' is no range of distances: expected metres, as 0..8 or 8.."
            ))
        })
    }
}

impl std::fmt::Display for DistanceRange {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}..", self.from_m)?;
        self.to_m.map_or(Ok(()), |to_m| write!(f, "{to_m}"))
    }
}

impl TryFrom<String> for DistanceRange {
    type Error = Error;

    fn try_from(text: String) -> Result<Self, Error> {
        text.parse()
    }
}

impl From<DistanceRange> for String {
    fn from(range: DistanceRange) -> Self {
        range.to_string()
    }
}

/// The distances at which ranges end, metres, ascending: written `2,4,8,16`. None: ranges of equal
/// counts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct RangeEnds(Vec<f64>);

impl RangeEnds {
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn metres(&self) -> &[f64] {
        &self.0
    }
}

impl TryFrom<Vec<f64>> for RangeEnds {
    type Error = Error;

    fn try_from(ends_m: Vec<f64>) -> Result<Self, Error> {
        let is_distance = |m: &f64| *m > 0.0 && m.is_finite();
        let is_ascending = ends_m.is_sorted_by(|a, b| a < b);
        if ends_m.len() <= MAX_ENDS && ends_m.iter().all(is_distance) && is_ascending {
            return Ok(Self(ends_m));
        }
        Err(Error::Invalid(format!(
            "ranges end at ascending distances above 0 m, at most {MAX_ENDS}, as 2,4,8,16"
        )))
    }
}

impl From<RangeEnds> for Vec<f64> {
    fn from(ends: RangeEnds) -> Self {
        ends.0
    }
}

impl FromStr for RangeEnds {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let numbers = text
            .split(',')
            .map(|m| m.trim().parse().unwrap_or(f64::NAN));
        numbers.collect::<Vec<_>>().try_into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_has_its_beginning_and_not_its_end() {
        let range: DistanceRange = "0.5..8".parse().unwrap();
        assert_eq!(
            [0.49, 0.5, 7.9, 8.0].map(|m| range.has(m)),
            [false, true, true, false]
        );
        let open: DistanceRange = "8..".parse().unwrap();
        assert!(open.has(8.0) && open.has(1e9) && !open.has(7.0));
        assert_eq!([range, open].map(|own| own.to_string()), ["0.5..8", "8.."]);
        for wrong in [
            "8", "8..8", "9..8", "-1..2", "0..inf", "nan..2", "..", "a..b",
        ] {
            assert!(wrong.parse::<DistanceRange>().is_err(), "{wrong}");
        }
        assert_eq!(
            "2,4, 8".parse::<RangeEnds>().unwrap().metres(),
            [2.0, 4.0, 8.0]
        );
        for wrong in ["", "4,2", "2,2", "0,2", "2,inf", "2,x"] {
            assert!(wrong.parse::<RangeEnds>().is_err(), "{wrong}");
        }
    }
}
