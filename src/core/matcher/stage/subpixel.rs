//! Sub-pixel refinement by a parabola. The thesis works in whole pixels, so matchers have it off by
//! default.

use super::ssd::{DisparityRange, ssd};
use crate::matcher::{Parameter, Range};
use crate::stereo::RowMut;

/// Whether matches are refined, as the matchers' tables have it.
pub const SUBPIXEL: Parameter = Parameter {
    name: "subpixel",
    unit: "",
    range: Range::Flag { default: false },
    description: "refine to fractions of a pixel, by a parabola through the SSDs at the winner \
                  and beside it",
};

/// Moves the disparity `d` of each valid pixel of `row` to the lowest point of the parabola through
/// the SSDs at d − 1, d and d + 1: by `(p − n) / 2(p − 2m + n)`, at most half a pixel.
///
/// The SSDs are unweighted: the weight of the cost favours low disparities and would pull the
/// parabola that way. A disparity stays whole where one beside it is not admissible (an end of the
/// range, or the window would leave the right image), or where one beside it has the lower SSD and
/// won less only by its weight, or where all three are equal.
///
/// `right` is the row of the right image that the match of pixel x lies in.
pub fn refine<'a>(
    range: DisparityRange,
    left: &[u8],
    right: impl Fn(usize) -> &'a [u8],
    row: &mut RowMut<'_>,
) {
    for x in range.columns(row.width()) {
        let Ok(d) = row.at(x) else { continue };
        let (d, admissible) = (d as i32, range.admissible(x, left.len()));
        if admissible.contains(&(d - 1)) && admissible.contains(&(d + 1)) {
            let ssd = |d: i32| ssd(left, x, right(x), (x as i32 - d) as usize) as i32;
            let (previous, middle, next) = (ssd(d - 1), ssd(d), ssd(d + 1));
            let curvature = previous - 2 * middle + next;
            // A neighbour with a lower SSD lost by its weight alone: no minimum lies here.
            if middle <= previous.min(next) && curvature > 0 {
                let offset = (previous - next) as f32 / (2 * curvature) as f32;
                row.accept(x, d as f32 + offset);
            }
        }
    }
}
