//! Evaluations: the report of a run, whole or in parts.

mod folder;
mod maps;
mod part;
mod sweeps;

pub use folder::{COURSES, MANIFEST, REPORT, ReportContent, ReportHead, is_recording, read_ending};
pub use maps::maps;
pub use part::{PART, ReportPart, ReportRun, Shard};
pub use sweeps::number;
