//! What subcommands share: sources, outputs, the viewer, progress, live tables, frame
//! stepping, wrong usage.

pub(crate) mod filters;
pub(crate) mod live;
pub(crate) mod outputs;
pub(crate) mod progress;
pub(crate) mod recordings;
pub(crate) mod report_folder;
pub(crate) mod runner;
pub(crate) mod scenario_runs;
pub(crate) mod source;
pub(crate) mod stepper;
pub(crate) mod terminal;
pub(crate) mod usage;
pub(crate) mod viewer;
pub(crate) mod windows;
