//! Rectification: from raw pairs to pairs whose rows correspond (thesis, section 2.3).
//!
//! ```text
//! calibration ── bouguet ──▶ Rectification ──▶ Rectifier ──pair by pair──▶ rectified pairs
//!                                                                                │
//! misalignment ◀── AlignmentMeter ◀── matches ◀──────────────────────────────────┘
//! ```
//!
//! ```
//! use nalgebra::Isometry3;
//! use svl_core::rectify::Rectifier;
//! use svl_core::stereo::{Gray, Intrinsics, LengthUnit, StereoCalibration, StereoPair};
//!
//! let distortion = [-0.2, 0.0, 0.0, 0.0, 0.0];
//! let camera = |cy| Intrinsics::new((320, 240), (300.0, 300.0), (159.5, cy), distortion);
//! let right_from_left = Isometry3::translation(-0.12, 0.0, 0.0);
//! let (left, right) = (camera(119.5)?, camera(125.5)?);
//! let calibration = StereoCalibration::new(left, right, right_from_left, LengthUnit::Metres)?;
//! let rectifier = Rectifier::new(&calibration)?;
//! let raw = StereoPair::new(Gray::filled(320, 240, 90)?, Gray::filled(320, 240, 90)?)?;
//! let (mut left, mut right) = (Gray::filled(320, 240, 0)?, Gray::filled(320, 240, 0)?);
//! rectifier.apply(&raw, &mut left, &mut right)?;       // no allocation after the first pair
//! let pair = StereoPair::new(left, right)?;
//! assert_eq!(rectifier.rig().map(|rig| rig.baseline_m()), Some(0.12));
//! # Ok::<(), svl_core::Error>(())
//! ```

mod alignment;
mod bouguet;
mod epipolar;
mod features;
mod framing;
mod hidden;
mod rectifier;
mod remap;
mod rotated_camera;

pub use rectifier::Rectifier;
#[doc(hidden)]
pub use {
    alignment::{Alignment, AlignmentMeter, RectificationMeter},
    bouguet::bouguet,
    features::PointMatch,
    framing::Framing,
    hidden::hidden_views,
    remap::Remap,
};
