//! Scenes of stereo data sets and plain folders of pairs, as users have them on disk.

mod calib;
mod folder;
mod scene;

pub use calib::read_calib;
pub use folder::FolderSource;
pub use scene::{Scene, SceneSource};
