//! Common part of both development kits of KITTI (A. Geiger, P. Lenz and R. Urtasun, CVPR 2012; M.
//! Menze and A. Geiger, CVPR 2015): the valid disparities, and the map before and after densifying.
//!
//! The kits score three times. Their Matlab part scores the map as given: a pixel without disparity
//! is −1, nearly always an outlier. Their C++ part, which computes the web page's tables, scores
//! the densified map (`_dense` here, the page's column *All*) and only the estimated pixels
//! (`_est`, its column *Est*).

use super::{ProtocolImage, densify};
use svl_core::stereo::Plane;

/// A map before and after densifying, `+∞` for invalid pixels.
pub(super) struct KittiMaps {
    pub(super) sparse: Plane<f32>,
    pub(super) dense: Plane<f32>,
}

impl KittiMaps {
    /// Disparities below 0 are invalid.
    pub(super) fn new(image: &ProtocolImage) -> Self {
        let sparse = image
            .estimate
            .map(|d| if d >= 0.0 { d } else { f32::INFINITY });
        Self {
            dense: densify(&sparse),
            sparse,
        }
    }
}

/// The disparity as the kits store it.
pub(super) fn stored(disparity: f32) -> f32 {
    if disparity.is_finite() {
        disparity
    } else {
        -1.0
    }
}
