//! Remaining right cells of algorithms on perturbed pairs ([`svl_sim::stress`]): less light,
//! cameras that expose differently, and misaligned ones (figure 6.2).

use super::{Context, Experiment, Finding, stage};
use svl_core::Result;
use svl_core::stereo::Frame;
use svl_report::plot::Axis;
use svl_score::judge::{CellTally, Judge};
use svl_sim::stress::{Stress, StressKind};

pub(super) const LIGHT: Experiment = Experiment {
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
    run: run_light,
};

const STOPS: [f64; 5] = [0.0, 0.5, 1.0, 2.0, 3.0];
/// Index of two stops, a quarter of the light.
const QUARTER: usize = 3;
/// Standard-deviation threshold for a quarter of the light.
const READJUSTED: &str = "v2:texture_threshold=1";
const EXPOSURE: [f64; 5] = [0.0, 0.1, 0.25, 0.5, 1.0];
/// Index of half the exposure.
const HALF: usize = 4;

fn run_light(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
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

pub(super) const MISALIGNMENT: Experiment = Experiment {
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
    run: run_misaligned,
};

const OFFSETS_PX: [f64; 5] = [0.0, 0.5, 1.0, 2.0, 3.0];
/// Indices of 1 px and 2 px.
const ONE_PX: usize = 2;
const TWO_PX: usize = 3;
const ROLLS_DEG: [f64; 5] = [0.0, 0.25, 0.5, 1.0, 2.0];

fn run_misaligned(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
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

/// Every eighth pair of a run through the arena of chapter 7, with exactly aligned cameras, and
/// where what is measured on them goes.
struct PerturbedViews<'a, 'c> {
    context: &'a mut Context<'c>,
    finding: &'a mut Finding,
    views: Vec<Frame>,
}

impl<'a, 'c> PerturbedViews<'a, 'c> {
    fn new(context: &'a mut Context<'c>, finding: &'a mut Finding) -> Result<Self> {
        let arena = stage::aligned(0.0)?;
        let views = (0..arena.frames()).step_by(8).map(|i| arena.frame(i));
        let views = views.collect::<Result<_>>()?;
        Ok(Self {
            context,
            finding,
            views,
        })
    }

    /// Adds a table and a plot of the cells of algorithms, each with its name, at five levels of a
    /// perturbation, of which the first is 0, the original pairs.
    ///
    /// Returns for each level the fractions, in per cent, of each algorithm's right cells on the
    /// original pairs that it still has; NaN if it had none.
    fn kept<const N: usize>(
        &mut self,
        title: &str,
        kind: &str,
        levels: [f64; 5],
        algorithms: [(&str, &str); N],
    ) -> Result<[[f64; N]; 5]> {
        let specs = algorithms.map(|(_, spec)| spec);
        let mut tallies = [[CellTally::default(); N]; 5];
        for (level, tallies) in levels.iter().zip(&mut tallies) {
            let frames = self.views.iter().map(|frame| stressed(frame, kind, *level));
            let frames = frames.collect::<Result<_>>()?;
            let judged = self.context.judged(frames, &specs, &Judge::default())?;
            for (i, tally) in tallies.iter_mut().enumerate() {
                let cells = judged.iter().map(|judged| judged.estimates[i].cells.iter());
                *tally = CellTally::from_judgements(cells.flatten().flatten());
            }
        }
        let percent = |part: usize, whole: usize| 100.0 * part as f64 / whole as f64;
        let original = tallies[0];
        let kept = |now: [CellTally; N], i: usize| percent(now[i].right, original[i].right);
        let kept = tallies.map(|now| std::array::from_fn(|i| kept(now, i)));
        let mut rows = Vec::new();
        for (i, (name, _)) in algorithms.iter().enumerate() {
            for ((level, tallies), kept) in levels.iter().zip(&tallies).zip(&kept) {
                let tally = tallies[i];
                let counts = [tally.right, tally.wrong, tally.unknown];
                let [right, wrong, unknown] = counts.map(|cells| percent(cells, tally.scored()));
                let values = [right, wrong, unknown, kept[i]];
                rows.push((format!("{name}, {level}"), values));
            }
        }
        let unit = StressKind::find(kind)?.unit;
        let heads = "right cells, % | wrong, % | unknown, % | kept of the right ones, %";
        self.finding
            .table(&format!("{title}, {unit} | {heads}"), rows);
        let x = Axis::new(format!("{kind}, {unit}"));
        let axes = [x, Axis::new("kept of the right cells, %")];
        let names = algorithms.map(|(name, _)| name);
        let value = |i: usize, level: usize| kept[level][i];
        self.finding.curves(title, axes, &names, &levels, value);
        Ok(kept)
    }
}

/// The frame at a level of a perturbation.
fn stressed(frame: &Frame, kind: &str, level: f64) -> Result<Frame> {
    let mut frame = frame.clone();
    if level > 0.0 {
        let stress: Stress = format!("{kind}={level}").parse()?;
        frame.pair = stress.apply(frame.pair, 1, frame.sequence)?;
    }
    Ok(frame)
}
