//! The baseline of cameras whose calibrations have none, from the static transforms.

use super::transforms::Transforms;
use crate::recording::messages::Channel;
use nalgebra::Isometry3;

/// Limits on cameras that are parallel and side by side: rotation in radians, and the other two
/// axes as a fraction of the baseline. Wider than the rounding of the programs that write them.
const MAX_ROTATION: f64 = 1e-3;
const MAX_OFFSET: f64 = 1e-2;

/// Looks for the transform between two cameras, by their frames.
pub(super) struct BaselineSearch {
    has_transforms: bool,
    transforms: Transforms,
}

impl BaselineSearch {
    pub(super) fn new(channels: &[&Channel]) -> Self {
        Self {
            has_transforms: channels.iter().any(|channel| Transforms::reads(channel)),
            transforms: Transforms::default(),
        }
    }

    /// False if there are no static transforms, or they have the cameras' already.
    pub(super) fn may_be_found(&self, left: &str, right: &str) -> bool {
        self.has_transforms && left != right && self.pose(left, right).is_none()
    }

    pub(super) fn take_in(&mut self, channel: &Channel, data: &[u8]) {
        if Transforms::reads(channel) {
            // An unreadable one is reported if it is needed for the truth.
            drop(self.transforms.add(channel, data));
        }
    }

    /// The baseline if the cameras are parallel and side by side.
    pub(super) fn found_m(&self, left: &str, right: &str) -> Option<f64> {
        let right = self.pose(left, right)?;
        let [x, y, z] = right.translation.vector.into();
        let is_beside = y.abs().max(z.abs()) <= MAX_OFFSET * x;
        (is_beside && right.rotation.angle() < MAX_ROTATION).then_some(x)
    }

    /// The pose of the right camera in the left one.
    fn pose(&self, left: &str, right: &str) -> Option<Isometry3<f64>> {
        let pose = self.transforms.between(left, right);
        pose.filter(|_| left != right)
    }
}
