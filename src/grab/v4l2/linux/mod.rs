//! V4L2: opens two cameras in one mode, lists the cameras of this machine.

mod abi;
mod camera;
mod config;
mod control;
mod device;
#[cfg(test)]
mod driver_tests;
mod mode;
mod pixels;
mod stamp;
mod stream;

use crate::camera::Camera;
use crate::driver::{CameraPair, CameraRequest, ListedCamera};
use crate::split::split;
use crate::trigger::Trigger;
use crate::{CameraError, camera_error};
use camera::V4l2Camera;
use config::V4l2Config;
use device::V4l2Device;
use mode::{Mode, USUAL, Wish, choose};
use stamp::Times;
use std::path::Path;
use stream::{MappedStream, monotonic_ns};
use svl_core::Result;

pub(super) fn open(request: &CameraRequest<'_>) -> Result<CameraPair> {
    let config = V4l2Config::parse(request.driver, request.text, request.side_by_side.is_some())?;
    // Before the streams start, as it may take seconds and their buffers would overflow.
    let controller = request.controller()?;
    let triggered = controller.is_some();
    let opened = config.devices.iter().map(|device| V4l2Device::open(device));
    let devices = opened.collect::<Result<Vec<_>>>()?;
    // By device number, as links under /dev/v4l/by-path refer to the same camera.
    if let [left, right] = &devices[..]
        && left.is(right)
    {
        let reason = format!("{} and {} are one camera; name two", left.name, right.name);
        return Err(camera_error("v4l2", reason));
    }
    let rate_hz = request.rate_hz;
    let usual = request.side_by_side.map_or(USUAL, |both| both.whole(USUAL));
    let wish = Wish {
        size: config.size,
        format: config.format,
        rate_hz,
        usual,
    };
    let wanted = [config.size.unwrap_or(usual), usual];
    let modes: Vec<_> = devices.iter().map(|device| device.modes(&wanted)).collect();
    let both = [modes.first(), modes.last()].map(|modes| modes.map_or(&[][..], Vec::as_slice));
    let (format, size) = choose(wish, both)?;
    // Read once for both cameras: two readings of the clocks would add a constant skew.
    let times = Times::begin(request.clock, monotonic_ns());
    let ready = |device: V4l2Device| -> Result<(Box<dyn Camera>, f64)> {
        let layout = device.set_format(format, size)?;
        let hz = device.set_rate(rate_hz).unwrap_or(rate_hz);
        // Triggered cameras expose at the pulses, regardless of the rate that was set.
        if !triggered && (hz / rate_hz - 1.0).abs() > 0.01 {
            tracing::warn!(
                "{}: gives {hz:.1} images per second in {format} of {}x{}",
                device.name,
                size.0,
                size.1
            );
        }
        let name = device.name.clone();
        let camera = V4l2Camera::new(name, MappedStream::start(device)?, layout, triggered, times)?;
        Ok((Box::new(camera), hz))
    };
    let ready = devices.into_iter().map(ready).collect::<Result<Vec<_>>>()?;
    let reached_hz = ready
        .iter()
        .map(|(_, hz)| *hz)
        .fold(f64::INFINITY, f64::min);
    let mut cameras = ready.into_iter().map(|(camera, _)| camera);
    let cameras = match (cameras.next(), cameras.next(), request.side_by_side) {
        (Some(both), None, Some(places)) => split(both, places),
        (Some(left), Some(right), _) => [left, right],
        _ => return Err(camera_error("v4l2", "no camera")),
    };
    Ok(CameraPair {
        cameras,
        trigger: controller.map(|controller| Box::new(controller) as Box<dyn Trigger>),
        rate_hz: if triggered { rate_hz } else { reached_hz },
        rig: None,
    })
}

pub(super) fn list() -> Vec<ListedCamera> {
    list_in(Path::new("/sys/class/video4linux"))
}

/// Video devices with the names of their drivers, as listed by Linux in a folder.
fn list_in(folder: &Path) -> Vec<ListedCamera> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let listed = |entry: std::fs::DirEntry| {
        let description = std::fs::read_to_string(entry.path().join("name")).unwrap_or_default();
        let name = format!("/dev/{}", entry.file_name().display());
        ListedCamera {
            modes: modes(Path::new(&name)),
            description: description.trim().to_owned(),
            name,
        }
    };
    let mut cameras: Vec<_> = entries.map(listed).collect();
    cameras.sort_by(|a, b| a.name.cmp(&b.name));
    cameras
}

/// A line for each format of a device, with the sizes and their rates.
fn modes(device: &Path) -> Vec<String> {
    let modes = match V4l2Device::open(device) {
        Ok(device) => device.modes(&[USUAL]),
        // Without the remedy, which is to list the cameras.
        Err(error) => {
            let text = match error.downcast_ref() {
                Some(CameraError { reason, .. }) => reason.split(';').next().unwrap_or_default(),
                None => &error.to_string(),
            };
            return vec![text.to_owned()];
        }
    };
    if modes.is_empty() {
        return vec!["no format that svl reads".to_owned()];
    }
    let size = |mode: &Mode| {
        let (width, height) = mode.size;
        match mode.max_rate_hz {
            Some(hz) => format!("{width}x{height} ({} Hz)", (hz * 10.0).round() / 10.0),
            None => format!("{width}x{height}"),
        }
    };
    let of_one_format = modes.chunk_by(|a, b| a.format == b.format);
    let line = |modes: &[Mode]| {
        let sizes: Vec<_> = modes.iter().map(size).collect();
        format!("{}: {}", modes[0].format, sizes.join(", "))
    };
    of_one_format.map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn video_devices_have_their_drivers_names() {
        let folder = tempfile::tempdir().unwrap();
        for (device, name) in [("video98", "Firefly MV\n"), ("video97", "Webcam\n")] {
            std::fs::create_dir(folder.path().join(device)).unwrap();
            std::fs::write(folder.path().join(device).join("name"), name).unwrap();
        }
        let found = list_in(folder.path());
        let names = found
            .iter()
            .map(|camera| (&*camera.name, &*camera.description));
        assert_eq!(
            names.collect::<Vec<_>>(),
            [("/dev/video97", "Webcam"), ("/dev/video98", "Firefly MV")]
        );
        assert!(list_in(Path::new("nowhere")).is_empty());
    }
}
