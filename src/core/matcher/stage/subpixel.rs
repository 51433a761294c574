//! Sub-pixel refinement by a parabola. The thesis uses whole pixels, so it is off by default.

use super::ssd::{DisparityRange, ssd};
use crate::matcher::{Parameter, Range};
use crate::stereo::RowMut;

/// The switch for the refinement, as a parameter of the matchers.
pub const SUBPIXEL: Parameter = Parameter {
    name: "subpixel",
    unit: "",
    range: Range::Flag { default: false },
    description: "refine to fractions of a pixel, by a parabola through the SSDs at the winner \
                  and beside it",
};

/// Moves the disparity `d` of each valid pixel of `row` to the minimum of the parabola through the
/// SSDs at d − 1, d and d + 1: by `(p − n) / 2(p − 2m + n)`, at most half a pixel.
///
/// The SSDs are unweighted: the weight of the cost favours low disparities and would pull the
/// parabola that way. A disparity stays whole if a neighbour is not admissible (an end of the
/// range, or the window would leave the right image), if a neighbour has a lower SSD and lost only
/// by its weight, or if all three are equal.
///
/// `right` returns the row of the right image that contains the match of pixel x.
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
            // A neighbour with a lower SSD lost only by its weight: there is no minimum here.
            if middle <= previous.min(next) && curvature > 0 {
                let offset = (previous - next) as f32 / (2 * curvature) as f32;
                row.accept(x, d as f32 + offset);
            }
        }
    }
}
