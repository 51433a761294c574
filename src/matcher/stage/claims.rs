//! Left/right check without a second matching: each right pixel believes the cheapest of the left
//! pixels that claim it.
//!
//! As OpenCV's `validateDisparity`, which gives the disparity two pixels to be confirmed by, those
//! around the match.

use crate::matcher::{Parameter, Range};
use crate::stereo::{Reason, RowMut};

/// The check, with the scratch of one thread.
pub struct Claims {
    tolerance_px: f32,
    /// Per pixel of the right image: cost and disparity of the claim it believes.
    claims: Vec<(u16, f32)>,
}

impl Claims {
    /// The tolerance, as the matchers' tables have it.
    pub const TOLERANCE: Parameter = Parameter {
        name: "symmetry_tolerance",
        unit: "px",
        range: Range::Int {
            default: -1,
            min: -1,
            max: 1024,
        },
        description: "farthest that left and right image may disagree, -1 = not checked",
    };

    /// For rows of `width` pixels; nothing when `tolerance` says so.
    pub fn new(width: usize, tolerance: i32) -> Option<Self> {
        (tolerance >= 0).then(|| Self {
            tolerance_px: tolerance as f32,
            claims: vec![(u16::MAX, 0.0); width],
        })
    }

    /// Rejects the pixels of `row` whose match believes another. `cost` gives a valid pixel's cost.
    pub fn check_row(&mut self, cost: impl Fn(usize) -> u16, row: &mut RowMut<'_>) {
        let width = row.width() as i32;
        self.claims.fill((u16::MAX, 0.0));
        for x in 0..row.width() {
            if let Ok(d) = row.at(x) {
                let match_x = x as i32 - (d + 0.5).floor() as i32;
                if (0..width).contains(&match_x) && cost(x) < self.claims[match_x as usize].0 {
                    self.claims[match_x as usize] = (cost(x), d);
                }
            }
        }
        for x in 0..row.width() {
            if let Ok(d) = row.at(x) {
                let denied = |match_x: i32| {
                    (0..width).contains(&match_x) && {
                        let (cost, believed) = self.claims[match_x as usize];
                        cost < u16::MAX && (believed - d).abs() > self.tolerance_px
                    }
                };
                if denied(x as i32 - d.floor() as i32) && denied(x as i32 - d.ceil() as i32) {
                    row.reject(x, Reason::Inconsistent);
                }
            }
        }
    }
}
