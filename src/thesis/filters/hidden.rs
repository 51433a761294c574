//! Figure 8.3: false acceptance and rejection of the floor over the number of hidden neurons.

use super::super::measure::mean_and_median;
use super::super::{Context, Experiment, Finding};
use super::{samples, show, train};
use svl_core::Result;
use svl_core::filter::FilterKind;
use svl_train::fit::filter::SamplePart;

pub(crate) const EXPERIMENT: Experiment = Experiment {
    figures: &["8.3"],
    place: "Figure 8.3",
    title: "Hidden neurons of the floor network",
    claim: "Few hidden neurons are better than many, and 55 is the best choice: it minimizes false \
            acceptance with an acceptable false rejection (section 8.2.1).",
    method: "Patterned floors in the thesis's arena, labelled by the truth. As in the thesis: 500 \
             windows to train on and 250 to test; 250 more decide when to stop. The parts come \
             from runs with different patterns. Each size is trained with three seeds, and their \
             means are drawn, as the thesis suggests.",
    run,
};

const SIZES: [usize; 9] = [10, 25, 45, 55, 75, 100, 200, 500, 1000];

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let kind = FilterKind::Floor;
    let limits = [
        (SamplePart::Training, 250),
        (SamplePart::Validation, 125),
        (SamplePart::Test, 125),
    ];
    let seeds = [1..25, 31..43, 51..63];
    let samples = samples(context, kind, &super::arena(kind)?, seeds, 10)?;
    let training = train(context, &mut samples.limited(&limits), &SIZES, &[1, 2, 3])?;
    let by_hidden = training.by_hidden();
    let mean = |is_few: bool| {
        let sizes = by_hidden.iter();
        let sizes = sizes.filter(|(hidden, _)| (**hidden <= 100) == is_few);
        mean_and_median(sizes.map(|(_, [accepted, rejected])| accepted + rejected))[0]
    };
    let (few, many) = (mean(true), mean(false));
    let [accepted, rejected] = by_hidden[&55];
    let least = by_hidden.values().map(|[accepted, _]| *accepted);
    let least = least.fold(f64::INFINITY, f64::min);
    finding.quantity("false acceptance at 55", "%", "5", accepted);
    finding.quantity("false rejection at 55", "%", "14", rejected);
    finding.condition(few < many).says(format!(
        "Up to 100 neurons have fewer errors than more: {few:.1} and {many:.1} % of both kinds \
         together."
    ));
    finding.condition(accepted <= least + 0.8).says(format!(
        "55 neurons have the least false acceptance, within one window in 125: {accepted:.1} %, \
         at best {least:.1} %."
    ));
    show(finding, "hidden neurons", &training, &["Hidden neurons"]);
    finding.why = format!(
        "With up to 100 neurons {few:.1} % of both errors together, with more {many:.1} %; with \
         55 {accepted:.1} % are falsely accepted and {rejected:.1} % falsely rejected."
    );
    Ok(())
}
