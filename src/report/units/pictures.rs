//! Pictures of the pairs of a unit.

use super::worst::{WorstFrame, WorstPicture};
use crate::pages::html::figures::{CheckpointFigure, FrameShot, SceneFigure};
use crate::rows::held::Row;
use serde::{Deserialize, Serialize};
use serde_json::value::{RawValue, to_raw_value};
use svl_core::{Error, Result};
use svl_score::judge::CheckpointFrame;

/// An image file, and the size of the image that it is of.
pub type StoredImage = (Vec<u8>, (usize, usize));

/// Pictures of the pairs of a unit.
#[derive(Clone, Default, Serialize, Deserialize)]
pub struct BlockPictures {
    /// The best and the worst frame of each checkpoint, by its number.
    pub checkpoints: Vec<CheckpointShot>,
    /// Frames by their places in the run.
    pub samples: Vec<(u64, CheckpointFigure)>,
    /// Scenes by their places in the run.
    pub scenes: Vec<(u64, SceneFigure)>,
    /// The frames of the algorithm that may be its worst, by their places.
    pub worst: Vec<WorstFrame<WorstPicture>>,
}

impl BlockPictures {
    /// The numbers of the pairs that they show.
    pub fn sequences(&self) -> impl Iterator<Item = u64> {
        let checkpoints = self.checkpoints.iter().map(|shot| shot.sequence);
        let frames = self.figures().flat_map(|figure| &figure.shots);
        let frames = frames.map(|(_, shot)| shot.row.sequence);
        let scenes = self.all_scenes().flat_map(|scene| &scene.shots);
        let scenes = scenes.map(|shot| shot.row.sequence);
        checkpoints.chain(frames).chain(scenes)
    }

    fn figures(&self) -> impl Iterator<Item = &CheckpointFigure> {
        let worst = self.worst.iter().filter_map(|frame| match &frame.picture {
            WorstPicture::Frame(figure) => Some(&**figure),
            WorstPicture::Scene(_) | WorstPicture::Sample => None,
        });
        self.samples.iter().map(|(_, figure)| figure).chain(worst)
    }

    fn all_scenes(&self) -> impl Iterator<Item = &SceneFigure> {
        let worst = self.worst.iter().filter_map(|frame| match &frame.picture {
            WorstPicture::Scene(scene) => Some(&**scene),
            WorstPicture::Frame(_) | WorstPicture::Sample => None,
        });
        self.scenes.iter().map(|(_, scene)| scene).chain(worst)
    }

    /// The picture of one of the worst frames, wherever it is.
    pub(super) fn worst_picture(&self, frame: &WorstFrame<WorstPicture>) -> Option<WorstPicture> {
        let WorstPicture::Sample = frame.picture else {
            return Some(frame.picture.clone());
        };
        let sample = self.samples.iter().find(|(place, _)| *place == frame.place);
        let sample = sample.map(|(_, own)| WorstPicture::Frame(Box::new(own.clone())));
        sample.or_else(|| {
            let scene = self.scenes.iter().find(|(place, _)| *place == frame.place);
            scene.map(|(_, own)| WorstPicture::Scene(Box::new(own.clone())))
        })
    }

    /// A frame of the row's pair, if they show it: of a scene without cells.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a picture is not what svl writes.
    pub fn shot(&self, row: &Row) -> Result<Option<FrameShot>> {
        let is_own = |own: &Row| own.pair_hash == row.pair_hash;
        let mut frames = self.figures().flat_map(|figure| &figure.shots);
        if let Some((_, shot)) = frames.find(|(_, shot)| is_own(&shot.row)) {
            return Ok(Some(shot.clone()));
        }
        let checkpoints = self.checkpoints.iter();
        for shot in checkpoints.filter(|shot| shot.sequence == row.sequence) {
            let shot = shot.shot()?;
            if is_own(&shot.row) {
                return Ok(Some(FrameShot {
                    passed: None,
                    failures: Vec::new(),
                    findings: Vec::new(),
                    ..shot
                }));
            }
        }
        let mut scenes = self.all_scenes();
        Ok(scenes.find_map(|scene| {
            let own = scene.shots.iter().find(|own| is_own(&own.row))?;
            Some(FrameShot {
                preview: Some(own.disparities.clone()),
                true_preview: scene.truth.clone(),
                errors: own.errors.clone(),
                row: own.row.clone(),
                left: scene.left.clone(),
                size: (own.row.width as usize, own.row.height as usize),
                ..FrameShot::default()
            })
        }))
    }
}

/// The picture of a frame that shows a checkpoint.
#[derive(Clone, Serialize, Deserialize)]
pub struct CheckpointShot {
    pub algorithm: String,
    pub checkpoint: u32,
    pub sequence: u64,
    pub frame: CheckpointFrame,
    /// Parsed only if it is shown.
    shot: Box<RawValue>,
}

impl CheckpointShot {
    /// The picture of a frame with the result of that checkpoint.
    ///
    /// # Errors
    /// [`Error::Invalid`] for numbers that JSON does not have.
    pub fn new(checkpoint: u32, frame: &CheckpointFrame, shot: &FrameShot) -> Result<Self> {
        let stored = to_raw_value(shot);
        Ok(Self {
            algorithm: shot.row.algorithm.clone(),
            checkpoint,
            sequence: shot.row.sequence,
            frame: *frame,
            shot: stored.map_err(|e| Error::Invalid(format!("pictures: {e}")))?,
        })
    }

    /// The picture.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not what svl writes.
    pub fn shot(&self) -> Result<FrameShot> {
        let shot = serde_json::from_str(self.shot.get());
        shot.map_err(|e| Error::Invalid(format!("pictures: {e}")))
    }
}
