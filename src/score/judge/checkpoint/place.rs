//! Frames that show a checkpoint: by the robot's pose, by their numbers or by their time.

use std::path::Path;
use svl_core::stereo::{Frame, Pose};

/// Rule for the frames that show a checkpoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CheckpointPlace {
    /// Frames taken from about this pose.
    Pose {
        /// Position of the left camera, metres on the floor.
        at_m: [f64; 2],
        /// Largest distance of a frame from it.
        radius_m: f64,
        /// Direction of view in the world, `atan2(y, x)`.
        heading_deg: f64,
        heading_tolerance_deg: f64,
    },
    /// Frames with these sequence numbers, both ends included.
    Frames([u64; 2]),
    /// Frames in these seconds since the run's first pair, both ends included.
    Seconds([f64; 2]),
}

/// The run of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameOrigin {
    /// The end of its file's path; empty if runs have no files.
    pub name: String,
    /// Stamp of the first pair of its source.
    pub start_ns: u64,
    /// True if its stamps are placeholders.
    pub is_untimed: bool,
    /// Perturbation of its pairs, if any, in the text form of [`svl_sim::stress::Stress`].
    pub stress: Option<String>,
    /// Seed of the arena, if it is one.
    pub seed: Option<u64>,
}

impl FrameOrigin {
    /// True if it is the run of that file, or if there is no file.
    pub fn is_in(&self, file: Option<&str>) -> bool {
        let ends = |file: &str| {
            let (run, file) = (Path::new(&self.name), Path::new(file));
            run.ends_with(file) || file.ends_with(run)
        };
        file.is_none_or(|file| !self.name.is_empty() && ends(file))
    }
}

