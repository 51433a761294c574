//! The numbers of a stereo calibration that are named where they are unusual.

use super::{Rig, StereoCalibration};
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
    /// The likely mistake and its cure, in words; `None` for a usual value.
    pub doubt: Option<String>,
}

impl CalibrationCheck {
    fn new(name: &'static str, value: f64, usual: [f64; 2], doubt: impl Fn() -> String) -> Self {
        let is_usual = usual[0] <= value && value <= usual[1];
        Self {
            name,
            value,
            usual,
            doubt: (!is_usual).then(doubt),
        }
    }

    /// The principal points of two cameras; of both, the one farther from the middle.
    fn centers(name: &'static str, kind: &str, cameras: [((f64, f64), (usize, usize)); 2]) -> Self {
        let kinds = ["left", "right"].map(|side| format!("{side} {kind}"));
        Self::centers_of(name, kinds, cameras, "--calib FILE")
    }

    /// The principal point of the camera of other images than the pairs'.
    pub fn center(kind: &str, center_px: (f64, f64), size: (usize, usize)) -> Self {
        let kinds = [kind.to_owned(), String::new()];
        Self::centers_of(
            "center",
            kinds,
            [(center_px, size); 2],
            "correct its camera_info",
        )
    }

    fn centers_of(
        name: &'static str,
        kinds: [String; 2],
        cameras: [((f64, f64), (usize, usize)); 2],
        cure: &str,
    ) -> Self {
        let off = |((x, y), (width, height)): ((f64, f64), (usize, usize))| {
            // A size of 0 was not set.
            let off = |at: f64, side: usize| match side {
                0 => 0.0,
                _ => ((at + 0.5) / side as f64 - 0.5).abs(),
            };
            off(x, width).max(off(y, height))
        };
        let [left, right] = cameras.map(off);
        let (kind, ((x, y), (width, height)), value) = if left >= right {
            (&kinds[0], cameras[0], left)
        } else {
            (&kinds[1], cameras[1], right)
        };
        let place = if value > 0.5 {
            "outside"
        } else {
            "far from the middle of"
        };
        let check = Self::new(name, value, CENTER, || {
            format!(
                "the principal point ({x:.0}, {y:.0}) of the {kind} is {place} its image of \
                 {width}x{height}: unless the images are cropped, the calibration is of another \
                 size or binning, and distances are wrong: {cure}"
            )
        });
        let is_half = |at: f64, side: usize| HALF.contains(&(2.0 * (at + 0.5) / side as f64));
        let are_half = cameras
            .iter()
            .all(|((x, y), (w, h))| is_half(*x, *w) && is_half(*y, *h));
        let half = || {
            format!(
                "the principal point ({x:.0}, {y:.0}) of the {kind} is the middle of \
                 {:.0}x{:.0} pixels, and its image has {width}x{height}: unless the images are \
                 cropped, the calibration is of half the size, and distances are wrong: {cure}",
                2.0 * x + 1.0,
                2.0 * y + 1.0
            )
        };
        Self {
            doubt: check.doubt.or_else(|| are_half.then(half)),
            ..check
        }
    }

    /// The focal length beside the width of the image, pixels.
    fn width(focal_px: f64, width: usize) -> Self {
        // A size of 0 was not set.
        let part = match width {
            0 => 1.0,
            _ => focal_px / width as f64,
        };
        Self::new("focal_of_width", part, FOCAL_OF_WIDTH, || {
            format!(
                "the focal length is {focal_px:.1} px, and the images are {width} px wide: no \
                 camera has it, and distances are wrong: --calib FILE"
            )
        })
    }

    /// The offsets in the projections of both cameras: equal ones of opposite signs are each that
    /// to the other camera.
    pub fn offsets(left: &Matrix3x4<f64>, right: &Matrix3x4<f64>) -> Self {
        let [left_m, right_m] = [left, right].map(|p| p[(0, 3)] / p[(0, 0)]);
        let apart = match left_m.abs().max(right_m.abs()) {
            0.0 => 1.0,
            most => (left_m + right_m).abs() / most,
        };
        Self::new("projection_offsets", apart, OFFSETS, || {
            format!(
                "P has an offset of {left_m:.4} m in the left camera and of {right_m:.4} m in the \
                 right one, which makes a baseline of {:.4} m: if each is the distance to the \
                 other camera, distances are twice too long: --calib FILE",
                left_m - right_m
            )
        })
    }

