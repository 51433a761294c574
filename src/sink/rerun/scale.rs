//! The fixed scale of a camera's pictures: what is near, what is far, where the colours end.

use crate::stereo::{Frame, Rig};

/// Distance at which an obstacle fills its cell, metres.
const NEAR_M: f64 = 0.2;
/// Colours end at this many times the near distance: 3 m in the arena.
const FAR: f64 = 15.0;
/// Disparity taken for near where nothing is known of the camera: the end of svl's default search range.
const NEAR_PX: f64 = 80.0;

/// Scale of all pictures of one camera, so that a colour and a size mean the same in every frame of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    /// Disparity of a near obstacle; it fills its cell and has the last colour.
    pub near_px: f64,
    /// Offset that makes `disparity + doffs_px` proportional to nearness.
    pub doffs_px: f64,
    /// Depth of the last colour, metres.
    pub far_m: f64,
}

impl Scale {
    /// For a moving rig (the arena, a robot) near is 0.2 m and far 3 m, or more where the camera could not measure
    /// 0.2 m within a quarter of its width. A still scene with truth takes its own nearest and farthest point.
    pub(super) fn of(frame: &Frame) -> Self {
        let quarter_px = frame.pair.size().0 as f64 / 4.0;
        let still = frame.truth.as_ref().filter(|_| frame.pose.is_none());
        let span = still.and_then(|truth| {
            let known = truth.disparity.pixels().filter(|d| d.is_finite()).map(f64::from);
            known.fold(None, |span, d| span.map_or(Some((d, d)), |(low, high)| Some((d.min(low), d.max(high)))))
        });
        match (frame.rig, span) {
            (Some(rig), None) => {
                let near_m = rig.depth_m(quarter_px).map_or(NEAR_M, |least| least.max(NEAR_M));
                Self::between(&rig, rig.disparity_px(near_m), FAR * near_m)
            }
            (Some(rig), Some((low, high))) => {
                let near_m = rig.depth_m(high).unwrap_or(NEAR_M);
                Self::between(&rig, high, rig.depth_m(low).map_or(FAR * near_m, |far| far.min(FAR * near_m)))
            }
            (None, span) => {
                Self { near_px: span.map_or(NEAR_PX, |(_, high)| high.max(1.0)), doffs_px: 0.0, far_m: FAR * NEAR_M }
            }
        }
    }

    fn between(rig: &Rig, near_px: f64, far_m: f64) -> Self {
        Self { near_px, doffs_px: rig.doffs_px(), far_m }
    }

    /// How near a disparity is, 0 (infinitely far) ..= 1 (near or nearer): `near_m / depth`, cut at 1.
    pub(super) fn nearness(&self, disparity_px: f64) -> f64 {
        ((disparity_px + self.doffs_px) / (self.near_px + self.doffs_px)).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stereo::{Exposure, Gray, Plane, Pose, StereoPair, Truth};

    fn frame(rig: Option<Rig>, pose: Option<Pose>, truth: Option<f32>) -> Frame {
        let image = Gray::filled(320, 240, 0).unwrap();
        let truth = truth.map(|d| Truth { disparity: Plane::filled(320, 240, d).unwrap(), visibility: None });
        let pair = StereoPair::new(image.clone(), image).unwrap();
        Frame { sequence: 0, stamp_ns: 0, name: None, pair, rig, pose, truth, exposure: Exposure::default() }
    }

    #[test]
    fn the_arena_goes_from_20_cm_to_3_m() {
        let rig = Rig::new(328.0, (159.5, 119.5), 0.044, 0.0).unwrap();
        let scale = Scale::of(&frame(Some(rig), Some(Pose::identity()), Some(9.0)));
        assert!((scale.far_m - 3.0).abs() < 1e-9);
        assert!((scale.nearness(rig.disparity_px(0.4)) - 0.5).abs() < 1e-9);
        assert_eq!(scale.nearness(rig.disparity_px(0.1)), 1.0);
    }

    #[test]
    fn a_scene_takes_its_own_span() {
        let rig = Rig::new(1000.0, (159.5, 119.5), 0.19, 30.0).unwrap();
        let scale = Scale::of(&frame(Some(rig), None, Some(64.0)));
        assert_eq!((scale.near_px, scale.nearness(64.0)), (64.0, 1.0));
        assert_eq!(Scale::of(&frame(None, None, Some(16.0))).near_px, 16.0);
        assert_eq!(Scale::of(&frame(None, None, None)).near_px, NEAR_PX);
    }
}
