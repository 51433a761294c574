//! Checks of a match that need no second matching (thesis, section 5.3.3, "Validity Test" and "Back checking").

use super::DisparityRange;
use crate::kernel::{Isa, Search, least_ssd};
use crate::stereo::{Reason, RowMut};

/// The self check: a match must be better than the window's best match in its own image.
///
/// The reference of a window is its least SSD with the left image's own windows, up to the farthest disparity to
/// either side and wholly inside. It is high on texture, so the check forgives there what it would not in a flat area.
/// It holds one thread's scratch.
pub struct SelfCheck {
    search: Search,
    windows: Vec<u32>,
    references: Vec<u32>,
}

impl SelfCheck {
    /// For rows of `width` pixels.
    pub fn new(width: usize, range: DisparityRange) -> Self {
        let farthest = range.farthest();
        Self {
            search: Search::new(width, -farthest, farthest, false),
            windows: Vec::with_capacity(width),
            references: Vec::with_capacity(width),
        }
    }

    /// Rejects the matches of `row` whose SSDPI is not below their reference in `left`. A window that has no other
    /// window to resemble passes.
    pub fn check_row(&mut self, isa: Isa, left: &[u8], row: &mut RowMut<'_>) {
        self.windows.clear();
        self.windows.extend((0..row.width()).filter(|&x| row.at(x).is_ok()).map(|x| x as u32));
        least_ssd(isa, &mut self.search, left, left, &self.windows, &mut self.references);
        for (&x, &reference) in self.windows.iter().zip(&self.references) {
            let ssdpi = row.ssdpi(x as usize);
            if ssdpi >= reference {
                row.reject(x as usize, Reason::SelfCheck, ssdpi);
            }
        }
    }
}

/// The back check: with view axes that cross, a negative disparity lies behind the crossing and becomes 0, the farthest
/// that can be measured.
///
/// The thesis says "the maximal disparity", which would be the nearest obstacle and contradicts its own explanation.
pub fn back_check(row: &mut RowMut<'_>) {
    for x in 0..row.width() {
        if row.at(x).is_ok_and(|d| d < 0.0) {
            row.accept(x, 0.0, row.ssdpi(x));
        }
    }
}
