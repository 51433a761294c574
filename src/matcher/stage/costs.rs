//! Block matching with a filter on all costs of a window (thesis, sections 5.3.1 and 5.3.2).

use super::filter::CostFilter;
use super::ssd::{DisparityRange, search, ssd};
use crate::kernel::{Doubt, Isa, Lanes, Match, SsdSearch, weight};
use crate::stereo::{Reason, RowMut};

/// Finds the cheapest match of each pixel and asks a filter whether other disparities come close.
/// It holds one thread's scratch.
pub struct CostSearch<F> {
    filter: F,
    range: DisparityRange,
    search: SsdSearch,
    /// Rows, one after the other, as the doubts.
    matches: Vec<Match>,
    doubts: Vec<Doubt>,
}

impl<F: CostFilter> CostSearch<F> {
    /// For rows of `width` pixels.
    pub fn new(filter: F, width: usize, range: DisparityRange) -> Self {
        Self {
            filter,
            range,
            search: search(width, range),
            matches: vec![Match::NONE; width * Lanes::COUNT],
            doubts: vec![Doubt::Certain; width * Lanes::COUNT],
        }
    }

    /// Matches the first `rows` of a block of the left image with the same rows of the right one.
    pub fn search(&mut self, isa: Isa, left: &[Lanes<u16>], right: &[Lanes<u16>], rows: usize) {
        let (matches, doubts) = (
            &mut self.matches[..rows * left.len()],
            &mut self.doubts[..rows * left.len()],
        );
        self.filter
            .search(isa, left, right, &mut self.search, matches, doubts);
    }

    /// Fills `row`, the one of that `lane` in the block: *border* where no disparity is admissible,
    /// *untextured* where `textured` says so, *ambiguous* where the filter does, elsewhere the
    /// winners.
    pub fn write_row(
        &self,
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
            row.set_ssdpi(x, winner.ssd());
            if doubt == Doubt::Ambiguous
                || doubt == Doubt::Open && self.settle(left, right, x, winner)
            {
                row.reject(x, Reason::Ambiguous);
            } else {
                row.accept(x, (self.search.first() + winner.index() as i32) as f32);
            }
        }
    }

    fn settle(&self, left: &[u8], right: &[u8], x: usize, winner: Match) -> bool {
        let least = winner.ssd() * self.search.weight(winner.index());
        let admissible = self.range.admissible(x, left.len());
        let cost = |d: i32| ssd(left, x, right, (x as i32 - d) as usize) * weight(d);
        self.filter.settle(least, admissible.map(|d| (d, cost(d))))
    }
}
