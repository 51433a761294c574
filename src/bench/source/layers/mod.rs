//! Layers over a source, in the order of [`Chain`](chain::Chain).

pub(crate) mod alignment_monitor;
pub(crate) mod board_truth;
pub(crate) mod chain;
pub(crate) mod distinct;
pub(crate) mod floored;
pub(crate) mod limited;
pub(crate) mod measured;
pub(crate) mod plausible;
pub(crate) mod rectified;
pub(crate) mod registered;
pub(crate) mod repeat_watch;
pub(crate) mod resized;
pub(crate) mod stressed;
