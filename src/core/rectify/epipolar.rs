//! Epipolar geometry of two images from point matches: the fundamental matrix.
//!
//! Normalized eight-point algorithm (Hartley, In defense of the eight-point algorithm, 1997) in
//! RANSAC (Fischler & Bolles 1981) with a fixed seed, so that results are reproducible.

use super::features::PointMatch;
use nalgebra::{Matrix3, SMatrix, SVD, SymmetricEigen, Vector3};

/// Largest number of samples.
const SAMPLES: usize = 500;
/// Fewest inliers that cannot be chance.
const MIN_INLIERS: usize = 16;
/// Probability of having drawn a sample without outliers at which sampling stops.
const CERTAINTY: f64 = 0.999;

/// The matches that agree with the geometry of most of them: those whose Sampson distance is below
/// `tolerance_px`. Empty if they are fewer than 16, or less than half of all matches.
pub(super) fn inliers(matches: &[PointMatch], tolerance_px: f64) -> Vec<PointMatch> {
    if matches.len() < MIN_INLIERS {
        return Vec::new();
    }
    let mut random = Random(0x5EED);
    let agreeing = |f: &Matrix3<f64>| -> Vec<PointMatch> {
        matches
            .iter()
            .filter(|m| sampson_px(f, m) < tolerance_px)
            .copied()
            .collect()
    };
    let mut best: Vec<PointMatch> = Vec::new();
    let mut samples = SAMPLES;
    let mut tried = 0;
    while tried < samples {
        tried += 1;
        let sample: [PointMatch; 8] = std::array::from_fn(|_| matches[random.below(matches.len())]);
        let Some(f) = fundamental(&sample) else {
            continue;
        };
        let count = matches
            .iter()
            .filter(|m| sampson_px(&f, m) < tolerance_px)
            .count();
        // Counting first saves an allocation for most samples.
        if count > best.len() {
            best = agreeing(&f);
            let share = count as f64 / matches.len() as f64;
            let needed = (1.0 - CERTAINTY).ln() / (1.0 - share.powi(8)).max(f64::MIN_POSITIVE).ln();
            // The more inliers, the fewer samples are needed (Fischler & Bolles).
            samples = SAMPLES.min(needed.ceil().max(1.0) as usize);
        }
    }
    // The winning sample fits eight points; refit to all its inliers until they hardly change.
    for _ in 0..3 {
        let Some(f) = fundamental(&best) else {
            return Vec::new();
        };
        best = agreeing(&f);
    }
    if best.len() < MIN_INLIERS || 2 * best.len() < matches.len() {
        best.clear();
    }
    best
}

/// Sampson distance: the distance of a match from the nearest one that satisfies `f`, to first
/// order (Hartley & Zisserman, Multiple View Geometry, section 11.4.3).
fn sampson_px(f: &Matrix3<f64>, PointMatch { left, right }: &PointMatch) -> f64 {
    let (left, right) = (left.to_homogeneous(), right.to_homogeneous());
    let (there, back) = (f * left, f.transpose() * right);
    let slope = there.xy().norm_squared() + back.xy().norm_squared();
    right.dot(&there).abs() / slope.sqrt()
}

/// F in `rightᵀ F left = 0`, for homogeneous pixels; norm 1.
fn fundamental(matches: &[PointMatch]) -> Option<Matrix3<f64>> {
    let left = normalisation(matches.iter().map(|m| m.left.to_homogeneous()))?;
    let right = normalisation(matches.iter().map(|m| m.right.to_homogeneous()))?;
    let mut sums = SMatrix::<f64, 9, 9>::zeros();
    for m in matches {
        let l = left * m.left.to_homogeneous();
        let r = right * m.right.to_homogeneous();
        let row = (r * l.transpose()).transpose();
        let row = SMatrix::<f64, 9, 1>::from_column_slice(row.as_slice());
        sums += row * row.transpose();
    }
    let eigen = SymmetricEigen::try_new(sums, f64::EPSILON, 200)?;
    let least = eigen.eigenvalues.imin();
    let f = Matrix3::from_row_slice(eigen.eigenvectors.column(least).as_slice());
    // Enforce rank 2, so that all epipolar lines meet in the epipole.
    let mut svd = SVD::try_new(f, true, true, f64::EPSILON, 200)?;
    let least = svd.singular_values.imin();
    svd.singular_values[least] = 0.0;
    let f = right.transpose() * svd.recompose().ok()? * left;
    let norm = f.norm();
    (norm.is_finite() && norm > 0.0).then(|| f / norm)
}

