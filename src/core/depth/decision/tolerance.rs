//! True disparities for which a reported one is right.

use super::BINS_PER_PX;
use crate::stereo::{CellRule, Rig};
use std::ops::Range;

/// For each bin that could be reported, the bins of true disparities for which it is right.
#[derive(Clone, Debug)]
pub struct Tolerance {
    /// First and last bin, not limited to existing bins.
    ends: Vec<[i32; 2]>,
    /// First bin and one past the last, limited.
    within: Vec<[u32; 2]>,
}

/// Distances beyond the resolution are reported as this disparity, pixels.
const MAX_PX: f64 = 10_000.0;

impl Tolerance {
    /// From a rule, narrowed on both sides by `allowance_px`, for `bins` bins. Without a rig the
    /// rule is that of [`CellRule::for_rig`].
    pub fn new(rule: CellRule, rig: Option<&Rig>, allowance_px: f64, bins: usize) -> Self {
        let ends = (0..bins as i32).map(|bin| Self::ends_of(rule, rig, allowance_px, bin));
        let ends: Vec<_> = ends.collect();
        let limited = |bin: i32| bin.clamp(0, bins as i32) as u32;
        let within = ends
            .iter()
            .map(|[first, last]| [limited(*first), limited(last.saturating_add(1))])
            .collect();
        Self { ends, within }
    }

    /// The first and the last bin for which `bin` is right, as [`Tolerance::ends`].
    pub fn ends_of(rule: CellRule, rig: Option<&Rig>, allowance_px: f64, bin: i32) -> [i32; 2] {
        let rule = rule.for_rig(rig.is_some());
        let infinity_px = rig.map_or(0.0, |rig| -rig.doffs_px());
        if f64::from(bin) / f64::from(BINS_PER_PX) <= infinity_px {
            return by_infinity(infinity_px, rule.far_px(), allowance_px);
        }
        match (rule, rig) {
            (
                CellRule::Distance {
                    tolerance_m,
                    tolerance_percent,
                    ..
                },
                Some(rig),
            ) => by_distance(
                bin,
                rig,
                [tolerance_m, tolerance_percent / 100.0],
                allowance_px,
            ),
            (CellRule::Disparity { tolerance_px }, _) => {
                by_disparity(bin, tolerance_px, allowance_px)
            }
            // `for_rig` returns no distance rule without a rig.
            (CellRule::Distance { .. }, None) => [bin, bin],
        }
    }

    /// Number of bins.
    pub fn bins(&self) -> usize {
        self.ends.len()
    }

    /// The first bin for which `bin` is right, and one past the last.
    pub(super) fn within(&self, bin: usize) -> [usize; 2] {
        self.within[bin].map(|end| end as usize)
    }

    /// The bins from `bin`, and from the first that is right for any of `voted`, to the last.
    pub(super) fn reaching(&self, voted: Range<usize>, bin: usize) -> Range<usize> {
        // The ends rise with the bin, but for those at infinity, which are all that of bin 0.
        let is_below = |[_, end]: &[u32; 2]| *end as usize <= voted.start;
        let first = match self.within.first() {
            Some(first) if !is_below(first) => 0,
            _ => self.within.partition_point(is_below),
        };
        let is_reached = |[start, _]: &[u32; 2]| (*start as usize) < voted.end;
        let end = self.within.partition_point(is_reached);
        first.min(bin)..end.max(bin + 1).min(self.bins())
    }

    /// The first and the last bin for which `bin` is right, including those beyond the range.
    pub fn ends(&self, bin: usize) -> [i32; 2] {
        self.ends[bin]
    }

    /// Number of bins for which `bin` is right, including those beyond the range.
    pub(super) fn span(&self, bin: usize) -> i64 {
        let [first, last] = self.ends[bin].map(i64::from);
        last - first + 1
    }
}

fn by_disparity(v: i32, tolerance_px: f64, allowance_px: f64) -> [i32; 2] {
    let scale = f64::from(BINS_PER_PX);
    let k = ((tolerance_px - allowance_px) * scale + 0.5)
        .floor()
        .max(0.0) as i32;
    [v - k, v + k]
}

/// That of any report at infinity: of all farther ones, too.
fn by_infinity(infinity_px: f64, far_px: f64, allowance_px: f64) -> [i32; 2] {
    let infinity = (infinity_px * f64::from(BINS_PER_PX) + 0.5).floor() as i32;
    let [first, last] = by_disparity(0, far_px, allowance_px);
    [first, infinity + last]
}

fn by_distance(v: i32, rig: &Rig, [metres, share]: [f64; 2], allowance_px: f64) -> [i32; 2] {
    let scale = f64::from(BINS_PER_PX);
    let (fb, doffs) = (rig.focal_px() * rig.baseline_m(), rig.doffs_px());
    let d = (f64::from(v) / scale + doffs).max(0.001);
    let z = fb / d;
    let bin = |px: f64| ((px.min(MAX_PX) - doffs) * scale + 0.5).floor() as i32;
    let farther = ((1.0 - share) * d).min(fb / (z + metres)) + allowance_px;
    let nearest = if z > metres + 0.001 {
        fb / (z - metres).max(0.001)
    } else {
        MAX_PX
    };
    let nearer = ((1.0 + share) * d).max(nearest) - allowance_px;
    [bin(farther).min(v), bin(nearer).max(v)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_intervals() {
        // The arena's rig: f·B = 0.044 · 160 / tan 26°.
        let focal = 160.0 / 26_f64.to_radians().tan();
        let rig = Rig::new(focal, (160.0, 120.0), 0.044, 0.0).unwrap();
        let tolerance = Tolerance::new(CellRule::default(), Some(&rig), 0.25, 16 * 41);
        let ends = [24, 100, 400].map(|v: usize| tolerance.ends[v]);
        assert_eq!(ends, [[21, 27], [82, 118], [299, 610]]);
        // At infinity up to a pixel, and what is beyond; infinity may be at a disparity above 0.
        assert_eq!(tolerance.ends[0], [-6, 6]);
        let crossed = Rig::new(focal, (160.0, 120.0), 0.044, -3.0).unwrap();
        let crossed = Tolerance::new(CellRule::default(), Some(&crossed), 0.25, 64);
        assert_eq!([0, 24].map(|v| crossed.ends[v]), [[-6, 30]; 2]);
        assert_ne!(crossed.ends[25], [-6, 30]);
        let pixels = Tolerance::new(CellRule::default(), None, 0.25, 16);
        assert_eq!(pixels.ends[5], [-9, 19]);
        assert_eq!(pixels.within(5), [0, 16]);
    }
}
