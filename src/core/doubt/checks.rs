//! The numbers of a stereo calibration beside the values that they usually have.

use super::{CalibrationCure, CameraImage, Doubt, PrincipalPoint, Subject};
use crate::error::{Error, Result};
use crate::stereo::{Rig, StereoCalibration};
use nalgebra::Matrix3x4;
use serde::Serialize;

/// Distances of a principal point from the middle, as a fraction of the image's side: the middle
/// half.
const CENTER: [f64; 2] = [0.0, 0.25];
/// Ratios of the focal lengths after and before rectification.
const FOCAL: [f64; 2] = [0.5, 1.5];
/// Ratios of a baseline to that of another source.
const BASELINE: [f64; 2] = [0.95, 1.05];
/// Focal lengths as a fraction of the image's width: from a view of 157 degrees to a telescope.
const FOCAL_OF_WIDTH: [f64; 2] = [0.1, 100.0];
/// Twice a principal point as a fraction of the image's side, if it is that of half the image.
const HALF: std::ops::RangeInclusive<f64> = 0.44..=0.56;
/// Usual distances where they are those of half the image.
const HALF_CENTER: [f64; 2] = [0.0, 0.219];
/// Least difference of the offsets in both projections from equal ones of opposite signs, as a
/// fraction.
const OFFSETS: [f64; 2] = [0.05, f64::MAX];

/// A number of a calibration beside the values that it usually has.
///
/// Another value is no error, since crops have such: it is named to the user.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibrationCheck {
    /// Name of the number.
    pub name: &'static str,
    pub value: f64,
    /// Least and greatest usual value.
    pub usual: [f64; 2],
    /// The likely mistake; `None` for a usual value.
    pub cure: Option<CalibrationCure>,
}

impl CalibrationCheck {
    fn new(name: &'static str, value: f64, usual: [f64; 2], cure: CalibrationCure) -> Self {
        let is_usual = usual[0] <= value && value <= usual[1];
        Self {
            name,
            value,
            usual,
            cure: (!is_usual).then_some(cure),
        }
    }

    /// The doubt about the calibration, if the value is unusual.
    pub fn doubt(&self) -> Option<Doubt> {
        let cure = self.cure.clone()?;
        Some(cure.doubt(Subject::Calibration, self.name, self.value, self.usual))
    }

    /// The principal points of two cameras; of both, the one farther from the middle.
    fn centers(name: &'static str, [left, right]: [PrincipalPoint; 2]) -> Self {
        let is_half = |at: f64, side: usize| HALF.contains(&(2.0 * (at + 0.5) / side as f64));
        let are_half = [&left, &right]
            .into_iter()
            .all(|point| is_half(point.px.0, point.size.0) && is_half(point.px.1, point.size.1));
        let at = if left.off_center() >= right.off_center() {
            left
        } else {
            right
        };
        let off = at.off_center();
        let (usual, cure) = if are_half && off <= CENTER[1] {
            (HALF_CENTER, CalibrationCure::HalfSize { at })
        } else {
            (CENTER, CalibrationCure::OtherSize { at })
        };
        Self::new(name, off, usual, cure)
    }

    /// The principal point of a depth camera.
    pub fn depth_center(px: (f64, f64), size: (usize, usize)) -> Self {
        let camera = CameraImage::Depth;
        let at = PrincipalPoint { camera, px, size };
        Self::centers("center", [at.clone(), at])
    }

    /// The focal length beside the width of the image, pixels.
    fn width(focal_px: f64, width_px: usize) -> Self {
        // A size of 0 was not set.
        let part = match width_px {
            0 => 1.0,
            _ => focal_px / width_px as f64,
        };
        let cure = CalibrationCure::NoCamera { focal_px, width_px };
        Self::new("focal_of_width", part, FOCAL_OF_WIDTH, cure)
    }

    /// The offsets in the projections of both cameras: equal ones of opposite signs are each that
    /// to the other camera.
    pub fn offsets(left: &Matrix3x4<f64>, right: &Matrix3x4<f64>) -> Self {
        let [left_m, right_m] = [left, right].map(|p| p[(0, 3)] / p[(0, 0)]);
        let apart = match left_m.abs().max(right_m.abs()) {
            0.0 => 1.0,
            most => (left_m + right_m).abs() / most,
        };
        let cure = CalibrationCure::TwoOffsets { left_m, right_m };
        Self::new("projection_offsets", apart, OFFSETS, cure)
    }

    /// The baseline by two projections, negative if the right camera is to the left.
    pub fn sides(left: &Matrix3x4<f64>, right: &Matrix3x4<f64>) -> Self {
        let baseline_m = (left[(0, 3)] - right[(0, 3)]) / left[(0, 0)];
        let cure = CalibrationCure::ExchangedCameras { baseline_m };
        Self::new("baseline_m", baseline_m, [0.0, f64::MAX], cure)
    }

