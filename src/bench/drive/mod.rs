//! Drives: an algorithm steers a robot through courses, and its collisions are counted.
//!
//! ```text
//! course (seed) ─▶ world, route ─┐
//!                                ▼
//!          ┌─▶ DriveSource: robot moves, frame is rendered ─▶ run ─▶ depth grid ─┐
//!          └──────────────────────── steering rule ◀── hear ◀────────────────────┘
//! ```
//!
//! A command that was decided on a frame holds from the next frame on: one frame of delay.

mod course;
mod proof;
mod run;
mod source;

pub use course::Course;
pub use run::{DrivePlan, DriveResult};
pub use source::DriveSource;
pub use svl_score::drive::{DriveEvent, DriveLog, TrackPoint};
