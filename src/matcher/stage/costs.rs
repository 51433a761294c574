//! Block matching with a filter on all costs of a window (thesis, sections 5.3.1 and 5.3.2).

use super::filter::CostFilter;
use super::ssd::{DisparityRange, ssd};
use crate::kernel::{Doubt, Isa, Lanes, Match, Search, doubt_rows, match_rows};
use crate::stereo::{DisparityMap, Reason, RowMut};

/// Finds the cheapest match of each pixel and asks a filter whether other disparities come close. It holds one thread's
/// scratch.
pub struct CostSearch<F> {
    filter: F,
    range: DisparityRange,
    /// The part of `range` that is admissible anywhere in the image.
    within: Costs,
    columns: Vec<Lanes<Match>>,
    doubt_columns: Vec<Lanes<Doubt>>,
    matches: Vec<Match>,
    doubts: Vec<Doubt>,
}

/// What a search for the cheapest disparity needs beside the images.
pub(super) struct Costs {
    pub(super) first: i32,
    pub(super) weights: Vec<u32>,
    pub(super) sums: Vec<Lanes<u32>>,
}

impl Costs {
    pub(super) fn new(width: usize, range: DisparityRange) -> Self {
        let disparities = range.within(width);
        Self {
            first: *disparities.start(),
            weights: disparities.clone().map(DisparityRange::weight).collect(),
            sums: disparities.map(|_| Lanes::splat(0)).collect(),
        }
    }
}

impl<F: CostFilter> CostSearch<F> {
    /// For rows of `width` pixels.
    pub fn new(filter: F, width: usize, range: DisparityRange) -> Self {
        Self {
            filter,
            range,
            within: Costs::new(width, range),
            columns: vec![Lanes::splat(Match::NONE); width],
            doubt_columns: vec![Lanes::splat(Doubt::Certain); width],
            matches: vec![Match::NONE; width * Lanes::COUNT],
            doubts: vec![Doubt::Certain; width * Lanes::COUNT],
        }
    }

    /// Matches a block of rows of the left image with the same rows of the right one.
    pub fn search(&mut self, isa: Isa, left: &[Lanes<u16>], right: &[Lanes<u16>]) {
        let Costs { first, weights, sums } = &mut self.within;
        let search = Search { left, right, first: *first, weights };
        self.filter.search(isa, &search, sums, &mut self.columns, &mut self.doubt_columns);
        match_rows(isa, &self.columns, &mut self.matches);
        doubt_rows(isa, &self.doubt_columns, &mut self.doubts);
    }

    /// Fills `row`, the one of that `lane` in the block: *border* where no disparity is admissible, *untextured* where
    /// `textured` says so, *ambiguous* where the filter does, elsewhere the winners.
    pub fn write_row(&self, lane: usize, [left, right]: [&[u8]; 2], textured: &[bool], row: &mut RowMut<'_>) {
        let start = lane * row.width();
        row.clear(Reason::Border);
        for x in self.range.columns(row.width()) {
            let (winner, doubt) = (self.matches[start + x], self.doubts[start + x]);
            if !textured[x] {
                row.reject(x, Reason::Untextured, DisparityMap::NO_SSDPI);
            } else if doubt == Doubt::Ambiguous || doubt == Doubt::Open && self.settle(left, right, x, winner) {
                row.reject(x, Reason::Ambiguous, winner.ssd());
            } else {
                row.accept(x, (self.within.first + winner.index() as i32) as f32, winner.ssd());
            }
        }
    }

    fn settle(&self, left: &[u8], right: &[u8], x: usize, winner: Match) -> bool {
        let least = winner.ssd() * self.within.weights[winner.index() as usize];
        let admissible = self.range.admissible(x, left.len());
        let cost = |d: i32| ssd(left, x, right, (x as i32 - d) as usize) * DisparityRange::weight(d);
        self.filter.settle(least, admissible.map(|d| (d, cost(d))))
    }
}
