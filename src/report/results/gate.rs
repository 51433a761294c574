//! Limits of a run's metrics, and the gate result of a run: `svl score --gate`.

use super::summary::Results;
use crate::show::junit::{TestCase, TestResult};
use crate::subjects::references::PRIOR;
use serde::Serialize;
use svl_score::judge::{Cases, Measured, Metric, MetricUnit};
use svl_score::manifest::{AlgorithmRecord, Manifest};
use svl_score::scenario::Limit;

/// The state of a limit after a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum GateState {
    Pass,
    Fail,
    /// The run has no number for it, which fails, too.
    NotMeasured,
    /// The limit's algorithm was not run, on purpose.
    Skipped,
}

impl GateState {
    pub fn words(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "FAIL",
            Self::NotMeasured => "NOT MEASURED",
            Self::Skipped => "skipped",
        }
    }

    /// True if the gate fails by it.
    pub fn fails(self) -> bool {
        matches!(self, Self::Fail | Self::NotMeasured)
    }
}

/// The result of a limit for one algorithm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GateResult {
    pub limit: Limit,
    /// Label of the algorithm; absent when no algorithm of the run matches the limit.
    pub algorithm: Option<String>,
    /// Value of the metric; absent if the run does not measure it.
    pub value: Option<f64>,
    pub state: GateState,
    /// The cases that the value rests on.
    pub cases: Option<Cases>,
    /// Caveats of the value: its truth is not exact, its pairs are not those of the table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub caution: Option<String>,
}

/// Results of a run, one for every algorithm that matches the limit.
pub fn limit_results(limit: &Limit, summary: &Results, manifest: &Manifest) -> Vec<GateResult> {
    // A bare name matches the algorithm with any parameters.
    let is = |a: &&AlgorithmRecord, name: &str| a.label == name || a.name == name;
    let unit = limit.relative_to.as_deref();
    let unit = unit.map(|name| manifest.algorithms.iter().find(|a| is(a, name)));
    let area = limit.area.unwrap_or_default();
    let result = |algorithm: &AlgorithmRecord| {
        let label = &algorithm.label;
        let is_of_prior = limit.relative_to.as_deref() == Some(PRIOR);
        let own = |label: &str| match (limit.checkpoint, limit.range) {
            (Some(_), _) => summary.measurement(label, limit.metric, limit.checkpoint, area),
            (None, Some(range)) => summary.error_within(label, limit.metric, area, range),
            (None, None) => match limit.metric.estimated() {
                Some(number) => summary.estimate(label, area)?.promised(number),
                None => summary.own(label)?.totals.measured(limit.metric, area),
            },
        };
        let measured = own(label);
        let cases = measured.map_or_else(Cases::none, |own| own.cases);
        let is_measured = |own: &Measured| limit.metric.is_measured(&own.cases, limit.minimum());
        let value = measured
            .filter(is_measured)
            .and_then(|measured| match unit {
                _ if is_of_prior => Some(measured.value - limit.metric.value_of(own(PRIOR)?)?),
                None => Some(measured.value),
                Some(unit) => unit.and_then(|unit| time_ratio(summary, algorithm, unit)),
            });
        let is_of_own = !summary.basis.own.is_empty() && limit.checkpoint.is_none();
        let own_pairs = is_of_own.then(|| "of its own pairs".to_owned());
        let caution = summary.caution().filter(|_| limit.metric.against_truth);
        let estimate = summary
            .estimate(label, area)
            .filter(|_| limit.metric.estimated().is_some());
        let untold = estimate.and_then(|own| own.absent.clone().filter(|_| value.is_none()));
        let cautions: Vec<_> = caution
            .into_iter()
            .chain(own_pairs)
            .chain(untold.clone())
            .collect();
        let [min, max] = limit.bounds();
        let keeps = |v: f64| min.is_none_or(|min| v >= min) && max.is_none_or(|max| v <= max);
        let state = match value {
            // The reference of the ratio is named but not in this run.
            _ if matches!(unit, Some(None)) && !is_of_prior => GateState::Skipped,
            None => GateState::NotMeasured,
            Some(value) if keeps(value) => GateState::Pass,
            Some(_) => GateState::Fail,
        };
        GateResult {
            algorithm: Some(label.clone()),
            value,
            state,
            cases: untold.is_none().then_some(cases),
            caution: (!cautions.is_empty()).then(|| cautions.join(", ")),
            ..GateResult::skipped(limit)
        }
    };
    // A limit for a bare name has a result per variant of the algorithm.
    let algorithms = manifest.algorithms.iter();
    let own = algorithms.filter(|a| is(a, &limit.algorithm));
    let results: Vec<_> = own.map(result).collect();
    match results[..] {
        [] => vec![GateResult::skipped(limit)],
        _ => results,
    }
}

