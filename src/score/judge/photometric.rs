//! Photometric agreement of the left image with the right one, warped by a disparity.
//!
//! Zero-mean normalized cross-correlation (ZNCC) of windows, which is invariant to gain and offset:
//! Hirschmüller and Scharstein, "Evaluation of Stereo Matching Costs on Images with Radiometric
//! Differences", TPAMI 31, 2009. The best match against all others: Hu and Mordohai, "A
//! Quantitative Evaluation of Confidence Measures for Stereo Vision", TPAMI 34, 2012, section 3.

use svl_core::stereo::{Gray, StereoPair};

/// Windows are 9 x 9.
const RADIUS: usize = 4;
const SIDE: usize = 2 * RADIUS + 1;
const PIXELS: i64 = 81;
/// Rivals have disparities from 0 to this fraction of the width.
const RIVALS: usize = 4;

/// The ZNCCs of a pair's left pixels with all right pixels that may match them: for every fourth
/// column and row, with every disparity from 0 to a quarter of the width.
pub struct Correlations<'a> {
    pair: &'a StereoPair,
    columns: usize,
    rivals: usize,
    /// Per sampled pixel, per rival.
    z: Vec<f32>,
}

impl<'a> Correlations<'a> {
    /// Interval of the sampled columns and rows, starting at half of it.
    pub const STEP: usize = 4;

    pub fn new(pair: &'a StereoPair) -> Self {
        let (width, height) = pair.size();
        let places = |length: usize| (Self::STEP / 2..length).step_by(Self::STEP);
        let (columns, rivals) = (places(width).count(), width / RIVALS + 1);
        let mut z = vec![0.0; places(height).count() * columns * rivals];
        // An image below two pixels a side has no sample.
        let rows = z.chunks_mut((columns * rivals).max(1)).zip(places(height));
        let mut products = vec![0; width];
        for (z, y) in rows {
            if y < RADIUS || y + RADIUS >= height {
                continue;
            }
            let [left, right] = [pair.left(), pair.right()].map(|image| Windows::new(image, y));
            for k in 0..rivals {
                // Products of the rows, summed per column: the right image is shifted by k.
                products.fill(0u32);
                for y in y - RADIUS..=y + RADIUS {
                    let pixels = pair.left().row(y)[k..].iter().zip(pair.right().row(y));
                    for (sum, (&a, &b)) in products[k..].iter_mut().zip(pixels) {
                        *sum += u32::from(u16::from(a) * u16::from(b));
                    }
                }
                for (x, z) in places(width).zip(z[k..].iter_mut().step_by(rivals)) {
                    if x >= RADIUS + k && x + RADIUS < width {
                        let product = products[x - RADIUS..=x + RADIUS].iter().sum();
                        *z = left.zncc(x, &right, x - k, product);
                    }
                }
            }
        }
        Self {
            pair,
            columns,
            rivals,
            z,
        }
    }

    /// The best ZNCC of a sampled pixel, within 1 px of the rounded disparity; 0 if no window is
    /// complete and textured, or none correlates.
    pub fn best(&self, at: (usize, usize), disparity_px: f32) -> f32 {
        let rounded = disparity_px.round() as i64;
        let z = |k: i64| match usize::try_from(k) {
            Ok(k) if k < self.rivals => self.all(at)[k],
            _ => zncc(self.pair, at, k),
        };
        (rounded - 1..=rounded + 1).map(z).fold(0.0, f32::max)
    }

    /// True if the match of a sampled pixel correlates, and no disparity more than 1 px from its
    /// own gives a better one.
    pub fn unrivalled(&self, at: (usize, usize), disparity_px: f32) -> bool {
        let (own, rounded) = (self.best(at, disparity_px), disparity_px.round() as i64);
        let rivals = self.all(at).iter().enumerate();
        let mut rivals = rivals.filter(|(k, _)| (*k as i64 - rounded).abs() > 1);
        own > 0.0 && rivals.all(|(_, &z)| z <= own)
    }

    fn all(&self, (x, y): (usize, usize)) -> &[f32] {
        let pixel = y / Self::STEP * self.columns + x / Self::STEP;
        &self.z[pixel * self.rivals..][..self.rivals]
    }
}

/// Sums over the windows around the pixels of a row that have a complete one.
struct Windows {
    sums: Vec<i64>,
    /// One over the root of the variance, as scaled by [`central`]; 0 for flat windows.
    norms: Vec<f64>,
}

