//! Figure 8.2: training and validation error of the too-close network.

use super::super::{Context, Experiment, Finding, TableValue};
use super::{draw, errors, samples, train};
use svl_core::Result;
use svl_core::filter::FilterKind;
use svl_train::FilterTraining;
use svl_train::fit::filter::SamplePart;

pub(crate) const EXPERIMENT: Experiment = Experiment {
    figures: &["8.2"],
    place: "Figure 8.2",
    title: "Training of the too-close network",
    claim: "A network with about 100 hidden neurons learns from 100 samples what is too close: \
            training and validation error fall (section 8.1.1).",
    method: "A robot that creeps up to walls, labelled by the truth. As the thesis: 50 windows of \
             each category to train on; 25 more of each decide when to stop. Tested on all windows \
             of other runs, with other pictures. Then trained on all windows of the runs, too.",
    records: false,
    run,
};

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let kind = FilterKind::TooClose;
    let runs = [
        (SamplePart::Training, 1..9),
        (SamplePart::Validation, 11..14),
        (SamplePart::Test, 21..24),
    ];
    let mut all = samples(context, kind, &super::arena(kind)?, &runs, 2)?;
    let mut few = all.limited(&[(SamplePart::Training, 50), (SamplePart::Validation, 25)]);
    let (_, small) = train(context, &mut few, &[25, 100, 400], &[1, 2, 3])?;
    let (_, large) = train(context, &mut all, &[100], &[1])?;
    let mut finding = Finding::default();
    let [training, validation] = add_errors(&small, &mut finding);
    add_sizes(&small, &mut finding);
    add_tables(&small, &large, &mut finding);
    finding.why = format!(
        "With 100 samples the training error falls from {:.3} to {:.3}, the validation error from \
         {:.3} to {:.3}. On other runs {:.1} % of both errors together are left; trained on all \
         windows {:.1} %.",
        training.0,
        training.1,
        validation.0,
        validation.1,
        errors(&small).iter().sum::<f64>(),
        errors(&large).iter().sum::<f64>()
    );
    draw(
        &mut finding,
        &small,
        &["Training and validation", "Hidden neurons"],
    );
    Ok(finding)
}

/// Adds the errors of the epochs: of training and validation the first and the least one.
fn add_errors(small: &FilterTraining, finding: &mut Finding) -> [(f64, f64); 2] {
    let ends = |error: fn(&svl_train::fit::filter::EpochError) -> f64| {
        let first = small.epochs.first().map(error).unwrap_or(f64::NAN);
        (first, small.epochs.iter().map(error).fold(first, f64::min))
    };
    let (training, validation) = (ends(|e| e.training), ends(|e| e.validation));
    finding.quantity("training error at the start", "MSE", "0.42", training.0);
    finding.quantity("least training error", "MSE", "0.01", training.1);
    finding.quantity(
        "validation error at the start",
        "MSE",
        "0.275",
        validation.0,
    );
    finding.quantity("least validation error", "MSE", "0.245", validation.1);
    finding.condition(
        training.1 < 0.25 * training.0,
        format!(
            "The training error falls below a quarter of what it was: {:.3} to {:.3}.",
            training.0, training.1
        ),
    );
    finding.condition(
        validation.1 < validation.0,
        format!(
            "The validation error falls: {:.3} to {:.3}.",
            validation.0, validation.1
        ),
    );
    [training, validation]
}

/// Adds whether the thesis's number of hidden neurons is a good one.
fn add_sizes(small: &FilterTraining, finding: &mut Finding) {
    let by_hidden = small.by_hidden();
    let sum = |[accepted, rejected]: &[f64; 2]| accepted + rejected;
    let least = by_hidden.values().map(sum).fold(f64::INFINITY, f64::min);
    let hundred = by_hidden.get(&100).map_or(f64::NAN, sum);
    finding.condition(
        hundred <= least + 1.0,
        format!(
            "100 hidden neurons are within 1 % of the best size: {hundred:.1} % of both errors \
             together, at best {least:.1} %."
        ),
    );
}

/// The errors by the number of hidden neurons, and with 100 and with all samples.
fn add_tables(small: &FilterTraining, large: &FilterTraining, finding: &mut Finding) {
    let table = finding.table([
        "hidden neurons, 100 samples",
        "false accepted, %",
        "false rejected, %",
    ]);
    for (hidden, errors) in &small.by_hidden() {
        table.row(hidden.to_string(), errors.map(TableValue::from));
    }
    let table = finding.table(["samples", "false accepted, %", "false rejected, %"]);
    for (name, training) in [("100", small), ("all", large)] {
        let [yes, no] = training.samples["training"];
        table.row(
            format!("{name}: {yes} and {no}"),
            errors(training).map(TableValue::from),
        );
    }
}
