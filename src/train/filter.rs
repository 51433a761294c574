//! Training of a filter from labelled windows, with its figures.

use super::{FilterTraining, HiddenTrial};
use crate::fit::filter::{
    EpochError, FitSettings, FittedNetwork, RocCurve, SamplePart, Standard, WindowErrors,
    WindowSamples, fit_network,
};
use svl_core::filter::{FilterKind, FilterModel, Network};
use svl_core::kernel::Isa;
use svl_core::{Error, Result};

/// Version of the training: raised when equal samples and settings give other weights, so that
/// filters in the cache are trained again.
pub const REVISION: u32 = 1;

/// Options of a training.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainSettings {
    /// Numbers of hidden neurons to try; the one with the least validation error is kept.
    pub hidden: Vec<usize>,
    /// Seeds of each.
    pub seeds: Vec<u64>,
    pub most_epochs: usize,
    /// Range of disparities for *too close*, pixels.
    pub range_px: f64,
}

impl TrainSettings {
    /// Default limit of the epochs.
    pub const EPOCHS: usize = 60;

    /// The defaults of a filter.
    pub fn default_of(kind: FilterKind) -> Self {
        Self {
            hidden: vec![kind.spec().hidden],
            seeds: vec![1],
            most_epochs: Self::EPOCHS,
            range_px: Self::RANGE_PX,
        }
    }

    /// The range of disparities by default, pixels.
    pub const RANGE_PX: f64 = 80.0;
}

/// Smallest number of samples of a category in any part.
const MIN_SAMPLES: usize = 20;

/// Callback after every epoch: hidden neurons, seed, epoch, errors; returns true to continue.
pub type EpochProgress<'a> = &'a mut dyn FnMut(FitSettings, usize, EpochError) -> bool;

/// Trains a filter on samples, whose features are standardized in place.
///
/// # Errors
/// [`Error::Invalid`] for too few samples, or of one category.
pub fn train_filter(
    samples: &mut WindowSamples,
    settings: &TrainSettings,
    isa: Isa,
    progress: EpochProgress<'_>,
) -> Result<(FilterModel, FilterTraining)> {
    check(samples)?;
    let data = samples.hash();
    let standard = Standard::apply(samples);
    let tested = |fitted: &FittedNetwork| scored(fitted, samples, SamplePart::Test, isa);
    let mut trials = Vec::new();
    let mut best: Option<(f64, FitSettings, FittedNetwork, Network)> = None;
    'trials: for &hidden in &settings.hidden {
        for &seed in &settings.seeds {
            let fit = FitSettings {
                hidden,
                seed,
                most_epochs: settings.most_epochs,
            };
            let (error, fitted) = fit_with_threshold(samples, fit, isa, progress)?;
            trials.push(HiddenTrial {
                hidden,
                seed,
                validation_error: error,
                errors: WindowErrors::new(&tested(&fitted), 0.0),
            });
            let interrupted = fitted.interrupted;
            if best.as_ref().is_none_or(|(least, ..)| error < *least) {
                let network = fitted.network(&standard)?;
                best = Some((error, fit, fitted, network));
            }
            if interrupted {
                break 'trials;
            }
        }
    }
    let Some((_, fit, fitted, network)) = best else {
        return Err(Error::Invalid(
            "no number of hidden neurons to train".into(),
        ));
    };
    let test = tested(&fitted);
    let training = FilterTraining::new(samples, fit, &fitted, trials, &test, data);
    let range_px = (samples.kind == FilterKind::TooClose).then_some(settings.range_px);
    let model = FilterModel {
        kind: samples.kind,
        features: samples.features,
        network,
        range_px,
        facts: training.facts(),
    };
    Ok((model, training))
}

/// A network with its validation error. Its scores are shifted so that 0 is the threshold of least
/// cost.
fn fit_with_threshold(
    samples: &WindowSamples,
    fit: FitSettings,
    isa: Isa,
    progress: EpochProgress<'_>,
) -> Result<(f64, FittedNetwork)> {
    let mut after = |epoch, errors| progress(fit, epoch, errors);
    let mut fitted = fit_network(samples, fit, isa, &mut after)?;
    let error = fitted.epochs[fitted.best_epoch.max(1) - 1].validation;
    let scored = scored(&fitted, samples, SamplePart::Validation, isa);
    let roc = RocCurve::new(&scored, samples.kind.spec().acceptance_cost);
    fitted.shift(-roc.threshold)?;
    Ok((error, fitted))
}

/// The scores of a part's samples, each with its label.
fn scored(
    fitted: &FittedNetwork,
    samples: &WindowSamples,
    part: SamplePart,
    isa: Isa,
) -> Vec<(f32, bool)> {
    let scores = fitted.scores(samples, part, isa).into_iter();
    scores.zip(samples.labels(part)).collect()
}

fn check(samples: &WindowSamples) -> Result<()> {
    let wrong = |what: String| Err(Error::Invalid(what));
    if samples.parts.len() < 3 {
        return wrong(format!(
            "{} cannot be split into training, validation and test, which never share one; use \
             three or more",
            svl_core::counted(samples.parts.len() as u64, "recording")
        ));
    }
    let counts = samples.counts();
    for part in SamplePart::ALL {
        let name = part.name();
        for (count, category) in counts[name].into_iter().zip(samples.kind.spec().categories) {
            if count < MIN_SAMPLES {
                return wrong(format!(
                    "{} labelled '{category}' in the {name} set: at least {MIN_SAMPLES} are \
                     needed; label more, or use more recordings",
                    svl_core::counted(count as u64, "window")
                ));
            }
        }
    }
    Ok(())
}
