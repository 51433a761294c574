//! The units of a report: what was measured, each under a digest of all that it depends on.
//! Measuring writes units, all else reads them.
//!
//! ```text
//! report.json                       the list: the options of the command, its runs and algorithms
//! units/sessions/SESSION.json       a process that matched
//! units/RUN-DIGEST/run.json         a run under these options: its files, pairs, losses, warnings
//! units/RUN-DIGEST/00003-DIGEST.unit   an algorithm over a block of pairs of the run, or a drive
//! ```
//!
//! The digest of a run covers its options, the one of a unit also the algorithm and the content of
//! its pairs. Every file is written whole, with a checksum, and renamed into place.

pub(crate) mod facts;
pub(crate) mod io;
pub(crate) mod latencies;
pub(crate) mod phantoms;
pub(crate) mod pictures;
pub(crate) mod plan;
pub(crate) mod run_units;
pub mod shots;
pub(crate) mod store;
pub(crate) mod tables;
pub(crate) mod unit;
mod worst;

pub use facts::{PairFacts, RunFacts};
pub use pictures::{BlockPictures, CheckpointShot, StoredImage};
pub use plan::{BLOCK, PlannedAlgorithm, PlannedWitness, ReportPlan, ReportRun};
pub use run_units::RunUnits;
pub use store::{REPORT_LIST, StoredSession, UNITS, Units};
pub use tables::{collect_tables, made_of, read_tables, write_tables};
pub use unit::{DriveFacts, StoredUnit, UnitHeader, UnitRows, UnitWriter, unit_format};
pub use worst::{Badness, WorstFrame, WorstFrames, WorstPicture};
