//! The occlusion mask, computed from the true disparities of both images.

use super::{Plane, Visibility};
use crate::error::{Error, Result};

/// Largest difference between the true disparities of one point in the two images, pixels.
const TOLERANCE_PX: f32 = 1.0;

/// The mask of the pixels that the right camera sees too, from the true disparities of the left and
/// of the right image (pixels, both positive, `+∞` where unknown).
///
/// Computed like `mask0nocc.png` of the Middlebury evaluation v3: left pixel `x` with disparity `d`
/// lies at `round(x - d)` in the right image, halves away from zero; it is visible if the truth of
/// that pixel is within 1.0 px of `d`, occluded if it is farther off, unknown, or outside the
/// image.
///
/// # Errors
/// [`Error::PairSize`] when the two differ in size.
pub fn cross_check(left: &Plane<f32>, right: &Plane<f32>) -> Result<Plane<Visibility>> {
    if left.size() != right.size() {
        return Err(Error::PairSize {
            left: left.size(),
            right: right.size(),
        });
    }
    Plane::from_fn(left.width(), left.height(), |x, y| {
        let d = left.get(x, y);
        if !d.is_finite() {
            return Visibility::Unknown;
        }
        let there = (x as f32 - d).round();
        let inside = there >= 0.0 && there < right.width() as f32;
        if inside && (right.get(there as usize, y) - d).abs() <= TOLERANCE_PX {
            Visibility::Visible
        } else {
            Visibility::Occluded
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hand_computed() {
        use Visibility::{Occluded, Unknown, Visible};
        const INF: f32 = f32::INFINITY;
        let left = Plane::from_vec(8, 1, vec![1.0, 0.5, 1.5, INF, 2.0, 2.0, 5.0, 1.0]).unwrap();
        // 0 leaves the frame (-1); 1 falls on 0.5, which rounds to 1; 2 falls on 0.5 too; 4 on 2; 5
        // on 3; 6 on 1; 7 on 6.
        let right = Plane::from_vec(8, 1, vec![9.0, 1.5, 1.0, INF, 0.0, 0.0, 2.01, 0.0]).unwrap();
        let mask = cross_check(&left, &right).unwrap();
        assert_eq!(
            mask.row(0),
            [
                Occluded, Visible, Visible, Unknown, Visible, Occluded, Occluded, Occluded
            ]
        );
        // A disparity below zero that leaves on the right.
        let left = Plane::from_vec(2, 1, vec![-0.4, -0.5]).unwrap();
        let right = Plane::from_vec(2, 1, vec![-1.0, -0.5]).unwrap();
        assert_eq!(
            cross_check(&left, &right).unwrap().row(0),
            [Visible, Occluded]
        );
    }

    #[test]
    fn sizes_must_agree() {
        let one = Plane::filled(1, 1, 0.0).unwrap();
        assert!(cross_check(&one, &Plane::filled(2, 1, 0.0).unwrap()).is_err());
    }
}
