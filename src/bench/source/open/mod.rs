//! From a user's name to a source of frames, with the facts about it.

pub(crate) mod facts;
pub(crate) mod run_source;
pub(crate) mod sources;
pub(crate) mod usability;
