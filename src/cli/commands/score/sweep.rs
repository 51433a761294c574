//! Sweeps: one parameter over a range of values, one algorithm per value.

use std::str::FromStr;
use svl::matcher::{self, Algorithm, Range, Value};
use svl::report::html::ParameterSweep;

/// Most algorithms of one run: that many still have room in a table and on a plot.
pub(super) const MAX_ALGORITHMS: usize = 32;

/// What one `--algo` asks for: an algorithm, or several where a number is a range `FROM..TO/STEP`.
#[derive(Clone, Debug)]
pub(super) struct Algorithms(pub(super) Vec<Algorithm>);

impl FromStr for Algorithms {
    type Err = svl::Error;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let Some(swept) = Swept::find(text)? else {
            return Ok(Self(vec![text.parse()?]));
        };
        swept
            .values()?
            .iter()
            .map(|value| format!("{}{value}{}", swept.before, swept.after).parse())
            .collect::<Result<_, _>>()
            .map(Self)
    }
}

/// The range in a text, with what stands around it.
struct Swept<'a> {
    before: &'a str,
    range: &'a str,
    after: &'a str,
}

impl<'a> Swept<'a> {
    /// The only range among the settings of numbers; a text, say a command, may hold two dots.
    fn find(text: &'a str) -> svl::Result<Option<Self>> {
        let Some((name, settings)) = text.split_once(':') else {
            return Ok(None);
        };
        let spec = matcher::find(name)?;
        let is_number = |key: &str| {
            let parameter = spec.parameters.iter().find(|p| p.name == key);
            parameter.is_some_and(|p| matches!(p.range, Range::Int { .. } | Range::Real { .. }))
        };
        let mut found = None;
        let mut at = text.len() - settings.len();
        for setting in settings.split(',') {
            if let Some((key, range)) = setting
                .split_once('=')
                .filter(|(key, value)| value.contains("..") && is_number(key))
            {
                if found.is_some() {
                    return invalid(format!(
                        "{text}: one range at a time; name the other values one by one"
                    ));
                }
                let begin = at + key.len() + 1;
                found = Some(Self {
                    before: &text[..begin],
                    range,
                    after: &text[begin + range.len()..],
                });
            }
            at += setting.len() + 1;
        }
        Ok(found)
    }

    /// The values from the first to the last, each in its shortest exact form.
    fn values(&self) -> svl::Result<Vec<String>> {
        let range = self.range;
        let wrong = |why: &str| {
            svl::Error::Invalid(format!("range '{range}': {why}, for instance 0..20/5"))
        };
        let (ends, step) = range
            .split_once('/')
            .ok_or_else(|| wrong("write FROM..TO/STEP"))?;
        let (from, to) = ends
            .split_once("..")
            .ok_or_else(|| wrong("write FROM..TO/STEP"))?;
        // `..=` says what `..` means here as well.
        let to = to.strip_prefix('=').unwrap_or(to);
        let number = |text: &str| text.parse().ok().filter(|v: &f64| v.is_finite());
        let (Some(first), Some(last), Some(width)) = (number(from), number(to), number(step))
        else {
            return Err(wrong("FROM, TO and STEP are numbers"));
        };
        if width <= 0.0 || last < first {
            return Err(wrong("STEP is above 0 and TO not below FROM"));
        }
        // A step that lands on the end but for the last binary digit lands on it.
        let steps = ((last - first) / width + 1e-9).floor();
        if steps >= MAX_ALGORITHMS as f64 {
            return Err(wrong(&format!(
                "these are more than {MAX_ALGORITHMS} values; take larger steps"
            )));
        }
        let decimals = |text: &str| {
            text.split_once('.')
                .map_or(0, |(_, decimals)| decimals.len())
        };
        let decimals = decimals(from).max(decimals(step)).min(12);
        Ok((0..=steps as usize)
            .map(|i| trimmed(&format!("{:.decimals$}", first + width * i as f64)))
            .collect())
    }
}

/// A decimal number without the zeros behind it.
fn trimmed(number: &str) -> String {
    if number.contains('.') {
        number
            .trim_end_matches('0')
            .trim_end_matches('.')
            .to_owned()
    } else {
        number.to_owned()
    }
}

fn invalid<T>(what: String) -> svl::Result<T> {
    Err(svl::Error::Invalid(what))
}