/// The ratio of two medians. Both are of one run and machine, so it carries over to other machines.
fn time_ratio(summary: &Results, tested: &AlgorithmRecord, unit: &AlgorithmRecord) -> Option<f64> {
    let labels = [tested, unit].map(|record| record.label.as_str());
    if !summary.are_times_comparable(labels.into_iter()) {
        return None;
    }
    let median = |label| summary.own(label)?.p50_ms;
    Some(median(labels[0])? / median(labels[1])?)
}

/// A bound with all of its digits: one that rounds to another would be another limit.
fn exact_bound(metric: &Metric, bound: f64) -> String {
    match metric.unit {
        MetricUnit::Share => {
            let shown = |digits: usize| format!("{:.digits$}", 100.0 * bound);
            let is_bound = |text: &String| {
                text.parse()
                    .is_ok_and(|v: f64| (v / 100.0 - bound).abs() < 1e-12)
            };
            let text = (1..9).map(shown).find(is_bound);
            text.unwrap_or_else(|| shown(9)) + " %"
        }
        _ => metric.show_relative(bound),
    }
}

impl GateResult {
    /// That of a limit that no algorithm of the run matches.
    fn skipped(limit: &Limit) -> Self {
        Self {
            limit: limit.clone(),
            algorithm: None,
            value: None,
            state: GateState::Skipped,
            cases: None,
            caution: None,
        }
    }

    /// The number that is limited, in words: algorithm, metric, and what it is relative to.
    fn subject(&self) -> String {
        let limit = &self.limit;
        let algorithm = self.algorithm.as_ref().unwrap_or(&limit.algorithm);
        let area = limit.area.map(|area| format!(" in area {area}"));
        let checkpoint = limit
            .checkpoint
            .map(|number| format!(" at checkpoint {number}"));
        let range = limit.range.map(|range| format!(" at {range} m"));
        let ends = [", high end", ", low end"];
        let number = limit.metric.estimated();
        let end = number.map(|own| ends[usize::from(own.is_of_right())].to_owned());
        let other = limit.relative_to.as_deref().map(|other| match other {
            PRIOR => " minus the prior's".to_owned(),
            other => format!(" in units of {other}'s"),
        });
        let extent = [area, checkpoint, range, other, end]
            .map(Option::unwrap_or_default)
            .concat();
        format!("{algorithm}: {}{extent}", limit.metric.words)
    }

    /// The same with the kind of its bounds, without their values.
    fn limited(&self) -> String {
        let [min, max] = self.limit.bounds();
        let bounds = [min.map(|_| "at least"), max.map(|_| "at most")];
        let bounds: Vec<_> = bounds.into_iter().flatten().collect();
        format!("{}, {} the limit", self.subject(), bounds.join(" and "))
    }

    /// For JUnit.
    pub fn test_case(&self) -> TestCase {
        let result = match self.state {
            GateState::Pass => TestResult::Passed,
            GateState::Fail | GateState::NotMeasured => TestResult::Failed,
            GateState::Skipped => TestResult::Skipped,
        };
        TestCase {
            name: self.limited(),
            result: result(self.to_string()),
        }
    }
}

impl std::fmt::Display for GateResult {
    /// One line: algorithm, metric, value and limits.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Limit { metric, line, .. } = &self.limit;
        let [min, max] = self.limit.bounds();
        f.write_str(&self.subject())?;
        let rests_on = self.cases.map(|cases| metric.cases_words(&cases));
        match (self.state, self.value) {
            (GateState::Skipped, _) => {
                f.write_str(" has no result, as an algorithm is not in the run")?;
            }
            (_, None) => {
                f.write_str(" is not measured in this run")?;
                let minimum = metric.minimum_words(self.limit.minimum());
                if let Some(cases) = rests_on {
                    write!(f, ": it rests on {cases}, and needs {minimum}")?;
                }
            }
            (_, Some(value)) => {
                // A value that rounds to the bound would look like a pass.
                let hidden = [min, max]
                    .into_iter()
                    .flatten()
                    .any(|b| b != value && metric.show_relative(b) == metric.show_relative(value));
                match (hidden, metric.unit == MetricUnit::Share) {
                    (true, true) => write!(f, " {:.4} %", 100.0 * value)?,
                    _ => write!(f, " {}", metric.show_relative(value))?,
                }
                if let Some(cases) = rests_on {
                    write!(f, " over {cases}")?;
                }
            }
        }
        let bounds = [("at least", min), ("at most", max)]
            .map(|(words, bound)| bound.map(|bound| (words, exact_bound(metric, bound))));
        for (i, (words, bound)) in bounds.into_iter().flatten().enumerate() {
            write!(f, "{} {words} {bound}", if i == 0 { "," } else { " and" })?;
        }
        if let Some(caution) = &self.caution {
            write!(f, ", {caution}")?;
        }
        write!(f, " (line {line})")
    }
}

