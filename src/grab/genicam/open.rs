//! Opens two GenICam cameras by name, with their trigger.

use super::camera::GenicamCamera;
use super::device::TriggerMode;
use super::trigger::SoftwareTrigger;
use crate::camera::Camera;
use crate::camera_error;
use crate::driver::{CameraPair, CameraRequest};
use crate::trigger::{Trigger, TriggerSource};
use svl_core::{Error, Result};

pub(super) fn open(request: &CameraRequest<'_>) -> Result<CameraPair> {
    let rate_hz = request.rate_hz;
    let mode = match request.trigger {
        TriggerSource::Software | TriggerSource::FixedRate(_) => TriggerMode::Software,
        TriggerSource::Serial(_) => TriggerMode::Line,
        TriggerSource::FreeRunning => TriggerMode::FreeRunning { rate_hz },
    };
    let Some((left, right)) = two_names(request.text) else {
        return Err(Error::Usage(format!(
            "genicam: expected two cameras, genicam:LEFT,RIGHT, not '{}'; `svl record --list` \
             lists them",
            request.text
        )));
    };
    // Started before the trigger: a pulse before both stream would be missed by one.
    let cameras = [
        GenicamCamera::open(left, mode, request.clock)?,
        GenicamCamera::open(right, mode, request.clock)?,
    ];
    let [[width, height], [other_width, other_height]] = cameras.each_ref().map(|c| c.size());
    if (width, height) != (other_width, other_height) {
        let reason = format!(
            "takes images of {width}x{height}, {right} of {other_width}x{other_height}; set both \
             to one size"
        );
        return Err(camera_error(left, reason));
    }
    let trigger: Option<Box<dyn Trigger>> = match mode {
        TriggerMode::Software => Some(Box::new(SoftwareTrigger::new(&cameras, request.clock))),
        TriggerMode::Line => request
            .controller()?
            .map(|controller| Box::new(controller) as _),
        TriggerMode::FreeRunning { .. } => None,
    };
    Ok(CameraPair {
        cameras: cameras.map(|camera| Box::new(camera) as Box<dyn Camera>),
        trigger,
        rate_hz,
        rig: None,
    })
}

/// Left and right at the comma in the middle: an id begins with the vendor's name, which may
/// contain commas.
fn two_names(names: &str) -> Option<(&str, &str)> {
    let commas: Vec<_> = names.match_indices(',').map(|(at, _)| at).collect();
    let middle = *commas
        .get(commas.len() / 2)
        .filter(|_| commas.len() % 2 == 1)?;
    let (left, right) = (names[..middle].trim(), names[middle + 1..].trim());
    (!left.is_empty() && !right.is_empty() && left != right).then_some((left, right))
}

#[cfg(test)]
mod tests {
    use super::two_names;

    #[test]
    fn two_cameras_are_named() {
        assert_eq!(
            two_names("192.168.0.2, 192.168.0.3"),
            Some(("192.168.0.2", "192.168.0.3"))
        );
        let ids = "Eyes, Inc.-E1-7,Eyes, Inc.-E1-8";
        assert_eq!(two_names(ids), Some(("Eyes, Inc.-E1-7", "Eyes, Inc.-E1-8")));
        for wrong in ["", "a", "a,", ",b", " , ", "a,b,c", "a,a"] {
            assert_eq!(two_names(wrong), None, "{wrong}");
        }
    }
}
