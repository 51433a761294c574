//! Section 8.2.2: the floor filter on a moving robot.

use super::super::{Context, Experiment, Finding, TableValue};
use super::{errors, samples, train};
use svl_core::Result;
use svl_core::filter::FilterKind;
use svl_report::plot::{Axis, Chart, Series, SeriesStyle};
use svl_sim::arena::ArenaConfig;
use svl_train::FilterTraining;
use svl_train::fit::filter::{SamplePart, WindowSamples};

pub(crate) const EXPERIMENT: Experiment = Experiment {
    figures: &["8.2.2"],
    place: "Figure 8.2.2",
    title: "The floor filter on a moving robot",
    claim: "On the robot the filter is less reliable than expected, probably by motion blur; more \
            data would improve it (section 8.2.2).",
    method: "The floor network, trained on views without motion blur, tested on the same and on a \
             robot that goes and sways twice as fast with a shutter of 16 ms; then trained with \
             blur, and on fewer floors. Tests are on patterns that nothing was trained on.",
    records: false,
    run,
};

/// Number of floors for training.
const FLOORS: usize = 16;

/// A camera with images as sharp as its lens: a flash instead of the shutter.
fn still(config: &ArenaConfig) -> ArenaConfig {
    let mut still = config.clone();
    still.sensor.shutter_us /= 100;
    still.sensor.white_e_per_ms *= 100.0;
    still
}

/// Twice as fast, with twice the shutter and half the light.
fn moving(config: &ArenaConfig) -> ArenaConfig {
    let mut moving = config.clone();
    moving.rate_hz *= 2.0;
    moving.robot.sway_hz *= 2.0;
    moving.sensor.shutter_us *= 2;
    moving.sensor.white_e_per_ms *= 0.5;
    moving
}

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let kind = FilterKind::Floor;
    let config = super::arena(kind)?;
    let runs = [
        (SamplePart::Training, 1..FLOORS as u64 + 1),
        (SamplePart::Validation, 41..49),
        (SamplePart::Test, 51..59),
    ];
    let still = samples(context, kind, &still(&config), &runs, 3)?;
    let moving = samples(context, kind, &moving(&config), &runs, 3)?;
    let mut tried = |name: &str, trained: &WindowSamples, floors, tested: &WindowSamples| {
        let parts = &still.parts;
        let chosen = |samples: &WindowSamples, takes: &dyn Fn(usize) -> bool| {
            let numbers = 0..samples.samples.len();
            samples.select(numbers.filter(|&i| takes(samples.samples[i].group)))
        };
        let is_test = |group: usize| parts[group] == SamplePart::Test;
        let learns = |group: usize| !is_test(group) && (group < floors || group >= FLOORS);
        let mut data = chosen(trained, &learns);
        data.append(chosen(tested, &is_test));
        let (_, training) = train(context, &mut data, &[kind.spec().hidden], &[1])?;
        Ok::<_, svl_core::Error>((name.to_owned(), training))
    };
    let trials = [
        tried("without blur, tested without", &still, FLOORS, &still)?,
        tried("without blur, tested moving", &still, FLOORS, &moving)?,
        tried("with blur, tested moving", &moving, FLOORS, &moving)?,
        tried("with blur on 4 floors, tested moving", &moving, 4, &moving)?,
    ];
    let mut finding = Finding::default();
    let sum = |training: &FilterTraining| errors(training).iter().sum::<f64>();
    let [resting, robot, mended, little] = [0, 1, 2, 3].map(|i| sum(&trials[i].1));
    finding.condition(
        robot > 1.5 * resting,
        format!(
            "A network trained without blur has half as many errors more on a moving robot: \
             {resting:.1} % of both kinds together, moving {robot:.1} %."
        ),
    );
    finding.condition(
        mended < robot,
        format!("Trained with blur it has fewer there: {mended:.1} %."),
    );
    finding.condition(
        mended < little,
        format!("More data improve it: with 4 of the {FLOORS} floors {little:.1} %."),
    );
    add_table(&trials, &mut finding);
    plot(&trials, &mut finding);
    finding.why = format!(
        "Trained without blur: {resting:.1} % of both errors together at rest, {robot:.1} % \
         moving; trained with blur {mended:.1} %, on 4 of the {FLOORS} floors {little:.1} %."
    );
    Ok(finding)
}

fn add_table(trials: &[(String, FilterTraining)], finding: &mut Finding) {
    let heads = [
        "trained",
        "false accepted, %",
        "false rejected, %",
        "area of the ROC",
    ];
    let table = finding.table(heads);
    for (name, training) in trials {
        let [accepted, rejected] = errors(training);
        table.row(
            name,
            [accepted, rejected, training.roc.area].map(TableValue::from),
        );
    }
}

fn plot(trials: &[(String, FilterTraining)], finding: &mut Finding) {
    let curve = |(name, training): &(String, FilterTraining)| {
        let points = training
            .roc
            .points
            .iter()
            .map(|(x, y)| (100.0 * x, 100.0 * y));
        Series::new(name, SeriesStyle::Line, points)
    };
    finding.plot(&Chart {
        title: "Acceptance of the floor".into(),
        x: Axis::new("false acceptance, %").with_range(0.0, 20.0),
        y: Axis::new("true acceptance, %").with_range(60.0, 100.0),
        series: trials.iter().map(curve).collect(),
    });
}
