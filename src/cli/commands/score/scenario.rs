//! The scenario that `svl score` scores.

use super::Args;
use crate::cli::shared::progress::Terminal;
use crate::cli::shared::terminal::print;
use crate::cli::shared::usage;
use anyhow::bail;
use std::path::Path;
use svl::filter::without_filters;
use svl::matcher::Algorithm;
use svl::outputs::{Outputs, write};
use svl::scenario::{Limit, PRIOR, Scenario, distinct_kinds};
use svl::train::{scenario_filters, with_filters};
use svl::{counted, runs};

/// The description of the run: the scenario that is named, or one of the recordings that are named,
/// changed by the options.
pub(super) fn described(args: &Args) -> anyhow::Result<Scenario> {
    let mut scenario = runs::named(&args.what)?;
    let mut known = scenario.algorithms.clone();
    if args.check {
        let algorithms = scenario.algorithms.iter();
        let ranges = algorithms.filter_map(Algorithm::max_disparity);
        let max = ranges.max().unwrap_or(80);
        scenario.algorithms = vec![format!("truth:max_disparity={max}").parse()?];
        scenario.gate.clear();
    }
    if !args.algo.is_empty() {
        let swept = args.algo.iter().map(|sweep| sweep.expand(args.sample));
        scenario.algorithms = swept.collect::<svl::Result<Vec<_>>>()?.concat();
    }
    known.extend_from_slice(&scenario.algorithms);
    check_gate(args, &scenario, &known)?;
    if !args.stress.is_empty() {
        distinct_kinds(&args.stress)?;
        scenario.stress.clone_from(&args.stress);
    }
    args.sizes.change(&mut scenario)?;
    if let Some(columns) = &args.columns {
        scenario.columns = columns.clone();
    }
    if let Some(ranges) = &args.ranges {
        scenario.ranges = ranges.clone();
    }
    if args.latency.is_some() || args.robot.is_some() {
        scenario.latency = args.latency.clone().or(scenario.latency);
        scenario.robot = args.robot.or(scenario.robot);
        scenario.check_motion().map_err(usage::wrong)?;
    }
    let filters = args.filters.scenario_filters()?;
    if !filters.is_empty() {
        scenario.filters = filters;
    }
    runs::change(
        std::slice::from_mut(&mut scenario),
        &args.source,
        &args.what[0],
    )?;
    Ok(scenario)
}

/// The algorithm of a limit that is not in the run.
fn unknown_in<'a>(limit: &'a Limit, known: &[Algorithm]) -> Option<&'a String> {
    let is_known = |name: &str| {
        let name = without_filters(name);
        let mut known = known.iter();
        known.any(|algorithm| algorithm.label() == name || algorithm.spec().name == name)
    };
    let relative_to = limit.relative_to.iter().filter(|name| *name != PRIOR);
    let mut names = std::iter::once(&limit.algorithm).chain(relative_to);
    names.find(|name| !is_known(name))
}

/// Refuses limits of algorithms that neither the scenario nor the command line names; without
/// --gate those of svl may be limited all the same.
fn check_gate(args: &Args, scenario: &Scenario, known: &[Algorithm]) -> anyhow::Result<()> {
    for limit in &scenario.gate {
        if let Some(name) = unknown_in(limit, known)
            && (args.gate || without_filters(name).parse::<Algorithm>().is_err())
        {
            let (named, line) = (&args.what[0], limit.line);
            return Err(usage::wrong(format!(
                "{named}: gate in line {line}: '{name}' is neither an algorithm of the scenario \
                 nor named with --algo"
            )));
        }
    }
    Ok(())
}

/// Prints a scenario, or writes it to a file that is not there yet.
pub(super) fn print_description(mut scenario: Scenario, file: Option<&Path>) -> anyhow::Result<()> {
    // A limit of an algorithm that is not run would never be measured.
    let algorithms = &scenario.algorithms;
    let limits = scenario.gate.len();
    let is_run = |limit: &Limit| unknown_in(limit, algorithms).is_none();
    scenario.gate.retain(is_run);
    let left_out = (limits - scenario.gate.len()) as u64;
    if left_out > 0 {
        let limits = counted(left_out, "limit");
        tracing::warn!("{limits} of algorithms that are not run are not printed");
    }
    let Some(file) = file else {
        return print(&scenario.to_toml(Path::new(""))?);
    };
    if file.exists() {
        bail!("{}: exists already; name another file", file.display());
    }
    let text = scenario.to_toml(file.parent().unwrap_or(Path::new("")))?;
    let outputs = Outputs::claim(false, [], [file])?;
    write(file, text)?;
    outputs.commit()?;
    Ok(())
}

/// Adds the algorithms behind the scenario's filters.
pub(super) fn add_filters(scenario: &mut Scenario, args: &Args, quiet: bool) -> anyhow::Result<()> {
    if !args.check {
        let filters = scenario_filters(scenario, &Terminal { quiet })?;
        let algorithms = std::mem::take(&mut scenario.algorithms);
        scenario.algorithms = with_filters(algorithms, &filters);
    }
    Ok(())
}
