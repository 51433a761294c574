//! Raw pairs, rectified on their way.

use super::Source;
use crate::error::{Error, Result};
use crate::rectify::{Epipolar, Framing, Rectifier, matches, uncalibrated};
use crate::stereo::{Frame, Geometry, Gray, Losses, StereoPair};
use std::collections::VecDeque;

/// A source whose pairs are rectified; its frames have the rectified rig.
pub struct RectifiedSource {
    source: Box<dyn Source>,
    rectifier: Rectifier,
    /// Frames that were looked at before the first was given out, still raw.
    ahead: VecDeque<Frame>,
    /// What the last pair was before; the next is rectified into it.
    spare: [Gray; 2],
}

/// Pairs that an estimate is made of.
const LOOKED_AT: usize = 8;
/// How far a match may be from the geometry that the others agree on: as far as lenses bend it.
const TOLERANCE_PX: f64 = 2.0;

impl RectifiedSource {
    /// The pairs of `source`, which are raw, by a calibration.
    ///
    /// # Errors
    /// [`Error::Dimensions`].
    pub fn new(source: Box<dyn Source>, rectifier: Rectifier) -> Result<Self> {
        Self::ahead(source, rectifier, VecDeque::new())
    }

    /// The pairs of `source` by what is seen in its first ones, without a calibration: rows agree,
    /// distances stay unknown.
    ///
    /// # Errors
    /// [`Error::Invalid`] where too little is seen in both images; those of the source.
    pub fn estimated(mut source: Box<dyn Source>, framing: &Framing) -> Result<Self> {
        let mut ahead: VecDeque<Frame> = VecDeque::new();
        while ahead.len() < LOOKED_AT
            && let Some(frame) = source.next()?
        {
            ahead.push_back(frame);
        }
        let size = ahead.front().map_or((0, 0), |frame| frame.pair.size());
        let alike = ahead.iter().filter(|frame| frame.pair.size() == size);
        let pooled: Vec<_> = alike.flat_map(|frame| matches(&frame.pair)).collect();
        let agreeing = Epipolar::of(&pooled, TOLERANCE_PX)
            .map(|found| found.inliers)
            .unwrap_or_default();
        let told = |e: Error| {
            Error::Invalid(format!(
                "{}: cannot be rectified by its pictures: {e}",
                source.name()
            ))
        };
        let homographies = uncalibrated(&agreeing, size, framing).map_err(told)?;
        let rectifier = Rectifier::uncalibrated(&homographies, size)?;
        Self::ahead(source, rectifier, ahead)
    }

    fn ahead(
        source: Box<dyn Source>,
        rectifier: Rectifier,
        ahead: VecDeque<Frame>,
    ) -> Result<Self> {
        let (width, height) = rectifier.size();
        let blank = || Gray::filled(width, height, 0);
        Ok(Self {
            source,
            rectifier,
            ahead,
            spare: [blank()?, blank()?],
        })
    }

    fn rectified(&mut self, frame: Frame) -> Result<Frame> {
        // Both would be wrong after it, and say that the pair is rectified.
        if frame.rig().is_some() || frame.truth.is_some() {
            let why =
                "its pairs come with the rig or the truth of rectified images: leave --calib out";
            return Err(Error::Invalid(format!("{}: {why}", self.source.name())));
        }
        let [left, right] = &mut self.spare;
        let told = |e: Error| {
            Error::Invalid(format!(
                "{}: pair {}: {e}",
                self.source.name(),
                frame.sequence
            ))
        };
        self.rectifier
            .apply(&frame.pair, left, right)
            .map_err(told)?;
        let [left, right] = std::mem::replace(&mut self.spare, frame.pair.into_images());
        Ok(Frame {
            pair: StereoPair::new(left, right)?,
            geometry: Geometry::Rectified(self.rectifier.rig().copied()),
            // That of the left camera, which is turned.
            pose: frame
                .pose
                .and_then(|pose| Some(pose * self.rectifier.turn()?.inverse())),
            ..frame
        })
    }
}

impl Source for RectifiedSource {
    fn name(&self) -> String {
        self.source.name()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let frame = match self.ahead.pop_front() {
            Some(frame) => Some(frame),
            None => self.source.next()?,
        };
        frame.map(|frame| self.rectified(frame)).transpose()
    }

    fn pairs(&self) -> Option<u64> {
        self.source.pairs()
    }

    fn finish(&mut self, taken: u64) -> Losses {
        self.source.finish(taken)
    }
}

/// A source whose raw pairs are taken as rectified, as their user wants it.
pub struct AssumeRectified<'a>(&'a mut dyn Source);

impl<'a> AssumeRectified<'a> {
    pub fn new(source: &'a mut dyn Source) -> Self {
        Self(source)
    }
}

impl Source for AssumeRectified<'_> {
    fn name(&self) -> String {
        self.0.name()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let mut frame = self.0.next()?;
        if let Some(Frame { geometry, .. }) = &mut frame
            && *geometry == Geometry::Raw
        {
            *geometry = Geometry::Rectified(None);
        }
        Ok(frame)
    }

    fn pairs(&self) -> Option<u64> {
        self.0.pairs()
    }

    fn finish(&mut self, taken: u64) -> Losses {
        self.0.finish(taken)
    }
}
