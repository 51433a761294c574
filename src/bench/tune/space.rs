//! The settings that are searched: a place in the unit cube for each.

use svl_core::matcher::{Algorithm, Parameter, Range, Value};
use svl_core::{Error, Result, nearest};

/// Varied parameters of an algorithm, whose others are fixed.
#[derive(Clone, Debug)]
pub struct Space {
    pub base: Algorithm,
    pub axes: Vec<SearchAxis>,
}

/// A parameter and the values that are tried.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchAxis {
    pub name: &'static str,
    values: AxisValues,
}

#[derive(Clone, Debug, PartialEq)]
enum AxisValues {
    Int {
        low: i32,
        high: i32,
        is_log: bool,
    },
    Real {
        low: f64,
        high: f64,
        is_log: bool,
    },
    /// Equally likely.
    Options(Vec<Value>),
}

/// A range whose ends differ by more than this factor is searched by the logarithm.
const MAX_LINEAR_RATIO: f64 = 8.0;

/// Without a range of its own a parameter is sought from its value divided by this to its value
/// times this.
const MAX_FACTOR: f64 = 4.0;

/// A range of at most this many whole numbers is searched completely.
const MAX_LISTED_VALUES: i32 = 64;

impl SearchAxis {
    /// `NAME`, `NAME=FROM..TO` or `NAME=A/B/C`; a name alone is sought around its value in `base`,
    /// or in all of a small range.
    ///
    /// # Errors
    /// [`Error::UnknownParameter`]; [`Error::Usage`] for invalid values.
    pub fn parse(base: &Algorithm, text: &str) -> Result<Self> {
        let (name, values) = match text.split_once('=') {
            Some((name, values)) => (name, Some(values)),
            None => (text, None),
        };
        let spec = base.spec();
        let parameters = spec.parameters;
        let parameter = parameters.iter().find(|p| p.name == name);
        let parameter = parameter.ok_or_else(|| Error::UnknownParameter {
            algorithm: spec.name,
            name: name.to_owned(),
            nearest: nearest(name, parameters.iter().map(|p| p.name)),
        })?;
        let range = &parameter.range;
        let wrong = |why: String| Error::Usage(format!("'{text}': {why}"));
        let value = |text: &str| {
            let expected = || wrong(format!("{text} is not a value of {name}; expected {range}"));
            range.parse(text.trim()).ok_or_else(expected)
        };
        let values = match values {
            None => {
                return Self::around(base, parameter).ok_or_else(|| {
                    wrong(format!(
                        "has no range to search; name values, as {name}=A/B"
                    ))
                });
            }
            Some(values) => values,
        };
        let values = match values.split_once("..") {
            None => AxisValues::Options(values.split('/').map(value).collect::<Result<_>>()?),
            Some((low, high)) => match (value(low)?, value(high.trim_start_matches('='))?) {
                (Value::Int(low), Value::Int(high)) if low < high => AxisValues::int(low, high),
                (Value::Real(low), Value::Real(high)) if low < high => AxisValues::real(low, high),
                _ => return Err(wrong("write a range of numbers as FROM..TO".into())),
            },
        };
        Ok(Self {
            name: parameter.name,
            values,
        })
    }

    /// An axis around its value in `base`; none for texts and files.
    fn around(base: &Algorithm, parameter: &Parameter) -> Option<Self> {
        let mut values = base.parameters().iter();
        let (_, value) = values.find(|(name, _)| *name == parameter.name)?;
        let values = match (parameter.range, value) {
            (Range::Int { min, max, .. }, Value::Int(_)) if max - min <= MAX_LISTED_VALUES => {
                AxisValues::int(min, max)
            }
            (Range::Int { min, max, .. }, Value::Int(at)) if *at > 0 => {
                let (low, high) = (f64::from(*at) / MAX_FACTOR, f64::from(*at) * MAX_FACTOR);
                AxisValues::int((low as i32).max(min), (high as i32).min(max))
            }
            // Many are switched off at 0 or below: that value, or one of the powers of two.
            (Range::Int { min, max, .. }, Value::Int(at)) => {
                let powers = (0..10).map(|power| 1 << power).filter(|v| *v <= max);
                let below = (0..5).map(|power| -(1 << power)).filter(|v| *v >= min);
                let values = std::iter::once(*at).chain(powers).chain(below);
                AxisValues::Options(values.map(Value::Int).collect())
            }
            (Range::Real { min, max, .. }, Value::Real(at)) if *at > 0.0 => {
                AxisValues::real((at / MAX_FACTOR).max(min), (at * MAX_FACTOR).min(max))
            }
            (Range::Real { min, max, .. }, Value::Real(_)) => AxisValues::real(min, max),
            (Range::Flag { .. }, _) => AxisValues::Options([false, true].map(Value::Flag).to_vec()),
            (Range::Choice { options, .. }, _) => {
                AxisValues::Options(options.iter().map(|o| Value::Choice(o)).collect())
            }
            _ => return None,
        };
        Some(Self {
            name: parameter.name,
            values,
        })
    }

