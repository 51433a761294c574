//! How well the right image, warped to the left one by a disparity, agrees with it.
//!
//! Zero-mean normalized cross-correlation (ZNCC) of windows, which gain and offset do not change:
//! Hirschmüller and Scharstein, "Evaluation of Stereo Matching Costs on Images with Radiometric
//! Differences", TPAMI 31, 2009. The best match against all others: Hu and Mordohai, "A
//! Quantitative Evaluation of Confidence Measures for Stereo Vision", TPAMI 34, 2012, section 3.

use crate::stereo::{Gray, StereoPair};

/// Every so many-th column and row is looked at, from half of that on.
pub(super) const STEP: usize = 4;
/// Windows are 9 x 9.
const RADIUS: usize = 4;
const PIXELS: i64 = 81;
/// Least ZNCC of a match: the texture's variance is then 2.3 times the noise's.
const MATCH: f32 = 0.7;
/// Rivals have disparities from 0 to this part of the width.
const RIVALS: usize = 4;

/// The ZNCCs of a pair's left pixels with all their rivals.
pub(super) struct Correlations<'a> {
    pair: &'a StereoPair,
    columns: usize,
    /// Disparities from 0.
    rivals: usize,
    /// Per pixel looked at, per rival.
    z: Vec<f32>,
}

impl<'a> Correlations<'a> {
    pub(super) fn of(pair: &'a StereoPair) -> Self {
        let (width, height) = pair.size();
        let places = |length: usize| (STEP / 2..length).step_by(STEP);
        let rivals = width / RIVALS + 1;
        let pixels = places(height).flat_map(|y| places(width).map(move |x| (x, y)));
        let z = pixels
            .flat_map(|(x, y)| (0..rivals).map(move |k| zncc(pair, (x, y), k as i64)))
            .collect();
        Self {
            pair,
            columns: places(width).count(),
            rivals,
            z,
        }
    }

    /// Whether the match of a pixel looked at is good.
    pub(super) fn warped(&self, at: (usize, usize), disparity_px: f32) -> bool {
        self.own(at, disparity_px) >= MATCH
    }

    /// Whether no other disparity, farther than 1 px from its own, gives a better match.
    pub(super) fn unrivalled(&self, at: (usize, usize), disparity_px: f32) -> bool {
        let (own, rounded) = (self.own(at, disparity_px), disparity_px.round() as i64);
        let rivals = self.all(at).iter().enumerate();
        let mut rivals = rivals.filter(|(k, _)| (*k as i64 - rounded).abs() > 1);
        own > 0.0 && rivals.all(|(_, &z)| z <= own)
    }

    /// The best ZNCC within 1 px of the disparity.
    fn own(&self, at: (usize, usize), disparity_px: f32) -> f32 {
        let rounded = disparity_px.round() as i64;
        let z = |k: i64| match usize::try_from(k) {
            Ok(k) if k < self.rivals => self.all(at)[k],
            _ => zncc(self.pair, at, k),
        };
        (rounded - 1..=rounded + 1).map(z).fold(0.0, f32::max)
    }

    fn all(&self, (x, y): (usize, usize)) -> &[f32] {
        let pixel = y / STEP * self.columns + x / STEP;
        &self.z[pixel * self.rivals..][..self.rivals]
    }
}

