//! HTML report of a calibration: one file without scripts or external resources.

pub(crate) mod page;
pub(crate) mod text;
pub(crate) mod verdict;
pub(crate) mod view;

pub use page::{CalibrationPage, RectifiedImages};
pub use text::terminal;
