//! The scenario that `svl score` scores.

use super::Args;
use crate::cli::shared::{filters, scenario_runs};
use svl::matcher::Algorithm;
use svl::scenario::{Scenario, StressLevels, distinct_kinds};
use svl::stress::Stress;

/// The scenario that is named, or that of the recordings that are.
pub(super) fn scenario(args: &Args, quiet: bool) -> anyhow::Result<Scenario> {
    let mut scenario = scenario_runs::named(&args.what)?;
    if args.check {
        let ranges = scenario
            .algorithms
            .iter()
            .filter_map(Algorithm::max_disparity);
        let max = ranges.max().unwrap_or(80);
        scenario.algorithms = vec![format!("truth:max_disparity={max}").parse()?];
        scenario.gate.clear();
    }
    if !args.algo.is_empty() {
        let swept = args.algo.iter().map(|sweep| sweep.expand(args.sample));
        scenario.algorithms = swept.collect::<svl::Result<Vec<_>>>()?.concat();
    }
    if !args.stress.is_empty() {
        distinct_kinds(&args.stress)?;
        scenario.stress.clone_from(&args.stress);
        let texts = args.stress.iter().flat_map(StressLevels::stresses);
        let texts: Vec<_> = texts.map(ToString::to_string).collect();
        // The scenario's hash says so, and its page.
        scenario_runs::note(&mut scenario, "stress", &texts.join(", "));
    }
    let named = &args.what[0];
    args.source
        .change(std::slice::from_mut(&mut scenario), named)?;
    if !args.check {
        let mut filters = args.filters.models()?;
        if filters.is_empty() {
            filters = filters::of_scenario(&scenario, quiet)?;
        }
        scenario.algorithms = filters::with_filters(scenario.algorithms, &filters);
    }
    Ok(scenario)
}

/// None, then all levels of the scenario's stress.
pub(super) fn stresses(scenario: &Scenario) -> impl Iterator<Item = Option<Stress>> {
    let stresses = scenario.stress.iter().flat_map(StressLevels::stresses);
    std::iter::once(None).chain(stresses.copied().map(Some))
}
