//! The vocabulary of stereo vision: images, pairs, rigs, disparities, depth grids, frames.
//!
//! **Images.** `x` grows to the right, `y` downwards, pixel centres at integers, row-major.
//!
//! **Disparity.** In pixels; a left pixel `(x, y)` with disparity `d` matches `(x - d, y)` in the
//! right image.
//!
//! **Camera frame** (optical): x right, y down, z forward, metres. **World frame**: x, y on the
//! floor, z up, metres.
//!
//! **Depth** `Z` is along the optical axis: `Z = f·B / (d + doffs)`.

mod calibration;
mod disparity;
mod distortion;
mod floor;
mod frame;
mod grid;
mod identity;
mod image;
mod intrinsics;
mod limits;
mod occlusion;
mod pair;
mod reason;
mod rig;
mod row;

pub(crate) use calibration::check_upright;
pub use calibration::{Rectification, StereoCalibration};
pub use disparity::{DisparityMap, ExtraPlanes};
pub(crate) use distortion::MAX_RADIUS;
pub use distortion::{Distortion, DistortionModel};
pub use grid::{Cell, CellDepth, CellRule, CellState, DepthGrid, GridShape};
pub(crate) use image::luma;
pub use image::{Gray, Plane, Rgb};
pub use intrinsics::Intrinsics;
pub use limits::LengthUnit;
pub use pair::{RectifiedPair, Side, StereoPair};
pub use reason::Reason;
pub use rig::Rig;
pub use row::RowMut;
#[doc(hidden)]
pub use {
    calibration::{motion, rotation},
    floor::{FloorPlane, Surface},
    frame::{
        Estimate, Exposure, Frame, Geometry, MapDensity, Pose, RecordedMap, Truth, TruthKind,
        TruthOrigin, Visibility,
    },
    grid::{CellEvidence, LevelCell, LevelVerdict, NearSurface},
    identity::{FittedTo, PairId, UnsortedPairs, hash_words, parse_hash},
    image::{MAX_SIDE, buffer, reserve},
    limits::{check_doffs, check_offsets},
    occlusion::cross_check,
    row::BandMut,
};
