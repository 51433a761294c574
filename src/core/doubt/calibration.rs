//! Causes of unusual numbers of a calibration.

use super::{Doubt, Subject};
use serde::{Deserialize, Serialize};

causes! {
    /// A cause of an unusual number of a calibration.
    CalibrationCure:

    /// It is of images of another size.
    OtherSize { at: PrincipalPoint } => (
        "the principal point {at} is {} its image of {}x{}: unless the images are cropped, the \
         calibration is of another size or binning, and distances are wrong: {}",
        at.place(), at.size.0, at.size.1, at.camera.cure())
    OtherImages { size: (usize, usize), images: (usize, usize) } => (
        "the calibration is for images of {}x{} pixels, these have {}x{}: scale the images, or \
         calibrate for their size",
        size.0, size.1, images.0, images.1)
    HalfSize { at: PrincipalPoint } => (
        "the principal point {at} is the middle of {:.0}x{:.0} pixels, and its image has {}x{}: \
         unless the images are cropped, the calibration is of half the size, and distances are \
         wrong: {}",
        2.0 * at.px.0 + 1.0, 2.0 * at.px.1 + 1.0, at.size.0, at.size.1, at.camera.cure())
    NoCamera { focal_px: f64, width_px: usize } => (
        "the focal length is {focal_px:.1} px, and the images are {width_px} px wide: no camera \
         has it, and distances are wrong: --calib FILE")
    TwoOffsets { left_m: f64, right_m: f64 } => (
        "P has an offset of {left_m:.4} m in the left camera and of {right_m:.4} m in the right \
         one, which makes a baseline of {:.4} m: if each is the distance to the other camera, \
         distances are twice too long: --calib FILE",
        left_m - right_m)
    /// Cameras of exchanged topics, or a P of another sign.
    ExchangedCameras { baseline_m: f64 } => (
        "by P the right camera is {:.4} m to the left: if svl info finds the images exchanged, \
         too, --left and --right name their topics; if the calibrations alone are, --calib FILE \
         replaces them, or a /tf_static with the cameras' frames shows that only the sign of P is \
         wrong (DepthAI: i_reverse_stereo_socket_order)",
        -baseline_m)
    ExchangedFrames { baseline_m: f64, other_m: f64, other: String } => (
        "the right camera is {baseline_m:.4} m to the right by the calibration, which is used, and \
         {:.4} m to the left by {other}: if the frames of the images are exchanged, a truth in \
         another frame is off by that",
        -other_m)
    OtherBaseline { baseline_m: f64, other_m: f64, other: String } => (
        "the baseline is {baseline_m:.4} m by the calibration, which is used, and {other_m:.4} m \
         by {other}: distances are wrong if the latter is right: --calib FILE")
    OtherFocalLength { rectified_px: f64, raw_px: f64 } => (
        "the focal length is {rectified_px:.1} px in P and {raw_px:.1} px in K: one of the two is \
         of another image size, and distances are wrong: --calib FILE")
    BinnedTwice { binning: [u32; 2], center_px: (f64, f64), size: (usize, usize) } => (
        "its binning of {}x{} would put the principal point at ({:.0}, {:.0}) of {}x{} pixels: K \
         and P are likely of binned pixels already, and distances are wrong: binning 0 in \
         CameraInfo, or --calib FILE",
        binning[0], binning[1], center_px.0, center_px.1, size.0, size.1)
}

/// The principal point of a camera in its image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PrincipalPoint {
    pub camera: CameraImage,
    pub px: (f64, f64),
    /// Width and height of the image; a side of 0 is unknown.
    pub size: (usize, usize),
}

/// The camera of an image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CameraImage {
    Left,
    Right,
    LeftRectified,
    RightRectified,
    Depth,
}

impl PrincipalPoint {
    /// Distance from the middle, as a fraction of the image's side: the greater of both.
    pub fn off_center(&self) -> f64 {
        let off = |at: f64, side: usize| match side {
            0 => 0.0,
            _ => ((at + 0.5) / side as f64 - 0.5).abs(),
        };
        off(self.px.0, self.size.0).max(off(self.px.1, self.size.1))
    }

    fn place(&self) -> &'static str {
        if self.off_center() > 0.5 {
            "outside"
        } else {
            "far from the middle of"
        }
    }
}

impl std::fmt::Display for PrincipalPoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (x, y) = self.px;
        write!(f, "({x:.0}, {y:.0}) of the {}", self.camera.name())
    }
}

impl CameraImage {
    fn name(self) -> &'static str {
        match self {
            Self::Left => "left camera",
            Self::Right => "right camera",
            Self::LeftRectified => "left rectified camera",
            Self::RightRectified => "right rectified camera",
            Self::Depth => "depth camera",
        }
    }

    fn cure(self) -> &'static str {
        if self == Self::Depth {
            "correct its camera_info"
        } else {
            "--calib FILE"
        }
    }
}