impl Windows {
    fn new(image: &Gray, y: usize) -> Self {
        let rows = || (y - RADIUS..=y + RADIUS).map(|y| image.row(y));
        let columns: Vec<[u32; 2]> = (0..image.width())
            .map(|x| {
                let pixels = rows().map(|row| u32::from(row[x]));
                pixels.fold([0, 0], |[sum, squares], p| [sum + p, squares + p * p])
            })
            .collect();
        let windows = columns.windows(SIDE);
        let (sums, norms) = windows
            .map(|window| {
                let [sum, squares] = [0, 1].map(|i| window.iter().map(|c| c[i]).sum::<u32>());
                let variance = central(squares, sum.into(), sum.into());
                let norm = if variance > 0.0 {
                    1.0 / variance.sqrt()
                } else {
                    0.0
                };
                (i64::from(sum), norm)
            })
            .unzip();
        Self { sums, norms }
    }

    /// ZNCC of the windows around `x` and the other's `other_x`; `product` is the sum of their
    /// products.
    fn zncc(&self, x: usize, other: &Self, other_x: usize, product: u32) -> f32 {
        let (i, j) = (x - RADIUS, other_x - RADIUS);
        let covariance = central(product, self.sums[i], other.sums[j]);
        (covariance * self.norms[i] * other.norms[j]) as f32
    }
}

/// A covariance times the square of the number of pixels, exact: from the sums of the products and
/// of the pixels.
fn central(products: u32, a: i64, b: i64) -> f64 {
    (PIXELS * i64::from(products) - a * b) as f64
}

/// ZNCC of the windows around the left pixel and the right pixel `k` to the left of it; 0 if a
/// window leaves its image or is flat.
fn zncc(pair: &StereoPair, (x, y): (usize, usize), k: i64) -> f32 {
    let (width, height) = pair.size();
    let inside = |x: i64| x >= RADIUS as i64 && x + (RADIUS as i64) < width as i64;
    let right_x = x as i64 - k;
    if !inside(x as i64) || !inside(right_x) || y < RADIUS || y + RADIUS >= height {
        return 0.0;
    }
    let window = |image: &Gray, x: usize| -> Vec<u32> {
        let rows = (y - RADIUS..=y + RADIUS).map(|y| &image.row(y)[x - RADIUS..=x + RADIUS]);
        rows.flatten().copied().map(u32::from).collect()
    };
    let (left, right) = (
        window(pair.left(), x),
        window(pair.right(), right_x as usize),
    );
    let sum = |values: &[u32]| i64::from(values.iter().sum::<u32>());
    let products = |a: &[u32], b: &[u32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<u32>();
    let (l, r) = (sum(&left), sum(&right));
    let variances = central(products(&left, &left), l, l) * central(products(&right, &right), r, r);
    if variances > 0.0 {
        (central(products(&left, &right), l, r) / variances.sqrt()) as f32
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::Plane;

    /// Noise; the right image is shifted `shift` px to the left, at half the brightness.
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
        // Left columns alternate 0 and 2, right ones 0, 0, 2, 2: of nine columns, 4 twos left and 4
        // or 5 right, about 2 in common.
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
    fn sums_by_columns_are_those_of_each_window() {
        let pair = pair(6);
        let z = Correlations::new(&pair);
        for y in (2..24).step_by(4) {
            for x in (2..96).step_by(4) {
                for (k, &fast) in z.all((x, y)).iter().enumerate() {
                    let slow = zncc(&pair, (x, y), k as i64);
                    assert!((fast - slow).abs() < 1e-6, "{x} {y} {k}: {fast} {slow}");
                }
            }
        }
    }

    #[test]
    fn only_the_right_disparity_is_supported() {
        let pair = pair(6);
        let z = Correlations::new(&pair);
        let at = (50, 10);
        for (d, supported) in [
            (6.0, true),
            (6.9, true),
            (4.0, false),
            (12.0, false),
            (40.0, false),
        ] {
            assert_eq!(
                (z.best(at, d) > 0.9, z.unrivalled(at, d)),
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
        let z = Correlations::new(&pair);
        assert!(z.best((50, 10), 3.0) > 0.99 && z.best((50, 10), 11.0) > 0.99);
        assert!(z.unrivalled((50, 10), 3.0));
        assert!(!z.unrivalled((50, 10), 6.0));
    }
}
