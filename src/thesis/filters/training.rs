//! Figure 8.2: training and validation error of the too-close network.

use super::super::{Context, Experiment, Finding};
use super::{ERRORS, error_sum, errors, samples, show, train};
use svl_core::Result;
use svl_core::filter::FilterKind;
use svl_train::FilterTraining;
use svl_train::fit::filter::{EpochError, SamplePart};

pub(crate) const EXPERIMENT: Experiment = Experiment {
    figures: &["8.2"],
    place: "Figure 8.2",
    title: "Training of the too-close network",
    claim: "A network with about 100 hidden neurons learns from 100 samples what is too close: \
            training and validation error fall (section 8.1.1).",
    method: "A robot that creeps up to walls, labelled by the truth. As the thesis: 50 windows of \
             each category to train on; 25 more of each decide when to stop. Tested on all windows \
             of other runs, with other pictures. Then trained on all windows of the runs, too.",
    run,
};

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let kind = FilterKind::TooClose;
    let seeds = [1..9, 11..14, 21..24];
    let mut all = samples(context, kind, &super::arena(kind)?, seeds, 2)?;
    let mut few = all.limited(&[(SamplePart::Training, 50), (SamplePart::Validation, 25)]);
    let small = train(context, &mut few, &[25, 100, 400], &[1, 2, 3])?;
    let large = train(context, &mut all, &[100], &[1])?;
    let errors_fall = add_epochs(&small, finding);
    add_best_size(&small, finding);
    let titles = ["Training and validation", "Hidden neurons"];
    show(finding, "hidden neurons, 100 samples", &small, &titles);
    let rows = [("100", &small), ("all", &large)].map(|(name, training)| {
        let [yes, no] = training.samples["training"];
        (format!("{name}: {yes} and {no}"), errors(training))
    });
    finding.table(&format!("samples | {ERRORS}"), rows);
    let [few, all] = [&small, &large].map(error_sum);
    finding.why = format!(
        "With 100 samples the {errors_fall}. On other runs {few:.1} % of both errors together are \
         left; trained on all windows {all:.1} %."
    );
    Ok(())
}

/// Adds the errors of the epochs: of training and validation the first and the least one. Returns
/// words on them.
fn add_epochs(small: &FilterTraining, finding: &mut Finding) -> String {
    let ends = |error: fn(&EpochError) -> f64| {
        let errors = || small.epochs.iter().map(error);
        let first = errors().next().unwrap_or(f64::NAN);
        (first, errors().fold(first, f64::min))
    };
    let (training, least_training) = ends(|e| e.training);
    let (validation, least_validation) = ends(|e| e.validation);
    finding.quantity("training error at the start", "MSE", "0.42", training);
    finding.quantity("least training error", "MSE", "0.01", least_training);
    finding.quantity("validation error at the start", "MSE", "0.275", validation);
    finding.quantity("least validation error", "MSE", "0.245", least_validation);
    let is_learned = least_training < 0.25 * training;
    finding.condition(is_learned).says(format!(
        "The training error falls below a quarter of what it was: {training:.3} to \
         {least_training:.3}."
    ));
    let is_valid = least_validation < validation;
    finding.condition(is_valid).says(format!(
        "The validation error falls: {validation:.3} to {least_validation:.3}."
    ));
    format!(
        "training error falls from {training:.3} to {least_training:.3}, the validation error \
         from {validation:.3} to {least_validation:.3}"
    )
}

/// Adds whether the thesis's number of hidden neurons is a good one.
fn add_best_size(small: &FilterTraining, finding: &mut Finding) {
    let by_hidden = small.by_hidden();
    let sum = |[accepted, rejected]: &[f64; 2]| accepted + rejected;
    let least = by_hidden.values().map(sum).fold(f64::INFINITY, f64::min);
    let hundred = sum(&by_hidden[&100]);
    finding.condition(hundred <= least + 1.0).says(format!(
        "100 hidden neurons are within 1 % of the best size: {hundred:.1} % of both errors \
         together, at best {least:.1} %."
    ));
}
