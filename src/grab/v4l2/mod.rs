//! Cameras on Linux through V4L2: webcams, and sensors on a board's camera port.
//!
//! ```text
//! device ── modes, format, rate ──▶ stream ── filled buffer ──▶ pixels ─▶ Gray ─┐
//!   ▲                                  │                                        ├─▶ Capture
//! control: shutter, gain               └── driver's stamp ──▶ stamp ────────────┘
//! ```
//!
//! V4L2 cannot trigger a camera. These cameras are free-running, and their images are paired by the
//! driver's stamps; or a controller triggers both, and each delivers its next image once armed.
//! `abi.rs` contains the kernel's structures: the crates that have them need libclang, or return no
//! stamps.

#[cfg(target_os = "linux")]
mod linux;

use super::driver::{Driver, DriverFunctions};
use svl_core::matcher::{Parameter, Range};

pub const DRIVER: Driver = Driver {
    name: "v4l2",
    cameras: "LEFT,RIGHT",
    help: "two cameras of this machine, as /dev/video0,/dev/video2, or one with --side-by-side",
    options: &[
        Parameter {
            name: "size",
            unit: "px",
            range: Range::Text { default: "auto" },
            description: "width and height; auto: nearest to 640x480, with --side-by-side for one \
                          half, of those that hold the rate",
        },
        Parameter {
            name: "format",
            unit: "",
            range: Range::Choice {
                default: "auto",
                options: &["auto", "GREY", "YUYV", "UYVY", "MJPG"],
            },
            description: "pixel format; auto: the simplest",
        },
    ],
    camera_options: &[],
    can_be_triggered: false,
    can_be_split: true,
    default_seed: None,
    functions: FUNCTIONS,
};

#[cfg(target_os = "linux")]
const FUNCTIONS: Result<DriverFunctions, &str> = Ok(DriverFunctions {
    open: linux::open,
    list: linux::list,
});
#[cfg(not(target_os = "linux"))]
const FUNCTIONS: Result<DriverFunctions, &str> = Err("V4L2 exists only on Linux");
