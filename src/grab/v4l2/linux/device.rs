//! A video device: capabilities, modes, pixel format, rate.

use super::abi::{
    self, CAP_DEVICE_CAPS, CAP_STREAMING, CAP_TIME_PER_FRAME, CAP_VIDEO_CAPTURE,
    CAP_VIDEO_CAPTURE_MPLANE, DISCRETE, FIELD_ANY, FIELD_NONE, VIDEO_CAPTURE,
};
use super::mode::{Mode, PixelFormat};
use super::pixels::Layout;
use crate::camera_error;
use rustix::fd::OwnedFd;
use rustix::fs::{Mode as Permissions, OFlags};
use rustix::io::Errno;
use std::path::Path;
use svl_core::stereo::MAX_SIDE;
use svl_core::{Error, Result};

/// A video device that captures images.
pub(super) struct V4l2Device {
    pub name: String,
    pub file: OwnedFd,
}

/// Limit on the entries that a driver lists of one kind: some lists never end.
const LISTED: u32 = 256;

impl V4l2Device {
    /// # Errors
    /// [`crate::CameraError`] if it cannot be opened or captures no images.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        // Opening a path that is not a camera may block, for example a pipe.
        let flags = OFlags::RDWR | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let opened = rustix::fs::open(path, flags, Permissions::empty());
        let file = opened.map_err(|errno| camera_error(&name, trouble(errno)))?;
        let device = Self { name, file };
        let mut capability = abi::Capability::default();
        abi::QUERYCAP
            .call(&device.file, &mut capability)
            .map_err(|errno| device.error(errno))?;
        // Without CAP_DEVICE_CAPS the first field describes this device; with it, the whole driver,
        // whose other devices may be metadata or radio.
        let has = match capability.capabilities & CAP_DEVICE_CAPS {
            0 => capability.capabilities,
            _ => capability.device_capabilities,
        };
        let wrong = if has & CAP_VIDEO_CAPTURE_MPLANE != 0 && has & CAP_VIDEO_CAPTURE == 0 {
            "gives images in several planes, which svl does not read"
        } else if has & CAP_VIDEO_CAPTURE == 0 {
            "captures no images; `svl record --list` lists those that do"
        } else if has & CAP_STREAMING == 0 {
            "does not stream, so its images have no stamps"
        } else {
            return Ok(device);
        };
        Err(camera_error(device.name, wrong))
    }

    pub(super) fn error(&self, errno: Errno) -> Error {
        camera_error(&self.name, trouble(errno))
    }

    /// True if both are one device under two names.
    pub(super) fn is(&self, other: &Self) -> bool {
        let number = |device: &Self| {
            rustix::fs::fstat(&device.file)
                .map(|stat| stat.st_rdev)
                .ok()
        };
        number(self) == number(other)
    }

    /// Modes in the formats that svl reads. From a range of sizes: the greatest, and the `wanted`.
    pub(super) fn modes(&self, wanted: &[(usize, usize)]) -> Vec<Mode> {
        let formats = (0..LISTED).map_while(|index| {
            let mut listed = abi::FormatDescription {
                index,
                kind: VIDEO_CAPTURE,
                ..Default::default()
            };
            abi::ENUM_FMT
                .call(&self.file, &mut listed)
                .ok()
                .map(|()| listed.pixel_format)
        });
        let mut modes = Vec::new();
        for format in formats.filter_map(PixelFormat::from_code) {
            for size in self.sizes(format, wanted) {
                let max_rate_hz = self.max_rate_hz(format, size);
                modes.push(Mode {
                    format,
                    size,
                    max_rate_hz,
                });
            }
        }
        modes
    }

    fn sizes(&self, format: PixelFormat, wanted: &[(usize, usize)]) -> Vec<(usize, usize)> {
        let mut sizes = Vec::new();
        // Drivers end a list with an error, EINVAL.
        for index in 0..LISTED {
            let mut listed = abi::FrameSize {
                index,
                pixel_format: format.code(),
                ..Default::default()
            };
            if abi::ENUM_FRAMESIZES.call(&self.file, &mut listed).is_err() {
                break;
            }
            let [a, b, c, d, e, f] = listed.sizes.map(|n| n as usize);
            if listed.kind == DISCRETE {
                sizes.push((a, b));
                continue;
            }
            let fits = |n: usize, [min, max, step]: [usize; 3]| {
                (min..=max).contains(&n) && (n - min).is_multiple_of(step.max(1))
            };
            let within = wanted
                .iter()
                .copied()
                .filter(|&(w, h)| fits(w, [a, b, c]) && fits(h, [d, e, f]));
            sizes.extend(within.chain([(b, e)]));
            break;
        }
        sizes.retain(|(w, h)| (1..=MAX_SIDE).contains(w) && (1..=MAX_SIDE).contains(h));
        sizes.sort_unstable();
        sizes.dedup();
        sizes
    }

    fn max_rate_hz(&self, format: PixelFormat, (width, height): (usize, usize)) -> Option<f64> {
        let rates = (0..LISTED).map_while(|index| {
            let (width, height) = (width as u32, height as u32);
            let mut listed = abi::FrameInterval {
                index,
                pixel_format: format.code(),
                width,
                height,
                ..Default::default()
            };
            abi::ENUM_FRAMEINTERVALS
                .call(&self.file, &mut listed)
                .ok()?;
            // A range begins with the least interval.
            Some(rate_hz([listed.intervals[0], listed.intervals[1]]))
        });
        rates.flatten().reduce(f64::max)
    }

    /// Sets format and size.
    ///
    /// # Errors
    /// [`crate::CameraError`] if the driver sets others.
    pub(super) fn set_format(
        &self,
        format: PixelFormat,
        (width, height): (usize, usize),
    ) -> Result<Layout> {
        let mut set = abi::AbiFormat {
            kind: VIDEO_CAPTURE,
            width: width as u32,
            height: height as u32,
            pixel_format: format.code(),
            field: FIELD_NONE,
            ..Default::default()
        };
        abi::S_FMT
            .call(&self.file, &mut set)
            .map_err(|errno| self.error(errno))?;
        if set.pixel_format != format.code()
            || (set.width as usize, set.height as usize) != (width, height)
        {
            let got = format!(
                "{} of {}x{}",
                String::from_utf8_lossy(&set.pixel_format.to_le_bytes()),
                set.width,
                set.height
            );
            let reason = format!(
                "gives {got} when asked for {format} of {width}x{height}; name a size= that it has"
            );
            return Err(camera_error(&self.name, reason));
        }
        if ![FIELD_ANY, FIELD_NONE].contains(&set.field) {
            return Err(camera_error(
                &self.name,
                "gives interlaced images, whose two fields are from different times",
            ));
        }
        // Some drivers report 0 bytes per line, or those of another format.
        let packed = width * format.bytes();
        Ok(Layout {
            format,
            width,
            height,
            stride: packed.max(set.bytes_per_line as usize),
        })
    }

    /// Requests a rate, and returns the rate that the driver sets, if it reports one.
    pub(super) fn set_rate(&self, wanted_hz: f64) -> Option<f64> {
        // Seconds per image as a fraction: rates like 29.97 need more than whole numbers.
        let interval = [1000, ((wanted_hz * 1000.0).round() as u32).max(1)];
        let mut set = abi::StreamParameters {
            kind: VIDEO_CAPTURE,
            interval,
            ..Default::default()
        };
        abi::S_PARM.call(&self.file, &mut set).ok()?;
        if set.capability & CAP_TIME_PER_FRAME == 0 {
            None
        } else {
            rate_hz(set.interval)
        }
    }
}

fn rate_hz([numerator, denominator]: [u32; 2]) -> Option<f64> {
    (numerator > 0 && denominator > 0).then(|| f64::from(denominator) / f64::from(numerator))
}

/// Words for a device error, with the remedy.
pub(super) fn trouble(errno: Errno) -> String {
    let words = match errno {
        Errno::NOENT | Errno::NXIO => "no such device; `svl record --list` lists the cameras",
        Errno::NODEV | Errno::SHUTDOWN => "disconnected; plug it in and record again",
        Errno::ACCESS | Errno::PERM => {
            "permission denied; join the group that may use it (often video)"
        }
        Errno::BUSY => "in use by another program; close that",
        Errno::NOTTY | Errno::ISDIR | Errno::NOTDIR => {
            "is not a video device; `svl record --list` lists those"
        }
        Errno::NOSPC => {
            "the USB bus has no room for its images; use another port, a smaller size= or \
             format=MJPG"
        }
        Errno::IO => "its driver failed; unplug it, plug it in and record again",
        _ => return format!("{errno}; unplug it, plug it in and record again"),
    };
    words.to_owned()
}
