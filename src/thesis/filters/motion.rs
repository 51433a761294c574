//! Section 8.2.2: the floor filter on a moving robot.

use super::super::{Context, Experiment, Finding};
use super::{ERRORS, error_sum, errors, samples, train};
use svl_core::Result;
use svl_core::filter::FilterKind;
use svl_report::plot::{Axis, Series, SeriesStyle};
use svl_sim::arena::ArenaConfig;
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
    run,
};

/// Number of floors for training.
const FLOORS: usize = 16;

/// A camera with images as sharp as its lens: a flash instead of the shutter.
fn still(mut config: ArenaConfig) -> ArenaConfig {
    config.sensor.shutter_us /= 100;
    config.sensor.white_e_per_ms *= 100.0;
    config
}

/// Twice as fast, with twice the shutter and half the light.
fn moving(mut config: ArenaConfig) -> ArenaConfig {
    config.rate_hz *= 2.0;
    config.robot.sway_hz *= 2.0;
    config.sensor.shutter_us *= 2;
    config.sensor.white_e_per_ms *= 0.5;
    config
}

/// The samples of training and test.
const NAMES: [&str; 4] = [
    "without blur, tested without",
    "without blur, tested moving",
    "with blur, tested moving",
    "with blur on 4 floors, tested moving",
];

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let kind = FilterKind::Floor;
    let seeds = || [1..FLOORS as u64 + 1, 41..49, 51..59];
    let [still, moving] = [still, moving]
        .map(|robot: fn(_) -> _| samples(context, kind, &robot(super::arena(kind)?), seeds(), 3));
    let (still, moving) = (still?, moving?);
    let mut trained = |samples: &WindowSamples, floors, tested: &WindowSamples| {
        let chosen = |samples: &WindowSamples, takes: &dyn Fn(usize) -> bool| {
            let numbers = 0..samples.samples.len();
            samples.select(numbers.filter(|&i| takes(samples.samples[i].group)))
        };
        let is_test = |group: usize| still.parts[group] == SamplePart::Test;
        let learns = |group: usize| !is_test(group) && (group < floors || group >= FLOORS);
        let mut data = chosen(samples, &learns);
        data.append(chosen(tested, &is_test));
        train(context, &mut data, &[kind.spec().hidden], &[1])
    };
    let trainings = [
        trained(&still, FLOORS, &still)?,
        trained(&still, FLOORS, &moving)?,
        trained(&moving, FLOORS, &moving)?,
        trained(&moving, 4, &moving)?,
    ];
    let [resting, robot, mended, little] = trainings.each_ref().map(error_sum);
    finding.condition(robot > 1.5 * resting).says(format!(
        "A network trained without blur has half as many errors more on a moving robot: \
         {resting:.1} % of both kinds together, moving {robot:.1} %."
    ));
    finding.condition(mended < robot).says(format!(
        "Trained with blur it has fewer there: {mended:.1} %."
    ));
    finding.condition(mended < little).says(format!(
        "More data improve it: with 4 of the {FLOORS} floors {little:.1} %."
    ));
    let rows = NAMES.iter().zip(&trainings).map(|(name, training)| {
        let [accepted, rejected] = errors(training);
        let values = [accepted, rejected, training.roc.area];
        (name.to_string(), values)
    });
    finding.table(&format!("trained | {ERRORS} | area of the ROC"), rows);
    let curves = NAMES.iter().zip(&trainings).map(|(name, training)| {
        let points = training.roc.points.iter();
        let points = points.map(|(x, y)| (100.0 * x, 100.0 * y));
        Series::new(name, SeriesStyle::Line, points)
    });
    let x = Axis::new("false acceptance, %").with_range(0.0, 20.0);
    let y = Axis::new("true acceptance, %").with_range(60.0, 100.0);
    finding.chart("Acceptance of the floor", [x, y], curves);
    finding.why = format!(
        "Trained without blur: {resting:.1} % of both errors together at rest, {robot:.1} % \
         moving; trained with blur {mended:.1} %, on 4 of the {FLOORS} floors {little:.1} %."
    );
    Ok(())
}
