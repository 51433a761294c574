//! Pairs whose truth is possible: the one place that every truth passes.

use super::repeat_watch::RepeatWatch;
use crate::source::frames::{Source, wraps};
use std::collections::VecDeque;
use svl_core::doubt::Doubt;
use svl_core::stereo::Frame;
use svl_core::{Error, Result};
use svl_recording::warn_of;
use svl_score::losses::Losses;
use svl_score::plausibility::{PlaceWatch, remove_impossible};

/// Impossible truths at the start that refuse all of them: a single one may be damaged.
const MAX_REFUSALS: u64 = 3;
/// Frames that are read ahead to decide.
const MAX_AHEAD: usize = 16;

/// A source whose frames keep the possible pixels of their truth. A truth that is impossible as a
/// whole is dropped; if all of the first ones are, the source fails with the likely unit.
pub struct PlausibleSource<'a> {
    source: Box<dyn Source + 'a>,
    ahead: VecDeque<Frame>,
    /// True once a truth was possible.
    has_possible: bool,
    /// Impossible truths, which are dropped.
    refused: u64,
    /// Impossible pixels of the others.
    pixels: u64,
    /// The doubt for which the source failed.
    failed: Option<Doubt>,
    repeats: RepeatWatch,
    places: PlaceWatch,
}

impl<'a> PlausibleSource<'a> {
    pub fn new(source: Box<dyn Source + 'a>) -> Self {
        Self {
            source,
            ahead: VecDeque::new(),
            has_possible: false,
            refused: 0,
            pixels: 0,
            failed: None,
            repeats: RepeatWatch::default(),
            places: PlaceWatch::default(),
        }
    }

    /// Removes what is impossible from a frame's truth, and returns the doubt if all of it is.
    fn check(&mut self, frame: &mut Frame) -> Option<Doubt> {
        let origin = frame.truth.as_ref()?.kind.origin.to_string();
        let check = remove_impossible(frame);
        let Some(refusal) = check.refusal else {
            self.has_possible |= check.removed < check.known;
            if check.removed > 0 && self.pixels == 0 {
                tracing::warn!(
                    "{}: pair {}: {} of {} pixels of the truth ({origin}) are impossible or zeros \
                     in place of none: dropped, as those of later pairs",
                    self.source.name(),
                    frame.sequence,
                    check.removed,
                    check.known
                );
            }
            self.pixels += check.removed;
            return None;
        };
        frame.truth = None;
        self.refused += 1;
        Some(refusal)
    }

    /// Reads on to decide if the first impossible truths are all.
    fn decide(&mut self, first: Frame, doubt: Doubt) -> Result<Option<Frame>> {
        self.ahead.push_back(first);
        while !self.has_possible && self.refused < MAX_REFUSALS && self.ahead.len() < MAX_AHEAD {
            let Some(mut frame) = self.source.next()? else {
                break;
            };
            self.check(&mut frame);
            self.ahead.push_back(frame);
        }
        if !self.has_possible {
            self.failed = Some(doubt);
            self.ahead.clear();
            return self.next_checked();
        }
        self.warn(&doubt);
        Ok(self.ahead.pop_front())
    }

    fn tell(&self, doubt: &Doubt) {
        warn_of(&self.source.name(), doubt);
    }

