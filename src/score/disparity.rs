//! Disparity errors of one map, and which pixels every score is of.

use crate::stereo::{DisparityMap, Plane, Truth, Visibility};

/// How far a disparity map is from the truth, over the pixels whose truth is known and that both
/// cameras see (all known pixels where the occluded ones are unknown).
///
/// Shares are 0..=1. `bad` counts `|d - truth| > t`, strictly, among the *estimated* pixels;
/// `invalid` is the share of truth pixels without an estimate: a missing estimate counts once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DisparityScore {
    /// Scored pixels.
    pub pixels: usize,
    /// Of them, those with an estimate.
    pub estimated: usize,
    bad1: usize,
    bad2: usize,
}

impl DisparityScore {
    /// Compares `map` with `truth`; both are of one size.
    pub fn of(map: &DisparityMap, truth: &Truth) -> Self {
        debug_assert_eq!(map.size(), truth.disparity.size());
        let mut score = Self::default();
        // Not `for`, which is slower over rows in a chain.
        scored_pixels(&truth.disparity, truth.visibility.as_ref()).for_each(
            |(x, y, true_disparity)| {
                let estimate = map.disparity().get(x, y);
                score.pixels += 1;
                if estimate.is_finite() {
                    let error = (estimate - true_disparity).abs();
                    score.estimated += 1;
                    score.bad1 += usize::from(error > 1.0);
                    score.bad2 += usize::from(error > 2.0);
                }
            },
        );
        score
    }

    /// Share of the estimates that are off by more than one pixel; nothing where there is no
    /// estimate.
    pub fn bad1(&self) -> Option<f64> {
        share(self.bad1, self.estimated)
    }

    /// Share of the estimates that are off by more than two pixels; nothing where there is no
    /// estimate.
    pub fn bad2(&self) -> Option<f64> {
        share(self.bad2, self.estimated)
    }

    /// Share of the scored pixels without an estimate; absent where there is no truth.
    pub fn invalid(&self) -> Option<f64> {
        share(self.pixels - self.estimated, self.pixels)
    }
}

/// The pixels whose truth is known, and that both cameras see where `mask` says which, as
/// `(x, y, true disparity)`. The two are of one size.
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
    use crate::stereo::Reason;

    #[test]
    fn hand_computed() {
        let mut map = DisparityMap::new(6, 1).unwrap();
        let mut row = map.rows_mut().next().unwrap();
        // truth 10 everywhere but at 5, where it is unknown; 4 is hidden from the right camera.
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
        let truth = Truth {
            disparity: truth,
            visibility: Some(visibility),
        };
        let score = DisparityScore::of(&map, &truth);
        assert_eq!((score.pixels, score.estimated), (4, 3));
        assert_eq!(
            (score.bad1(), score.bad2(), score.invalid()),
            (Some(2.0 / 3.0), Some(1.0 / 3.0), Some(0.25))
        );
        let all = DisparityScore::of(
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
        let truth = Truth {
            disparity: Plane::filled(2, 1, 3.0).unwrap(),
            visibility: None,
        };
        let score = DisparityScore::of(&DisparityMap::new(2, 1).unwrap(), &truth);
        assert_eq!(
            (score.bad1(), score.bad2(), score.invalid()),
            (None, None, Some(1.0))
        );
    }
}