/// A contradiction in a checkpoint.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointFault {
    #[error("{0}")]
    Place(&'static str),
    #[error("at_m and heading_deg must be numbers, radius_m and heading_tolerance_deg positive")]
    Pose,
    #[error("frames = [{0}, {1}]: the first is after the last")]
    Frames(u64, u64),
    #[error("seconds = [{0}, {1}]: expected two times, 0 or more, in order")]
    Seconds(f64, f64),
    /// Column and row of a cell, and what is wrong with it.
    #[error("cell [{0}, {1}]: {2}")]
    Cell(usize, usize, &'static str),
}

impl CheckpointPlace {
    /// The place with these entries in a file; `angles`: radius, heading and its tolerance.
    pub(super) fn new(
        at_m: Option<[f64; 2]>,
        angles: [Option<f64>; 3],
        frames: Option<[u64; 2]>,
        seconds: Option<[f64; 2]>,
    ) -> Result<Self, CheckpointFault> {
        let wrong = |what| Err(CheckpointFault::Place(what));
        match (at_m, frames, seconds) {
            (Some(at_m), None, None) => match angles {
                [
                    Some(radius_m),
                    Some(heading_deg),
                    Some(heading_tolerance_deg),
                ] => Ok(Self::Pose {
                    at_m,
                    radius_m,
                    heading_deg,
                    heading_tolerance_deg,
                }),
                _ => wrong("at_m needs radius_m, heading_deg and heading_tolerance_deg"),
            },
            (None, ..) if angles.iter().any(Option::is_some) => {
                wrong("radius_m, heading_deg and heading_tolerance_deg belong to at_m")
            }
            (None, Some(frames), None) => Ok(Self::Frames(frames)),
            (None, None, Some(seconds)) => Ok(Self::Seconds(seconds)),
            (None, None, None) => wrong("give one of at_m, frames, seconds and pair"),
            _ => wrong("give only one of at_m, frames and seconds"),
        }
    }

    pub(super) fn validate(&self) -> Result<(), CheckpointFault> {
        match *self {
            Self::Pose {
                at_m: [x, y],
                radius_m,
                heading_deg,
                heading_tolerance_deg,
            } => {
                let numbers = [x, y, radius_m, heading_deg, heading_tolerance_deg];
                let finite = numbers.iter().all(|v| v.is_finite());
                let is_pose = finite && radius_m > 0.0 && heading_tolerance_deg > 0.0;
                is_pose.then_some(()).ok_or(CheckpointFault::Pose)
            }
            Self::Frames([a, b]) if a > b => Err(CheckpointFault::Frames(a, b)),
            Self::Seconds([a, b]) if !(a >= 0.0 && b >= a && b.is_finite()) => {
                Err(CheckpointFault::Seconds(a, b))
            }
            _ => Ok(()),
        }
    }

    /// True if a frame of that run shows it.
    pub(super) fn covers(&self, frame: &Frame, run: &FrameOrigin) -> bool {
        match *self {
            Self::Pose { .. } => frame.pose.as_ref().is_some_and(|pose| self.is_near(pose)),
            Self::Frames([a, b]) => (a..=b).contains(&frame.sequence),
            Self::Seconds([a, b]) => {
                let seconds = frame.stamp_ns.saturating_sub(run.start_ns) as f64 / 1e9;
                (a..=b).contains(&seconds)
            }
        }
    }

    /// The range in words, if it ends after the run's last pair, of that number and stamp.
    pub(super) fn beyond(
        &self,
        (sequence, stamp_ns): (u64, u64),
        run: &FrameOrigin,
    ) -> Option<String> {
        let seconds = stamp_ns.saturating_sub(run.start_ns) as f64 / 1e9;
        match *self {
            Self::Frames([a, b]) if b > sequence => Some(format!(
                "frames = [{a}, {b}], and the last pair is {sequence}"
            )),
            Self::Seconds([a, b]) if b > seconds => Some(format!(
                "seconds = [{a}, {b}], and the last pair is at {seconds:.2} s"
            )),
            _ => None,
        }
    }

    fn is_near(&self, pose: &Pose) -> bool {
        let Self::Pose {
            at_m,
            radius_m,
            heading_deg,
            heading_tolerance_deg,
        } = *self
        else {
            return false;
        };
        let at = pose.translation.vector;
        let view = pose.rotation * nalgebra::Vector3::z();
        let facing_deg = view.y.atan2(view.x).to_degrees();
        // Difference of two directions, in -180..180.
        let off_deg = (facing_deg - heading_deg + 180.0).rem_euclid(360.0) - 180.0;
        (at.x - at_m[0]).hypot(at.y - at_m[1]) <= radius_m && off_deg.abs() <= heading_tolerance_deg
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::Checkpoint;
    use svl_core::stereo::{Geometry, Gray, StereoPair};

    fn opening() -> CheckpointPlace {
        CheckpointPlace::Pose {
            at_m: [1.0, 0.5],
            radius_m: 0.1,
            heading_deg: 90.0,
            heading_tolerance_deg: 5.0,
        }
    }

    #[test]
    fn covers_by_place_and_heading() {
        // Optical frame looking along +y of the world: its z is the world's y, its x the world's x,
        // its y downwards.
        let looking = |yaw_deg: f64, x: f64| {
            let axes = nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(
                1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0,
            ));
            let turn = nalgebra::Rotation3::from_axis_angle(
                &nalgebra::Vector3::z_axis(),
                yaw_deg.to_radians(),
            );
            Pose::from_parts(
                [x, 0.5, 0.06].into(),
                nalgebra::UnitQuaternion::from_rotation_matrix(&(turn * axes)),
            )
        };
        assert!(opening().is_near(&looking(0.0, 1.0)));
        assert!(opening().is_near(&looking(-4.9, 1.09)) && opening().is_near(&looking(4.9, 0.91)));
        assert!(!opening().is_near(&looking(5.1, 1.0)) && !opening().is_near(&looking(0.0, 1.11)));
        let west = CheckpointPlace::Pose {
            at_m: [1.0, 0.5],
            radius_m: 0.1,
            heading_deg: -179.0,
            heading_tolerance_deg: 5.0,
        };
        assert!(
            west.is_near(&looking(92.0, 1.0)),
            "179 and -179 degrees are two apart wrapping around"
        );
    }

    #[test]
    fn frames_and_seconds_hold_both_ends() {
        let image = Gray::filled(1, 1, 0).unwrap();
        let frame = |sequence, stamp_ns| Frame {
            sequence,
            stamp_ns,
            ..Frame::new(
                StereoPair::new(image.clone(), image.clone()).unwrap(),
                Geometry::Rectified(None),
            )
        };
        let run = FrameOrigin {
            name: "own.mcap".into(),
            start_ns: 7_000_000_000,
            ..FrameOrigin::default()
        };
        let frames = CheckpointPlace::Frames([3, 5]);
        let shows = [2, 3, 5, 6].map(|sequence| frames.covers(&frame(sequence, 0), &run));
        assert_eq!(shows, [false, true, true, false]);
        let seconds = CheckpointPlace::Seconds([0.5, 1.0]);
        let shows = [7_499_999_999, 7_500_000_000, 8_000_000_000, 8_000_000_001]
            .map(|stamp_ns| seconds.covers(&frame(0, stamp_ns), &run));
        assert_eq!(shows, [false, true, true, false]);
        let is_beyond = |place: CheckpointPlace, last| place.beyond(last, &run).is_some();
        assert!(is_beyond(frames, (4, 0)) && !is_beyond(frames, (5, 0)));
        assert!(is_beyond(seconds, (0, 7_999_999_999)) && !is_beyond(seconds, (0, 8_000_000_000)));
    }

    #[test]
    fn a_run_is_known_by_the_end_of_its_path() {
        let run = |name: &str| FrameOrigin {
            name: name.into(),
            start_ns: 0,
            ..FrameOrigin::default()
        };
        assert!(run("own.mcap").is_in(None) && run("").is_in(None));
        assert!(run("own.mcap").is_in(Some("day/own.mcap")));
        assert!(run("day/own.mcap").is_in(Some("own.mcap")));
        assert!(!run("own.mcap").is_in(Some("n.mcap")) && !run("").is_in(Some("own.mcap")));
    }

    #[test]
    fn a_place_is_said_in_one_way() {
        let parse = |place: &str| {
            let text = format!("number = 1\nname = \"x\"\nmust = [[0, 0]]\n{place}");
            let parsed = toml::from_str::<Checkpoint>(&text);
            parsed.map_err(|e| e.message().to_owned()).map(|c| c.place)
        };
        assert_eq!(
            parse("frames = [1, 1]").unwrap(),
            CheckpointPlace::Frames([1, 1])
        );
        for (place, words) in [
            ("", "give one of at_m, frames, seconds and pair"),
            (
                "frames = [1, 2]\nseconds = [1, 2]",
                "give only one of at_m, frames and seconds",
            ),
            ("at_m = [1, 2]", "at_m needs radius_m"),
            ("frames = [1, 2]\nradius_m = 1", "belong to at_m"),
            ("frames = [1]", "length 1"),
            ("frames = [-1, 2]", "-1"),
        ] {
            let error = parse(place).unwrap_err();
            assert!(error.contains(words), "{place}: {error}");
        }
    }
}