#[cfg(test)]
mod tests {
    use super::super::summary::{ReportTables, ResultParts, Shown};
    use super::*;
    use crate::rows::held::Row;
    use crate::rows::records::CellRow;
    use crate::subjects::accuracy::{AccuracyTally, RunRanges};
    use crate::subjects::speed::tests::row;
    use serde_json::json;
    use svl_core::stereo::{CellRule, CellState};
    use svl_score::judge::{CellArea, MetricValues, Verdict};

    /// Ten pairs with that number of near obstacles each, in which v3 misses none in 1 ms, and bm
    /// in 4 ms.
    fn pairs(near: f64) -> Vec<Row> {
        let mut metrics = MetricValues::from([("right", 5.0), ("wrong", 1.0), ("unknown", 2.0)]);
        for (name, value) in [("near", near), ("found", near)] {
            metrics.set(name, Some(value));
        }
        for name in ["missed", "false", "close", "blind"] {
            metrics.set(name, Some(0.0));
        }
        let row = |(sequence, (algorithm, us)): (u64, (&str, u64))| Row {
            sequence,
            algorithm: algorithm.into(),
            metrics: metrics.clone(),
            ..row(us, (64, 48), None)
        };
        let both = |i| [(i, ("v3", 1000)), (i, ("bm", 4000))];
        (0..10).flat_map(both).map(row).collect()
    }

    /// Ten known cells at 0.8 m, of which `far` are reported at infinity, the others exactly.
    fn cells(sequence: u64, far: u32) -> Vec<CellRow> {
        let cell = |column| CellRow {
            sequence,
            algorithm: "v3".into(),
            column,
            distance_m: (column >= far).then_some(0.8),
            true_distance_m: Some(0.8),
            verdict: Verdict::Right,
            area: Some(CellArea::Obstacle),
            state: Some(CellState::Known),
            ..CellRow::default()
        };
        (0..10).map(cell).collect()
    }

    /// The result of a limit of those pairs, with as many cells at infinity in as many of them.
    fn gated(near: f64, far: u32, frames: u64, limit: serde_json::Value) -> GateResult {
        let mut keys = json!({ "algorithm": "v3" });
        let more = limit.as_object().unwrap().clone();
        keys.as_object_mut().unwrap().extend(more);
        let mut manifest =
            Manifest::new("s", &["v3", "bm"].map(|own| own.parse().unwrap())).unwrap();
        manifest.description = Some(json!({ "gate": [keys] }));
        let ranges = RunRanges::new(&manifest).unwrap();
        let mut accuracy = AccuracyTally::new(CellRule::default(), &ranges);
        for sequence in 0..frames {
            accuracy.add(Some(100_000_000 * sequence), &cells(sequence, far));
        }
        let tables = ReportTables {
            rows: pairs(near).into_iter().collect(),
            accuracy: {
                let ranges = ranges.in_order(&accuracy);
                accuracy.into_rows(&["v3"], &ranges)
            },
            ..ReportTables::default()
        };
        let results = Results::new(&tables, ResultParts::default(), Shown::default()).unwrap();
        let limit: Limit = serde_json::from_value(keys).unwrap();
        limit.validate().unwrap();
        limit_results(&limit, &results, &manifest).remove(0)
    }

