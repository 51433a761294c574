//! Plots as SVG, for reports and the thesis's figures.

pub(crate) mod bars;
pub(crate) mod canvas;
pub(crate) mod chart;
pub(crate) mod distance;
pub(crate) mod heat;
pub(crate) mod labels;
pub(crate) mod map;
pub(crate) mod series;
pub(crate) mod strips;
pub(crate) mod ticks;

pub use bars::Bars;
pub use chart::{Axis, Chart, two_columns};
pub use distance::distance_chart;
pub use heat::{HeatCell, HeatGrid};
pub use map::{CameraSector, CourseMap, MapWay};
pub use series::{AlgorithmColors, Series, SeriesStyle};
pub use strips::Strips;
