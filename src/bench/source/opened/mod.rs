//! A request for a source, and what an open source contains.

pub(crate) mod calibration;
pub(crate) mod open_source;
pub(crate) mod request;
