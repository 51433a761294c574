//! Less light, and cameras that expose differently.

use super::stressed::PerturbedViews;
use super::{Context, Experiment, Finding};
use svl_core::Result;

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["light"],
    place: "Chapter 5",
    title: "Less light, and unequal exposure",
    claim: "The standard deviation of v2's texture filter falls with the light, so that its \
            threshold has to be readjusted (section 5.3.2); v3's filter depends less on the light \
            (5.3.3). Both cameras have to expose for the same time, which the frame grabber \
            ensures (4.2.2).",
    method: "Every eighth pair of a run through the arena of chapter 7 with exactly aligned \
             cameras, perturbed: dark takes light from both cameras, 1 stop halves it, with the \
             noise that less light has; exposure takes it from the right one. v2 has its \
             threshold of 4 grey levels, and one in proportion to a quarter of the light. Counted \
             is what an algorithm keeps of its right cells.",
    run,
};

const STOPS: [f64; 5] = [0.0, 0.5, 1.0, 2.0, 3.0];
/// Index of two stops, a quarter of the light.
const QUARTER: usize = 3;
/// Standard-deviation threshold for a quarter of the light.
const READJUSTED: &str = "v2:texture_threshold=1";
const EXPOSURE: [f64; 5] = [0.0, 0.1, 0.25, 0.5, 1.0];
/// Index of half the exposure.
const HALF: usize = 4;

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let mut views = PerturbedViews::new(context, finding)?;
    let algorithms = [("v2", "v2"), ("v2, readjusted", READJUSTED), ("v3", "v3")];
    let dark = views.kept("Less light", "dark", STOPS, algorithms)?;
    let algorithms = [("v3", "v3"), ("v5", "v5")];
    let unequal = views.kept("Unequal exposure", "exposure", EXPOSURE, algorithms)?;
    let [v2, readjusted, v3] = dark[QUARTER];
    finding.condition(v3 > v2).says(format!(
        "With a quarter of the light v3 keeps more of its right cells than v2: {v3:.0} % and \
         {v2:.0} %."
    ));
    finding.condition(readjusted > v2).says(format!(
        "There v2 keeps more with a threshold of 1 than with one of 4: {readjusted:.0} % and \
         {v2:.0} %."
    ));
    let [half, census] = unequal[HALF];
    finding.condition(half < 90.0).says(format!(
        "Where the right camera exposes half as long, v3 loses a tenth of its right cells or \
         more: it keeps {half:.0} %."
    ));
    finding.why = format!(
        "With a quarter of the light v2 keeps {v2:.0} % of its right cells, {readjusted:.0} % with \
         its threshold readjusted, and v3 {v3:.0} %. Where the right camera exposes half as long, \
         v3 keeps {half:.0} %; v5, which matches by the census, keeps {census:.0} %."
    );
    Ok(())
}
