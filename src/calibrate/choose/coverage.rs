//! Coverage of the accepted views: image areas and board tilts that are still missing.

use nalgebra::{Point2, Vector2};
use std::fmt::{Display, Formatter};

/// Names of the image areas, row by row.
pub(super) const AREAS: [&str; 9] = [
    "upper left",
    "top",
    "upper right",
    "left",
    "middle",
    "right",
    "lower left",
    "bottom",
    "lower right",
];
/// Fewest corners that cover an area.
const MIN_AREA_CORNERS: u32 = 6;
/// Least tilt of a tilted view, radians.
const MIN_TILT: f64 = 0.2;
/// Fewest tilted views in each direction: they determine the focal length.
const TILTED_VIEWS: u32 = 2;

/// Counts of corners by image area, and of views by tilt.
#[derive(Clone, Debug, Default)]
pub(super) struct ViewCoverage {
    /// Corners by area, in the left and in the right image.
    areas: [[u32; 9]; 2],
    /// Views tilted to the left, right, up, down.
    tilts: [u32; 4],
}

/// Missing coverage: image areas without corners, directions in which no board was tilted.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct MissingCoverage {
    pub left: Vec<&'static str>,
    pub right: Vec<&'static str>,
    pub tilted: Vec<&'static str>,
}

impl ViewCoverage {
    pub(super) fn add(
        &mut self,
        (width, height): (usize, usize),
        corners: [&[Point2<f64>]; 2],
        tilt: Vector2<f64>,
    ) {
        let third =
            |v: f64, side: usize| ((3.0 * (v + 0.5) / side as f64).max(0.0) as usize).min(2);
        for (areas, corners) in self.areas.iter_mut().zip(corners) {
            for corner in corners {
                areas[3 * third(corner.y, height) + third(corner.x, width)] += 1;
            }
        }
        let tilts = [-tilt.x, tilt.x, -tilt.y, tilt.y];
        for (count, tilt) in self.tilts.iter_mut().zip(tilts) {
            *count += u32::from(tilt > MIN_TILT);
        }
    }

    pub(super) fn missing(&self) -> MissingCoverage {
        let below = |names: &[&'static str], counts: &[u32], least: u32| {
            let short = names.iter().zip(counts).filter(|(_, n)| **n < least);
            short.map(|(name, _)| *name).collect()
        };
        MissingCoverage {
            left: below(&AREAS, &self.areas[0], MIN_AREA_CORNERS),
            right: below(&AREAS, &self.areas[1], MIN_AREA_CORNERS),
            tilted: below(&["left", "right", "up", "down"], &self.tilts, TILTED_VIEWS),
        }
    }
}

impl MissingCoverage {
    pub fn is_empty(&self) -> bool {
        self.left.is_empty() && self.right.is_empty() && self.tilted.is_empty()
    }
}

impl Display for MissingCoverage {
    /// `in the left image upper left, top; a board tilted up`; empty if nothing is missing.
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let parts = [
            ("in the left image", &self.left, ", "),
            ("in the right image", &self.right, ", "),
            ("a board tilted", &self.tilted, " and "),
        ];
        let parts = parts.into_iter().filter(|(_, names, _)| !names.is_empty());
        let names = |names: &[&str], and| {
            if names.len() == AREAS.len() {
                "everywhere".into()
            } else {
                names.join(and)
            }
        };
        let parts: Vec<_> = parts
            .map(|(what, which, and)| format!("{what} {}", names(which, and)))
            .collect();
        f.write_str(&parts.join("; "))
    }
}