    #[test]
    fn where_nothing_is_near_nothing_is_missed_and_no_limit_passes() {
        for name in ["missed", "blind"] {
            let found = gated(0.0, 0, 2, json!({ "metric": name, "max": 0 }));
            assert_eq!(found.state, GateState::NotMeasured, "{found}");
        }
        let found = gated(0.0, 0, 2, json!({ "metric": "missed", "max": 0 }));
        let words = "v3: missed near obstacles is not measured in this run: it rests on 0 near \
                     obstacles, and needs 1 near obstacle, at most 0 (line 0)";
        assert_eq!(found.to_string(), words);
        // Cells reported near are false without any obstacle, too.
        let found = gated(0.0, 0, 2, json!({ "metric": "false", "max": 0 }));
        assert_eq!(found.state, GateState::Pass, "{found}");
        let found = gated(1.0, 0, 2, json!({ "metric": "missed", "max": 0 }));
        let words = "v3: missed near obstacles 0 over 10 near obstacles, at most 0 (line 0)";
        assert_eq!((found.state, &*found.to_string()), (GateState::Pass, words));
        for (min_cases, state) in [(10, GateState::Pass), (11, GateState::NotMeasured)] {
            let limit = json!({ "metric": "missed", "max": 0, "min_cases": min_cases });
            assert_eq!(gated(1.0, 0, 2, limit).state, state);
        }
    }

    #[test]
    fn errors_that_leave_out_cells_pass_no_limit() {
        let state = |far, limit: serde_json::Value| gated(1.0, far, 2, limit);
        for name in ["rmse", "median_error", "abs_rel", "noise"] {
            let limit = json!({ "metric": name, "max": 0.25 });
            assert_eq!(state(0, limit.clone()).state, GateState::Pass, "{name}");
            // Six of ten cells are at infinity, and all others exact.
            let found = state(6, limit);
            assert_eq!(found.state, GateState::NotMeasured, "{found}");
            let limit = json!({ "metric": name, "max": 0.25, "min_share": 0.4 });
            assert_eq!(state(6, limit).state, GateState::Pass, "{name}");
        }
        let found = state(6, json!({ "metric": "rmse", "max": 0.25 })).to_string();
        let words = "it rests on 8 of 20 known cells with a finite truth, and needs 95 %";
        assert!(found.contains(words), "{found}");
        let bias = state(6, json!({ "metric": "bias", "max_magnitude": 0.1 }));
        assert_eq!(bias.state, GateState::NotMeasured, "{bias}");
    }

    #[test]
    fn a_limit_of_a_range_is_that_of_its_cells() {
        // All cells are at 0.8 m.
        let limit = |range: &str| json!({ "metric": "rmse", "range": range, "max": 0.25 });
        let found = gated(1.0, 0, 2, limit("0..0.8"));
        assert_eq!(found.state, GateState::NotMeasured, "{found}");
        let found = gated(1.0, 0, 2, limit("0.8..8"));
        let words = "v3: RMSE of distances at 0.8..8 m 0.000 m over 20 known cells with a finite \
                     truth, at most 0.250 m";
        assert_eq!(found.state, GateState::Pass, "{found}");
        assert!(found.to_string().starts_with(words), "{found}");
    }

    #[test]
    fn a_bias_is_limited_from_both_sides() {
        let both = json!({ "metric": "bias", "max_magnitude": 0.1 });
        let far = json!({ "metric": "bias", "min": -2, "max": -1 });
        for (limit, state) in [(both, GateState::Pass), (far, GateState::Fail)] {
            assert_eq!(gated(1.0, 0, 2, limit).state, state);
        }
    }

    #[test]
    fn a_time_is_limited_in_units_of_that_of_another_algorithm() {
        let limit = json!({ "metric": "time", "relative_to": "bm", "max": 0.5 });
        let found = gated(1.0, 0, 2, limit);
        assert_eq!((found.value, found.state), (Some(0.25), GateState::Pass));
    }

    #[test]
    fn changes_need_two_frames_and_carry_their_cells() {
        for name in ["noise", "flicker"] {
            let limit = json!({ "metric": name, "max": 0.1 });
            let one = gated(1.0, 0, 1, limit.clone());
            assert_eq!(one.state, GateState::NotMeasured);
            let found = gated(1.0, 0, 3, limit);
            assert_eq!(found.state, GateState::Pass, "{found}");
            let words = "over 3 frames, 20 cells at rest";
            assert!(found.to_string().contains(words), "{found}");
            let limit = json!({ "metric": name, "max": 0.1, "min_cases": 4 });
            assert_eq!(gated(1.0, 0, 3, limit).state, GateState::NotMeasured);
        }
    }
}