    /// The value at a place, 0..1.
    fn value(&self, at: f64) -> Value {
        let at = at.clamp(0.0, 1.0);
        match &self.values {
            AxisValues::Int { low, high, is_log } => {
                let (from, to) = (f64::from(*low), f64::from(*high));
                // Each number has the same part of the axis.
                let value = if *is_log {
                    from * ((to + 1.0) / from).powf(at)
                } else {
                    from + at * (to - from + 1.0)
                };
                Value::Int((value as i32).clamp(*low, *high))
            }
            AxisValues::Real { low, high, is_log } => {
                let value = if *is_log {
                    low * (high / low).powf(at)
                } else {
                    low + at * (high - low)
                };
                // Three digits are enough to tell settings apart, and can be typed.
                let digits = (2.0 - value.abs().max(1e-6).log10().floor()).max(0.0) as usize;
                let rounded = format!("{value:.digits$}").parse().unwrap_or(value);
                Value::Real(f64::clamp(rounded, *low, *high))
            }
            AxisValues::Options(options) => {
                let place = (at * options.len() as f64) as usize;
                options[place.min(options.len() - 1)].clone()
            }
        }
    }

    /// Place of a value, 0..1; a value outside is at the nearer end.
    fn place(&self, value: &Value) -> f64 {
        let within = |value: f64, low: f64, high: f64, is_log: bool| {
            let at = if is_log {
                (value.max(low) / low).ln() / (high / low).ln()
            } else {
                (value - low) / (high - low)
            };
            at.clamp(0.0, 1.0)
        };
        match &self.values {
            AxisValues::Int { low, high, is_log } => {
                let (low, high) = (f64::from(*low), f64::from(*high) + 1.0);
                // The middle of its part.
                let value = value.number().unwrap_or(low) + 0.5;
                within(value, low, high, *is_log)
            }
            AxisValues::Real { low, high, is_log } => {
                within(value.number().unwrap_or(*low), *low, *high, *is_log)
            }
            AxisValues::Options(options) => {
                let place = options.iter().position(|option| option == value);
                (place.unwrap_or(0) as f64 + 0.5) / options.len() as f64
            }
        }
    }
}

impl AxisValues {
    fn int(low: i32, high: i32) -> Self {
        let is_log = low > 0 && f64::from(high) / f64::from(low) > MAX_LINEAR_RATIO;
        Self::Int { low, high, is_log }
    }

    fn real(low: f64, high: f64) -> Self {
        let is_log = low > 0.0 && high / low > MAX_LINEAR_RATIO;
        Self::Real { low, high, is_log }
    }
}

impl std::fmt::Display for SearchAxis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = self.name;
        match &self.values {
            AxisValues::Int { low, high, .. } => write!(f, "{name}={low}..{high}"),
            AxisValues::Real { low, high, .. } => write!(f, "{name}={low}..{high}"),
            AxisValues::Options(options) => {
                let options: Vec<_> = options.iter().map(Value::to_string).collect();
                write!(f, "{name}={}", options.join("/"))
            }
        }
    }
}

impl Space {
    /// The named parameters, or all that change the result; not the revision of an algorithm, which
    /// makes it another algorithm.
    ///
    /// # Errors
    /// As [`SearchAxis::parse`]; that there is nothing to search.
    pub fn new(base: Algorithm, named: &[String]) -> Result<Self> {
        let axes: Vec<_> = match named {
            [] => {
                let fixed = ["revision", "timeout_s"];
                let parameters = base.spec().parameters.iter();
                let parameters = parameters.filter(|p| !fixed.contains(&p.name));
                parameters
                    .filter_map(|p| SearchAxis::around(&base, p))
                    .collect()
            }
            named => {
                let axes = named.iter().map(|text| SearchAxis::parse(&base, text));
                axes.collect::<Result<_>>()?
            }
        };
        for (i, axis) in axes.iter().enumerate() {
            if axes[..i].iter().any(|other| other.name == axis.name) {
                return Err(Error::Usage(format!(
                    "{}: named twice; name it once",
                    axis.name
                )));
            }
        }
        if axes.is_empty() {
            let name = base.label();
            return Err(Error::Usage(format!(
                "{name}: has no parameter to search; name some with --vary"
            )));
        }
        Ok(Self { base, axes })
    }

