//! Checks of a match that need no second matching pass (thesis, section 5.3.3, "Validity Test" and
//! "Back checking").

use super::ssd::{farthest_shift, ssd};
use super::{DisparityRange, RowCheck};
use crate::kernel::{CAP, Isa, Lanes, REACH, least_ssd, self_check_row, transpose_back};
use crate::matcher::{Parameter, Range};
use crate::stereo::{DisparityMap, Reason, RowMut};

/// The self check: a match must be better than the window's best match in its own image.
///
/// The reference of a window is its least SSD with the left image's own windows, up to the farthest
/// disparity to either side and wholly inside. It is high on texture, so the check is more tolerant
/// there than in a flat area. It holds one thread's scratch.
pub struct SelfCheck {
    farthest: usize,
    sums: Vec<Lanes<u16>>,
    columns: Vec<Lanes<u16>>,
    references: Vec<u16>,
}

impl SelfCheck {
    /// For rows of `width` pixels.
    pub fn new(width: usize, range: DisparityRange) -> Self {
        let farthest = range.farthest().min(farthest_shift(width)).max(0) as usize;
        Self {
            farthest,
            sums: vec![Lanes::splat(0); farthest],
            columns: vec![Lanes::splat(0); width],
            references: vec![0; width * Lanes::COUNT],
        }
    }

    /// True if some window near `x` differs from the one at `x` by at most `ssdpi`; the nearest are
    /// the likeliest.
    fn resembles(&self, left: &[u8], x: usize, ssdpi: u32) -> bool {
        let inside = REACH..left.len() - REACH;
        // Left of the image the subtraction wraps to a number outside it.
        let around = (1..=self.farthest).flat_map(|o| [x.wrapping_sub(o), x + o]);
        around
            .filter(|u| inside.contains(u))
            .any(|u| ssd(left, x, left, u) <= ssdpi)
    }
}

impl RowCheck for SelfCheck {
    /// Finds the references of a block of rows of the left image.
    fn search(&mut self, isa: Isa, left: &[Lanes<u16>], _: &[Lanes<u16>], _: usize) {
        least_ssd(isa, left, &mut self.sums, &mut self.columns);
        transpose_back(isa, &self.columns, &mut self.references);
    }

    /// Rejects the matches of `row`, lane `lane` of the block, whose SSDPI is not below their
    /// reference. A window that no other window resembles passes.
    fn check_row(&self, isa: Isa, lane: usize, left: &[u8], row: &mut RowMut<'_>) {
        self_check_row(
            isa,
            &self.references[lane * row.width()..][..row.width()],
            row,
        );
        each_capped(row, |x, row| {
            let ssdpi = row.ssdpi()[x];
            if row.at(x).is_ok() && self.resembles(left, x, ssdpi) {
                row.reject(x, Reason::SelfCheck);
            }
        });
    }
}

/// Calls `look_up` with each pixel of `row` whose SSD may be capped; they are few.
fn each_capped(row: &mut RowMut<'_>, mut look_up: impl FnMut(usize, &mut RowMut<'_>)) {
    const CHUNK: usize = 32;
    let capped = |ssd: u32| (u32::from(CAP)..DisparityMap::NO_SSDPI).contains(&ssd);
    for start in (0..row.width()).step_by(CHUNK) {
        let end = row.width().min(start + CHUNK);
        if row.ssdpi()[start..end]
            .iter()
            // Without a branch per pixel: nearly all chunks have no capped pixel.
            .fold(false, |any, &ssd| any | capped(ssd))
        {
            (start..end).for_each(|x| {
                if capped(row.ssdpi()[x]) {
                    look_up(x, row);
                }
            });
        }
    }
}

/// The switch that turns negative disparities into 0, as a parameter of the matchers.
pub const BACK_CHECK: Parameter = Parameter {
    name: "back_check",
    unit: "",
    range: Range::Flag { default: false },
    description: "write negative disparities as 0, the farthest that can be measured",
};

/// The back check: if the optical axes cross, a negative disparity lies behind the crossing and
/// becomes 0, the farthest that can be measured.
///
/// The thesis says "the maximal disparity", which would be the nearest obstacle and contradicts its
/// own explanation.
pub fn back_check(row: &mut RowMut<'_>) {
    for x in 0..row.width() {
        if row.at(x).is_ok_and(|d| d < 0.0) {
            row.accept(x, 0.0);
        }
    }
}
