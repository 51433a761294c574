//! The part of wide cameras' views that rectified images do not show.

use super::bouguet::bouguet;
use super::framing::{Framing, MAX_ANGLE, MAX_ANGLE_OF_ALL};
use crate::stereo::StereoCalibration;

/// The views that rectified images lose, a line each for the user: those of lenses wider than a
/// plane, and those beyond the fold of a distortion model. Without a rectification, that of
/// [`bouguet`] with the default framing counts.
pub fn hidden_views(calibration: &StereoCalibration) -> Vec<String> {
    let cameras = [("left", calibration.left()), ("right", calibration.right())];
    let folds = cameras.into_iter().filter_map(|(name, camera)| {
        let (_, farthest) = camera.side_distances_px();
        let fold = camera.fold_px(farthest)?;
        Some(format!(
            "the {name} image has no directions beyond {fold:.0} px from its principal point, \
             where its distortion model folds: calibrate with the board near the image's sides"
        ))
    });
    folds.chain(wide_view(calibration)).collect()
}

/// The views beside the rectified images of wide lenses; `None` if they show nearly all.
fn wide_view(calibration: &StereoCalibration) -> Option<String> {
    let computed = || bouguet(calibration, &Framing::default()).ok();
    let by = calibration.rectification().cloned().or_else(computed)?;
    let focal = by.rig.focal_px();
    let shown = [by.size.0, by.size.1].map(|side| 2.0 * (side as f64 / 2.0 / focal).atan());
    let (horizontal, vertical) = calibration.left().field_of_view()?;
    let hides = |seen: f64, shown: f64| seen > 2.0 * MAX_ANGLE && seen > 1.05 * shown;
    if !hides(horizontal, shown[0]) && !hides(vertical, shown[1]) {
        return None;
    }
    let [horizontal, vertical, width, height] =
        [horizontal, vertical, shown[0], shown[1]].map(|angle| angle.to_degrees().round());
    let most = (2.0 * MAX_ANGLE_OF_ALL).to_degrees().round();
    Some(format!(
        "the cameras see {horizontal}° x {vertical}°, the rectified images show {width}° x \
         {height}°: a plane shows less than 180°; `svl record --calib FILE --alpha 1` shows about \
         {most}°"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::{Distortion, Intrinsics, LengthUnit};
    use nalgebra::Isometry3;

    /// Two fisheyes side by side with a field of view of that many degrees across 640 pixels.
    fn fisheyes(degrees: f64) -> StereoCalibration {
        let focal = 320.0 / (degrees / 2.0).to_radians();
        let lens = Distortion::Equidistant([0.0; 4]);
        let camera = Intrinsics::new((640, 480), (focal, focal), (319.5, 239.5), lens).unwrap();
        let apart = Isometry3::translation(-0.1, 0.0, 0.0);
        StereoCalibration::new(camera, camera, apart, LengthUnit::Metres).unwrap()
    }

    #[test]
    fn wide_lenses_are_shown_up_to_a_limit() {
        for (degrees, alpha, shown) in [
            // The height limits it.
            (100.0, 0.0, 91.3),
            (150.0, 0.0, 120.0),
            (180.0, 0.0, 120.0),
            (200.0, 0.0, 120.0),
            // The same height, so farther to the sides.
            (150.0, 1.0, 157.3),
            (180.0, 1.0, 157.3),
            (200.0, 1.0, 157.3),
        ] {
            let calibration = fisheyes(degrees);
            let framing = Framing { alpha, size: None };
            let by = bouguet(&calibration, &framing).unwrap();
            let across = 2.0 * (320.0 / by.rig.focal_px()).atan().to_degrees();
            assert!((across - shown).abs() < 0.5, "{degrees} {alpha}: {across}");
            let center = by.rig.center_px();
            assert!((center.0 - 319.5).abs() < 0.01 && (center.1 - 239.5).abs() < 0.01);
            let hidden = hidden_views(&calibration.with_rectification(by));
            assert_eq!(
                hidden.len() == 1,
                degrees > f64::max(shown, 120.0) + 1.0,
                "{degrees} {alpha}: {hidden:?}"
            );
        }
    }

    #[test]
    fn hidden_views_are_named() {
        let calibration = fisheyes(200.0);
        let by = bouguet(&calibration, &Framing::default()).unwrap();
        assert_eq!(
            hidden_views(&calibration.with_rectification(by)),
            [
                "the cameras see 200° x 150°, the rectified images show 120° x 105°: a plane shows \
             less than 180°; `svl record --calib FILE --alpha 1` shows about 150°"
            ]
        );
    }
}
