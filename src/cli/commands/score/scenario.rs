//! The scenario that `svl score` scores.

use super::Args;
use crate::cli::shared::{filters, usage};
use std::path::Path;
use svl::matcher::Algorithm;
use svl::scenario::Scenario;

/// The scenario that is named, or that of the recordings that are.
pub(super) fn scenario(args: &Args, quiet: bool) -> anyhow::Result<Scenario> {
    let is_scenario = |what: &str| Path::new(what).extension().is_some_and(|e| e == "toml");
    let mut scenario = match &args.what[..] {
        [name] if name == "arena" => Scenario::arena()?,
        [path] if is_scenario(path) => Scenario::read(Path::new(path))?,
        recordings => {
            if let Some(name) = recordings.iter().find(|name| is_scenario(name)) {
                let cure = "name one scenario, or recordings";
                return Err(usage::wrong(format!("{name}: is a scenario; {cure}")));
            }
            Scenario::of_recordings(recordings, vec!["v5".parse()?])?
        }
    };
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
