//! Figure 6.2: misaligned cameras.

use super::stressed::PerturbedViews;
use super::{Context, Experiment, Finding};
use svl_core::Result;

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["6.2"],
    place: "Figure 6.2",
    title: "Bad rectification",
    claim: "The alignment of the cameras decides the quality of the depth map (section 6.1). \
            Vertical smoothing overcomes a bad rectification in part (5.3.1); v4 needs no \
            rectified images (5.3.4).",
    method: "Every eighth pair of a run through the arena of chapter 7 with exactly aligned \
             cameras, perturbed: the right image moved down, or rotated about its centre. Counted \
             is what an algorithm keeps of its right cells, v3 with its vertical smoothing and \
             without.",
    run,
};

const OFFSETS_PX: [f64; 5] = [0.0, 0.5, 1.0, 2.0, 3.0];
/// Indices of 1 px and 2 px.
const ONE_PX: usize = 2;
const TWO_PX: usize = 3;
const ROLLS_DEG: [f64; 5] = [0.0, 0.25, 0.5, 1.0, 2.0];

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let algorithms = [
        ("v3", "v3"),
        ("v3, no smoothing", "v3:smoothing_sigma=0"),
        ("v4", "v4"),
        ("v5", "v5"),
    ];
    let mut views = PerturbedViews::new(context, finding)?;
    let title = "Right image too low";
    let moved = views.kept(title, "row_offset", OFFSETS_PX, algorithms)?;
    views.kept("Right image rotated", "roll", ROLLS_DEG, algorithms)?;
    let [v3, sharp, v4, v5] = moved[ONE_PX];
    let [v3_at_two, sharp_at_two, v4_at_two, v5_at_two] = moved[TWO_PX];
    finding.condition(v3 < 90.0).says(format!(
        "1 px too low, v3 loses a tenth of its right cells or more: it keeps {v3:.0} %."
    ));
    finding.condition(v3 > sharp).says(format!(
        "1 px too low, v3 keeps more of its right cells with smoothing than without: {v3:.0} % \
         and {sharp:.0} %."
    ));
    finding.condition(v4_at_two > v3_at_two).says(format!(
        "2 px too low, v4 keeps more of its right cells than v3: {v4_at_two:.0} % and \
         {v3_at_two:.0} %."
    ));
    finding.why = format!(
        "With the right image 1 px too low v3 keeps {v3:.0} % of its right cells, {sharp:.0} % \
         without smoothing, v4 {v4:.0} % and v5 {v5:.0} %; 2 px too low {v3_at_two:.0} %, \
         {sharp_at_two:.0} %, {v4_at_two:.0} % and {v5_at_two:.0} %."
    );
    Ok(())
}
