//! GigE Vision and USB3 Vision cameras, through [aravis](https://aravisproject.github.io/aravis/).
//!
//! Stamps are of the camera's own clock, taken as the begin of the exposure (SFNC, `Timestamp`) and
//! brought to the host's clock by when the first packet of each image came
//! ([`super::DeviceClock`]). That asks nothing of the camera beyond a stamp; one that gives none is
//! stamped by that packet. A camera's number of an image counts images, not the pulses that it
//! missed, so it is no trigger id: the coordinator knows the pulse.
//!
//! A camera is taken to be ready for its next trigger when its last image has arrived whole.

mod camera;
mod device;
mod trigger;

pub use camera::GenicamCamera;
pub use device::{Drive, Found, found};
pub use trigger::SoftwareTrigger;

use super::{Camera, Clock};
use crate::error::{Error, Result};
use std::sync::Arc;

/// Opens the left and the right camera, by id or by IP address, and starts them.
///
/// # Errors
/// [`Error::Camera`] when there is no such camera, it is in use, or it cannot do what is needed;
/// [`Error::Invalid`] when the two are one, or have images of different sizes.
pub fn open(names: [&str; 2], drive: Drive, clock: &Arc<Clock>) -> Result<[GenicamCamera; 2]> {
    let [left, right] = names;
    if left == right {
        return Err(Error::Invalid(format!(
            "genicam:{left},{right}: both are the same camera; name two"
        )));
    }
    let [a, b] = [
        GenicamCamera::open(left, drive, clock)?,
        GenicamCamera::open(right, drive, clock)?,
    ];
    let ([width, height], [other_width, other_height]) = (a.size(), b.size());
    if a.size() != b.size() {
        return Err(Error::Invalid(format!(
            "{} takes images of {width}x{height}, {} of {other_width}x{other_height}; set both \
             alike",
            a.name(),
            b.name()
        )));
    }
    Ok([a, b])
}
