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

/// Use of a recording's samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SamplePart {
    Training,
    /// For early stopping, and for the threshold.
    Validation,
    /// For the figures.
    Test,
}

impl SamplePart {
    pub const ALL: [Self; 3] = [Self::Training, Self::Validation, Self::Test];

    pub fn name(self) -> &'static str {
        ["training", "validation", "test"][self as usize]
    }

    /// Parts for that many recordings, at least three: a fifth for the test, a fifth for the
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
