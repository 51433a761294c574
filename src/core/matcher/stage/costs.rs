//! Block matching with a filter on all costs of a window (thesis, sections 5.3.1 and 5.3.2).

use super::RowSearch;
use super::ssd::{DisparityRange, search, ssd};
use crate::kernel::{FilterDecision, Isa, Lanes, Match, SsdSearch, weight};
use crate::stereo::{Reason, RowMut};

/// A filter on the costs of a window, run along with the search for the winner.
pub trait CostFilter: Copy + Send + Sync + 'static {
    /// Finds the matches of rows of two blocks, and the filter's decision on each.
    fn search(
        &self,
        isa: Isa,
        left: &[Lanes<u16>],
        right: &[Lanes<u16>],
        search: &mut SsdSearch,
        matches: &mut [Match],
        doubts: &mut [FilterDecision],
    );

    /// True if a window that [`CostFilter::search`] left open is ambiguous, by its least cost and
    /// all its costs, as pairs with their disparities. Not called for a filter that leaves none
    /// open.
    fn settle(&self, _least: u32, _costs: impl Iterator<Item = (i32, u32)>) -> bool {
        false
    }
}

/// Finds the cheapest match of each pixel and asks a filter if other disparities are nearly as
/// cheap. It holds one thread's scratch.
pub struct CostSearch<F> {
    filter: F,
    range: DisparityRange,
    search: SsdSearch,
    /// Row after row, as the doubts.
    matches: Vec<Match>,
    doubts: Vec<FilterDecision>,
}

impl<F: CostFilter> CostSearch<F> {
    /// For rows of `width` pixels.
    pub fn new(filter: F, width: usize, range: DisparityRange) -> Self {
        Self {
            filter,
            range,
            search: search(width, range),
            matches: vec![Match::NONE; width * Lanes::COUNT],
            doubts: vec![FilterDecision::Certain; width * Lanes::COUNT],
        }
    }

    fn settle(&self, left: &[u8], right: &[u8], x: usize, winner: Match) -> bool {
        // Rare: single precision left it open, so all costs are computed again.
        let least = winner.ssd() * self.search.weight(winner.index());
        let admissible = self.range.admissible(x, left.len());
        let cost = |d: i32| ssd(left, x, right, (x as i32 - d) as usize) * weight(d);
        self.filter.settle(least, admissible.map(|d| (d, cost(d))))
    }
}

impl<F: CostFilter> RowSearch for CostSearch<F> {
    fn search(&mut self, isa: Isa, left: &[Lanes<u16>], right: &[Lanes<u16>], rows: usize) {
        let matches = &mut self.matches[..rows * left.len()];
        let doubts = &mut self.doubts[..rows * left.len()];
        self.filter
            .search(isa, left, right, &mut self.search, matches, doubts);
    }

    /// *Ambiguous* if the filter decides so.
    fn write_row(
        &self,
        _: Isa,
        lane: usize,
        [left, right]: [&[u8]; 2],
        textured: &[bool],
        row: &mut RowMut<'_>,
    ) {
        let start = lane * row.width();
        row.clear(Reason::Border);
        for x in self.range.columns(row.width()) {
            let (winner, doubt) = (self.matches[start + x], self.doubts[start + x]);
            if !textured[x] {
                row.reject(x, Reason::Untextured);
                continue;
            }
            // Kept also for ambiguous pixels: their windows were compared.
            row.set_ssdpi(x, winner.ssd());
            if doubt == FilterDecision::Ambiguous
                || doubt == FilterDecision::Open && self.settle(left, right, x, winner)
            {
                row.reject(x, Reason::Ambiguous);
            } else {
                row.accept(x, (self.search.first() + winner.index() as i32) as f32);
            }
        }
    }
}
