//! Images of both cameras joined to pairs.

pub(crate) mod calibration_wait;
pub(crate) mod calibrations;
pub(crate) mod first_messages;
pub(crate) mod own_topics;
pub(crate) mod pair_reader;
pub(crate) mod pair_stamps;
pub(crate) mod skew;
pub(crate) mod stamp_order;
pub(crate) mod stamp_pairing;
pub(crate) mod steps;
pub(crate) mod stream_facts;
pub(crate) mod truth;