    /// Place of a setting.
    pub fn place(&self, algorithm: &Algorithm) -> Vec<f64> {
        let place = |axis: &SearchAxis| {
            let mut values = algorithm.parameters().iter();
            let found = values.find(|(name, _)| *name == axis.name);
            found.map_or(0.5, |(_, value)| axis.place(value))
        };
        self.axes.iter().map(place).collect()
    }

    /// `from` with the values at `place` on the axes that are `moved`; none if the algorithm
    /// rejects their combination. A whole number that it rejects is replaced by the next one.
    pub fn at(&self, from: &Algorithm, place: &[f64], moved: &[usize]) -> Option<Algorithm> {
        let mut algorithm = from.clone();
        for &i in moved {
            let axis = &self.axes[i];
            let value = axis.value(place[i]);
            let with = |value: &Value| {
                let changed = algorithm.with(axis.name, value).ok()?;
                changed.check().is_ok().then_some(changed)
            };
            let next = |value: &Value| match value {
                Value::Int(v) => with(&Value::Int(v + 1)),
                _ => None,
            };
            algorithm = with(&value).or_else(|| next(&value))?;
        }
        Some(algorithm)
    }
}

/// Point `i` of a quasi-random sequence that fills the unit cube of these dimensions evenly: R2
/// of Roberts 2018, generalized.
pub fn quasi_random(i: usize, dimensions: usize) -> impl Iterator<Item = f64> {
    // The root of x^(d+1) = x + 1, by iteration.
    let power = 1.0 / (dimensions as f64 + 1.0);
    let root = (0..64).fold(2.0_f64, |x, _| (1.0 + x).powf(power));
    (0..dimensions).map(move |k| (0.5 + i as f64 * root.powi(-(k as i32 + 1))).fract())
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::matcher::MATCHERS;

    #[test]
    fn a_setting_is_found_again_at_its_place() {
        for spec in MATCHERS.iter().filter(|spec| spec.matches_images()) {
            let base: Algorithm = spec.name.parse().unwrap();
            // A matcher without parameters has no space.
            let Ok(space) = Space::new(base.clone(), &[]) else {
                assert!(spec.parameters.is_empty(), "{}", spec.name);
                continue;
            };
            let all: Vec<_> = (0..space.axes.len()).collect();
            let same = space.at(&base, &space.place(&base), &all).unwrap();
            for (axis, (_, value)) in space.axes.iter().zip(0..).map(|(axis, _)| {
                let mut values = base.parameters().iter();
                (axis, values.find(|(name, _)| *name == axis.name).unwrap())
            }) {
                let mut values = same.parameters().iter();
                let found = values.find(|(name, _)| *name == axis.name).unwrap().1;
                let close = |a: f64, b: f64| (a - b).abs() <= 0.01 * a.abs().max(b.abs());
                let is_same = match (value.number(), found.number()) {
                    (Some(a), Some(b)) => close(a, b),
                    _ => value == found,
                };
                assert!(is_same, "{} {axis}: {value} {found}", spec.name);
            }
        }
    }

    #[test]
    fn axes_cover_the_named_values() {
        let bm: Algorithm = "bm".parse().unwrap();
        let values = |text: &str| {
            let axis = SearchAxis::parse(&bm, text).unwrap();
            let mut values: Vec<_> = (0..=100)
                .map(|i| axis.value(f64::from(i) / 100.0).to_string())
                .collect();
            values.dedup();
            values.join(" ")
        };
        assert_eq!(values("block_size=5..8"), "5 6 7 8");
        assert_eq!(values("prefilter"), "xsobel log");
        assert_eq!(values("uniqueness=0/7/15"), "0 7 15");
        // An even block size is invalid: the next odd one is used.
        let space = Space::new(bm.clone(), &["block_size=6..8".into()]).unwrap();
        let size = |at: f64| space.at(&bm, &[at], &[0]).map(|a| a.written());
        assert_eq!(size(0.1).unwrap(), "bm:block_size=7");
        assert_eq!(size(0.9).unwrap(), "bm");
        let wrong = |text: &str| SearchAxis::parse(&bm, text).unwrap_err().to_string();
        assert!(
            wrong("block=3").contains("block_size"),
            "{}",
            wrong("block=3")
        );
        assert!(wrong("block_size=3..9").contains("in 5..=31"));
        assert!(wrong("block_size=9..9").contains("FROM..TO"));
    }
}
