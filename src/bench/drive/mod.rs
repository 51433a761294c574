//! Drives: an algorithm steers a robot through courses, and its collisions are counted.
//!
//! ```text
//! course (seed) ─▶ world, route ─┐
//!                                ▼
//!          ┌─▶ DriveSource: robot moves, frame is rendered ─▶ run ─▶ depth grid ─┐
//!          └──────────────────────── steering rule ◀── hear ◀────────────────────┘
//! ```
//!
//! A command that was decided on a frame takes effect after the algorithm's latency, and until then
//! the former one holds; without a latency from the next frame on. Pairs that arrive while the
//! algorithm is busy are skipped.

mod course;
mod plan;
mod proof;
mod source;

pub use course::Course;
pub use plan::{DrivePlan, DriveResult};
pub use source::DriveSource;
pub use svl_score::drive::{DriveEvent, DriveLog, TrackPoint};
