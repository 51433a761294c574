//! Sweeps: parameters over ranges and lists of values, one algorithm for each combination.

use std::collections::BTreeSet;
use std::str::FromStr;
use svl_core::matcher::{self, Algorithm, Range, labelled};
use svl_core::{Error, Result};

/// Most algorithms of one run.
pub const MAX_ALGORITHMS: usize = 1000;

/// The request of one `--algo`: an algorithm, or a grid of them, where numbers are ranges
/// `FROM..TO/STEP` or lists `A/B/C`, and words lists.
#[derive(Clone, Debug)]
pub struct Algorithms {
    label: Option<String>,
    /// The algorithm's name.
    name: String,
    axes: Vec<Axis>,
}

/// A setting, with its values where it is swept.
#[derive(Clone, Debug)]
struct Axis {
    /// The text before the value, with `=`; the whole text of a setting that is not swept.
    key: String,
    values: Vec<String>,
    is_swept: bool,
}

impl FromStr for Algorithms {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (label, written) = labelled(text)?;
        let (name, settings) = written.split_once(':').unwrap_or((written, ""));
        let spec = matcher::find(name)?;
        let axis = |setting: &str| -> Result<Axis> {
            let swept = setting.split_once('=').and_then(|(key, values)| {
                let parameter = spec.parameters.iter().find(|p| p.name == key)?;
                Some((key, values, &parameter.range))
            });
            let (key, values) = match swept {
                Some((key, range, Range::Int { .. } | Range::Real { .. }))
                    if range.contains("..") =>
                {
                    (format!("{key}="), range_of(range)?)
                }
                // Commands, paths and topics may contain slashes.
                Some((key, list, range))
                    if list.contains('/')
                        && matches!(
                            range,
                            Range::Int { .. }
                                | Range::Real { .. }
                                | Range::Flag { .. }
                                | Range::Choice { .. }
                        ) =>
                {
                    let values = list.split('/').map(str::to_owned).collect();
                    (format!("{key}="), values)
                }
                _ => (setting.to_owned(), Vec::new()),
            };
            Ok(Axis {
                key,
                is_swept: !values.is_empty(),
                values: if values.is_empty() {
                    vec![String::new()]
                } else {
                    values
                },
            })
        };
        let settings = (!settings.is_empty()).then(|| settings.split(','));
        let axes = settings.into_iter().flatten().map(axis);
        let algorithms = Self {
            label: label.map(str::to_owned),
            name: name.to_owned(),
            axes: axes.collect::<Result<_>>()?,
        };
        // Every value is checked beside the first ones of the others.
        for (i, axis) in algorithms.axes.iter().enumerate() {
            for value in 0..axis.values.len() {
                let mut place = vec![0; algorithms.axes.len()];
                place[i] = value;
                algorithms.at(&place)?;
            }
        }
        algorithms.at(&vec![0; algorithms.axes.len()])?;
        Ok(algorithms)
    }
}

impl Algorithms {
    /// The algorithms, the last parameter running fastest; `sample`: the largest number of them,
    /// spread evenly over the grid by a quasi-random sequence (R2 of Roberts 2018, generalized),
    /// always the same ones.
    ///
    /// # Errors
    /// [`Error::Usage`] for more than [`MAX_ALGORITHMS`]; those of their parameters.
    pub fn expand(&self, sample: Option<usize>) -> Result<Vec<Algorithm>> {
        let lengths: Vec<_> = self.axes.iter().map(|axis| axis.values.len()).collect();
        let all = lengths.iter();
        let all = all.fold(1_usize, |n, len| n.saturating_mul(*len));
        let most = sample.unwrap_or(all);
        if most.min(all) > MAX_ALGORITHMS {
            return Err(Error::Usage(format!(
                "{all} algorithms in one run; at most {MAX_ALGORITHMS}: take larger steps, or a \
                 --sample of them"
            )));
        }
        let place = |mut i: usize| {
            let mut place = vec![0; lengths.len()];
            for (at, len) in place.iter_mut().zip(&lengths).rev() {
                (*at, i) = (i % len, i / len);
            }
            place
        };
        let places: Vec<_> = if most < all {
            spread(&lengths, most)
        } else {
            (0..all).map(place).collect()
        };
        places.iter().map(|place| self.at(place)).collect()
    }

    /// The algorithm with these values.
    fn at(&self, place: &[usize]) -> Result<Algorithm> {
        let settings = |is_shown: &dyn Fn(&Axis) -> bool| {
            let chosen = self.axes.iter().zip(place);
            let chosen = chosen.filter(|(axis, _)| is_shown(axis));
            let texts = chosen.map(|(axis, &i)| format!("{}{}", axis.key, axis.values[i]));
            texts.collect::<Vec<_>>().join(",")
        };
        let with = |name: &str, settings: String| {
            if settings.is_empty() {
                name.to_owned()
            } else {
                format!("{name}:{settings}")
            }
        };
        let algorithm: Algorithm = with(&self.name, settings(&|_| true)).parse()?;
        Ok(match &self.label {
            Some(label) => algorithm.called(with(label, settings(&|axis| axis.is_swept))),
            None => algorithm,
        })
    }
}

