//! Patches around corners, and their best candidates in the other image by correlation.

use super::corners::MARGIN;
use crate::stereo::Gray;

/// Cells along a side, and pixels along a side of a cell.
const SIDE: usize = 8;
const CELL: usize = 2;
/// Norm of a patch as a vector, so that the product of two fits 32 bits.
const NORM: f64 = 16_384.0;

/// 16 x 16 pixels around a corner, normalized for brightness and contrast.
pub(super) struct Patch {
    /// The corner, (x, y).
    pub(super) at: (usize, usize),
    cells: [i16; SIDE * SIDE],
}

impl Patch {
    /// `None` for a uniform patch. `at` is at least [`MARGIN`] from the border.
    pub(super) fn new(image: &Gray, at: (usize, usize)) -> Option<Self> {
        const { assert!(SIDE * CELL / 2 <= MARGIN) };
        let (left, top) = (at.0 - SIDE * CELL / 2, at.1 - SIDE * CELL / 2);
        let mut sums = [0.0; SIDE * SIDE];
        for y in 0..SIDE * CELL {
            let row = &image.row(top + y)[left..][..SIDE * CELL];
            for (x, &pixel) in row.iter().enumerate() {
                sums[y / CELL * SIDE + x / CELL] += f64::from(pixel);
            }
        }
        let mean = sums.iter().sum::<f64>() / sums.len() as f64;
        let norm = sums
            .iter()
            .map(|sum| (sum - mean) * (sum - mean))
            .sum::<f64>()
            .sqrt();
        let cells = sums.map(|sum| ((sum - mean) / norm * NORM).round() as i16);
        (norm > 0.0).then_some(Self { at, cells })
    }

    /// Normalized cross-correlation, -1..=1.
    fn correlation(&self, other: &Self) -> f64 {
        let products = self
            .cells
            .iter()
            .zip(&other.cells)
            .map(|(&a, &b)| i32::from(a) * i32::from(b));
        f64::from(products.sum::<i32>()) / (NORM * NORM)
    }
}

/// Distance within which two corners count as the same point, pixels.
const SAME: usize = 4;

/// For each patch the index of its best candidate `among` others, at most `reach` rows away; `None`
/// if its correlation is below `least`, or its `1 − correlation` is not less than `uniqueness`
/// times that of the next best.
pub(super) fn candidates(
    patches: &[Patch],
    among: &[Patch],
    reach: f64,
    least: f64,
    uniqueness: f64,
) -> Vec<Option<usize>> {
    let best = |patch: &Patch| {
        let near = among
            .iter()
            .enumerate()
            .filter(|(_, other)| other.at.1.abs_diff(patch.at.1) as f64 <= reach);
        let scores: Vec<_> = near
            .map(|(i, other)| (i, patch.correlation(other)))
            .collect();
        let &(best, score) = scores.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let at = among[best].at;
        // Corners within a few pixels show the same point, so they do not compete.
        let is_same =
            |i: usize| among[i].at.0.abs_diff(at.0) <= SAME && among[i].at.1.abs_diff(at.1) <= SAME;
        let rival = scores
            .iter()
            .filter(|(i, _)| !is_same(*i))
            .map(|(_, score)| *score)
            .fold(-1.0, f64::max);
        (score >= least && 1.0 - score < uniqueness * (1.0 - rival)).then_some(best)
    };
    patches.iter().map(best).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_and_contrast_do_not_matter() {
        let texture = |x: usize, y: usize| (x * x * 3 + y * y * 5 + x * y * 7) % 90;
        let image = Gray::from_fn(24, 24, |x, y| texture(x, y) as u8).unwrap();
        let other = Gray::from_fn(24, 24, |x, y| (2 * texture(x, y) + 40) as u8).unwrap();
        let inverse = Gray::from_fn(24, 24, |x, y| (200 - texture(x, y)) as u8).unwrap();
        let patch = |image: &Gray| Patch::new(image, (12, 12)).unwrap();
        assert!(patch(&image).correlation(&patch(&other)) > 0.999);
        assert!(patch(&image).correlation(&patch(&inverse)) < -0.999);
        assert!(Patch::new(&Gray::filled(24, 24, 7).unwrap(), (12, 12)).is_none());
    }
}
