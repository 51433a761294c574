//! Subjects besides the metrics, such as speed, stress and drives: a table each.

pub(crate) mod accuracy;
pub(crate) mod checkpoints;
pub(crate) mod drives;
pub(crate) mod kept;
pub(crate) mod late;
pub(crate) mod pieces;
pub(crate) mod recordings;
pub(crate) mod references;
pub(crate) mod reliability;
pub(crate) mod sources;
pub(crate) mod speed;
pub(crate) mod stress;
pub(crate) mod witness;
