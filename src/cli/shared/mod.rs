//! What subcommands share: sources, outputs, progress, wrong usage.

pub(crate) mod cache;
pub(crate) mod folder;
pub(crate) mod live;
pub(crate) mod output;
pub(crate) mod progress;
pub(crate) mod recorder;
pub(crate) mod rectify;
pub(crate) mod runner;
pub(crate) mod source;
pub(crate) mod tables;
pub(crate) mod usage;
