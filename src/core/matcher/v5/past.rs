//! The states of a run's cells before and after a pair.

use crate::depth::decision::{CellPast, follows};
use crate::matcher::MatchContext;
use crate::stereo::{CellRule, GridShape, Rig};

/// A pair, and what its cells depend on besides.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct PairKey {
    sequence: u64,
    stamp_ns: Option<u64>,
    size: (usize, usize),
    shape: GridShape,
    rule: CellRule,
    rig: Option<Rig>,
}

impl PairKey {
    pub(super) fn new(context: &MatchContext<'_>, size: (usize, usize)) -> Self {
        Self {
            sequence: context.sequence,
            stamp_ns: context.stamp_ns,
            size,
            shape: context.grid.shape(),
            rule: context.cells,
            rig: context.rig,
        }
    }

    /// True if the cells of this pair have those of `last` as their past: its stamp is later by at
    /// most a second, or without stamps its number is the next.
    fn follows(&self, last: &Self) -> bool {
        let is_next = match (last.stamp_ns, self.stamp_ns) {
            (Some(last), Some(now)) => follows(last, now),
            (None, None) => last.sequence.checked_add(1) == Some(self.sequence),
            _ => false,
        };
        let settings = |key: &Self| (key.size, key.shape, key.rule, key.rig);
        is_next && settings(self) == settings(last)
    }
}

/// The states of a run's cells, those of all levels of a cell one after the other.
#[derive(Default)]
pub(super) struct CellPasts {
    last: Option<PairKey>,
    before: Vec<CellPast>,
    after: Vec<CellPast>,
}

impl CellPasts {
    /// That many states before a pair, and those after it, to be set. A pair that is matched once
    /// more has the same states before it.
    pub(super) fn begin(&mut self, pair: PairKey, states: usize) -> (&[CellPast], &mut [CellPast]) {
        let is_again = self.last == Some(pair);
        if !is_again {
            match &self.last {
                Some(last) if pair.follows(last) => {
                    std::mem::swap(&mut self.before, &mut self.after);
                }
                _ => self.before.clear(),
            }
            self.last = Some(pair);
        }
        self.before.resize(states, CellPast::default());
        self.after.clear();
        self.after.resize(states, CellPast::default());
        (&self.before, &mut self.after)
    }
}
