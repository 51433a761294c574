//! Filters of the depth grid (thesis, chapter 8): small neural networks applied to the amplitude
//! spectrum of windows of the left image. [`FILTERS`] is their table.
//!
//! *Floor* (section 8.2): the ground is not an obstacle. Disparities in cells that show it are
//! dropped with [`crate::stereo::Reason::Floor`]. *Too close* (section 8.1): anything nearer than
//! the range of disparities cannot be matched. Cells that show it are
//! [`crate::stereo::CellState::TooClose`].
//!
//! Departures from the thesis: windows follow the cells; the outputs are probabilities; the
//! networks are trained on standardized features, and the standardization is part of their weights.

mod math;
mod model;
mod network;
mod set;
mod spectrum;
mod window;

pub(crate) use model::safetensors_bytes;
pub use model::{FilterFault, FilterModel};
#[doc(hidden)]
pub use {
    math::{exp, logistic, tanh},
    model::ModelFacts,
    network::Network,
    set::{CellFilter, Filters},
    spectrum::{Features, Scaling, Spectrum},
    window::FilterWindows,
};

use crate::error::{Error, Result, did_you_mean};

/// Object of a filter's detection.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FilterKind {
    /// A cell that shows the floor.
    Floor,
    /// A cell that shows something nearer than the range of disparities.
    TooClose,
}

/// An entry of [`FILTERS`].
#[doc(hidden)]
#[derive(Debug)]
pub struct FilterSpec {
    pub kind: FilterKind,
    /// Name in files, labels and on the command line.
    pub name: &'static str,
    pub summary: &'static str,
    /// Labels of its windows: the detected category, and everything else.
    pub categories: [&'static str; 2],
    /// Features of a network unless the user chooses others.
    pub features: Features,
    /// Number of false rejections that weigh as much as one false acceptance in the choice of its
    /// threshold: taking an obstacle for floor is worse than the reverse.
    pub acceptance_cost: f64,
    /// Weight of the L2 penalty of its training.
    pub decay: f32,
    /// Hidden neurons unless the user chooses a number: those of the thesis.
    pub hidden: usize,
}

/// All filters.
#[doc(hidden)]
pub const FILTERS: &[FilterSpec] = &[
    FilterSpec {
        kind: FilterKind::Floor,
        name: "floor",
        summary: "drops disparities of the floor, which is not an obstacle",
        categories: ["floor", "other"],
        features: Features {
            window: 64,
            scaling: Scaling::Amplitude,
        },
        acceptance_cost: 2.0,
        decay: 0.01,
        hidden: 55,
    },
    FilterSpec {
        kind: FilterKind::TooClose,
        name: "too-close",
        summary: "marks cells that are nearer than the range of disparities",
        categories: ["too-close", "clear"],
        features: Features {
            window: 128,
            scaling: Scaling::Log,
        },
        acceptance_cost: 1.0,
        decay: 0.1,
        hidden: 100,
    },
];

impl FilterKind {
    /// Entry of the kind in the table.
    pub fn spec(self) -> &'static FilterSpec {
        let spec = FILTERS.iter().find(|spec| spec.kind == self);
        spec.expect("every kind is in the table")
    }

    pub fn name(self) -> &'static str {
        self.spec().name
    }
}

/// An algorithm's label without its filters: `v3` of `v3+floor`.
#[doc(hidden)]
pub fn without_filters(label: &str) -> &str {
    let is_filter = |name| FILTERS.iter().any(|spec| spec.name == name);
    match label.rsplit_once('+') {
        Some((rest, name)) if is_filter(name) => without_filters(rest),
        _ => label,
    }
}

impl std::fmt::Display for FilterKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for FilterKind {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let names = FILTERS.iter().map(|spec| spec.name);
        let spec = FILTERS.iter().find(|spec| spec.name == text);
        spec.map(|spec| spec.kind).ok_or_else(|| {
            let all: Vec<_> = names.clone().collect();
            Error::Usage(format!(
                "there is no filter '{text}'{}; filters: {}",
                did_you_mean(text, names),
                all.join(", ")
            ))
        })
    }
}
