//! The robot of a drive: its motion, its collisions, and the rule that steers it.

mod motion;
mod steering;

pub use motion::{
    DriveCommand, DriveEvent, DriveLog, GroundPoint, RobotState, TrackPoint, advance,
};
pub use steering::Steering;
