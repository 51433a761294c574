//! What subcommands share: sources, outputs, progress, wrong usage.

pub(crate) mod cache;
pub(crate) mod live;
pub(crate) mod outputs;
pub(crate) mod progress;
pub(crate) mod recorder;
pub(crate) mod rectify;
pub(crate) mod runner;
pub(crate) mod source;
pub(crate) mod terminal;
pub(crate) mod usage;