    /// A baseline beside that of another source, called `other`, both in metres; negative if there
    /// the right camera is to the left.
    pub fn baseline(metres: f64, other_m: f64, other: &str) -> Self {
        Self::new("baseline_ratio", metres / other_m, BASELINE, || {
            if other_m < 0.0 {
                return format!(
                    "the right camera is {metres:.4} m to the right by the calibration, which is \
                     used, and {:.4} m to the left by {other}: if the frames of the images are \
                     exchanged, a truth in another frame is off by that",
                    -other_m
                );
            }
            format!(
                "the baseline is {metres:.4} m by the calibration, which is used, and {other_m:.4} \
                 m by {other}: distances are wrong if the latter is right: --calib FILE"
            )
        })
    }

    /// The focal length of a rectified camera beside that of the camera itself, pixels.
    pub fn focal(rectified_px: f64, raw_px: f64) -> Self {
        Self::new("focal_ratio", rectified_px / raw_px, FOCAL, || {
            format!(
                "the focal length is {rectified_px:.1} px in P and {raw_px:.1} px in K: one of the \
                 two is of another image size, and distances are wrong: --calib FILE"
            )
        })
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
        let [columns, rows] = binning;
        Self::new("binning", (once - twice).min(0.0), [0.0, 0.0], || {
            format!(
                "its binning of {columns}x{rows} would put the principal point at ({:.0}, {:.0}) \
                 of {}x{} pixels: K and P are likely of binned pixels already, and distances are \
                 wrong: binning 0 in CameraInfo, or --calib FILE",
                center_px.0, center_px.1, size.0, size.1
            )
        })
    }
}

impl Rig {
    /// The focal length and the principal points of both cameras in rectified images of that size.
    pub fn checks(&self, size: (usize, usize)) -> Vec<CalibrationCheck> {
        let (cx, cy) = self.center_px();
        let centers = [(cx, cy), (cx + self.doffs_px(), cy)].map(|center| (center, size));
        vec![
            CalibrationCheck::centers("rectified_center", "rectified camera", centers),
            CalibrationCheck::width(self.focal_px(), size.0),
        ]
    }
}

impl StereoCalibration {
    /// The principal points and focal lengths before and after rectification, these beside each
    /// other per pixel of the image's width.
    pub fn checks(&self) -> Vec<CalibrationCheck> {
        let cameras = [self.left(), self.right()].map(|camera| (camera.center_px(), camera.size()));
        let mut checks = vec![
            CalibrationCheck::centers("center", "camera", cameras),
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
        let doubts = checks.iter().filter_map(|check| check.doubt.clone());
        doubts.collect::<Vec<_>>().join("; ")
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
        let offsets =
            |left, right| CalibrationCheck::offsets(&projection(left), &projection(right)).doubt;
        assert!(
            offsets(0.1, -0.1)
                .unwrap()
                .contains("a baseline of 0.2000 m")
        );
        assert_eq!(
            [offsets(0.0, -0.1), offsets(0.06, -0.47), offsets(0.0, 0.0)],
            [None, None, None]
        );
    }

    #[test]
    fn the_camera_of_depths_is_named_with_its_own_cure() {
        let doubt = |x, y| CalibrationCheck::center("depth camera", (x, y), (160, 120)).doubt;
        assert_eq!(doubt(80.0, 60.0), None);
        let words = doubt(160.0, 120.0).unwrap();
        assert!(words.starts_with("the principal point (160, 120) of the depth camera is"));
        assert!(words.ends_with("correct its camera_info"), "{words}");
    }

    #[test]
    fn focal_lengths_and_baselines_are_compared() {
        assert_eq!(CalibrationCheck::focal(300.0, 500.0).doubt, None);
        assert!(CalibrationCheck::focal(240.0, 500.0).doubt.is_some());
        assert!(CalibrationCheck::focal(760.0, 500.0).doubt.is_some());
        assert_eq!(CalibrationCheck::baseline(0.1, 0.104, "/tf").doubt, None);
        let other = CalibrationCheck::baseline(0.1, 0.12, "/tf_static");
        assert!(other.doubt.unwrap().contains("0.1200 m by /tf_static"));
    }

    #[test]
    fn a_binning_that_was_applied_before_is_named() {
        let binning = |x, y| CalibrationCheck::binning((x, y), [2, 2], (320, 240));
        assert_eq!(binning(160.0, 118.0).doubt, None);
        assert_eq!(binning(140.0, 150.0).doubt, None);
        let twice = binning(82.5, 62.5);
        assert!(twice.doubt.unwrap().contains("binning of 2x2"));
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
