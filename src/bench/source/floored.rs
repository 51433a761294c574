//! A source whose truth tells floor from obstacles by a plane below the camera.

use super::{Source, wraps};
use svl_core::stereo::{FloorPlane, Frame};
use svl_core::{Error, Result};

/// Marks what of another source's truth is floor.
pub struct FloorSource {
    source: Box<dyn Source>,
    floor: FloorPlane,
    /// True if the user named the plane: it takes the place of the truth's own surfaces.
    is_named: bool,
}

impl FloorSource {
    /// A level camera of a height that the user named, or that the recording has.
    pub fn new(source: Box<dyn Source>, camera_height_m: f64, is_named: bool) -> Self {
        Self {
            source,
            floor: FloorPlane::level(camera_height_m),
            is_named,
        }
    }
}

impl Source for FloorSource {
    wraps!(source);

    fn next(&mut self) -> Result<Option<Frame>> {
        let Some(mut frame) = self.source.next()? else {
            return Ok(None);
        };
        let rig = frame.rig().copied();
        if let Some(truth) = &mut frame.truth
            && (self.is_named || truth.surface.is_none())
        {
            match rig {
                Some(rig) => truth.surface = Some(self.floor.surfaces(&truth.disparity, &rig)),
                None if self.is_named => {
                    return Err(Error::Usage(format!(
                        "--camera-height: pairs of {} have no calibration, so no distances; omit \
                         it, or name one with --calib FILE",
                        self.source.name()
                    )));
                }
                None => {}
            }
        }
        Ok(Some(frame))
    }
}
