//! Stereo calibration: intrinsics, extrinsics and rectification of two cameras.

use super::limits::{LengthUnit, check_baseline};
use super::{Distortion, DistortionModel, Intrinsics, Rig, Side};
use crate::error::{Error, Result};
use nalgebra::{Isometry3, Matrix3, Rotation3, SVD, Translation3, UnitQuaternion, Vector3};

/// A calibrated pair of cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct StereoCalibration {
    left: Intrinsics,
    right: Intrinsics,
    right_from_left: Isometry3<f64>,
    unit: LengthUnit,
    rectification: Option<Rectification>,
}

impl StereoCalibration {
    /// `right_from_left`: `X_right = R X_left + T`, both in the cameras' optical frames (x right, y
    /// down, z forward), `T` in `unit`.
    ///
    /// # Errors
    /// [`Error::Rig`] unless it is finite, the baseline is not zero, and in metres between 0.5 mm
    /// and 30 m, the right camera is on the right, both cameras have one distortion model or none,
    /// and the models reach at least the nearest sides of the images before they fold
    /// ([`Intrinsics::fold_px`]).
    pub fn new(
        left: Intrinsics,
        right: Intrinsics,
        right_from_left: Isometry3<f64>,
        unit: LengthUnit,
    ) -> Result<Self> {
        let place = right_from_left.inverse().translation.vector;
        let numbers = place.iter().chain(right_from_left.rotation.coords.iter());
        if !numbers.copied().all(f64::is_finite) || place.norm() == 0.0 {
            let [x, y, z] = place.into();
            return Err(Error::Rig(format!(
                "the right camera is at ({x}, {y}, {z}) of the left one, which must be finite and \
                 not 0; calibrate both cameras together"
            )));
        }
        if place.x <= 0.0 {
            check_upright(&right_from_left)?;
        }
        if place.x <= 0.0 && place.x.abs() < place.y.abs() {
            return Err(Error::Rig(
                "the cameras are mounted one above the other; rotate their images by 90 degrees \
                 and calibrate these"
                    .to_owned(),
            ));
        }
        if place.x <= 0.0 {
            return Err(Error::Rig(format!(
                "the right camera is at x = {:.4} of the left one; swap left and right, or turn \
                 the images of both if they are upside down",
                place.x
            )));
        }
        check_baseline(place.norm(), unit)?;
        check_models(left.distortion(), right.distortion())?;
        check_fold("left", &left)?;
        check_fold("right", &right)?;
        Ok(Self {
            left,
            right,
            right_from_left,
            unit,
            rectification: None,
        })
    }

    /// The same cameras with the rectification from their file, or one computed for them.
    pub fn with_rectification(self, rectification: Rectification) -> Self {
        Self {
            rectification: Some(rectification),
            ..self
        }
    }

    pub fn left(&self) -> &Intrinsics {
        &self.left
    }

    pub fn right(&self) -> &Intrinsics {
        &self.right
    }

    /// R and T of `X_right = R X_left + T`.
    pub fn right_from_left(&self) -> &Isometry3<f64> {
        &self.right_from_left
    }

    pub fn unit(&self) -> LengthUnit {
        self.unit
    }

    /// Distance between the camera centres, in [`StereoCalibration::unit`].
    pub fn baseline(&self) -> f64 {
        self.right_from_left.translation.vector.norm()
    }

    pub fn rectification(&self) -> Option<&Rectification> {
        self.rectification.as_ref()
    }

    /// True if the images are rectified already: no distortion, and a rectification that turns and
    /// scales nothing.
    pub fn is_rectified(&self) -> bool {
        let is_same = |by: &Rectification, camera: &Intrinsics, side| {
            camera.distortion().is_none()
                && camera.matrix() == by.rig.intrinsics(side)
                && camera.size() == by.size
        };
        self.rectification.as_ref().is_some_and(|by| {
            by.left.angle() + by.right.angle() == 0.0
                && is_same(by, &self.left, Side::Left)
                && is_same(by, &self.right, Side::Right)
        })
    }

    /// The rectified rig; `None` without a rectification or if the unit is not metres.
    pub fn rig(&self) -> Option<Rig> {
        let rectification = self.rectification.as_ref()?;
        (self.unit == LengthUnit::Metres).then_some(rectification.rig)
    }
}

/// # Errors
/// [`Error::Rig`] for two models, unless one camera has no distortion and the other no fisheye.
fn check_models(left: &Distortion, right: &Distortion) -> Result<()> {
    let (first, second) = (left.model(), right.model());
    let is_fisheye = [first, second].contains(&DistortionModel::Equidistant);
    if first == second || !is_fisheye && (left.is_none() || right.is_none()) {
        return Ok(());
    }
    Err(Error::Rig(format!(
        "the left camera's distortion is {first}, the right one's {second}; calibrate both with \
         one model"
    )))
}

/// # Errors
/// [`Error::Rig`] if one camera is upside down against the other.
pub(crate) fn check_upright(right_from_left: &Isometry3<f64>) -> Result<()> {
    // The cosine of the angle between their y axes; that of cameras turned by 90° is 0.
    if (right_from_left.rotation * Vector3::y()).y > -0.5 {
        return Ok(());
    }
    Err(Error::Rig(
        "one camera is upside down against the other: turn its images, `ffmpeg -i IN -vf \
         hflip,vflip OUT`, and calibrate again"
            .to_owned(),
    ))
}

