//! Code that subcommands share: sources, help, the viewer, progress, frame stepping, wrong usage.

pub(crate) mod data;
pub(crate) mod filters;
pub(crate) mod help;
pub(crate) mod log;
pub(crate) mod progress;
pub(crate) mod recordings;
pub(crate) mod report;
pub(crate) mod source;
pub(crate) mod stepper;
pub(crate) mod terminal;
pub(crate) mod usage;
pub(crate) mod viewer;
