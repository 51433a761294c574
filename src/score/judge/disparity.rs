//! Disparity errors of one map, and the pixels that are scored.

use svl_core::stereo::{DisparityMap, Plane, Truth, Visibility};

/// Errors of a disparity map over the pixels whose truth is known and that both cameras see (all
/// known pixels if occlusions are unknown).
///
/// Fractions are 0..=1. `bad` counts `|d - truth| > t`, strictly, among the *estimated* pixels;
/// `invalid` is the fraction of truth pixels without an estimate: a missing estimate counts once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DisparityScore {
    /// Scored pixels.
    pub pixels: usize,
    /// Scored pixels with an estimate.
    pub estimated: usize,
    bad1: usize,
    bad2: usize,
}

impl DisparityScore {
    /// Compares `map` with `truth`; both are of one size.
    pub fn new(map: &DisparityMap, truth: &Truth) -> Self {
        debug_assert_eq!(map.size(), truth.disparity.size());
        let mask = truth.visibility.as_ref();
        let mut score = Self::default();
        for (y, truth) in truth.disparity.rows().enumerate() {
            let visible = mask.map(|mask| mask.row(y));
            score.add_row(map.disparity().row(y), truth, visible);
        }
        score
    }

    /// Counts a row without a branch per pixel, so that the compiler can vectorize: otherwise a
    /// replay of recordings with truth spends a fifth of its time here.
    fn add_row(&mut self, estimates: &[f32], truth: &[f32], visible: Option<&[Visibility]>) {
        let mut counts = [0u32; 4];
        let mut count = |estimate: f32, truth: f32, is_visible: bool| {
            let known = truth.is_finite() & is_visible;
            let estimated = known & estimate.is_finite();
            let error = (estimate - truth).abs();
            counts[0] += u32::from(known);
            counts[1] += u32::from(estimated);
            counts[2] += u32::from(estimated & (error > 1.0));
            counts[3] += u32::from(estimated & (error > 2.0));
        };
        let pixels = estimates.iter().zip(truth);
        match visible {
            Some(visible) => pixels
                .zip(visible)
                .for_each(|((&estimate, &truth), &seen)| {
                    count(estimate, truth, seen == Visibility::Visible);
                }),
            None => pixels.for_each(|(&estimate, &truth)| count(estimate, truth, true)),
        }
        let [pixels, estimated, bad1, bad2] = counts.map(|count| count as usize);
        self.pixels += pixels;
        self.estimated += estimated;
        self.bad1 += bad1;
        self.bad2 += bad2;
    }

    /// Fraction of the estimates that are off by more than one pixel; `None` without estimates.
    pub fn bad1(&self) -> Option<f64> {
        share(self.bad1, self.estimated)
    }

    /// Fraction of the estimates that are off by more than two pixels; `None` without estimates.
    pub fn bad2(&self) -> Option<f64> {
        share(self.bad2, self.estimated)
    }

    /// Fraction of the scored pixels that are off by more than two pixels or have no estimate;
    /// `None` without truth.
    pub fn total_bad2(&self) -> Option<f64> {
        share(self.bad2 + self.pixels - self.estimated, self.pixels)
    }

    /// Fraction of the scored pixels without an estimate; `None` without truth.
    pub fn invalid(&self) -> Option<f64> {
        share(self.pixels - self.estimated, self.pixels)
    }
}

/// The pixels whose truth is known and, if `mask` is given, that both cameras see, as `(x, y, true
/// disparity)`. The two have the same size.
pub(super) fn scored_pixels<'a>(
    truth: &'a Plane<f32>,
    mask: Option<&'a Plane<Visibility>>,
) -> impl Iterator<Item = (usize, usize, f32)> + 'a {
    truth.rows().enumerate().flat_map(move |(y, row)| {
        let visible = mask.map(|mask| mask.row(y));
        let pixels = row.iter().enumerate().map(move |(x, &truth)| (x, y, truth));
        pixels.filter(move |&(x, _, d)| {
            d.is_finite() && visible.is_none_or(|v| v[x] == Visibility::Visible)
        })
    })
}

fn share(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::Reason;

    #[test]
    fn hand_computed() {
        let mut map = DisparityMap::new(6, 1).unwrap();
        let mut row = map.rows_mut().next().unwrap();
        // truth 10 everywhere but at 5, where it is unknown; 4 is occluded in the right camera.
        row.accept(0, 11.0); // off by exactly 1: good
        row.accept(1, 11.5); // bad1
        row.accept(2, 13.0); // bad1, bad2
        row.reject(3, Reason::Untextured); // invalid
        row.accept(4, 50.0);
        row.accept(5, 50.0);
        let mut truth = Plane::filled(6, 1, 10.0).unwrap();
        truth.set(5, 0, f32::INFINITY);
        let mut visibility = Plane::filled(6, 1, Visibility::Visible).unwrap();
        visibility.set(4, 0, Visibility::Occluded);
        let truth = Truth::exact(truth, Some(visibility));
        let score = DisparityScore::new(&map, &truth);
        assert_eq!((score.pixels, score.estimated), (4, 3));
        assert_eq!(
            (score.bad1(), score.bad2(), score.invalid()),
            (Some(2.0 / 3.0), Some(1.0 / 3.0), Some(0.25))
        );
        assert_eq!(score.total_bad2(), Some(0.5));
        let all = DisparityScore::new(
            &map,
            &Truth {
                visibility: None,
                ..truth
            },
        );
        assert_eq!((all.pixels, all.bad2()), (5, Some(0.5)));
    }

    #[test]
    fn nothing_estimated_is_not_zero_error() {
        let truth = Truth::exact(Plane::filled(2, 1, 3.0).unwrap(), None);
        let score = DisparityScore::new(&DisparityMap::new(2, 1).unwrap(), &truth);
        assert_eq!(
            (score.bad1(), score.bad2(), score.invalid()),
            (None, None, Some(1.0))
        );
    }
}
