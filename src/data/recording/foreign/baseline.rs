//! The baseline of cameras whose calibrations have none, from the static transforms.

use super::sensor::head;
use super::transforms::Transforms;
use crate::recording::messages::Channel;
use svl_core::stereo::Side;

/// Limits on cameras that are parallel and side by side: rotation in radians, and the other two
/// axes as a fraction of the baseline. Wider than the rounding of the programs that write them.
const MAX_ROTATION: f64 = 1e-3;
const MAX_OFFSET: f64 = 1e-2;

/// Looks for the transform between two cameras.
pub(super) struct BaselineSearch {
    has_transforms: bool,
    frames: [Option<String>; 2],
    transforms: Transforms,
}

impl BaselineSearch {
    pub(super) fn new(channels: &[&Channel]) -> Self {
        Self {
            has_transforms: channels.iter().any(|channel| Transforms::reads(channel)),
            frames: [None, None],
            transforms: Transforms::default(),
        }
    }

    /// False if the recording has no static transforms, or they have the cameras' already.
    pub(super) fn may_be_found(&self) -> bool {
        self.has_transforms && self.pose().is_none()
    }

    pub(super) fn take_in(&mut self, images: &[String; 2], channel: &Channel, data: &[u8]) {
        for (topic, frame) in images.iter().zip(&mut self.frames) {
            if *topic == channel.topic && frame.is_none() {
                *frame = head(channel, data).ok().map(|(_, frame)| frame);
            }
        }
        if Transforms::reads(channel) {
            // An unreadable one is reported if it is needed for the truth.
            drop(self.transforms.add(channel, data));
        }
    }

    /// The baseline if the cameras are parallel and side by side.
    pub(super) fn found_m(&self) -> Option<f64> {
        let right = self.pose()?;
        let [x, y, z] = right.translation.vector.into();
        let is_beside = y.abs().max(z.abs()) <= MAX_OFFSET * x;
        (is_beside && right.rotation.angle() < MAX_ROTATION).then_some(x)
    }

    /// The pose of the right camera in the left one.
    fn pose(&self) -> Option<nalgebra::Isometry3<f64>> {
        let frame = |side: Side| self.frames[side as usize].as_deref();
        let (left, right) = (frame(Side::Left)?, frame(Side::Right)?);
        self.transforms
            .between(left, right)
            .filter(|_| left != right)
    }
}
