//! The latencies after which the cells of a report are scored, too.

use super::facts::RunFacts;
use super::plan::ReportPlan;
use super::run_units::RunUnits;
use super::store::StoredSession;
use crate::results::summary::Results;
use std::collections::BTreeMap;
use svl_core::{Result, listed, matcher};
use svl_score::manifest::AlgorithmRecord;
use svl_score::scenario::{CellKeys, Latency};

/// Longest latency of a topic, milliseconds: a later one is of another clock.
const MAX_TOPIC_MS: f64 = 10_000.0;

/// Latencies by algorithm and run.
#[derive(Default)]
pub struct Latencies {
    asked: Option<Latency>,
    /// By label the median time of a matcher, milliseconds, if it is asked for and is of matching
    /// alone.
    times_ms: BTreeMap<String, f64>,
}

impl Latencies {
    /// `results`: those of the report, where times are asked for.
    ///
    /// # Errors
    /// The errors of the results.
    pub fn new(
        plan: &ReportPlan,
        sessions: &[StoredSession],
        results: impl FnOnce() -> Result<Results>,
    ) -> Result<Self> {
        let table: Option<CellKeys> = plan.manifest.part("cells")?;
        let asked = table.and_then(|table| table.latency_ms);
        let mut sessions = sessions.iter();
        let are_times = sessions.all(|session| session.manifest.shard.is_none());
        let mut times_ms = BTreeMap::new();
        if are_times && matches!(asked, Some(Latency::Measured(_))) {
            let algorithms = results()?.algorithms.into_iter();
            times_ms.extend(algorithms.filter_map(|own| Some((own.algorithm, own.p50_ms?))));
        }
        Ok(Self { asked, times_ms })
    }

    /// True if cells are scored late.
    pub(crate) fn are_asked(&self) -> bool {
        self.asked.is_some()
    }

    /// By label the latencies of the algorithms in a run, milliseconds.
    pub(crate) fn in_run(&self, plan: &ReportPlan, facts: &RunFacts) -> BTreeMap<String, f64> {
        let is_untimed = facts.record.as_ref().is_some_and(|own| own.is_untimed);
        let records = plan.manifest.algorithms.iter().filter(|_| !is_untimed);
        let known = records.filter_map(|own| Some((own.label.clone(), self.ms(own, facts)?)));
        known.collect()
    }

    fn ms(&self, own: &AlgorithmRecord, facts: &RunFacts) -> Option<f64> {
        match self.asked.as_ref()? {
            Latency::Measured(_) if own.is_recorded() => {
                let is_own = |topic: &str| own.values.iter().any(|(_, value)| value == topic);
                let delay = facts.latency.iter().find(|delay| is_own(&delay.topic))?;
                let [median_ms, _] = delay.topic_ms?;
                (0.0..=MAX_TOPIC_MS)
                    .contains(&median_ms)
                    .then_some(median_ms)
            }
            Latency::Measured(_) => self.times_ms.get(&own.label).copied(),
            latency => latency.ms(&own.label, matcher::find(&own.name).ok()?),
        }
    }

    /// Notes on them: those that were measured, and the algorithms without one.
    pub(crate) fn cautions(&self, plan: &ReportPlan, runs: &[RunUnits]) -> Vec<String> {
        let (mut known, mut unknown) = (Vec::new(), Vec::new());
        for own in plan.manifest.algorithms.iter().filter(|_| self.are_asked()) {
            let all_ms = runs.iter().filter_map(|run| self.ms(own, &run.facts));
            match all_ms.reduce(f64::max) {
                Some(ms) => known.push(format!("{} {ms:.1} ms", own.label)),
                None => unknown.push(own.label.as_str()),
            }
        }
        let is_measured = matches!(self.asked, Some(Latency::Measured(_))) && !known.is_empty();
        let measured = is_measured.then(|| {
            format!(
                "late cells: {}: matchers by their median time on this machine, topics by their \
                 latency on the robot",
                listed(known)
            )
        });
        let unknown = (!unknown.is_empty()).then(|| {
            format!(
                "{}: no late cells, as no latency is known; latency_ms under [cells] sets it",
                listed(unknown)
            )
        });
        measured.into_iter().chain(unknown).collect()
    }
}
