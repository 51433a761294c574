//! Fits the scores that earlier reports add ([`TimeTable`]): a logistic regression on the trust in
//! the last report, with the score of the pair alone as given.

use super::PairCells;
use super::cells::FOLDS;
use super::steps::{ABSENT, StepData, StepSide, at, fewest};
use serde::Serialize;
use svl_core::depth::decision::{CellPast, Past, TimeTable, VerdictTable, follows};

/// The pairs of a run, in their order, and its weight.
#[derive(Clone, Debug)]
pub struct CellSequence {
    /// Runs of one group are held out together.
    pub group: usize,
    pub weight: f64,
    pub pairs: Vec<PairCells>,
}

/// A fitted table, with its figures.
#[derive(Clone, Debug)]
pub struct TimeFit {
    pub table: TimeTable,
    pub figures: TimeFigures,
}

/// Figures of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TimeFigures {
    /// Cells with a past and a truth.
    pub cells: usize,
    /// Cells whose report agrees with the last one, is farther, and is nearer.
    pub relations: [usize; 3],
    /// Mean logistic loss of held-out cells without and with earlier reports.
    pub loss_alone: f64,
    pub loss: f64,
}

/// Largest number of steps.
const MAX_STEPS: usize = 12;

/// Runs are also seen with every n-th pair alone: a table of one frame rate does not fit others.
const THINNED: [usize; 2] = [1, 5];

/// Fits the table of time for the decisions of `table`; `least_score` is that of a cell with a
/// past. `None` if no cell has one.
pub fn fit_time(runs: &[CellSequence], table: &VerdictTable, least_score: i64) -> Option<TimeFit> {
    let mut samples = TimeSamples::default();
    for run in runs {
        for step in THINNED {
            samples.add(run, step, table);
        }
    }
    let count = samples.right.len();
    if count == 0 {
        return None;
    }
    let relations = std::array::from_fn(|kind| {
        let own = samples.features.iter();
        own.filter(|features| features[kind] != ABSENT).count()
    });
    // They sum to their number, so that the ridge's influence stays small.
    let scale = count as f64 / samples.weights.iter().sum::<f64>();
    let weights = samples.weights.iter().map(|weight| scale * weight);
    let weights = weights.collect();
    let sides = [StepSide::Rises, StepSide::Falls, StepSide::Falls];
    let data = StepData::new(samples.features, samples.right, weights, sides);
    let data = data.given(samples.scores);
    let all: Vec<_> = (0..count).collect();
    let groups = samples.groups;
    let fold = |i: usize| groups[i] % FOLDS;
    let folds = data.hold_out(&all, MAX_STEPS, FOLDS, &fold, &|| true)?;
    let losses = data.losses(&folds, MAX_STEPS);
    let steps = fewest(&losses);
    let (_, [agrees, farther, nearer]) = data.steps(at(&data.path(&all, steps), steps));
    Some(TimeFit {
        table: TimeTable {
            least_score,
            agrees,
            farther,
            nearer,
        },
        figures: TimeFigures {
            cells: count,
            relations,
            loss_alone: losses[0],
            loss: losses[steps],
        },
    })
}

#[derive(Default)]
struct TimeSamples {
    /// Per relation the trust in the last report, of the others [`ABSENT`].
    features: Vec<[i64; 3]>,
    right: Vec<bool>,
    weights: Vec<f64>,
    /// Log odds by the pair alone.
    scores: Vec<f64>,
    groups: Vec<usize>,
}

impl TimeSamples {
    /// Adds the cells of every `step`-th pair that have a past and a truth.
    fn add(&mut self, run: &CellSequence, step: usize, table: &VerdictTable) {
        let mut states: Vec<CellPast> = Vec::new();
        let mut last_ns = None;
        for pair in run.pairs.iter().step_by(step) {
            let last = last_ns.replace(pair.stamp_ns);
            if !last.is_some_and(|last| follows(last, pair.stamp_ns)) {
                states.clear();
            }
            states.resize(pair.cells.len(), CellPast::default());
            for (cell, state) in pair.cells.iter().zip(&mut states) {
                let (Some(report), Some(evidence)) = (cell.report(), cell.evidence) else {
                    *state = CellPast::default();
                    continue;
                };
                let score = table.score(&evidence);
                let past = state.relation(report, cell.ends);
                let kind = match past {
                    Past::None => None,
                    Past::Agrees => Some(0),
                    // A near report never loses by its past.
                    Past::Farther | Past::Nearer if cell.is_near => None,
                    Past::Farther => Some(1),
                    Past::Nearer => Some(2),
                };
                if let (Some(kind), Some(right)) = (kind, cell.right) {
                    let mut features = [ABSENT; 3];
                    features[kind] = state.trust;
                    self.features.push(features);
                    self.right.push(right);
                    self.weights.push(run.weight);
                    self.scores.push(score as f64 / 1000.0);
                    self.groups.push(run.group);
                }
                *state = state.after(past, report, score, Some(pair.stamp_ns));
            }
        }
    }
}
