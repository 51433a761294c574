//! Chapter 8: the filter networks, on windows of the arena with exact labels.

pub(super) mod hidden;
pub(super) mod motion;
pub(super) mod spectrum;
pub(super) mod training;

use super::{Context, Finding};
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;
use svl_core::filter::{FilterKind, Spectrum};
use svl_core::kernel::isa;
use svl_core::{Error, Result};
use svl_report::plot::Chart;
use svl_score::scenario::{Scenario, ScenarioSource};
use svl_sim::arena::{Arena, ArenaConfig};
use svl_train::fit::filter::{EpochError, FitSettings, SamplePart, WindowLabels, WindowSamples};
use svl_train::{FilterTraining, TrainSettings, train_filter};

/// The arena in which a filter of the scenarios is trained.
fn arena(kind: FilterKind) -> Result<ArenaConfig> {
    let (text, name) = match kind {
        FilterKind::Floor => (include_str!("floor-training.toml"), "floor-training.toml"),
        FilterKind::TooClose => (include_str!("close-training.toml"), "close-training.toml"),
    };
    match Scenario::parse(text, Path::new(name))?.source {
        ScenarioSource::Arena { config, .. } => Ok(*config),
        _ => Err(Error::Invalid(format!("{name}: does not use the arena"))),
    }
}

/// The windows of every n-th frame of runs, whose seeds are those of training, validation and test.
fn samples(
    context: &mut Context<'_>,
    kind: FilterKind,
    config: &ArenaConfig,
    seeds: [Range<u64>; 3],
    every: usize,
) -> Result<WindowSamples> {
    let runs = SamplePart::ALL.into_iter().zip(seeds);
    let runs = runs.flat_map(|(part, seeds)| seeds.map(move |seed| (part, seed)));
    let (parts, seeds): (_, Vec<_>) = runs.unzip();
    let features = kind.spec().features;
    let mut samples = WindowSamples::new(kind, features, parts);
    let mut spectrum = Spectrum::new(features.window);
    let range_px = TrainSettings::RANGE_PX;
    let labels = WindowLabels::Truth { range_px };
    for (group, seed) in seeds.into_iter().enumerate() {
        let arena = Arena::new(config, seed)?;
        let indices: Vec<_> = (0..arena.frames()).step_by(every).collect();
        let frames = indices.into_par_iter().map(|index| arena.frame(index));
        for frame in frames.collect::<Result<Vec<_>>>()? {
            samples.add(&mut spectrum, &frame, group, &labels)?;
            context.step()?;
        }
    }
    Ok(samples)
}

/// Trains networks with those sizes and seeds.
fn train(
    context: &mut Context<'_>,
    samples: &mut WindowSamples,
    hidden: &[usize],
    seeds: &[u64],
) -> Result<FilterTraining> {
    let settings = TrainSettings {
        hidden: hidden.to_vec(),
        seeds: seeds.to_vec(),
        most_epochs: 50,
        range_px: TrainSettings::RANGE_PX,
    };
    let mut step = Ok(());
    let mut after = |_: FitSettings, _: usize, _: EpochError| {
        step = context.step();
        step.is_ok()
    };
    let trained = train_filter(samples, &settings, isa()?, &mut after)?;
    step.map(|()| trained.1)
}

/// Adds a table of the errors by the number of hidden neurons, which `head` names, and some of the
/// plots of a training.
fn show(finding: &mut Finding, head: &str, training: &FilterTraining, titles: &[&str]) {
    let rows = training.by_hidden().into_iter();
    let rows = rows.map(|(hidden, errors)| (hidden.to_string(), errors));
    finding.table(&format!("{head} | {ERRORS}"), rows);
    let charts = training.charts().into_iter();
    for (title, _, chart) in charts.filter(|(title, ..)| titles.contains(title)) {
        let title = title.to_owned();
        finding.plots.push(Chart { title, ..chart }.svg());
    }
}

/// The headings of [`errors`].
const ERRORS: &str = "false accepted, % | false rejected, %";

/// False acceptance and rejection on the test set, per cent.
fn errors(training: &FilterTraining) -> [f64; 2] {
    let errors = training.errors;
    [errors.false_acceptance.rate, errors.false_rejection.rate].map(|rate| 100.0 * rate)
}

/// Both errors together.
fn error_sum(training: &FilterTraining) -> f64 {
    errors(training).iter().sum()
}
