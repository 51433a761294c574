//! GigE Vision and USB3 Vision cameras, through [aravis](https://aravisproject.github.io/aravis/).
//!
//! Stamps come from the camera's clock, interpreted as the start of the exposure (SFNC,
//! `Timestamp`), and are converted to the host's clock by the arrival of the first packet of each
//! image ([`super::DeviceClock`]). Without camera stamps, an image is stamped by that packet. The
//! frame id counts images, not the pulses that a camera missed, so it is not a trigger id: the
//! coordinator knows the pulse.
//!
//! A camera counts as ready for its next trigger once its last image has arrived completely.

#[cfg(feature = "genicam")]
mod camera;
#[cfg(feature = "genicam")]
mod device;
#[cfg(feature = "genicam")]
mod open;
#[cfg(feature = "genicam")]
mod trigger;

use super::driver::{Driver, DriverFunctions};

pub const DRIVER: Driver = Driver {
    name: "genicam",
    cameras: "LEFT,RIGHT",
    help: "two GigE Vision or USB3 Vision cameras, by id or IP address",
    options: &[],
    camera_options: &[],
    can_be_triggered: true,
    can_be_split: false,
    default_seed: None,
    functions: FUNCTIONS,
};

#[cfg(feature = "genicam")]
const FUNCTIONS: Result<DriverFunctions, &str> = Ok(DriverFunctions {
    open: open::open,
    list: device::list,
});
#[cfg(not(feature = "genicam"))]
const FUNCTIONS: Result<DriverFunctions, &str> = Err(
    "install aravis (Debian: libaravis-dev, libusb-1.0-0-dev) and cargo install --locked --path . \
     --features genicam",
);
