//! Pairs with the truth of another sensor, of their recording or their folder.

use super::{FolderTruth, Source, wraps};
use svl_core::Result;
use svl_core::stereo::{Frame, Losses};
use svl_recording::TruthTopic;

/// The measurements of another sensor.
pub enum SensorTruth {
    Topic(Box<TruthTopic>),
    Files(FolderTruth),
}

/// A source whose frames get their truth from another sensor, in place of their own.
pub struct MeasuredSource {
    source: Box<dyn Source>,
    truth: SensorTruth,
}

impl MeasuredSource {
    pub fn new(source: Box<dyn Source>, truth: SensorTruth) -> Self {
        Self { source, truth }
    }
}

impl Source for MeasuredSource {
    wraps!(source);

    fn next(&mut self) -> Result<Option<Frame>> {
        let mut frame = self.source.next()?;
        if let Some(frame) = &mut frame {
            match &mut self.truth {
                SensorTruth::Topic(truth) => truth.attach(frame)?,
                SensorTruth::Files(truth) => truth.attach(frame)?,
            }
        }
        Ok(frame)
    }

    fn finish(&mut self, taken: u64) -> Losses {
        let (without_truth, jumped) = match &self.truth {
            SensorTruth::Topic(truth) => (truth.without(), truth.jumped()),
            SensorTruth::Files(truth) => (truth.without(), 0),
        };
        Losses {
            without_truth,
            jumped,
            ..self.source.finish(taken)
        }
    }
}
