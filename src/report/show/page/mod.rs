//! Common parts of all HTML pages: each is one file that fetches nothing.

pub(crate) mod parts;
pub(crate) mod plot_view;

pub use minijinja::Value;
pub use parts::{MarkView, PageImages, data_url, fill};
pub use plot_view::PlotView;