    fn warn(&self, doubt: &Doubt) {
        let value: &(dyn std::error::Error + 'static) = doubt;
        let name = self.source.name();
        tracing::warn!(doubt = value, "{name}: {doubt}; such pairs are not scored");
    }

    fn next_checked(&mut self) -> Result<Option<Frame>> {
        if let Some(doubt) = &self.failed {
            return Err(Error::format(self.source.name(), doubt.clone()));
        }
        if let Some(frame) = self.ahead.pop_front() {
            return Ok(Some(frame));
        }
        let Some(mut frame) = self.source.next()? else {
            return Ok(None);
        };
        match self.check(&mut frame) {
            Some(doubt) if !self.has_possible => self.decide(frame, doubt),
            Some(doubt) => {
                if self.refused == 1 {
                    self.warn(&doubt);
                }
                Ok(Some(frame))
            }
            None => Ok(Some(frame)),
        }
    }
}

impl Source for PlausibleSource<'_> {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        let frame = self.next_checked()?;
        if let Some(frame) = &frame {
            let found = [self.repeats.take_in(frame), self.places.take_in(frame)];
            found.iter().flatten().for_each(|doubt| self.tell(doubt));
        }
        Ok(frame)
    }

    fn seek(&mut self, index: u64) -> Result<bool> {
        let sought = self.source.seek(index)?;
        if sought {
            self.ahead.clear();
            if index > 0 {
                // Only the first pairs of the source decide.
                drop(self.places.decide());
            }
        }
        Ok(sought)
    }

    fn finish(&mut self, taken: u64) -> Losses {
        if let Some(misplaced) = self.places.decide() {
            self.tell(&misplaced);
        }
        let losses = self.source.finish(taken);
        Losses {
            without_truth: losses.without_truth + self.refused,
            impossible: losses.impossible + self.pixels,
            ..losses
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::frames::FromFn;
    use svl_core::stereo::{Geometry, Gray, Plane, Rig, StereoPair, Truth};

    /// A pair for each disparity of a truth; none for NaN.
    fn pairs(truths: &[f32]) -> impl Source {
        let mut truths = truths.iter();
        FromFn(move || {
            let Some(&d) = truths.next() else {
                return Ok(None);
            };
            let image = Gray::filled(40, 2, 0)?;
            let rig = Rig::new(50.0, (20.0, 1.0), 0.1, 0.0)?;
            let mut disparity = Plane::filled(40, 2, d)?;
            disparity.set(0, 0, if d < 40.0 { 6000.0 } else { d });
            Ok(Some(Frame {
                truth: (!d.is_nan()).then(|| Truth::exact(disparity, None)),
                ..Frame::new(
                    StereoPair::new(image.clone(), image)?,
                    Geometry::Rectified(Some(rig)),
                )
            }))
        })
    }

    /// True for the frames that keep a truth, and the losses or the error.
    fn read(truths: &[f32]) -> (Vec<bool>, std::result::Result<(u64, u64), String>) {
        let mut source = PlausibleSource::new(Box::new(pairs(truths)));
        let mut kept = Vec::new();
        loop {
            match source.next() {
                Ok(Some(frame)) => kept.push(frame.truth.is_some()),
                Ok(None) => break,
                Err(error) => return (kept, Err(error.to_string())),
            }
        }
        let losses = source.finish(kept.len() as u64);
        (kept, Ok((losses.without_truth, losses.impossible)))
    }

    #[test]
    fn single_pixels_are_dropped_and_counted() {
        assert_eq!(
            read(&[5.0, f32::NAN, 6.0]),
            (vec![true, false, true], Ok((0, 2)))
        );
    }

    #[test]
    fn a_damaged_truth_is_dropped_and_one_of_another_unit_is_refused() {
        let (kept, losses) = read(&[5.0, 1280.0, 6.0]);
        assert_eq!((kept, losses), (vec![true, false, true], Ok((1, 2))));
        let (kept, losses) = read(&[1280.0, f32::NAN, 6.0]);
        assert_eq!((kept, losses), (vec![false, false, true], Ok((1, 1))));
        for truths in [
            &[1280.0][..],
            &[1280.0, f32::NAN],
            &[1280.0, 1281.0, 1282.0, 5.0],
        ] {
            let (kept, error) = read(truths);
            assert!(kept.is_empty());
            let error = error.unwrap_err();
            for part in [
                "pairs: the truth (exact) is impossible: its median disparity is 1280 px",
                "likely its disparities divided by 256",
            ] {
                assert!(error.contains(part), "{error}");
            }
        }
    }
}
