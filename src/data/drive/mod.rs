//! The robot of a drive: how it moves, what it touches, and the rule that steers it.

mod motion;
mod steering;

pub use motion::{
    DriveCommand, DriveEvent, DriveLog, GroundPoint, RobotState, TrackPoint, advance,
};
pub use steering::Steering;
