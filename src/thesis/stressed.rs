//! Remaining right cells of an algorithm on perturbed pairs ([`svl_sim::stress`]).

use super::{Context, Finding, TableValue};
use svl_core::Result;
use svl_core::stereo::Frame;
use svl_report::plot::{Axis, Chart, Series, SeriesStyle};
use svl_score::judge::{CellTally, Judge};
use svl_sim::arena::{Arena, ArenaConfig};
use svl_sim::stress::Stress;

/// Every eighth pair of a run through the arena of chapter 7, with exactly aligned cameras.
pub(super) fn views() -> Result<Vec<Frame>> {
    let mut config = ArenaConfig::default();
    (config.rig.right_row_offset_px, config.rig.right_roll_deg) = (0.0, 0.0);
    let arena = Arena::new(&config, 1)?;
    let views = (0..arena.frames()).step_by(8);
    views.map(|view| arena.frame(view)).collect()
}

/// The cells of algorithms at the levels of a perturbation.
pub(super) struct StressCurves<'a> {
    kind: &'a str,
    /// The first is 0, the original pairs.
    levels: Vec<f64>,
    /// Per algorithm, with its name, a tally per level.
    algorithms: Vec<(&'a str, Vec<CellTally>)>,
}

impl<'a> StressCurves<'a> {
    /// `algorithms`: with their names.
    pub(super) fn measure(
        context: &mut Context<'_>,
        frames: &[Frame],
        (kind, levels): (&'a str, &[f64]),
        algorithms: &[(&'a str, &str)],
    ) -> Result<Self> {
        let specs: Vec<_> = algorithms.iter().map(|(_, spec)| *spec).collect();
        let levels: Vec<f64> = std::iter::once(0.0).chain(levels.iter().copied()).collect();
        let mut tallies: Vec<_> = algorithms
            .iter()
            .map(|(name, _)| (*name, Vec::new()))
            .collect();
        for &level in &levels {
            let stressed = |frame: &Frame| {
                let pair = match level {
                    0.0 => frame.pair.clone(),
                    _ => {
                        let stress: Stress = format!("{kind}={level}").parse()?;
                        stress.apply(frame.pair.clone(), 1, frame.sequence)?
                    }
                };
                Ok(Frame {
                    pair,
                    ..frame.clone()
                })
            };
            let frames = frames.iter().map(stressed).collect::<Result<Vec<_>>>()?;
            let judged = context.judged(frames, &specs, &Judge::default())?;
            for (i, (_, tallies)) in tallies.iter_mut().enumerate() {
                let cells = judged.iter().filter_map(|judged| {
                    let scored = judged.estimates.get(i)?;
                    scored.cells.as_deref().map(CellTally::from_judgements)
                });
                tallies.push(cells.fold(CellTally::default(), |mut sum, tally| {
                    sum.right += tally.right;
                    sum.wrong += tally.wrong;
                    sum.unknown += tally.unknown;
                    sum
                }));
            }
        }
        Ok(Self {
            kind,
            levels,
            algorithms: tallies,
        })
    }

    /// Fraction, in per cent, of an algorithm's right cells on the original pairs that it still
    /// has; NaN if it had none.
    pub(super) fn kept(&self, algorithm: usize, level: usize) -> f64 {
        let tallies = &self.algorithms[algorithm].1;
        100.0 * tallies[level].right as f64 / tallies[0].right as f64
    }

    /// Adds a table and a plot.
    pub(super) fn show(&self, finding: &mut Finding, title: &str, axis: &str) {
        let table = finding.table([
            &format!("{title}, {axis}"),
            "right cells, %",
            "wrong, %",
            "unknown, %",
            "kept of the right ones, %",
        ]);
        for (i, (name, tallies)) in self.algorithms.iter().enumerate() {
            for (j, (level, tally)) in self.levels.iter().zip(tallies).enumerate() {
                let share = |cells: usize| 100.0 * cells as f64 / tally.scored() as f64;
                let shares = [tally.right, tally.wrong, tally.unknown].map(share);
                let values = shares.into_iter().chain([self.kept(i, j)]);
                table.row(format!("{name}, {level}"), values.map(TableValue::from));
            }
        }
        let curve = |(i, (name, _)): (usize, &(&str, Vec<CellTally>))| {
            let levels = self.levels.iter().enumerate();
            let points = levels.map(|(j, level)| (*level, self.kept(i, j)));
            Series::new(name, SeriesStyle::Both, points)
        };
        finding.plot(&Chart {
            title: title.to_owned(),
            x: Axis::new(format!("{}, {axis}", self.kind)),
            y: Axis::new("kept of the right cells, %"),
            series: self.algorithms.iter().enumerate().map(curve).collect(),
        });
    }
}
