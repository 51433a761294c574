//! svl: the record/replay bench for stereo vision that keeps robots from hitting things.
//!
//! `docs/architecture.md` draws the parts of a run. This crate re-exports the modules of its
//! packages. A robot links `svl-core` ([`stereo`], [`kernel`], [`matcher`], [`filter`], [`depth`],
//! [`rectify`]) and, for calibration files, `svl-calibrate`.
//!
//! ```
//! use svl::depth::{self, GridSettings};
//! use svl::matcher::Algorithm;
//! use svl::stereo::{Gray, RectifiedPair, StereoPair};
//!
//! let left = Gray::filled(320, 240, 90)?;
//! let pair = StereoPair::new(left.clone(), left)?;
//! let v3: Algorithm = "v3:max_disparity=64".parse()?;
//! let output = v3.match_pair(RectifiedPair::assume(&pair), None)?;
//! let grid = depth::grid(output.disparity.disparity(), GridSettings::default(), None);
//! assert!(grid.cell(2, 1).depth.is_none(), "a grey wall has no texture to match");
//! # Ok::<(), svl::Error>(())
//! ```

pub use svl_bench::{console, drive, evaluation, pass, record, runs, sink, source, tune};
pub use svl_calibrate as calibrate;
pub use svl_core::{
    Error, Result, alternatives, counted, depth, doubt, filter, interrupt, joined, kernel, matcher,
    nanoseconds, printable, printable_line, rectify, statistics, stereo, timing,
};
pub use svl_files::{self as files, BuildInfo, outputs, overlay, slow_profile};
pub use svl_grab as grab;
#[cfg(feature = "ros2")]
pub use svl_live::dds;
pub use svl_recording as recording;
pub use svl_report as report;
pub use svl_score::{
    bootstrap, judge as score, losses, manifest, memory, notice, plausibility, resize, scenario,
};
pub use svl_sim::{arena, stress};
pub use svl_thesis as reproduce;
pub use svl_train::{self as train, fit};
#[cfg(feature = "rerun")]
pub use svl_viewer as viewer;

/// This build of svl. A program that links svl calls [`BuildInfo::hand_down`] on it before it
/// records or scores, so that manifests record the build.
pub const BUILD: BuildInfo = BuildInfo {
    version: env!("CARGO_PKG_VERSION"),
    git_revision: option_env!("SVL_GIT_REVISION"),
    sources: option_env!("SVL_SOURCES"),
    profile: option_env!("SVL_PROFILE"),
};

/// The Rust examples of README and docs, as doctests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
#[doc = include_str!("../CONTRIBUTING.md")]
#[doc = include_str!("../docs/architecture.md")]
#[doc = include_str!("../docs/library.md")]
mod documents {}
