//! Amount of a run that is sent to Rerun: maps of every frame, or of some.

use svl_score::judge::Judged;

/// Every Nth frame is listed,
const EVERY: u64 = 30;
/// and every Nth while frames show a checkpoint: one or two of a robot's visit.
const EVERY_AT_CHECKPOINT: u64 = 10;
/// Limit on the scenes of a run that are all listed; a folder with more is a recording.
const MAX_LISTED_SCENES: u64 = 64;

/// Chooses some frames as they arrive: a run's first one, every 30th, every 10th of those that show
/// a checkpoint, and its first scenes.
#[derive(Clone, Copy, Default)]
pub(crate) struct ListedFrames {
    /// Number of frames since the last listed one, in this run.
    since: Option<u64>,
    /// Scenes of this run so far.
    scenes: u64,
}

impl ListedFrames {
    /// Starts a run, whose first frame is listed.
    pub(crate) fn begin_pass(&mut self) {
        *self = Self::default();
    }

    /// True if the next frame is listed.
    pub(crate) fn next(&mut self, judged: &Judged) -> bool {
        let mut estimates = judged.estimates.iter();
        let shows_checkpoint = estimates.any(|scored| !scored.checkpoints.is_empty());
        self.choose(judged.frame.name.is_some(), shows_checkpoint)
    }

    /// True if the next frame is listed, by what is known before it is scored.
    pub(crate) fn choose(&mut self, is_scene: bool, shows_checkpoint: bool) -> bool {
        let every = if shows_checkpoint {
            EVERY_AT_CHECKPOINT
        } else {
            EVERY
        };
        let since = self.since.map(|since| since + 1);
        self.scenes += u64::from(is_scene);
        // Scenes are few, and their neighbours are different.
        let is_scene = is_scene && self.scenes <= MAX_LISTED_SCENES;
        let listed = is_scene || since.is_none_or(|since| since >= every);
        self.since = if listed { Some(0) } else { since };
        listed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_every_nth_and_checkpoint_frames_and_scenes_are_listed() {
        let mut frames = ListedFrames::default();
        let mut at = |checkpoint: std::ops::Range<u64>| {
            frames.begin_pass();
            let mut has = |i: &u64| frames.choose(false, checkpoint.contains(i));
            (0..75).filter(|i| has(i)).collect::<Vec<_>>()
        };
        assert_eq!(at(0..0), [0, 30, 60]);
        assert_eq!(at(40..52), [0, 30, 40, 50]);
        frames.begin_pass();
        let scenes = (0..200).filter(|_| frames.choose(true, false)).count();
        assert_eq!(scenes, 64 + 4);
    }
}
