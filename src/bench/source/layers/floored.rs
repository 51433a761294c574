//! Truth that tells floor from obstacles by a plane below the camera.

use crate::source::frames::Source;
use svl_core::stereo::{FloorPlane, Frame};
use svl_core::{Error, Result};

/// A level camera.
pub struct LevelCamera {
    pub height_m: f64,
    /// True if the user named its height: the floor takes the place of the truth's own surfaces.
    pub is_named: bool,
}

impl LevelCamera {
    /// Marks what of the truth of frames is floor.
    pub fn floor(self) -> impl FnMut(Frame, &dyn Source) -> Result<Frame> {
        let floor = FloorPlane::level(self.height_m);
        move |mut frame, source| {
            let rig = frame.rig().copied();
            if let Some(truth) = &mut frame.truth
                && (self.is_named || truth.surface.is_none())
            {
                match rig {
                    Some(rig) => truth.surface = Some(floor.surfaces(&truth.disparity, &rig)),
                    None if self.is_named => {
                        return Err(Error::Usage(format!(
                            "--camera-height: pairs of {} have no calibration, so no distances; \
                             omit it, or name one with --calib FILE",
                            source.name()
                        )));
                    }
                    None => {}
                }
            }
            Ok(frame)
        }
    }
}
