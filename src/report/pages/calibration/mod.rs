//! HTML report of a calibration: one file without scripts or external resources.

pub(crate) mod text;
pub(crate) mod verdict;
pub(crate) mod view;

pub use text::terminal;
pub use view::{CalibrationPage, RectifiedImages};
