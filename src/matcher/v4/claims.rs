//! v4's matching: right windows claim left ones, each left one keeps its cheapest claim.

use crate::kernel::{Isa, NO_SUM, Proposal, TableSearch, WindowTable, propose_row, window_sums};
use crate::matcher::stage::{DisparityRange, each_band, each_row};
use crate::matcher::{Parameter, Range};
use crate::stereo::{Gray, Plane};

/// How far from its own place a window looks for its match.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    /// Of the sums of two windows' pixels.
    pub(super) sum: u32,
    /// Of their rows.
    pub(super) rows: usize,
}

impl Tolerance {
    pub(super) const SUM: Parameter = Parameter {
        name: "hash_tolerance",
        unit: "grey levels",
        range: Range::Int {
            default: 150,
            min: 0,
            max: 9 * 255,
        },
        description: "farthest that the sums of the nine pixels of two windows may be apart",
    };
    pub(super) const ROWS: Parameter = Parameter {
        name: "row_tolerance",
        unit: "px",
        range: Range::Int {
            default: 2,
            min: 0,
            max: 16,
        },
        description: "farthest that the rows of two windows may be apart",
    };
}

/// The left image's windows and the claims on them.
pub(super) struct Claims {
    range: DisparityRange,
    tolerance: Tolerance,
    /// Of the textured windows.
    sums: Plane<u16>,
    band_rows: usize,
    /// One per band.
    tables: Vec<WindowTable>,
    /// By right pixel.
    claims: Plane<Proposal>,
    /// By left pixel.
    granted: Plane<Proposal>,
}

impl Claims {
    pub(super) fn new(
        (width, height): (usize, usize),
        range: DisparityRange,
        tolerance: Tolerance,
    ) -> crate::Result<Self> {
        // Rows differ in what they have to look up: more and smaller bands than blocks give.
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
            tables: vec![WindowTable::new(width, tolerance.rows); height.div_ceil(band_rows)],
            claims: Plane::filled(width, height, Proposal::NONE)?,
            granted: Plane::filled(width, height, Proposal::NONE)?,
        })
    }

    /// The claim that each pixel of the left image grants. Only textured ones can be claimed.
    pub(super) fn settle(
        &mut self,
        isa: Isa,
        left: &Gray,
        right: &Gray,
        textured: &Plane<bool>,
    ) -> &Plane<Proposal> {
        let Self {
            range,
            tolerance,
            sums,
            band_rows,
            tables,
            claims,
            granted,
        } = self;
        let (width, height) = left.size();
        // Scratch planes are made by `Plane::filled`, so their rows have no gaps.
        each_row(
            sums.as_mut_slice().expect("gapless"),
            width,
            16,
            |y, sums| {
                window_sums(left.row(y), textured.row(y), sums);
            },
        );

        each_band(
            claims.as_mut_slice().expect("gapless"),
            *band_rows * width,
            tables,
            |band, claims, table| {
                for (y, claims) in (band * *band_rows..).zip(claims.chunks_exact_mut(width)) {
                    table.fill(left, sums, y, tolerance.rows);
                    let search = TableSearch {
                        table,
                        min_disparity: range.min(),
                        max_disparity: range.max(),
                        sum_tolerance: tolerance.sum,
                    };
                    propose_row(isa, &search, right.row(y), claims);
                }
            },
        );

        each_row(
            granted.as_mut_slice().expect("gapless"),
            width,
            16,
            |y, granted| {
                granted.fill(Proposal::NONE);
                for row in y.saturating_sub(tolerance.rows)..height.min(y + tolerance.rows + 1) {
                    let row_offset = (row as i32 - y as i32) as i8;
                    let claims = claims.row(row).iter().enumerate();
                    for (u, &claim) in claims.filter(|(_, claim)| claim.row_offset == row_offset) {
                        // A claim that is none names column u itself and costs too much.
                        let granted =
                            &mut granted[(u as i32 + i32::from(claim.disparity)) as usize];
                        if claim.cost() < granted.cost() {
                            *granted = claim;
                        }
                    }
                }
            },
        );
        granted
    }
}