/// The similarity that moves the centroid to the origin and scales the mean distance from it to √2.
fn normalisation(points: impl Iterator<Item = Vector3<f64>> + Clone) -> Option<Matrix3<f64>> {
    let count = points.clone().count() as f64;
    let mean = points.clone().sum::<Vector3<f64>>() / count;
    let distance = points.map(|p| (p - mean).norm()).sum::<f64>() / count;
    let scale = std::f64::consts::SQRT_2 / distance;
    let shift = Matrix3::new(
        scale,
        0.0,
        -scale * mean.x,
        0.0,
        scale,
        -scale * mean.y,
        0.0,
        0.0,
        1.0,
    );
    (distance > 0.0 && scale.is_finite()).then_some(shift)
}

/// SplitMix64 (Steele, Lea & Flood 2014).
struct Random(u64);

impl Random {
    /// Uniform in `0..count`, up to a modulo bias of 2⁻⁵⁰.
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((mixed ^ (mixed >> 31)) % count as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Point2, Point3, UnitQuaternion};

    /// Points in front of two cameras, with that noise, and as many outliers.
    fn seen(count: usize, noise_px: f64, outliers: usize) -> (Vec<PointMatch>, Vec<PointMatch>) {
        let mut random = Random(7);
        let mut even = |from: f64, to: f64| {
            from + (to - from) * random.below(1 << 30) as f64 / (1 << 30) as f64
        };
        let motion = Isometry3::from_parts(
            [-0.2, 0.01, 0.02].into(),
            UnitQuaternion::from_euler_angles(0.02, -0.05, 0.03),
        );
        let mut matches = Vec::new();
        for _ in 0..count {
            let z = even(1.0, 8.0);
            let point = Point3::new(even(-0.5, 0.5) * z, even(-0.4, 0.4) * z, z);
            let mut pixel = |p: Point3<f64>| {
                Point2::new(
                    500.0 * p.x / p.z + 320.0 + even(-noise_px, noise_px),
                    500.0 * p.y / p.z + 240.0 + even(-noise_px, noise_px),
                )
            };
            matches.push(PointMatch {
                left: pixel(point),
                right: pixel(motion * point),
            });
        }
        let mut pixel = || Point2::new(even(0.0, 639.0), even(0.0, 479.0));
        (
            matches,
            (0..outliers)
                .map(|_| PointMatch {
                    left: pixel(),
                    right: pixel(),
                })
                .collect(),
        )
    }

    #[test]
    fn outliers_are_rejected() {
        let (good, bad) = seen(200, 0.2, 100);
        let found = inliers(&[good.clone(), bad].concat(), 1.0);
        let kept = good.iter().filter(|m| found.contains(m)).count();
        assert!(
            kept > 195 && found.len() - kept < 10,
            "{kept} of {}",
            found.len()
        );
        let f = fundamental(&found).unwrap();
        assert!(f.determinant().abs() < 1e-15, "not of rank two");
    }

    #[test]
    fn random_matches_have_no_geometry() {
        let (good, bad) = seen(20, 0.0, 300);
        assert_eq!(inliers(&bad, 1.0), []);
        assert_eq!(inliers(&good[..10], 1.0), []);
        assert_eq!(inliers(&[good[0]; 40], 1.0), [], "one point is no geometry");
    }
}