/// The first `count` places that the sequence visits in a grid of more places, each once.
fn spread(lengths: &[usize], count: usize) -> Vec<Vec<usize>> {
    let swept: Vec<_> = (0..lengths.len()).filter(|&i| lengths[i] > 1).collect();
    let mut seen = BTreeSet::new();
    let mut places = Vec::new();
    // The sequence fills the unit cube evenly, so that it visits all places; the bound covers
    // places that rounding might skip.
    for i in 1..=10_000 * count {
        let mut place = vec![0; lengths.len()];
        for (at, &axis) in quasi_random(i, swept.len()).zip(&swept) {
            place[axis] = (at * lengths[axis] as f64) as usize;
        }
        if seen.insert(place.clone()) {
            places.push(place);
        }
        if places.len() == count {
            break;
        }
    }
    places
}

/// Point `i` of a quasi-random sequence that fills the unit cube of these dimensions evenly: R2
/// of Roberts 2018, generalized.
fn quasi_random(i: usize, dimensions: usize) -> impl Iterator<Item = f64> {
    // The root of x^(d+1) = x + 1, by iteration.
    let power = 1.0 / (dimensions as f64 + 1.0);
    let root = (0..64).fold(2.0_f64, |x, _| (1.0 + x).powf(power));
    (0..dimensions).map(move |k| (0.5 + i as f64 * root.powi(-(k as i32 + 1))).fract())
}

/// The values of `FROM..TO/STEP`, each in its shortest exact form.
fn range_of(range: &str) -> Result<Vec<String>> {
    let wrong = |why: &str| Error::Invalid(format!("range '{range}': {why}, for instance 0..20/5"));
    let (ends, step) = range
        .split_once('/')
        .ok_or_else(|| wrong("write FROM..TO/STEP"))?;
    let (from, to) = ends
        .split_once("..")
        .ok_or_else(|| wrong("write FROM..TO/STEP"))?;
    // `..=` has the meaning of `..` here.
    let to = to.strip_prefix('=').unwrap_or(to);
    let number = |text: &str| text.parse().ok().filter(|v: &f64| v.is_finite());
    let (Some(first), Some(last), Some(width)) = (number(from), number(to), number(step)) else {
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

/// A decimal number without trailing zeros.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(text: &str) -> std::result::Result<Vec<String>, String> {
        let algorithms: Algorithms = text.parse().map_err(|e: Error| e.to_string())?;
        let algorithms = algorithms.expand(None).map_err(|e| e.to_string())?;
        Ok(algorithms.iter().map(|a| a.label().to_owned()).collect())
    }

    #[test]
    fn a_range_expands_to_algorithms() {
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
    fn several_ranges_and_lists_are_a_grid() {
        assert_eq!(
            labels("bm:uniqueness=0..10/10,block_size=5/9").unwrap(),
            [(0, 5), (0, 9), (10, 5), (10, 9)]
                .map(|(u, b)| format!("bm:uniqueness={u},block_size={b}"))
        );
        assert_eq!(
            labels("fast=v3:max_disparity=64,subpixel=true/false").unwrap(),
            ["fast:subpixel=true", "fast:subpixel=false"]
        );
        assert_eq!(labels("net=exec:command='./a/b.py'").unwrap(), ["net"]);
    }

    #[test]
    fn a_sample_is_spread_over_the_grid() {
        let grid: Algorithms = "bm:uniqueness=0..99/1,max_disparity=0..99/1"
            .parse()
            .unwrap();
        let sample = grid.expand(Some(100)).unwrap();
        assert_eq!(sample.len(), 100);
        // Each hundredth of the plane, ten by ten, has about one: never more than three.
        let mut counts = [0; 100];
        for algorithm in &sample {
            let [x, y] = ["uniqueness", "max_disparity"].map(|key| {
                let mut parameters = algorithm.parameters().iter();
                let (_, value) = parameters.find(|(name, _)| *name == key).unwrap();
                value.number().unwrap() as usize / 10
            });
            counts[10 * y + x] += 1;
        }
        assert!(counts.iter().all(|&n| n <= 3), "{counts:?}");
        assert!(counts.iter().filter(|&&n| n > 0).count() > 70, "{counts:?}");
        // A small grid is taken whole.
        let small: Algorithms = "bm:uniqueness=0..20/10".parse().unwrap();
        assert_eq!(small.expand(Some(100)).unwrap().len(), 3);
        assert_eq!(small.expand(Some(2)).unwrap().len(), 2);
    }

    #[test]
    fn wrong_ranges_are_named() {
        for (text, word) in [
            ("bm:uniqueness=0..20", "FROM..TO/STEP"),
            ("bm:uniqueness=0..20/x", "are numbers"),
            ("bm:uniqueness=0..20/0", "above 0"),
            ("bm:uniqueness=20..0/5", "above 0"),
            ("bm:uniqueness=0..1e300/1e-300", "more than 1000"),
            (
                "bm:uniqueness=0..100/1,max_disparity=16..64/1",
                "4949 algorithms in one run; at most 1000",
            ),
            ("bm:block_size=5/x", "block_size=x"),
            ("v3=bm", "'v3' is an algorithm's own name"),
            ("a b=bm", "'a b' is not a label"),
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
}
