//! One-pass left-right consistency check, without a second matching: the disparity of a right pixel
//! is that of the cheapest left pixel that matches it.
//!
//! The rule of OpenCV's `validateDisparity`: a disparity between two whole pixels passes if the
//! right pixel on either side confirms it.

use crate::matcher::{Parameter, Range};
use crate::stereo::{Reason, RowMut};

/// The check, with the scratch of one thread.
pub struct OnePassCheck {
    tolerance_px: f32,
    /// Per pixel of the right image: cost and disparity of its cheapest match.
    right: Vec<(u16, f32)>,
}

/// Invalid value: a right pixel that no left pixel matches.
const UNMATCHED: (u16, f32) = (u16::MAX, 0.0);

impl OnePassCheck {
    /// The tolerance, as a parameter of the matchers.
    pub const fn tolerance(default: i32) -> Parameter {
        Parameter {
            name: "symmetry_tolerance",
            unit: "px",
            range: Range::int(default, -1..=1024),
            description: "largest difference between left and right disparity, -1 = no check",
        }
    }

    /// For rows of `width` pixels; `None` if `tolerance` is negative, which turns the check off.
    pub fn new(width: usize, tolerance: i32) -> Option<Self> {
        (tolerance >= 0).then(|| Self {
            tolerance_px: tolerance as f32,
            right: vec![UNMATCHED; width],
        })
    }

    /// Rejects the pixels of `row` whose right pixel has another disparity. `cost` returns the cost
    /// of a valid pixel.
    pub fn check_row(&mut self, cost: impl Fn(usize) -> u16, row: &mut RowMut<'_>) {
        let width = row.width() as i32;
        self.right.fill(UNMATCHED);
        for x in 0..row.width() {
            if let Ok(d) = row.at(x) {
                let match_x = x as i32 - (d + 0.5).floor() as i32;
                // Strictly: among equal costs the left-most pixel wins, as in OpenCV.
                if (0..width).contains(&match_x) && cost(x) < self.right[match_x as usize].0 {
                    self.right[match_x as usize] = (cost(x), d);
                }
            }
        }
        for x in 0..row.width() {
            if let Ok(d) = row.at(x) {
                let denied = |match_x: i32| {
                    (0..width).contains(&match_x) && {
                        let (cost, disparity) = self.right[match_x as usize];
                        cost < u16::MAX && (disparity - d).abs() > self.tolerance_px
                    }
                };
                // Both neighbours of the match must contradict it; for a whole disparity they are
                // one pixel.
                if denied(x as i32 - d.floor() as i32) && denied(x as i32 - d.ceil() as i32) {
                    row.reject(x, Reason::Inconsistent);
                }
            }
        }
    }
}
