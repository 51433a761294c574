//! Remaining right cells of algorithms on perturbed pairs ([`svl_sim::stress`]).

use super::{Context, Finding, stage};
use svl_core::Result;
use svl_core::stereo::Frame;
use svl_report::plot::{Axis, Series, SeriesStyle};
use svl_score::judge::{CellTally, Judge};
use svl_sim::stress::Stress;

/// Every eighth pair of a run through the arena of chapter 7, with exactly aligned cameras.
pub(super) fn views() -> Result<Vec<Frame>> {
    let arena = stage::aligned(0.0)?;
    let views = (0..arena.frames()).step_by(8);
    views.map(|view| arena.frame(view)).collect()
}

/// The cells of algorithms at the levels of a perturbation.
pub(super) struct StressCurves<const N: usize> {
    kind: &'static str,
    names: [&'static str; N],
    /// A tally per algorithm at each level; the first level is 0, the original pairs.
    levels: Vec<(f64, [CellTally; N])>,
}

impl<const N: usize> StressCurves<N> {
    /// `algorithms`: with their names.
    pub(super) fn measure(
        context: &mut Context<'_>,
        frames: &[Frame],
        (kind, levels): (&'static str, &[f64]),
        algorithms: [(&'static str, &str); N],
    ) -> Result<Self> {
        let mut curves = Self {
            kind,
            names: algorithms.map(|(name, _)| name),
            levels: Vec::new(),
        };
        for level in std::iter::once(0.0).chain(levels.iter().copied()) {
            let frames = frames.iter().map(|frame| stressed(frame, kind, level));
            let frames = frames.collect::<Result<Vec<_>>>()?;
            let specs = algorithms.map(|(_, spec)| spec);
            let judged = context.judged(frames, &specs, &Judge::default())?;
            let tally = |algorithm: usize| {
                let cells = judged.iter().map(|j| j.estimates[algorithm].cells.iter());
                CellTally::from_judgements(cells.flatten().flatten())
            };
            let tallies = std::array::from_fn(tally);
            curves.levels.push((level, tallies));
        }
        Ok(curves)
    }

    /// Fractions, in per cent, of each algorithm's right cells on the original pairs that it still
    /// has; NaN if it had none.
    pub(super) fn kept(&self, level: usize) -> [f64; N] {
        let right = |level: usize| self.levels[level].1.map(|tally| tally.right as f64);
        let (original, now) = (right(0), right(level));
        std::array::from_fn(|algorithm| 100.0 * now[algorithm] / original[algorithm])
    }

    /// Adds a table and a plot.
    pub(super) fn show(&self, finding: &mut Finding, title: &str, unit: &str) {
        let (mut rows, mut curves) = (Vec::new(), Vec::new());
        for (algorithm, name) in self.names.iter().enumerate() {
            let mut curve = Vec::new();
            for (i, (level, tallies)) in self.levels.iter().enumerate() {
                let (tally, kept) = (tallies[algorithm], self.kept(i)[algorithm]);
                let share = |cells: usize| 100.0 * cells as f64 / tally.scored() as f64;
                let [right, wrong, unknown] = [tally.right, tally.wrong, tally.unknown].map(share);
                rows.push((format!("{name}, {level}"), [right, wrong, unknown, kept]));
                curve.push((*level, kept));
            }
            curves.push(Series::new(name, SeriesStyle::Both, curve));
        }
        let heads = "right cells, % | wrong, % | unknown, % | kept of the right ones, %";
        finding.table(&format!("{title}, {unit} | {heads}"), rows);
        let x = Axis::new(format!("{}, {unit}", self.kind));
        finding.chart(title, [x, Axis::new("kept of the right cells, %")], curves);
    }
}

/// The frame at a level of a perturbation, 0 for the original.
fn stressed(frame: &Frame, kind: &str, level: f64) -> Result<Frame> {
    let mut frame = frame.clone();
    if level > 0.0 {
        let stress: Stress = format!("{kind}={level}").parse()?;
        frame.pair = stress.apply(frame.pair, 1, frame.sequence)?;
    }
    Ok(frame)
}
