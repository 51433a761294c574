//! Truth that tells floor from obstacles by a plane below the camera.

use crate::source::frames::{Source, wraps};
use std::collections::VecDeque;
use svl_core::stereo::{FloorPlane, Frame, Truth};
use svl_core::{Error, Result};
use svl_recording::warn_of;
use svl_score::plausibility::{FloorPoints, FloorSeen};

/// Frames that are read ahead, from the first with a truth on, to see the floor.
const MAX_AHEAD: usize = 24;

/// The source of the plane.
#[derive(Clone, Copy)]
pub struct ToldFloor {
    /// A level camera; else the source tells it.
    pub level: Option<LevelCamera>,
    /// True for a source that cannot be read ahead.
    pub is_live: bool,
}

impl ToldFloor {
    /// The floor below a recorded camera of that height.
    pub(crate) fn below(height_m: f64) -> Self {
        Self {
            level: Some(LevelCamera {
                height_m,
                is_named: false,
            }),
            is_live: false,
        }
    }
}

#[derive(Clone, Copy)]
pub struct LevelCamera {
    pub height_m: f64,
    /// True if the user named its height: the floor takes the place of the truth's own surfaces.
    pub is_named: bool,
}

/// A source whose truths have surfaces by a plane, unless the truths of the first pairs show
/// another one.
pub struct FlooredSource<'a> {
    source: Box<dyn Source + 'a>,
    told: ToldFloor,
    ahead: VecDeque<Result<Frame>>,
    points: FloorPoints,
    seen: Option<FloorSeen>,
}

impl<'a> FlooredSource<'a> {
    pub fn new(source: Box<dyn Source + 'a>, told: ToldFloor) -> Self {
        Self {
            source,
            told,
            ahead: VecDeque::new(),
            points: FloorPoints::default(),
            seen: None,
        }
    }

    fn is_named(&self) -> bool {
        self.told.level.is_some_and(|level| level.is_named)
    }

    /// The plane that is told, where it counts.
    fn plane(&self, truth: &Truth) -> Option<FloorPlane> {
        match truth.surface {
            _ if self.is_named() => self.level(),
            Some(_) => None,
            None => self.source.floor().or_else(|| self.level()),
        }
    }

    fn level(&self) -> Option<FloorPlane> {
        let level = self.told.level.as_ref();
        level.map(|level| FloorPlane::level(level.height_m))
    }

    /// Adds the truth of a frame to what decides.
    fn look(&mut self, frame: &Frame) {
        let told = frame.truth.as_ref().zip(frame.rig());
        let told = told.and_then(|(truth, rig)| Some((self.plane(truth)?, truth, rig)));
        let Some((plane, truth, rig)) = told.filter(|_| self.seen.is_none()) else {
            return;
        };
        self.points.add(truth, rig);
        if self.points.are_enough() {
            self.decide(&plane);
        }
    }

    fn decide(&mut self, plane: &FloorPlane) {
        let seen = self.points.seen(plane);
        if let FloorSeen::Another(doubt) = &seen {
            warn_of(&self.source.name(), doubt);
        }
        self.seen = Some(seen);
    }

    /// Reads on until the first truths have decided.
    fn look_ahead(&mut self, first: Frame) -> Result<Option<Frame>> {
        let plane = first.truth.as_ref().and_then(|truth| self.plane(truth));
        self.look(&first);
        self.ahead.push_back(Ok(first));
        while self.seen.is_none() && self.ahead.len() < MAX_AHEAD {
            let Some(next) = self.source.next().transpose() else {
                break;
            };
            let is_last = next.as_ref().map(|frame| self.look(frame)).is_err();
            self.ahead.push_back(next);
            if is_last {
                break;
            }
        }
        if let Some(plane) = plane.filter(|_| self.seen.is_none()) {
            self.decide(&plane);
        }
        self.ahead.pop_front().transpose()
    }

    fn next_seen(&mut self) -> Result<Option<Frame>> {
        if let Some(frame) = self.ahead.pop_front() {
            return frame.map(Some);
        }
        let Some(frame) = self.source.next()? else {
            return Ok(None);
        };
        let truth = frame.truth.as_ref().filter(|_| self.seen.is_none());
        let is_told = truth.is_some_and(|truth| self.plane(truth).is_some());
        match (is_told && frame.rig().is_some(), self.told.is_live) {
            (false, _) => Ok(Some(frame)),
            (true, true) => {
                self.look(&frame);
                Ok(Some(frame))
            }
            (true, false) => self.look_ahead(frame),
        }
    }
}

