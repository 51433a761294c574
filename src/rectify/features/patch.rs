//! The surroundings of a corner, and which of another image's are like them.

use super::corners::MARGIN;
use crate::stereo::Gray;

/// Cells along a side, and pixels along a side of a cell.
const SIDE: usize = 8;
const CELL: usize = 2;
/// Length of the vector that a patch is, so that products of two fit 32 bits.
const NORM: f64 = 16_384.0;

/// 16 x 16 pixels around a corner, without their brightness and contrast.
pub(super) struct Patch {
    /// Of the corner, (x, y).
    pub(super) at: (usize, usize),
    cells: [i16; SIDE * SIDE],
}

impl Patch {
    /// Nothing where all is equal. `at` lies [`MARGIN`] away from the border.
    pub(super) fn of(image: &Gray, at: (usize, usize)) -> Option<Self> {
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

    /// 1 for equal ones, 0 for those that have nothing in common.
    fn correlation(&self, other: &Self) -> f64 {
        let products = self
            .cells
            .iter()
            .zip(&other.cells)
            .map(|(&a, &b)| i32::from(a) * i32::from(b));
        f64::from(products.sum::<i32>()) / (NORM * NORM)
    }
}

/// Pixels within which two corners are of one thing.
const SAME: usize = 4;

/// For each of the patches the place of the one it is most like `among` others, no farther than
/// `reach` rows away; nothing where that correlates by less than `least`, or what is lost to 1 is
/// not less than `rivalry` of what the next best loses.
pub(super) fn candidates(
    patches: &[Patch],
    among: &[Patch],
    reach: f64,
    least: f64,
    rivalry: f64,
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
        let is_same =
            |i: usize| among[i].at.0.abs_diff(at.0) <= SAME && among[i].at.1.abs_diff(at.1) <= SAME;
        let rival = scores
            .iter()
            .filter(|(i, _)| !is_same(*i))
            .map(|(_, score)| *score)
            .fold(-1.0, f64::max);
        (score >= least && 1.0 - score < rivalry * (1.0 - rival)).then_some(best)
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
        let patch = |image: &Gray| Patch::of(image, (12, 12)).unwrap();
        assert!(patch(&image).correlation(&patch(&other)) > 0.999);
        assert!(patch(&image).correlation(&patch(&inverse)) < -0.999);
        assert!(Patch::of(&Gray::filled(24, 24, 7).unwrap(), (12, 12)).is_none());
    }
}
