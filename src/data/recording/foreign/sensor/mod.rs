//! Truth from another sensor of the recording: depth images, point clouds, laser scans.

mod depth_image;
mod kind;
mod measurements;
mod points;
mod transforms;
mod view;

use super::{PairStamps, topics};
use crate::recording::messages::{Channel, EventReader, FileEvent};
use crate::recording::{Recording, truth};
use measurements::Measurements;
use svl_core::stereo::{Frame, Plane, Rig, Truth, TruthDensity, TruthKind, TruthOrigin};
use svl_core::{Error, Result};
pub use view::RawCamera;
use view::{Setup, View};

/// Which topic holds the truth, and how near in time a measurement must be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TruthSelection {
    pub topic: String,
    /// Largest difference of the stamps of a pair and its measurement.
    pub max_skew_ns: u64,
}

impl TruthSelection {
    /// At 1 m/s a robot moves 2 cm in that time, a fifth of what a cell's distance may be off.
    pub const MAX_SKEW_NS: u64 = 20_000_000;
}

/// The measurements of a topic, as truths of the pairs of the same recording.
pub struct TruthTopic {
    recording: Recording,
    topic: String,
    measurements: Measurements,
    setup: Setup,
    /// How measurements are seen by the left camera, known from the first pair on.
    view: Option<View>,
    without: u64,
}

impl TruthTopic {
    /// Finds the topic, the left camera, the transform between the two, and which measurement is of
    /// which pair. `left`: the topic of the left images.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] where the topic is missing or of another type, its first
    /// message cannot be read, no transform leads to the left camera, the stamps are of another
    /// clock, or several pairs or measurements share one.
    pub(in crate::recording) fn open(
        recording: &Recording,
        left: &str,
        pairs: PairStamps,
        selection: &TruthSelection,
    ) -> Result<Self> {
        let channels = recording.channels()?;
        let TruthSelection { topic, max_skew_ns } = selection;
        let wrong = |reason: String| {
            let reason = format!("--truth {topic}: {reason}");
            Error::format(recording.path(), reason)
        };
        let kind = kind::of(&channels, topic, left).map_err(wrong)?;
        let setup = Setup::find(recording, &channels, left, topic, kind)?.map_err(wrong)?;
        let measurements = Measurements::find(recording, (topic, *max_skew_ns), kind, pairs)?;
        Ok(Self {
            recording: recording.clone(),
            topic: topic.clone(),
            measurements: measurements.map_err(wrong)?,
            setup,
            view: None,
            without: 0,
        })
    }

    /// Pairs so far for which there was no measurement.
    pub fn without(&self) -> u64 {
        self.without
    }

    /// Gives the frame the truth of the nearest measurement within the limit, or none. `raw`: the
    /// left camera, where svl rectified the pair.
    ///
    /// # Errors
    /// [`Error::Format`] for a pair without rig, and for depth images that cannot be placed in the
    /// left image; [`Error::Io`].
    pub fn attach(&mut self, frame: &mut Frame, raw: Option<&RawCamera>) -> Result<()> {
        let Some(rig) = frame.rig().copied() else {
            let why = "pairs without a calibration have no distances to compare: --calib FILE";
            return Err(self.wrong(why));
        };
        frame.truth = None;
        let Some(measured) = self.measurements.of(frame)? else {
            self.without += 1;
            return Ok(());
        };
        let size = frame.pair.size();
        let view = match self.view.take() {
            Some(view) => view,
            None => {
                let view = self.setup.view(&self.topic, &measured, &rig, size, raw);
                view.map_err(|reason| self.wrong(&reason))?
            }
        };
        let disparity = view.disparities(&measured, &rig, size);
        let density = view.density();
        self.view = Some(view);
        frame.truth = Some(Truth {
            disparity: disparity.map_err(|reason| self.wrong(&reason))?,
            visibility: None,
            surface: None,
            kind: TruthKind {
                density,
                origin: TruthOrigin::Sensor(self.topic.clone()),
            },
        });
        Ok(())
    }

    fn wrong(&self, reason: &str) -> Error {
        let reason = format!("--truth {}: {reason}", self.topic);
        Error::format(self.recording.path(), reason)
    }
}
