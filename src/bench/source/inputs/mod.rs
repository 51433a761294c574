//! Inputs of frames: recordings, folders, videos, data sets, cameras, the arena.

pub(crate) mod arena;
pub(crate) mod board;
pub(crate) mod cameras;
pub mod dataset;
pub(crate) mod folder;
pub(crate) mod image_pair;
pub(crate) mod recording;
pub(crate) mod video;
