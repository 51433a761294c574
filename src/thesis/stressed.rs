//! Remaining right cells of algorithms on perturbed pairs ([`svl_sim::stress`]).

use super::{Context, Finding, stage};
use svl_core::Result;
use svl_core::stereo::Frame;
use svl_report::plot::Axis;
use svl_score::judge::{CellTally, Judge};
use svl_sim::stress::{Stress, StressKind};

/// Every eighth pair of a run through the arena of chapter 7, with exactly aligned cameras, and
/// where what is measured on them goes.
pub(super) struct PerturbedViews<'a, 'c> {
    context: &'a mut Context<'c>,
    finding: &'a mut Finding,
    views: Vec<Frame>,
}

impl<'a, 'c> PerturbedViews<'a, 'c> {
    pub(super) fn new(context: &'a mut Context<'c>, finding: &'a mut Finding) -> Result<Self> {
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
    pub(super) fn kept<const N: usize>(
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
