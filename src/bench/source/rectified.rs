//! Rectification of a source's raw pairs.

use super::Source;
use std::collections::VecDeque;
use std::sync::Arc;
use svl_core::rectify::{EpipolarGeometry, Framing, Rectifier, bouguet, matches, uncalibrated};
use svl_core::stereo::{Frame, Geometry, Gray, Losses, StereoCalibration, StereoPair};
use svl_core::{Error, Result};

/// A source whose raw pairs are rectified: its frames are [`Geometry::Rectified`].
pub struct RectifiedSource {
    source: Box<dyn Source>,
    rectifier: Rectifier,
    /// The calibration of the rectifier; none of an estimate.
    calibration: Option<Arc<StereoCalibration>>,
    /// True if a pair with a calibration of its own is rectified by that.
    follows_pairs: bool,
    /// Pairs that were rectified, and those that could not be.
    rectified: u64,
    unreadable: u64,
    /// Frames read ahead for the estimate, still raw.
    ahead: VecDeque<Frame>,
    /// Buffers that the next pair is rectified into: the raw images of the last one.
    spare: [Gray; 2],
}

/// Pairs from which an uncalibrated rectification is estimated.
const ESTIMATED_FROM: usize = 8;
/// Largest distance of an inlier from the epipolar geometry: as far as distortion moves points.
const TOLERANCE_PX: f64 = 2.0;

impl RectifiedSource {
    /// Rectifies the raw pairs of `source` by one calibration.
    ///
    /// # Errors
    /// [`Error::Dimensions`], and those of [`Rectifier::new`].
    pub fn new(source: Box<dyn Source>, calibration: StereoCalibration) -> Result<Self> {
        let (rectifier, calibration) = prepared(calibration)?;
        Self::ahead(source, rectifier, Some(calibration), VecDeque::new())
    }

    /// Rectifies each raw pair of `source` by its own calibration, or by that of the pair before it
    /// if it has none; by `first` before any has.
    ///
    /// # Errors
    /// As [`RectifiedSource::new`].
    pub fn by_pairs(source: Box<dyn Source>, first: StereoCalibration) -> Result<Self> {
        Ok(Self {
            follows_pairs: true,
            ..Self::new(source, first)?
        })
    }

    /// Rectifies the raw pairs of `source` without a calibration, by matches in its first ones:
    /// pairs become row-aligned, but there is no rig.
    ///
    /// # Errors
    /// [`Error::Invalid`] for too few matches; those of the source.
    pub fn estimated(mut source: Box<dyn Source>, framing: &Framing) -> Result<Self> {
        let mut ahead: VecDeque<Frame> = VecDeque::new();
        while ahead.len() < ESTIMATED_FROM
            && let Some(frame) = source.next()?
        {
            ahead.push_back(frame);
        }
        let size = ahead.front().map_or((0, 0), |frame| frame.pair.size());
        let alike = ahead.iter().filter(|frame| frame.pair.size() == size);
        let pooled: Vec<_> = alike.flat_map(|frame| matches(&frame.pair)).collect();
        let agreeing = EpipolarGeometry::estimate(&pooled, TOLERANCE_PX)
            .map(|found| found.inliers)
            .unwrap_or_default();
        let context = |e: Error| {
            Error::Invalid(format!(
                "{}: cannot be rectified from its images: {e}",
                source.name()
            ))
        };
        let homographies = uncalibrated(&agreeing, size, framing).map_err(context)?;
        let rectifier = Rectifier::uncalibrated(&homographies, size)?;
        Self::ahead(source, rectifier, None, ahead)
    }

    fn ahead(
        source: Box<dyn Source>,
        rectifier: Rectifier,
        calibration: Option<Arc<StereoCalibration>>,
        ahead: VecDeque<Frame>,
    ) -> Result<Self> {
        let (width, height) = rectifier.size();
        let blank = || Gray::filled(width, height, 0);
        Ok(Self {
            source,
            rectifier,
            calibration,
            follows_pairs: false,
            rectified: 0,
            unreadable: 0,
            ahead,
            spare: [blank()?, blank()?],
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
            && self.calibration.as_ref() != Some(own)
        {
            let (rectifier, calibration) = prepared(StereoCalibration::clone(own))?;
            (self.rectifier, self.calibration) = (rectifier, Some(calibration));
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
        let [left, right] = std::mem::replace(&mut self.spare, frame.pair.into_images());
        Ok(Frame {
            pair: StereoPair::new(left, right)?,
            color,
            geometry: Geometry::Rectified(self.rectifier.rig().copied()),
            calibration: self.calibration.clone(),
            // The pose is that of the left camera, which rectification rotates.
            pose: frame
                .pose
                .and_then(|pose| Some(pose * self.rectifier.rotation()?.inverse())),
            ..frame
        })
    }
}

impl Source for RectifiedSource {
    fn wrapped(&self) -> Option<&dyn Source> {
        Some(&*self.source)
    }

    fn wrapped_mut(&mut self) -> Option<&mut dyn Source> {
        Some(&mut *self.source)
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        loop {
            let ahead = self.ahead.pop_front().map(|frame| Ok(Some(frame)));
            let Some(mut frame) = ahead.unwrap_or_else(|| self.source.next())? else {
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

    fn seek(&mut self, index: u64) -> Result<bool> {
        let seeks = self.source.seek(index)?;
        if seeks {
            self.ahead.clear();
        }
        Ok(seeks)
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

/// A source whose raw pairs are declared rectified by the user (`--calib none`).
pub struct AssumeRectified<'a>(&'a mut dyn Source);

impl<'a> AssumeRectified<'a> {
    pub fn new(source: &'a mut dyn Source) -> Self {
        Self(source)
    }
}

impl Source for AssumeRectified<'_> {
    fn wrapped(&self) -> Option<&dyn Source> {
        Some(self.0)
    }

    fn wrapped_mut(&mut self) -> Option<&mut dyn Source> {
        Some(self.0)
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let mut frame = self.0.next()?;
        if let Some(Frame {
            geometry,
            calibration,
            ..
        }) = &mut frame
            && *geometry == Geometry::Raw
        {
            (*geometry, *calibration) = (Geometry::Rectified(None), None);
        }
        Ok(frame)
    }
}