    /// A baseline beside that of another source, called `other`, both in metres; negative if there
    /// the right camera is to the left.
    pub fn baseline(baseline_m: f64, other_m: f64, other: &str) -> Self {
        let other = other.to_owned();
        let ratio = baseline_m / other_m;
        let cure = if other_m < 0.0 {
            CalibrationCure::ExchangedFrames {
                baseline_m,
                other_m,
                other,
            }
        } else {
            CalibrationCure::OtherBaseline {
                baseline_m,
                other_m,
                other,
            }
        };
        Self::new("baseline_ratio", ratio, BASELINE, cure)
    }

    /// The focal length of a rectified camera beside that of the camera itself, pixels.
    pub fn focal(rectified_px: f64, raw_px: f64) -> Self {
        let cure = CalibrationCure::OtherFocalLength {
            rectified_px,
            raw_px,
        };
        Self::new("focal_ratio", rectified_px / raw_px, FOCAL, cure)
    }

    /// The principal point of a camera of binned pixels, which would be nearer to the middle
    /// without that division: then the calibration was of binned pixels before.
    pub fn binning(center_px: (f64, f64), binning: [u32; 2], size: (usize, usize)) -> Self {
        let off = |factors: [f64; 2]| {
            let off = |at: f64, side: usize| (at / side as f64 - 0.5).powi(2);
            (off(center_px.0 * factors[0], size.0) + off(center_px.1 * factors[1], size.1)).sqrt()
        };
        let once = off(binning.map(f64::from));
        let twice = off([1.0; 2]);
        let cure = CalibrationCure::BinnedTwice {
            binning,
            center_px,
            size,
        };
        Self::new("binning", (once - twice).min(0.0), [0.0, 0.0], cure)
    }
}

/// Checks that a calibration is for images of that size.
///
/// # Errors
/// The doubt about the calibration.
#[doc(hidden)]
pub fn check_size(size: (usize, usize), images: (usize, usize)) -> Result<()> {
    let (own, other) = [(size.0, images.0), (size.1, images.1)][usize::from(size.0 == images.0)];
    let ratio = own as f64 / other as f64;
    let cure = CalibrationCure::OtherImages { size, images };
    let doubt = CalibrationCheck::new("size_ratio", ratio, [1.0; 2], cure).doubt();
    doubt.map_or(Ok(()), |doubt| Err(Error::other(doubt)))
}

impl Rig {
    /// The focal length and the principal points of both cameras in rectified images of that size.
    pub fn checks(&self, size: (usize, usize)) -> Vec<CalibrationCheck> {
        let (x, y) = self.center_px();
        let points = [
            (CameraImage::LeftRectified, x),
            (CameraImage::RightRectified, x + self.doffs_px()),
        ];
        let points = points.map(|(camera, x)| PrincipalPoint {
            camera,
            px: (x, y),
            size,
        });
        vec![
            CalibrationCheck::centers("rectified_center", points),
            CalibrationCheck::width(self.focal_px(), size.0),
        ]
    }
}

