//! A source whose pairs are perturbed in one way ([`svl_sim::stress`]).

use crate::source::frames::{Source, wraps};
use std::collections::VecDeque;
use svl_core::stereo::{Frame, Gray, StereoPair};
use svl_core::{Error, Result};
use svl_sim::stress::Stress;

/// The perturbation of a run's pairs.
pub struct Perturbation {
    pub stress: Stress,
    /// Seed of the run, or any other number.
    pub seed: u64,
}

/// Perturbs the pairs of another source. Sequence numbers, stamps and truth stay.
pub struct StressedSource<'a> {
    source: Box<dyn Source + 'a>,
    by: Perturbation,
    /// Right images of the last pairs, if a pair gets an earlier one.
    earlier: VecDeque<Gray>,
    given: u64,
}

impl<'a> StressedSource<'a> {
    pub fn new(source: Box<dyn Source + 'a>, by: Perturbation) -> Self {
        Self {
            source,
            by,
            earlier: VecDeque::new(),
            given: 0,
        }
    }

    /// The pair with the right image of an earlier one; none for the first pairs.
    fn skewed(&mut self, pair: StereoPair) -> Result<Option<StereoPair>> {
        let [left, right] = pair.into_images();
        self.earlier.push_back(right.clone());
        let is_full = self.earlier.len() > self.by.stress.earlier_frames();
        let earlier = if is_full {
            self.earlier.pop_front()
        } else if self.source.listens() {
            // A world that listens cannot skip frames: its first pairs get the oldest image there
            // is.
            self.earlier.front().cloned()
        } else {
            return Ok(None);
        };
        StereoPair::new(left, earlier.unwrap_or(right)).map(Some)
    }
}

impl Source for StressedSource<'_> {
    wraps!();

    fn name(&self) -> String {
        format!("{}, {}", self.source.name(), self.by.stress)
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let frames = self.by.stress.earlier_frames();
        while let Some(mut frame) = self.source.next()? {
            frame.keep_id();
            if frames > 0 && frame.name.is_some() {
                return Err(Error::Usage(format!(
                    "stress {}: uses images of neighbouring pairs, and scenes of a data set have \
                     none",
                    self.by.stress
                )));
            }
            let pair = match frames {
                0 => Some(
                    self.by
                        .stress
                        .apply(frame.pair, self.by.seed, frame.sequence)?,
                ),
                _ => self.skewed(frame.pair)?,
            };
            if let Some(pair) = pair {
                self.given += 1;
                // Colours would still be those of the pair as it was.
                return Ok(Some(Frame {
                    pair,
                    color: None,
                    ..frame
                }));
            }
        }
        match self.given {
            0 if !self.earlier.is_empty() => Err(Error::Usage(format!(
                "stress {}: {} has only {} pairs, which have no such neighbour",
                self.by.stress,
                self.source.name(),
                self.earlier.len()
            ))),
            _ => Ok(None),
        }
    }

    fn seek(&mut self, index: u64) -> Result<bool> {
        // A skew takes its right images from earlier pairs.
        let frames = self.by.stress.earlier_frames() as u64;
        let seeks = self.source.seek(index)?;
        if seeks && frames > 0 {
            self.earlier.clear();
        }
        Ok(seeks)
    }

    fn pairs(&self) -> Option<u64> {
        let frames = self.by.stress.earlier_frames() as u64;
        self.source
            .pairs()
            .map(|pairs| pairs.saturating_sub(frames))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::inputs::arena::ArenaSource;
    use svl_sim::arena::{Arena, ArenaConfig};

    #[test]
    fn skew_takes_the_right_image_of_an_earlier_pair() {
        let mut config = ArenaConfig {
            frames: 5,
            ..ArenaConfig::default()
        };
        (config.rig.width_px, config.rig.height_px) = (40, 30);
        let all = |source: &mut dyn Source| -> Vec<Frame> {
            std::iter::from_fn(|| source.next().unwrap()).collect()
        };
        let arena = || ArenaSource::new(Arena::new(&config, 1).unwrap(), 1);
        let plain = all(&mut arena());
        let stress = "skew=2".parse().unwrap();
        let by = Perturbation { stress, seed: 1 };
        let skewed = all(&mut StressedSource::new(Box::new(arena()), by));
        assert_eq!(skewed.len(), 3);
        for (frame, (own, earlier)) in skewed.iter().zip(plain[2..].iter().zip(&plain)) {
            assert_eq!(frame.sequence, own.sequence);
            assert_eq!(frame.pair.left(), own.pair.left());
            assert_eq!(frame.pair.right(), earlier.pair.right());
            assert_eq!(frame.truth, own.truth);
        }
    }
}
