//! v4's matching: each right window proposes its cheapest left window, each left window accepts its
//! cheapest proposal.

use crate::error::Result;
use crate::kernel::{Isa, NO_SUM, Proposal, TableSearch, WindowTable, propose_row, window_sums};
use crate::matcher::stage::{DisparityRange, each_band, each_plane_row};
use crate::matcher::{Parameter, Parameters, Range};
use crate::stereo::{Gray, Plane};

/// Largest differences between a window and its match.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    /// Between the sums of the two windows' pixels.
    pub(super) sum: u32,
    /// Between their rows.
    pub(super) rows: usize,
}

impl Tolerance {
    pub(super) fn from_parameters(parameters: &Parameters) -> Self {
        Self {
            sum: parameters.int(Self::SUM.name).unsigned_abs(),
            rows: parameters.int(Self::ROWS.name).unsigned_abs() as usize,
        }
    }

    pub(super) const SUM: Parameter = Parameter {
        name: "hash_tolerance",
        unit: "grey levels",
        range: Range::int(150, 0..=9 * 255),
        description: "largest difference between the sums of the nine pixels of two windows",
    };
    pub(super) const ROWS: Parameter = Parameter {
        name: "row_tolerance",
        unit: "px",
        range: Range::int(2, 0..=16),
        description: "largest row offset between a window and its match",
    };
}

/// The matching, with its scratch memory.
pub(super) struct Proposals {
    range: DisparityRange,
    tolerance: Tolerance,
    /// Sums of the textured windows.
    sums: Plane<u16>,
    band_rows: usize,
    /// One per band.
    tables: Vec<WindowTable>,
    /// By right pixel.
    proposed: Plane<Proposal>,
    /// By left pixel.
    accepted: Plane<Proposal>,
}

impl Proposals {
    pub(super) fn new(
        (width, height): (usize, usize),
        range: DisparityRange,
        tolerance: Tolerance,
    ) -> Result<Self> {
        // Look-ups differ in number from row to row: more and smaller bands than blocks give.
        let wanted = match rayon::current_num_threads() {
            1 => 1,
            threads => 8 * threads,
        };
        let band_rows = height.div_ceil(wanted);
        Ok(Self {
            range,
            tolerance,
            sums: Plane::filled(width, height, NO_SUM)?,
            band_rows,
            tables: (0..height.div_ceil(band_rows))
                .map(|_| WindowTable::new(width, tolerance.rows))
                .collect::<Result<_>>()?,
            proposed: Plane::filled(width, height, Proposal::NONE)?,
            accepted: Plane::filled(width, height, Proposal::NONE)?,
        })
    }

    /// The proposal that each pixel of the left image accepts. Only textured pixels are matched.
    pub(super) fn resolve(
        &mut self,
        isa: Isa,
        left: &Gray,
        right: &Gray,
        textured: &Plane<bool>,
    ) -> &Plane<Proposal> {
        let ((width, height), reach) = (left.size(), self.tolerance.rows);
        each_plane_row(&mut self.sums, 16, |y, sums| {
            window_sums(left.row(y), textured.row(y), sums);
        });

        // Created by `Plane::filled`, so its rows have no gaps.
        let rows = self.proposed.as_mut_slice().expect("gapless");
        let band_rows = self.band_rows;
        each_band(
            rows,
            band_rows * width,
            &mut self.tables,
            |band, rows, table| {
                for (y, row) in (band * band_rows..).zip(rows.chunks_exact_mut(width)) {
                    table.fill(left, &self.sums, y, reach);
                    let search = TableSearch {
                        table,
                        min_disparity: self.range.min(),
                        max_disparity: self.range.max(),
                        sum_tolerance: self.tolerance.sum,
                    };
                    propose_row(isa, &search, right.row(y), row);
                }
            },
        );

        // Gathered by left row, so that no two threads write the same one.
        each_plane_row(&mut self.accepted, 16, |y, accepted| {
            accepted.fill(Proposal::NONE);
            for row in y.saturating_sub(reach)..height.min(y + reach + 1) {
                let row_offset = (row as i32 - y as i32) as i8;
                let proposals = self.proposed.row(row).iter().enumerate();
                for (u, &proposal) in proposals.filter(|(_, p)| p.row_offset == row_offset) {
                    // `Proposal::NONE` names column u itself and costs too much.
                    let x = (u as i32 + i32::from(proposal.disparity)) as usize;
                    // Strictly: among equal costs the first in raster order of the right image
                    // wins.
                    if proposal.cost() < accepted[x].cost() {
                        accepted[x] = proposal;
                    }
                }
            }
        });
        &self.accepted
    }
}
