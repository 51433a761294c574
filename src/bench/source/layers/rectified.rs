//! AppliedCalibration of a source's raw pairs.

use crate::source::frames::{Source, wraps};
use std::sync::Arc;
use svl_core::rectify::{Framing, RectificationMeter, Rectifier, bouguet};
use svl_core::stereo::{Frame, Geometry, Gray, Rig, StereoCalibration, StereoPair};
use svl_core::{Error, Result};
use svl_recording::warn_of;
use svl_score::losses::Losses;

/// The calibration that rectifies raw pairs.
pub struct AppliedCalibration {
    pub calibration: StereoCalibration,
    /// True if each pair is rectified by its own calibration, or by that of the pair before it if
    /// it has none; by this one before any has.
    pub follows_pairs: bool,
}

/// A source whose raw pairs are rectified: its frames are [`Geometry::Rectified`].
pub struct RectifiedSource<'a> {
    source: Box<dyn Source + 'a>,
    rectifier: Rectifier,
    /// The calibration of the rectifier.
    calibration: Arc<StereoCalibration>,
    follows_pairs: bool,
    /// Pairs that were rectified, and those that could not be.
    rectified: u64,
    unreadable: u64,
    /// Buffers that the next pair is rectified into: the raw images of the last one.
    spare: [Gray; 2],
    meter: RectificationMeter,
}

impl<'a> RectifiedSource<'a> {
    /// # Errors
    /// [`Error::Dimensions`], and those of [`Rectifier::new`].
    pub fn new(source: Box<dyn Source + 'a>, by: AppliedCalibration) -> Result<Self> {
        let (rectifier, calibration) = prepared(by.calibration)?;
        let (width, height) = rectifier.size();
        let blank = || Gray::filled(width, height, 0);
        Ok(Self {
            source,
            rectifier,
            calibration,
            follows_pairs: by.follows_pairs,
            rectified: 0,
            unreadable: 0,
            spare: [blank()?, blank()?],
            meter: RectificationMeter::default(),
        })
    }

    fn rectified(&mut self, frame: Frame) -> Result<Frame> {
        // A rig and a truth belong to rectified images, so a calibration cannot apply to them. A
        // pair that is only declared rectified is raw if its user gives a calibration.
        if frame.rig().is_some() || frame.truth.is_some() {
            let why = "its pairs are rectified already, with rig or truth: omit --calib";
            return Err(Error::Invalid(format!("{}: {why}", self.source.name())));
        }
        if self.follows_pairs
            && let Some(own) = &frame.calibration
            && self.calibration != *own
        {
            (self.rectifier, self.calibration) = prepared(StereoCalibration::clone(own))?;
        }
        let [left, right] = &mut self.spare;
        let context = |e: Error| {
            Error::Invalid(format!(
                "{}: pair {}: {e}",
                self.source.name(),
                frame.sequence
            ))
        };
        self.rectifier
            .apply(&frame.pair, left, right)
            .map_err(context)?;
        let color = frame
            .color
            .as_ref()
            .map(|color| self.rectifier.apply_color(color));
        let color = color.transpose().map_err(context)?;
        let blank = Gray::filled(1, 1, 0)?;
        let [left, right] = std::mem::replace(&mut self.spare, [blank.clone(), blank]);
        let pair = StereoPair::new(left, right)?;
        self.measure(&frame.pair, &pair);
        self.spare = frame.pair.into_images();
        Ok(Frame {
            pair,
            color,
            geometry: Geometry::Rectified(self.rectifier.rig().copied()),
            calibration: Some(self.calibration.clone()),
            // The pose is that of the left camera, which rectification rotates.
            pose: frame
                .pose
                .map(|pose| pose * self.rectifier.rotation.inverse()),
            ..frame
        })
    }
}

impl RectifiedSource<'_> {
    /// Measures if the first pairs were rectified before, and warns of it.
    fn measure(&mut self, before: &StereoPair, after: &StereoPair) {
        if !self.meter.is_done()
            && self.meter.add(before, after)
            && let Some(doubt) = self.meter.doubt()
        {
            warn_of(&self.source.name(), &doubt);
        }
    }
}

impl Source for RectifiedSource<'_> {
    wraps!();

    fn rectification(&self) -> Option<&RectificationMeter> {
        Some(&self.meter)
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        loop {
            let Some(mut frame) = self.source.next()? else {
                return Ok(None);
            };
            frame.keep_id();
            match self.rectified(frame) {
                Ok(frame) => {
                    self.rectified += 1;
                    return Ok(Some(frame));
                }
                // The calibration is of another size than this pair, but not than others.
                Err(error) if self.rectified > 0 => {
                    if self.unreadable == 0 {
                        tracing::warn!("{error}; this pair is dropped");
                    }
                    self.unreadable += 1;
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn finish(&mut self, taken: u64) -> Losses {
        let losses = self.source.finish(taken);
        Losses {
            unreadable: losses.unreadable + self.unreadable,
            ..losses
        }
    }
}

/// The rectifier of a calibration, which has its rectification then.
fn prepared(calibration: StereoCalibration) -> Result<(Rectifier, Arc<StereoCalibration>)> {
    let calibration = match calibration.rectification() {
        Some(_) => calibration,
        None => {
            let rectification = bouguet(&calibration, &Framing::default())?;
            calibration.with_rectification(rectification)
        }
    };
    Ok((Rectifier::new(&calibration)?, Arc::new(calibration)))
}

/// Declares raw pairs rectified by the user (`--calib none`), with the rig of the projections in
/// their own calibration, or in that of the source.
pub fn declared(rig: Rig) -> impl FnMut(Frame, &dyn Source) -> Result<Frame> + Send {
    move |frame, _| {
        Ok(match frame.geometry {
            Geometry::Rectified(_) => frame,
            Geometry::Raw => {
                let own = frame.calibration.as_ref().and_then(|own| own.rig());
                Frame {
                    geometry: Geometry::Rectified(Some(own.unwrap_or(rig))),
                    calibration: None,
                    ..frame
                }
            }
        })
    }
}

/// The frame of a raw pair that is declared rectified by the user (`--calib none`).
pub fn assumed(frame: Frame, _: &dyn Source) -> Result<Frame> {
    Ok(match frame.geometry {
        Geometry::Rectified(_) => frame,
        Geometry::Raw => Frame {
            geometry: Geometry::Rectified(None),
            calibration: None,
            ..frame
        },
    })
}
