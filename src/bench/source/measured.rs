//! Pairs with the truth of another sensor of their recording.

use super::Source;
use svl_core::Result;
use svl_core::stereo::{Frame, Losses};
use svl_data::recording::{RawCamera, TruthTopic};

/// A source whose frames get their truth from another sensor's topic, in place of their own.
pub struct MeasuredSource {
    source: Box<dyn Source>,
    truth: TruthTopic,
    raw: Option<RawCamera>,
}

impl MeasuredSource {
    /// `raw`: the left camera, if svl rectifies the pairs of `source`.
    pub fn new(source: Box<dyn Source>, truth: TruthTopic, raw: Option<RawCamera>) -> Self {
        Self { source, truth, raw }
    }
}

impl Source for MeasuredSource {
    fn wrapped(&self) -> Option<&dyn Source> {
        Some(&*self.source)
    }

    fn wrapped_mut(&mut self) -> Option<&mut dyn Source> {
        Some(&mut *self.source)
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let mut frame = self.source.next()?;
        if let Some(frame) = &mut frame {
            self.truth.attach(frame, self.raw.as_ref())?;
        }
        Ok(frame)
    }

    fn finish(&mut self, taken: u64) -> Losses {
        Losses {
            without_truth: self.truth.without(),
            ..self.source.finish(taken)
        }
    }
}
