//! Chapter 8: the filter networks, on windows of the arena with exact labels.

pub(super) mod hidden;
pub(super) mod motion;
pub(super) mod spectrum;
pub(super) mod training;

use super::{Context, Finding};
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;
use svl_core::filter::{FilterKind, FilterModel, Spectrum};
use svl_core::kernel::isa;
use svl_core::{Error, Result};
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

/// The runs of a part: seeds unique to it.
type Runs = (SamplePart, Range<u64>);

/// The windows of runs, each run a recording, from every n-th frame.
fn samples(
    context: &mut Context<'_>,
    kind: FilterKind,
    config: &ArenaConfig,
    runs: &[Runs],
    every: usize,
) -> Result<WindowSamples> {
    let all = runs.iter().cloned();
    let all: Vec<_> = all
        .flat_map(|(part, seeds)| seeds.map(move |seed| (part, seed)))
        .collect();
    let parts = all.iter().map(|(part, _)| *part).collect();
    let features = kind.spec().features;
    let mut samples = WindowSamples::new(kind, features, parts);
    let mut spectrum = Spectrum::new(features.window);
    let range_px = TrainSettings::RANGE_PX;
    for (group, (_, seed)) in all.into_iter().enumerate() {
        let arena = Arena::new(config, seed)?;
        let indices: Vec<_> = (0..arena.frames()).step_by(every).collect();
        let frames = indices.into_par_iter().map(|index| arena.frame(index));
        for frame in frames.collect::<Result<Vec<_>>>()? {
            samples.add(
                &mut spectrum,
                &frame,
                group,
                &WindowLabels::Truth { range_px },
            )?;
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
) -> Result<(FilterModel, FilterTraining)> {
    let settings = TrainSettings {
        hidden: hidden.to_vec(),
        seeds: seeds.to_vec(),
        most_epochs: 50,
        range_px: TrainSettings::RANGE_PX,
    };
    let mut stopped = false;
    let mut after = |_: FitSettings, _: usize, _: EpochError| {
        stopped |= context.step().is_err();
        !stopped
    };
    let trained = train_filter(samples, &settings, isa()?, &mut after)?;
    if stopped {
        Err(Error::Invalid("stopped".into()))
    } else {
        Ok(trained)
    }
}

/// Draws the plots of a training.
fn draw(finding: &mut Finding, training: &FilterTraining, which: &[&str]) {
    for (title, _, chart) in training.charts() {
        if which.contains(&title) {
            let title = title.to_owned();
            finding.plot(&svl_report::plot::Chart { title, ..chart });
        }
    }
}

/// False acceptance and rejection on the test set, per cent.
fn errors(training: &FilterTraining) -> [f64; 2] {
    let errors = training.errors;
    [errors.false_acceptance.rate, errors.false_rejection.rate].map(|rate| 100.0 * rate)
}
