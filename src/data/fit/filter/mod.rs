//! Fitting of the filters (thesis, sections 8.1.1 and 8.2.1): labelled windows, back-propagation,
//! false acceptance and rejection.

mod errors;
mod fit;
mod labels;
mod samples;

pub use errors::{ErrorRate, RocCurve, WindowErrors};
pub use fit::{EpochError, FitSettings, FittedNetwork, Standard, fit_network};
pub use labels::FrameLabels;
pub use samples::{WindowLabels, WindowSample, WindowSamples, true_label};

/// What the samples of a recording are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SamplePart {
    Training,
    /// Decides when to stop, and the threshold.
    Validation,
    /// Gives the figures.
    Test,
}

impl SamplePart {
    pub const ALL: [Self; 3] = [Self::Training, Self::Validation, Self::Test];

    /// Parts of so many recordings, at least three: each fifth is for the test, each fifth for the
    /// validation.
    pub fn deal(recordings: usize) -> Vec<Self> {
        let part = |i: usize| match i % 5 {
            0 => Self::Test,
            1 => Self::Validation,
            _ => Self::Training,
        };
        (0..recordings).map(part).collect()
    }
}
