//! The baseline of cameras whose calibrations have none, from the static transforms.

use super::transforms::Transforms;
use crate::message::MessageError::{Exchanged, NoBaseline};
use crate::message::MessageResult;
use crate::stream::channel::Channel;

/// Limits on cameras that are parallel and side by side: rotation in radians, and the other two
/// axes as a fraction of the baseline. Wider than the rounding of the programs that write them.
const MAX_ROTATION: f64 = 1e-3;
const MAX_OFFSET: f64 = 1e-2;

/// Looks for the transform between two cameras, by their frames.
pub(crate) struct BaselineSearch {
    has_transforms: bool,
    transforms: Transforms,
    /// True once the user was warned of a transform that came later.
    has_warned: bool,
}

impl BaselineSearch {
    pub(crate) fn new(channels: &[&Channel]) -> Self {
        Self {
            has_transforms: channels.iter().any(|channel| Transforms::reads(channel)),
            transforms: Transforms::default(),
            has_warned: false,
        }
    }

    /// False if there are no static transforms, or they have the cameras' already.
    pub(crate) fn may_be_found(&self, left: &str, right: &str) -> bool {
        self.has_transforms && left != right && self.transforms.between(left, right).is_none()
    }

    pub(crate) fn take_in(&mut self, channel: &Channel, data: &[u8]) {
        if Transforms::reads(channel) {
            // An unreadable one is reported if it is needed for the truth.
            drop(self.transforms.add(channel, data));
        }
    }

    /// The baseline if the cameras are parallel and side by side.
    ///
    /// # Errors
    /// The reason why they have no baseline.
    pub(crate) fn metres(&self, left: &str, right: &str) -> MessageResult<f64> {
        if left == right {
            let why = format!("both cameras are in one frame, '{left}'");
            return Err(NoBaseline(why));
        }
        let pose = self.transforms.between(left, right);
        let why = || format!("no static transform leads from '{left}' to '{right}'");
        let pose = pose.ok_or_else(|| NoBaseline(why()))?;
        let [x, y, z] = pose.translation.vector.into();
        let degrees = pose.rotation.angle().to_degrees();
        if pose.rotation.angle() >= MAX_ROTATION {
            Err(NoBaseline(format!(
                "by the static transforms the cameras are turned by {degrees:.1}° to each other"
            )))
        } else if y.abs().max(z.abs()) > MAX_OFFSET * x.abs() {
            Err(NoBaseline(format!(
                "by the static transforms '{right}' is not beside '{left}', but at ({x:.3}, \
                 {y:.3}, {z:.3}) m"
            )))
        } else if x <= 0.0 {
            Err(Exchanged(left.to_owned(), right.to_owned(), -x))
        } else {
            Ok(x)
        }
    }

    /// Distance of two cameras by the transforms so far, metres; negative if the right one is to
    /// the left.
    pub(crate) fn apart_m(&self, left: &str, right: &str) -> Option<f64> {
        let pose = (left != right).then(|| self.transforms.between(left, right))??;
        let (metres, x) = (pose.translation.vector.norm(), pose.translation.x);
        let sign = if x < -0.9 * metres { -1.0 } else { 1.0 };
        (metres > 0.0).then_some(sign * metres)
    }

    /// Takes in a transform after the first pair. Returns a warning, once, if it would have changed
    /// the baseline in use.
    pub(crate) fn take_in_later(
        &mut self,
        channel: &Channel,
        data: &[u8],
        (left, right): (&str, &str),
        used_m: Option<f64>,
    ) -> Option<String> {
        let conflict = self.transforms.conflict((channel, data), (left, right));
        self.take_in(channel, data);
        let found_m = self.metres(left, right).ok();
        let warning = match (used_m, conflict) {
            (Some(used_m), Some(conflict)) => {
                format!("{conflict}; the first, with a baseline of {used_m:.4} m, is used")
            }
            (None, _) => format!(
                "the transform between the cameras, {:.4} m, came after the first pair: there are \
                 no distances; start svl again",
                found_m?
            ),
            (Some(_), None) => return None,
        };
        (!std::mem::replace(&mut self.has_warned, true))
            .then(|| format!("{}: {warning}", channel.topic))
    }
}
