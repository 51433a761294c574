//! Scenes of stereo data sets, as users have them on disk.

pub(crate) mod entry;
pub(crate) mod eth3d;
pub(crate) mod inventory;
pub(crate) mod kitti;
pub(crate) mod middlebury;
pub(crate) mod scene;
pub(crate) mod table;
pub(crate) mod truth;

pub use entry::Dataset;
pub use inventory::Inventory;
pub use scene::{Scene, SceneSource};
pub use table::DATASETS;
