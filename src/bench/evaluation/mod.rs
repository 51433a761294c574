//! Evaluations: scenarios through their algorithms into a report, whole or in parts.

mod drives;
mod evaluate;
mod left_image;
mod merge;
mod plan;
mod programs;
mod run_opener;
mod session;
mod shard;
mod sweep;
mod work;

pub use evaluate::Evaluation;
pub use left_image::find_left;
pub use merge::Parts;
pub use plan::{Again, ChosenViewer, EvaluationPlan};
pub use shard::Shard;
pub use sweep::{Algorithms, MAX_ALGORITHMS};
