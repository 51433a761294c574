//! How much of a run Rerun gets: maps of every frame, or of some.

use crate::error::{Error, Result};
use crate::score::Judged;
use std::str::FromStr;

/// Whose maps and point clouds are logged. Images, overlays and numbers are logged of all frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RerunDetail {
    /// Those of every 30th frame, of every 10th of those that show a checkpoint, and of all scenes.
    Light,
    /// Those of all frames.
    #[default]
    Full,
}

/// Of light detail each so manieth frame has maps,
pub const EVERY: u64 = 30;
/// and while frames show a checkpoint each so manieth: one or two of a robot's visit.
pub const EVERY_AT_CHECKPOINT: u64 = 10;

impl FromStr for RerunDetail {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "light" => Ok(Self::Light),
            "full" => Ok(Self::Full),
            other => Err(Error::Invalid(format!(
                "'{other}': expected light (maps of some frames) or full (of all)"
            ))),
        }
    }
}

/// Chooses the frames with maps, as they come.
#[derive(Clone, Copy)]
pub(super) struct MapFrames {
    detail: RerunDetail,
    /// Frames since the last that has maps, in this run.
    since: Option<u64>,
}

impl MapFrames {
    pub(super) fn new(detail: RerunDetail) -> Self {
        Self {
            detail,
            since: None,
        }
    }

    /// Whether only some frames have maps.
    pub(super) fn are_some(self) -> bool {
        self.detail == RerunDetail::Light
    }

    /// A run begins, whose first frame has maps.
    pub(super) fn begin_run(&mut self) {
        self.since = None;
    }

    /// Whether the next frame has maps.
    pub(super) fn next(&mut self, judged: &Judged) -> bool {
        let mut estimates = judged.estimates.iter();
        let shows_checkpoint = estimates.any(|scored| !scored.checkpoints.is_empty());
        self.choose(judged.frame.name.is_some(), shows_checkpoint)
    }

    fn choose(&mut self, is_scene: bool, shows_checkpoint: bool) -> bool {
        let every = match shows_checkpoint {
            true => EVERY_AT_CHECKPOINT,
            false => EVERY,
        };
        let since = self.since.map(|since| since + 1);
        let has_maps = self.detail == RerunDetail::Full
            // Scenes are few, and no neighbour shows what one of them does.
            || is_scene
            || since.is_none_or(|since| since >= every);
        self.since = if has_maps { Some(0) } else { since };
        has_maps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_has_maps_of_the_first_every_nth_and_checkpoints() {
        let mut frames = MapFrames::new(RerunDetail::Light);
        let mut at = |checkpoint: std::ops::Range<u64>| {
            frames.begin_run();
            let mut has = |i: &u64| frames.choose(false, checkpoint.contains(i));
            (0..75).filter(|i| has(i)).collect::<Vec<_>>()
        };
        assert_eq!(at(0..0), [0, 30, 60]);
        assert_eq!(at(40..52), [0, 30, 40, 50]);
        let mut full = MapFrames::new(RerunDetail::Full);
        assert!((0..3).all(|_| full.choose(false, false)));
        let mut scenes = MapFrames::new(RerunDetail::Light);
        assert!((0..3).all(|_| scenes.choose(true, false)));
    }
}
