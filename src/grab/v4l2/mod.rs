//! Cameras of a Linux machine, by V4L2: webcams, and sensors on a board's camera port.
//!
//! ```text
//!  device ── modes, format, rate ──▶ stream ── filled buffer ──▶ pixels ─▶ Gray ─┐
//!    ▲                                  │                                        ├─▶ camera ─▶ Capture
//!  control: shutter, gain               └── the driver's time ──▶ stamp ─────────┘
//! ```
//!
//! V4L2 has no way to fire a camera. So these run by themselves, and their images are paired by the
//! times at which the driver stamped them; or something outside fires them, and then each is given
//! its next image after it was armed. The kernel's structures stand in `abi.rs`: the crates that
//! have them want libclang to be built, or give no stamps.

mod abi;
mod camera;
mod config;
mod control;
mod device;
mod driver;
mod mode;
#[cfg(test)]
mod odd;
mod pixels;
mod stamp;
mod stream;

pub use config::V4l2Config;
pub use mode::{Format, Mode};

use crate::error::{Error, Result};
use crate::grab::{Camera, Clock};
use camera::V4l2Camera;
use device::Device;
use mode::{Wish, choose};
use stamp::Times;
use std::path::Path;
use stream::{Stream, monotonic_ns};

/// Begins to stream from two cameras in one mode, `rate_hz` times a second or as near to that as
/// they come, which is returned. `fired`: when something outside fires them, else by themselves.
///
/// # Errors
/// [`Error::Camera`] when one cannot be used; [`Error::Invalid`] when both are one, or have no mode
/// in common.
pub fn open(
    config: &V4l2Config,
    rate_hz: f64,
    fired: bool,
    clock: &Clock,
) -> Result<([Box<dyn Camera>; 2], f64)> {
    let [left, right] = &config.devices;
    let devices = [Device::open(left)?, Device::open(right)?];
    if devices[0].is(&devices[1]) {
        let [left, right] = devices.map(|device| device.name);
        return Err(Error::Invalid(format!(
            "v4l2: {left} and {right} are one camera; name two"
        )));
    }
    let wish = Wish {
        size: config.size,
        format: config.format,
        rate_hz,
    };
    let modes = [devices[0].modes(config.size), devices[1].modes(config.size)];
    let (format, size) = choose(wish, [&modes[0], &modes[1]])?;
    let times = Times::begin(clock, monotonic_ns());
    let ready = |device: Device| -> Result<(Box<dyn Camera>, f64)> {
        let layout = device.set_format(format, size)?;
        let hz = device.set_rate(rate_hz).unwrap_or(rate_hz);
        if !fired && (hz / rate_hz - 1.0).abs() > 0.01 {
            tracing::warn!(
                "{}: gives {hz:.1} images a second in {format} of {}x{}",
                device.name,
                size.0,
                size.1
            );
        }
        let name = device.name.clone();
        Ok((
            Box::new(V4l2Camera::new(
                name,
                Stream::start(device)?,
                layout,
                fired,
                times,
            )?),
            hz,
        ))
    };
    let [left, right] = devices;
    let ((left, left_hz), (right, right_hz)) = (ready(left)?, ready(right)?);
    Ok(([left, right], left_hz.min(right_hz)))
}

/// What a device can be asked for.
///
/// # Errors
/// [`Error::Camera`] when it is no camera, or cannot be asked.
pub fn modes(device: &Path) -> Result<Vec<Mode>> {
    Ok(Device::open(device)?.modes(None))
}
