//! Sweeps among the algorithms of a report.

use super::html::figures::ParameterSweep;
use svl_score::manifest::AlgorithmRecord;

/// Sweeps among the algorithms of a run, however they were named: those of one kind that
/// differ in one number.
pub(crate) fn sweeps(algorithms: &[AlgorithmRecord]) -> Vec<ParameterSweep> {
    let mut sweeps: Vec<ParameterSweep> = Vec::new();
    for first in algorithms {
        for (key, _) in &first.values {
            let mut points: Vec<_> = algorithms
                .iter()
                .filter(|other| differ_in(first, other, key))
                .filter_map(|other| Some((other.number(key)?, other)))
                .collect();
            points.sort_by(|(a, _), (b, _)| a.total_cmp(b));
            // The same algorithm by two names is not a sweep.
            points.dedup_by(|(a, _), (b, _)| a == b);
            let points = points.iter();
            let points = points.map(|(v, a)| (v.to_string(), a.label.clone()));
            let points: Vec<_> = points.collect();
            let sweep = ParameterSweep {
                algorithm: first.name.clone(),
                parameter: key.clone(),
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

/// True if two algorithms are of one kind and have all parameters but `key` in common.
fn differ_in(a: &AlgorithmRecord, b: &AlgorithmRecord, key: &str) -> bool {
    let mut both = a.values.iter().zip(&b.values);
    let is_same = |((name, value), (_, other)): (&(String, String), &(String, String))| {
        name == key || value == other
    };
    a.name == b.name && a.filters == b.filters && both.all(is_same)
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::matcher::Algorithm;
    use svl_score::manifest::Manifest;

    #[test]
    fn algorithms_that_differ_in_one_number_are_a_sweep() {
        let texts = "v3 sgm:p1=20 v3:texture_sigma=0.8 bm sgm:p1=5 v3:texture_sigma=0.2 \
                     sgm:p1=5,p2=84";
        let algorithms = texts.split(' ').map(|text| text.parse().unwrap());
        let algorithms: Vec<Algorithm> = algorithms.collect();
        let algorithms = Manifest::new("s", &algorithms).unwrap().algorithms;
        let found = sweeps(&algorithms).into_iter().map(|sweep| {
            let values: Vec<_> = sweep.points.into_iter().map(|(value, _)| value).collect();
            let (algorithm, parameter) = (sweep.algorithm, sweep.parameter);
            format!("{algorithm}: {parameter}: {}", values.join(" "))
        });
        let expected = [
            "v3: texture_sigma: 0.2 0.4 0.8",
            "sgm: p1: 5 20",
            "sgm: p2: 80 84",
        ];
        assert_eq!(found.collect::<Vec<_>>(), expected);
        assert!(sweeps(&algorithms[..2]).is_empty());
    }
}
