//! The fixed colour scale of one camera: disparity and depth of the last colour.

use svl_core::stereo::Frame;
use svl_files::overlay::{NEAR_M, Nearness, lowest_disparity};

/// Colours end at this multiple of the near distance: 3 m in the arena.
const COLOUR_END: f64 = 15.0;

/// Scale of all pictures of one camera, so that a colour and a size have the same meaning in every
/// frame of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scale {
    /// Disparity that fills a cell of the overlay and has the last colour.
    pub nearness: Nearness,
    /// Depth of the last colour, metres.
    pub far_m: f64,
}

impl Scale {
    /// Far is 15 times near, or the farthest point of a static scene with truth if that is nearer.
    pub(crate) fn new(frame: &Frame) -> Self {
        let nearness = Nearness::for_frame(frame);
        let near_m = frame
            .rig()
            .and_then(|rig| rig.depth_m(nearness.near_px))
            .unwrap_or(NEAR_M);
        let still = frame.truth.as_ref().filter(|_| frame.pose.is_none());
        let lowest = still.and_then(|truth| lowest_disparity(&truth.disparity));
        let farthest_m = frame
            .rig()
            .zip(lowest)
            .and_then(|(rig, lowest)| rig.depth_m(lowest.into()));
        Self {
            nearness,
            far_m: farthest_m.map_or(COLOUR_END * near_m, |far| far.min(COLOUR_END * near_m)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{Geometry, Gray, Plane, Pose, Rig, StereoPair, Truth};

    #[test]
    fn the_arena_goes_to_3_m_and_a_scene_to_its_farthest_point() {
        let image = Gray::filled(320, 240, 0).unwrap();
        let rig = Rig::new(328.0, (159.5, 119.5), 0.044, 0.0).unwrap();
        let truth = Plane::from_fn(320, 240, |x, _| if x == 0 { 7.216 } else { 72.16 }).unwrap();
        let arena = Frame {
            pose: Some(Pose::identity()),
            truth: Some(Truth::exact(truth, None)),
            ..Frame::new(
                StereoPair::new(image.clone(), image).unwrap(),
                Geometry::Rectified(Some(rig)),
            )
        };
        assert!((Scale::new(&arena).far_m - 3.0).abs() < 1e-6);
        let scene = Frame {
            pose: None,
            ..arena
        };
        assert!((Scale::new(&scene).far_m - 2.0).abs() < 1e-6);
    }
}