/// What is swept among the algorithms of a run, however they were named: those of one kind that
/// differ in one number.
pub(super) fn sweeps(algorithms: &[Algorithm]) -> Vec<ParameterSweep> {
    let mut sweeps: Vec<ParameterSweep> = Vec::new();
    for first in algorithms {
        for (key, _) in first.parameters().iter() {
            let mut points: Vec<_> = algorithms
                .iter()
                .filter(|other| differ_in(first, other, key))
                .filter_map(|other| Some((number(other, key)?, other)))
                .collect();
            points.sort_by(|(a, _), (b, _)| a.total_cmp(b));
            // The same algorithm by two names is no sweep.
            points.dedup_by(|(a, _), (b, _)| a == b);
            let points: Vec<_> = points
                .iter()
                .map(|(v, a)| (v.to_string(), a.label().to_owned()))
                .collect();
            let sweep = ParameterSweep {
                name: format!("{}: {key}", first.spec().name),
                points,
            };
            // Every one of its algorithms finds the same sweep.
            if sweep.points.len() > 1 && !sweeps.contains(&sweep) {
                sweeps.push(sweep);
            }
        }
    }
    sweeps
}

/// Whether two algorithms are of one kind and have all parameters but `key` in common.
fn differ_in(a: &Algorithm, b: &Algorithm, key: &str) -> bool {
    let others = |of: &Algorithm| {
        of.parameters()
            .iter()
            .filter(|(name, _)| *name != key)
            .map(|(_, value)| value.clone())
            .collect::<Vec<_>>()
    };
    a.spec().name == b.spec().name && others(a) == others(b)
}

fn number(algorithm: &Algorithm, key: &str) -> Option<f64> {
    match algorithm
        .parameters()
        .iter()
        .find(|(name, _)| *name == key)?
        .1
    {
        Value::Int(v) => Some(f64::from(*v)),
        Value::Real(v) => Some(*v),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(text: &str) -> Result<Vec<String>, String> {
        let algorithms: Algorithms = text.parse().map_err(|e: svl::Error| e.to_string())?;
        Ok(algorithms.0.iter().map(|a| a.label().to_owned()).collect())
    }

    #[test]
    fn a_range_is_so_many_ordinary_algorithms() {
        assert_eq!(labels("v3").unwrap(), ["v3"]);
        assert_eq!(
            labels("bm:uniqueness=0..25/10").unwrap(),
            ["bm:uniqueness=0", "bm:uniqueness=10", "bm:uniqueness=20"]
        );
        assert_eq!(
            labels("v3:max_disparity=64,texture_sigma=0.2..=0.5/0.1,subpixel=true").unwrap(),
            [0.2, 0.3, 0.4, 0.5]
                .map(|v| format!("v3:max_disparity=64,texture_sigma={v},subpixel=true"))
        );
        assert_eq!(
            labels("v3:min_disparity=-8..0/8").unwrap(),
            ["v3:min_disparity=-8", "v3:min_disparity=0"]
        );
        assert_eq!(
            labels("exec:command='../a.py 1..2/1'").unwrap(),
            ["exec:command='../a.py 1..2/1'"]
        );
    }

    #[test]
    fn wrong_ranges_are_named() {
        for (text, word) in [
            ("bm:uniqueness=0..20", "FROM..TO/STEP"),
            ("bm:uniqueness=0..20/x", "are numbers"),
            ("bm:uniqueness=0..20/0", "above 0"),
            ("bm:uniqueness=20..0/5", "above 0"),
            ("bm:uniqueness=0..100/1", "more than 32"),
            ("bm:uniqueness=0..1e300/1e-300", "more than 32"),
            ("bm:uniqueness=0..20/5,block_size=5..9/2", "one range"),
            ("bm:uniqueness=95..115/10", "0..=100"),
            ("bm:uniqueness=0..1/0.5", "whole number"),
            ("bmm:uniqueness=0..1/1", "did you mean 'bm'"),
        ] {
            let error = labels(text).unwrap_err();
            assert!(
                error.contains(word) && !error.contains('\n'),
                "{text}: {error}"
            );
        }
    }

    #[test]
    fn what_differs_in_one_number_is_a_sweep() {
        let texts = [
            "v3",
            "sgm:p1=20",
            "v3:texture_sigma=0.8",
            "bm",
            "sgm:p1=5",
            "v3:texture_sigma=0.2",
            "sgm:p1=5,p2=84",
        ];
        let algorithms: Vec<Algorithm> = texts.iter().map(|t| t.parse().unwrap()).collect();
        let found: Vec<_> = sweeps(&algorithms)
            .into_iter()
            .map(|s| {
                (
                    s.name,
                    s.points
                        .into_iter()
                        .map(|(value, _)| value)
                        .collect::<Vec<_>>()
                        .join(" "),
                )
            })
            .collect();
        let expected = [
            ("v3: texture_sigma", "0.2 0.4 0.8"),
            ("sgm: p1", "5 20"),
            ("sgm: p2", "80 84"),
        ];
        assert_eq!(
            found,
            expected.map(|(name, values)| (name.to_owned(), values.to_owned()))
        );
        assert!(sweeps(&algorithms[..2]).is_empty());
    }
}
