//! A source whose truth tells floor from obstacles by a plane below the camera.

use super::{Source, wraps};
use svl_core::stereo::{FloorPlane, Frame};
use svl_core::{Error, Result};

/// A level camera.
pub struct LevelCamera {
    pub height_m: f64,
    /// True if the user named its height: the floor takes the place of the truth's own surfaces.
    pub is_named: bool,
}

/// Marks what of another source's truth is floor.
pub struct FloorSource<'a> {
    source: Box<dyn Source + 'a>,
    floor: FloorPlane,
    is_named: bool,
}

impl<'a> FloorSource<'a> {
    pub fn new(source: Box<dyn Source + 'a>, camera: LevelCamera) -> Self {
        Self {
            source,
            floor: FloorPlane::level(camera.height_m),
            is_named: camera.is_named,
        }
    }
}

impl Source for FloorSource<'_> {
    wraps!();

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