impl StereoCalibration {
    /// The principal points and focal lengths before and after rectification, these beside each
    /// other per pixel of the image's width.
    pub fn checks(&self) -> Vec<CalibrationCheck> {
        let cameras = [
            (CameraImage::Left, self.left()),
            (CameraImage::Right, self.right()),
        ];
        let points = cameras.map(|(camera, own)| PrincipalPoint {
            camera,
            px: own.center_px(),
            size: own.size(),
        });
        let mut checks = vec![
            CalibrationCheck::centers("center", points),
            CalibrationCheck::width(self.left().focal_px().0, self.left().size().0),
        ];
        if let Some(by) = self.rectification().filter(|_| !self.is_rectified()) {
            checks.extend(by.rig.checks(by.size));
            let scale = by.size.0 as f64 / self.left().size().0 as f64;
            let raw_px = self.left().focal_px().0 * scale;
            checks.push(CalibrationCheck::focal(by.rig.focal_px(), raw_px));
        }
        checks
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::{Intrinsics, LengthUnit};

    fn doubt(checks: &[CalibrationCheck]) -> String {
        let doubts = checks.iter().filter_map(CalibrationCheck::doubt);
        let doubts: Vec<_> = doubts.map(|doubt| doubt.to_string()).collect();
        doubts.join("; ")
    }

    #[test]
    fn principal_points_outside_the_middle_half_are_named() {
        let doubts = |center, doffs_px| {
            let rig = Rig::new(500.0, center, 0.1, doffs_px).unwrap();
            doubt(&rig.checks((640, 480)))
        };
        assert_eq!(doubts((319.5, 239.5), 0.0), "");
        assert_eq!(doubts((165.0, 350.0), 31.0), "");
        let words = "the principal point (639, 479) of the left rectified camera is far from the \
                     middle of its image of 640x480";
        assert!(doubts((639.0, 479.0), 0.0).contains(words));
        let words = "the principal point (670, 240) of the right rectified camera is outside its";
        assert!(doubts((320.0, 240.0), 350.0).contains(words));
        assert!(doubts((f64::MAX, 240.0), 0.0).contains("outside"));
        let rig = Rig::new(500.0, (160.0, 120.0), 0.1, 0.0).unwrap();
        assert_eq!(doubt(&rig.checks((0, 0))), "");
        // Just inside the middle half, and the middle of half the image.
        let words = "the middle of 322x242 pixels, and its image has 640x480";
        let half = doubts((160.6, 120.6), 0.0);
        assert!(half.contains(words), "{half}");
        assert_eq!(doubts((160.6, 150.0), 0.0), "");
    }

    #[test]
    fn focal_lengths_of_no_camera_and_offsets_to_each_other_are_named() {
        let doubts = |focal_px| {
            let rig = Rig::new(focal_px, (319.5, 239.5), 0.1, 0.0).unwrap();
            doubt(&rig.checks((640, 480)))
        };
        assert!(doubts(1.0).contains("1.0 px, and the images are 640 px wide"));
        assert!(doubts(70_000.0).contains("no camera has it"));
        assert_eq!(doubts(64.0) + &doubts(20_000.0), "");
        let projection = |m: f64| Matrix3x4::new(1., 0., 0., m, 0., 1., 0., 0., 0., 0., 1., 0.);
        let offsets = |left, right| {
            doubt(&[CalibrationCheck::offsets(
                &projection(left),
                &projection(right),
            )])
        };
        assert!(offsets(0.1, -0.1).contains("a baseline of 0.2000 m"));
        assert_eq!(
            offsets(0.0, -0.1) + &offsets(0.06, -0.47) + &offsets(0.0, 0.0),
            ""
        );
    }

    #[test]
    fn the_camera_of_depths_is_named_with_its_own_cure() {
        let words = |x, y| doubt(&[CalibrationCheck::depth_center((x, y), (160, 120))]);
        assert_eq!(words(80.0, 60.0), "");
        let words = words(160.0, 120.0);
        assert!(words.starts_with("the principal point (160, 120) of the depth camera is"));
        assert!(words.ends_with("correct its camera_info"), "{words}");
    }

    #[test]
    fn refusals_carry_the_doubt() {
        assert!(check_size((320, 240), (320, 240)).is_ok());
        for (images, ratio) in [((640, 480), 0.5), ((320, 200), 1.2)] {
            let error = check_size((320, 240), images).unwrap_err();
            let doubt: &Doubt = error.downcast_ref().unwrap();
            assert_eq!(
                (doubt.value, &doubt.to_string()),
                (ratio, &error.to_string())
            );
        }
        let projection = |m: f64| Matrix3x4::new(50., 0., 0., m, 0., 50., 0., 0., 0., 0., 1., 0.);
        let sides = |m: f64| CalibrationCheck::sides(&projection(0.0), &projection(m));
        assert_eq!(sides(-5.0).cure, None);
        assert!(doubt(&[sides(5.0)]).contains("0.1000 m to the left"));
    }

    #[test]
    fn focal_lengths_and_baselines_are_compared() {
        assert_eq!(CalibrationCheck::focal(300.0, 500.0).cure, None);
        assert!(CalibrationCheck::focal(240.0, 500.0).cure.is_some());
        assert!(CalibrationCheck::focal(760.0, 500.0).cure.is_some());
        assert_eq!(CalibrationCheck::baseline(0.1, 0.104, "/tf").cure, None);
        let other = CalibrationCheck::baseline(0.1, 0.12, "/tf_static");
        assert!(doubt(&[other]).contains("0.1200 m by /tf_static"));
    }

    #[test]
    fn a_binning_that_was_applied_before_is_named() {
        let binning = |x, y| CalibrationCheck::binning((x, y), [2, 2], (320, 240));
        assert_eq!(binning(160.0, 118.0).cure, None);
        assert_eq!(binning(140.0, 150.0).cure, None);
        assert!(doubt(&[binning(82.5, 62.5)]).contains("binning of 2x2"));
    }

    #[test]
    fn a_calibration_is_checked_before_and_after_rectification() {
        let camera = |center| Intrinsics::new((640, 480), (500.0, 500.0), center, [0.0; 5]);
        let calibration = |center, focal_px| {
            let (left, right) = (camera((319.5, 239.5)).unwrap(), camera(center).unwrap());
            let rig = Rig::new(focal_px, (319.5, 239.5), 0.1, 0.0).unwrap();
            let apart = nalgebra::Isometry3::translation(-0.1, 0.0, 0.0);
            StereoCalibration::new(left, right, apart, LengthUnit::Metres)
                .unwrap()
                .with_rectification(crate::stereo::Rectification {
                    size: (640, 480),
                    left: nalgebra::Rotation3::identity(),
                    right: nalgebra::Rotation3::identity(),
                    rig,
                })
        };
        assert_eq!(doubt(&calibration((300.0, 250.0), 480.0).checks()), "");
        assert!(doubt(&calibration((30.0, 250.0), 480.0).checks()).contains("of the right camera"));
        assert!(doubt(&calibration((300.0, 250.0), 240.0).checks()).contains("240.0 px in P"));
    }
}