/// Of the windows around the left pixel and the right pixel `k` to the left of it; 0 where a
/// window leaves its image or is flat.
fn zncc(pair: &StereoPair, (x, y): (usize, usize), k: i64) -> f32 {
    let (width, height) = pair.size();
    let right_x = x as i64 - k;
    let inside = |x: i64| x >= RADIUS as i64 && x + (RADIUS as i64) < width as i64;
    if !inside(x as i64) || !inside(right_x) || y < RADIUS || y + RADIUS >= height {
        return 0.0;
    }
    let (mut l, mut r, mut ll, mut rr, mut lr) = (0u32, 0u32, 0u32, 0u32, 0u32);
    for y in y - RADIUS..=y + RADIUS {
        let left = window(pair.left(), x, y);
        let right = window(pair.right(), right_x as usize, y);
        for (&a, &b) in left.iter().zip(right) {
            let (a, b) = (u32::from(a), u32::from(b));
            l += a;
            r += b;
            ll += a * a;
            rr += b * b;
            lr += a * b;
        }
    }
    // Exact: the square of the pixels' number times the covariance.
    let central = |product: u32, a: u32, b: u32| {
        (PIXELS * i64::from(product) - i64::from(a) * i64::from(b)) as f64
    };
    let (ll, rr, lr) = (central(ll, l, l), central(rr, r, r), central(lr, l, r));
    if ll > 0.0 && rr > 0.0 {
        (lr / (ll * rr).sqrt()) as f32
    } else {
        0.0
    }
}

/// A row of the window around `(x, y)`.
fn window(image: &Gray, x: usize, y: usize) -> &[u8] {
    &image.row(y)[x - RADIUS..=x + RADIUS]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::Plane;

    /// Noise; the right image shows it `shift` px to the left, half as bright.
    fn pair(shift: usize) -> StereoPair {
        let mut random = fastrand::Rng::with_seed(5);
        let noise = (0..96 * 24).map(|_| 2 * random.u8(0..120)).collect();
        let left = Plane::from_vec(96, 24, noise).unwrap();
        let right = Plane::from_fn(96, 24, |x, y| left.get((x + shift) % 96, y) / 2 + 20);
        StereoPair::new(left, right.unwrap()).unwrap()
    }

    #[test]
    fn gain_and_offset_change_nothing() {
        let z = |k| zncc(&pair(6), (50, 10), k);
        assert!((z(6) - 1.0).abs() < 1e-6, "{}", z(6));
        assert!(z(9).abs() < 0.5, "{}", z(9));
    }

    #[test]
    fn by_hand() {
        // Left columns 0 and 2 in turn, right ones 0, 0, 2, 2: of nine columns with 4 twos left and
        // 4 or 5 right, 2 or so in common.
        let left = Plane::from_fn(9, 9, |x, _| 2 * (x as u8 % 2)).unwrap();
        let right = Plane::from_fn(9, 9, |x, _| 2 * (x as u8 / 2 % 2)).unwrap();
        let pair = StereoPair::new(left, right).unwrap();
        // Per row: n 9, sums 8 and 8, squares 16 and 16, products 4 · 2 columns = 8.
        let expected = (9.0 * 8.0 - 64.0) / (9.0 * 16.0 - 64.0);
        assert!((zncc(&pair, (4, 4), 0) - expected as f32).abs() < 1e-6);
        assert_eq!(zncc(&pair, (4, 4), 1), 0.0, "leaves the image");
        let flat = Plane::filled(9, 9, 7).unwrap();
        let flat = StereoPair::new(flat.clone(), flat).unwrap();
        assert_eq!(zncc(&flat, (4, 4), 0), 0.0);
    }

    #[test]
    fn only_the_right_disparity_is_supported() {
        let pair = pair(6);
        let z = Correlations::of(&pair);
        let at = (50, 10);
        for (d, supported) in [
            (6.0, true),
            (6.9, true),
            (4.0, false),
            (12.0, false),
            (40.0, false),
        ] {
            assert_eq!(
                (z.warped(at, d), z.unrivalled(at, d)),
                (supported, supported),
                "{d}"
            );
        }
    }

    #[test]
    fn equal_matches_do_not_rival_each_other() {
        let left = Plane::from_fn(96, 24, |x, y| ((x % 8) * 25 + y) as u8).unwrap();
        let right = Plane::from_fn(96, 24, |x, y| ((x + 3) % 8 * 25 + y) as u8).unwrap();
        let pair = StereoPair::new(left, right).unwrap();
        let z = Correlations::of(&pair);
        assert!(z.warped((50, 10), 3.0) && z.warped((50, 10), 11.0));
        assert!(z.unrivalled((50, 10), 3.0));
        assert!(!z.unrivalled((50, 10), 6.0));
    }
}
