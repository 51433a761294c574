//! Evaluations: scenarios through their algorithms into a report, whole or in parts.

mod drives;
mod evaluate;
mod folder;
mod maps;
mod merge;
mod part;
mod plan;
mod scored_runs;
mod sweep;
mod sweeps;

pub use evaluate::Evaluation;
pub use folder::{MANIFEST, REPORT};
pub use merge::Parts;
pub use part::Shard;
pub use plan::EvaluationPlan;
pub use sweep::{Algorithms, MAX_ALGORITHMS};