/// # Errors
/// [`Error::Rig`] if most of the image is beyond the fold of the distortion model.
fn check_fold(name: &str, camera: &Intrinsics) -> Result<()> {
    let ((nearest, _), (width, height)) = (camera.side_distances_px(), camera.size());
    match camera.fold_px(nearest) {
        Some(fold) => Err(Error::Rig(format!(
            "the {name} camera's {} {:?} folds {fold:.0} px from the principal point, inside the \
             image of {width}x{height}: calibrate again with the board near the image's sides",
            camera.distortion().model(),
            camera.distortion().coefficients()
        ))),
        None => Ok(()),
    }
}

/// The rectification of two cameras: a rotation for each, and one pinhole camera for both.
#[derive(Clone, Debug, PartialEq)]
pub struct Rectification {
    /// Width and height of the rectified images.
    pub size: (usize, usize),
    /// R1: `X_rectified = R1 X_left`.
    pub left: Rotation3<f64>,
    /// R2: `X_rectified = R2 X_right`, up to the baseline along x.
    pub right: Rotation3<f64>,
    /// The rectified cameras: their projection matrices are P1 and P2. Its baseline is in the
    /// calibration's unit.
    pub rig: Rig,
}

impl Rectification {
    /// The extrinsics that the rectification implies, for files without any: `R = R2ᵀ R1`,
    /// `T = R2ᵀ (−B, 0, 0)`.
    pub fn motion(&self) -> Isometry3<f64> {
        let back = self.right.inverse();
        let apart = back * Vector3::new(-self.rig.baseline_m(), 0.0, 0.0);
        Isometry3::from_parts(
            apart.into(),
            UnitQuaternion::from_rotation_matrix(&(back * self.left)),
        )
    }
}

/// The rotation nearest to a matrix from a file, which is a rotation only up to the digits written.
///
/// # Errors
/// [`Error::Rig`] if it is not finite or differs from a rotation by more than 0.001 in any element.
pub fn rotation(matrix: &Matrix3<f64>) -> Result<Rotation3<f64>> {
    let wrong = |why: &str| {
        Error::Rig(format!(
            "the matrix {:?} is not a rotation: {why}",
            matrix.transpose().as_slice()
        ))
    };
    if !matrix.iter().all(|v| v.is_finite()) {
        return Err(wrong("it is not finite"));
    }
    let crooked = || wrong("its rows are not right-handed, at right angles and of length 1");
    // A larger value overflows, and then no comparison holds.
    if matrix.amax() > 2.0 {
        return Err(crooked());
    }
    let svd = SVD::try_new(*matrix, true, true, f64::EPSILON, 100).ok_or_else(crooked)?;
    let nearest = svd
        .u
        .zip(svd.v_t)
        .map(|(u, v_t)| u * v_t)
        .ok_or_else(crooked)?;
    if (nearest - matrix).amax() > 1e-3 || nearest.determinant() < 0.0 {
        return Err(crooked());
    }
    Ok(Rotation3::from_matrix_unchecked(nearest))
}

/// R and T from a file as one motion.
///
/// # Errors
/// The errors of [`rotation`].
pub fn motion(matrix: &Matrix3<f64>, translation: Vector3<f64>) -> Result<Isometry3<f64>> {
    let rotation = UnitQuaternion::from_rotation_matrix(&rotation(matrix)?);
    Ok(Isometry3::from_parts(
        Translation3::from(translation),
        rotation,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Intrinsics {
        Intrinsics::new((640, 480), (500.0, 500.0), (319.5, 239.5), [0.0; 5]).unwrap()
    }

    #[test]
    fn swapped_and_coincident_cameras_are_refused() {
        let at = |x| {
            StereoCalibration::new(
                camera(),
                camera(),
                Isometry3::translation(x, 0.0, 0.0),
                LengthUnit::Metres,
            )
        };
        assert!(at(-0.1).is_ok());
        assert!(at(0.1).unwrap_err().to_string().contains("swap"));
        assert!(at(0.0).is_err());
        assert!(at(f64::NAN).is_err());
    }

    #[test]
    fn rotations_are_those_of_files_with_few_digits() {
        let exact = Rotation3::from_euler_angles(0.1, -0.02, 0.03);
        let rounded = exact.matrix().map(|v: f64| (v * 1e5).round() / 1e5);
        assert!((rotation(&rounded).unwrap().matrix() - exact.matrix()).amax() < 1e-5);
        assert!(rotation(&(exact.matrix() * 1.01)).is_err());
        assert!(rotation(&Matrix3::zeros()).is_err());
        assert!(rotation(&Matrix3::from_element(f64::NAN)).is_err());
        assert!(rotation(&-exact.matrix()).is_err());
        assert!(rotation(&(exact.matrix() * 1e308)).is_err());
    }

    #[test]
    fn squares_are_no_metres() {
        let calibration = |unit| {
            let apart = Isometry3::translation(-3.0, 0.0, 0.0);
            let rig = Rig::new(500.0, (319.5, 239.5), 3.0, 0.0).unwrap();
            let turn = Rotation3::identity();
            let rectification = Rectification {
                size: (640, 480),
                left: turn,
                right: turn,
                rig,
            };
            StereoCalibration::new(camera(), camera(), apart, unit)
                .unwrap()
                .with_rectification(rectification)
        };
        assert_eq!(calibration(LengthUnit::Squares).rig(), None);
        assert_eq!(
            calibration(LengthUnit::Metres).rig().unwrap().baseline_m(),
            3.0
        );
    }
}