impl Source for FlooredSource<'_> {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        let Some(mut frame) = self.next_seen()? else {
            return Ok(None);
        };
        let rig = frame.rig().copied();
        let is_named = self.is_named();
        let is_denied = matches!(self.seen, Some(FloorSeen::Another(_)));
        let floor = self.source.floor().or_else(|| self.level());
        frame.floor = floor.filter(|_| !is_denied);
        let Some(truth) = &mut frame.truth else {
            return Ok(Some(frame));
        };
        let plane = self.plane(truth);
        if rig.is_none() && is_named {
            return Err(Error::Usage(format!(
                "--camera-height: pairs of {} have no calibration, so no distances; omit it, or \
                 name one with --calib FILE",
                self.name()
            )));
        }
        if let Some((plane, rig)) = plane.zip(rig).filter(|_| !is_denied) {
            truth.surface = Some(plane.surfaces(&truth.disparity, &rig));
        }
        Ok(Some(frame))
    }

    fn seek(&mut self, index: u64) -> Result<bool> {
        let sought = self.source.seek(index)?;
        if sought {
            self.ahead.clear();
        }
        Ok(sought)
    }

    fn sees_floor(&self) -> Option<bool> {
        self.seen.as_ref().map(|seen| *seen == FloorSeen::Told)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::frames::FromFn;
    use svl_core::stereo::{Geometry, Gray, Plane, Rig, StereoPair};

    /// Pairs over a floor 0.5 m below the camera, some of them without a truth.
    fn pairs(count: usize) -> Box<dyn Source> {
        let mut numbers = 0..count;
        Box::new(FromFn(move || {
            let Some(number) = numbers.next() else {
                return Ok(None);
            };
            let rig = Rig::new(60.0, (32.0, 24.0), 0.1, 0.0)?;
            let floor_m = |y: usize| 0.5 * 60.0 / (y as f64 - 24.0).max(5.0);
            let truth = Plane::from_fn(64, 48, |_, y| rig.disparity_px(floor_m(y)) as f32)?;
            let image = Gray::filled(64, 48, 0)?;
            let pair = StereoPair::new(image.clone(), image)?;
            Ok(Some(Frame {
                sequence: number as u64,
                truth: (number % 3 > 0).then(|| Truth::exact(truth, None)),
                ..Frame::new(pair, Geometry::Rectified(Some(rig)))
            }))
        }))
    }

    /// The pairs that are given, those of them with surfaces, and whether the floor is seen.
    fn read(count: usize, height_m: f64, is_live: bool) -> (Vec<u64>, usize, Option<bool>) {
        let level = Some(LevelCamera {
            height_m,
            is_named: true,
        });
        let mut source = FlooredSource::new(pairs(count), ToldFloor { level, is_live });
        let (mut numbers, mut floored) = (Vec::new(), 0);
        while let Some(frame) = source.next().unwrap() {
            numbers.push(frame.sequence);
            floored += usize::from(frame.truth.is_some_and(|truth| truth.surface.is_some()));
        }
        (numbers, floored, source.sees_floor())
    }

    #[test]
    fn a_floor_counts_that_the_truth_shows() {
        for count in [1, 2, 40] {
            let (numbers, floored, seen) = read(count, 0.5, false);
            let with_truth = count - count.div_ceil(3);
            assert_eq!(numbers, (0..count as u64).collect::<Vec<_>>());
            assert_eq!((floored, seen), (with_truth, (count > 1).then_some(true)));
        }
    }

    #[test]
    fn no_truth_has_a_floor_that_it_denies() {
        let (numbers, floored, seen) = read(40, 1.0, false);
        assert_eq!((numbers.len(), floored, seen), (40, 0, Some(false)));
        // A live source decides by its first pairs: those before it have the told floor.
        let (numbers, floored, seen) = read(40, 1.0, true);
        assert_eq!((numbers.len(), floored, seen), (40, 11, Some(false)));
    }
}
