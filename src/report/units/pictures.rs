//! Pictures of the pairs of a unit.

use crate::pages::html::figures::{CheckpointFigure, FrameShot, SceneFigure};
use crate::rows::records::Row;
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
}

impl BlockPictures {
    /// The numbers of the pairs that they show.
    pub fn sequences(&self) -> impl Iterator<Item = u64> {
        let samples = self.samples.iter().flat_map(|(_, figure)| &figure.shots);
        let scenes = self.scenes.iter().flat_map(|(_, scene)| &scene.shots);
        let checkpoints = self.checkpoints.iter().map(|shot| shot.sequence);
        let checkpoints = checkpoints.chain(samples.map(|(_, shot)| shot.row.sequence));
        checkpoints.chain(scenes.map(|shot| shot.row.sequence))
    }

    /// The left image of the row's pair, if they show it: the file, and the size of the image.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a picture is not what svl writes.
    pub fn left(self, row: &Row) -> Result<Option<StoredImage>> {
        let is_own = |own: &Row| own.pair_hash == row.pair_hash;
        for shot in self
            .checkpoints
            .iter()
            .filter(|shot| shot.sequence == row.sequence)
        {
            let shot = shot.shot()?;
            if is_own(&shot.row) {
                return Ok(Some((shot.left, shot.size)));
            }
        }
        let samples = self.samples.into_iter();
        let samples = samples.flat_map(|(_, figure)| figure.shots);
        let mut samples = samples.filter(|(_, shot)| is_own(&shot.row));
        if let Some((_, shot)) = samples.next() {
            return Ok(Some((shot.left, shot.size)));
        }
        let shows = |scene: &SceneFigure| scene.shots.iter().any(|shot| is_own(&shot.row));
        let mut scenes = self.scenes.into_iter().filter(|(_, scene)| shows(scene));
        Ok(scenes.next().map(|(_, scene)| (scene.left, scene.size)))
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
