//! Figure 8.3: false acceptance and rejection of the floor over the number of hidden neurons.

use super::super::{Context, Experiment, Finding, TableValue};
use super::{draw, samples, train};
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
    records: false,
    run,
};

const SIZES: [usize; 9] = [10, 25, 45, 55, 75, 100, 200, 500, 1000];

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let kind = FilterKind::Floor;
    let runs = [
        (SamplePart::Training, 1..25),
        (SamplePart::Validation, 31..43),
        (SamplePart::Test, 51..63),
    ];
    let mut samples = samples(context, kind, &super::arena(kind)?, &runs, 10)?;
    let limits = [
        (SamplePart::Training, 250),
        (SamplePart::Validation, 125),
        (SamplePart::Test, 125),
    ];
    samples = samples.limited(&limits);
    let (_, training) = train(context, &mut samples, &SIZES, &[1, 2, 3])?;
    let mut finding = Finding::default();
    let by_hidden = training.by_hidden();
    let mean = |sizes: &dyn Fn(usize) -> bool| {
        let chosen = by_hidden.iter().filter(|(hidden, _)| sizes(**hidden));
        let sums: Vec<_> = chosen
            .map(|(_, [accepted, rejected])| accepted + rejected)
            .collect();
        sums.iter().sum::<f64>() / sums.len() as f64
    };
    let (few, many) = (mean(&|hidden| hidden <= 100), mean(&|hidden| hidden > 100));
    let at_55 = by_hidden.get(&55).copied().unwrap_or([f64::NAN; 2]);
    let least = by_hidden
        .values()
        .map(|e| e[0])
        .fold(f64::INFINITY, f64::min);
    finding.quantity("false acceptance at 55", "%", "5", at_55[0]);
    finding.quantity("false rejection at 55", "%", "14", at_55[1]);
    finding.condition(
        few < many,
        format!(
            "Up to 100 neurons have fewer errors than more: {few:.1} and {many:.1} % of both \
             kinds together."
        ),
    );
    finding.condition(
        at_55[0] <= least + 0.8,
        format!(
            "55 neurons have the least false acceptance, within one window in 125: {:.1} %, at \
             best {least:.1} %.",
            at_55[0]
        ),
    );
    let table = finding.table(["hidden neurons", "false accepted, %", "false rejected, %"]);
    for (hidden, errors) in &by_hidden {
        table.row(hidden.to_string(), errors.map(TableValue::from));
    }
    finding.why = format!(
        "With up to 100 neurons {few:.1} % of both errors together, with more {many:.1} %; with 55 \
         {:.1} % are falsely accepted and {:.1} % falsely rejected.",
        at_55[0], at_55[1]
    );
    draw(&mut finding, &training, &["Hidden neurons"]);
    Ok(finding)
}
