//! Pairs with the truth of another sensor, of their recording or their folder.

use super::{FolderTruth, Source};
use svl_core::Result;
use svl_core::stereo::{Frame, Losses};
use svl_data::recording::{RawCamera, TruthTopic};

/// The measurements of another sensor.
pub enum SensorTruth {
    Topic(Box<TruthTopic>),
    Files(FolderTruth),
}

/// A source whose frames get their truth from another sensor, in place of their own.
pub struct MeasuredSource {
    source: Box<dyn Source>,
    truth: SensorTruth,
    raw: Option<RawCamera>,
}

impl MeasuredSource {
    /// `raw`: the left camera, if svl rectifies the pairs of `source`.
    pub fn new(source: Box<dyn Source>, truth: SensorTruth, raw: Option<RawCamera>) -> Self {
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
            let raw = self.raw.as_ref();
            match &mut self.truth {
                SensorTruth::Topic(truth) => truth.attach(frame, raw)?,
                SensorTruth::Files(truth) => truth.attach(frame, raw)?,
            }
        }
        Ok(frame)
    }

    fn finish(&mut self, taken: u64) -> Losses {
        Losses {
            without_truth: match &self.truth {
                SensorTruth::Topic(truth) => truth.without(),
                SensorTruth::Files(truth) => truth.without(),
            },
            ..self.source.finish(taken)
        }
    }
}
