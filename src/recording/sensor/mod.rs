//! Distances that another sensor or program of the recording measured, as truth or as the map
//! of an algorithm.

pub(crate) mod depth_image;
pub(crate) mod kind;
pub(crate) mod measurements;
pub(crate) mod points;
pub(crate) mod topic;
pub(crate) mod view;
