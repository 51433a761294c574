//! Pairs with the truth of another sensor of their recording.

use super::Source;
use svl_core::Result;
use svl_core::stereo::{Frame, Losses};
use svl_data::recording::{RawCamera, TruthTopic};
use svl_data::score::Judged;

/// A source whose frames get their truth from another sensor's topic, in place of their own.
pub struct MeasuredSource {
    source: Box<dyn Source>,
    truth: TruthTopic,
    raw: Option<RawCamera>,
}

impl MeasuredSource {
    /// `raw`: the left camera, where svl rectifies the pairs of `source`.
    pub fn new(source: Box<dyn Source>, truth: TruthTopic, raw: Option<RawCamera>) -> Self {
        Self { source, truth, raw }
    }
}

impl Source for MeasuredSource {
    fn name(&self) -> String {
        self.source.name()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let mut frame = self.source.next()?;
        if let Some(frame) = &mut frame {
            self.truth.attach(frame, self.raw.as_ref())?;
        }
        Ok(frame)
    }

    fn pairs(&self) -> Option<u64> {
        self.source.pairs()
    }

    fn finish(&mut self, taken: u64) -> Losses {
        Losses {
            without_truth: self.truth.without(),
            ..self.source.finish(taken)
        }
    }

    fn listens(&self) -> bool {
        self.source.listens()
    }

    fn hear(&mut self, judged: &Judged) {
        self.source.hear(judged);
    }
}
