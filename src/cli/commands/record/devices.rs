//! What `svl record --list` finds.

use crate::cli::shared::output::print;
use std::path::Path;
#[cfg(all(feature = "v4l2", target_os = "linux"))]
use svl::grab::v4l2::Mode;

/// Prints what could be recorded from, and what could trigger it.
pub(super) fn list() -> anyhow::Result<()> {
    let mut lines = vec!["sim                     two simulated cameras".to_owned()];
    let cameras = video_devices(Path::new("/sys/class/video4linux"));
    for (device, name) in &cameras {
        lines.push(format!("{device:<22}  camera: {name}"));
        lines.extend(
            modes(Path::new(device))
                .into_iter()
                .map(|line| format!("{:<22}  {line}", "")),
        );
    }
    let genicam = genicam_cameras();
    lines.extend(
        genicam
            .iter()
            .map(|(name, what)| format!("{name:<22}  camera: {what}")),
    );
    let ports = serial2::SerialPort::available_ports().unwrap_or_default();
    lines.extend(
        ports
            .iter()
            .map(|port| format!("serial:{:<15}  serial port", port.display())),
    );
    if cameras.is_empty() && genicam.is_empty() {
        lines.push("no camera of this machine found".to_owned());
    }
    if cfg!(not(feature = "genicam")) {
        lines.push(
            "GenICam: not built in; GigE Vision and USB3 Vision cameras need --features genicam"
                .to_owned(),
        );
    }
    lines.push(String::new());
    print(&lines.join("\n"))
}

/// What a camera can be asked for: a line for each format, with the sizes and the rates that they
/// hold.
#[cfg(all(feature = "v4l2", target_os = "linux"))]
fn modes(device: &Path) -> Vec<String> {
    let modes = match svl::grab::v4l2::modes(device) {
        Ok(modes) => modes,
        // Without the cure, which is to look here.
        Err(svl::Error::Camera { reason, .. }) => {
            return reason.split(';').take(1).map(str::to_owned).collect();
        }
        Err(error) => return vec![error.to_string()],
    };
    if modes.is_empty() {
        return vec!["no format that svl reads".to_owned()];
    }
    let of_one_format = modes.chunk_by(|a, b| a.format == b.format);
    let line = |modes: &[Mode]| {
        let sizes = modes.iter().map(
            |Mode {
                 size: (width, height),
                 max_rate_hz,
                 ..
             }| match max_rate_hz {
                Some(hz) => format!("{width}x{height} ({} Hz)", (hz * 10.0).round() / 10.0),
                None => format!("{width}x{height}"),
            },
        );
        format!(
            "{}: {}",
            modes[0].format,
            sizes.collect::<Vec<_>>().join(", ")
        )
    };
    of_one_format.map(line).collect()
}

#[cfg(not(all(feature = "v4l2", target_os = "linux")))]
fn modes(_: &Path) -> Vec<String> {
    Vec::new()
}

/// GigE Vision and USB3 Vision cameras that answer within a second, with what they are.
#[cfg(feature = "genicam")]
fn genicam_cameras() -> Vec<(String, String)> {
    let what = |found: svl::grab::genicam::Found| {
        (
            format!("genicam:{}", found.id),
            format!("{}, {}, {}", found.model, found.protocol, found.address),
        )
    };
    svl::grab::genicam::found().into_iter().map(what).collect()
}

#[cfg(not(feature = "genicam"))]
fn genicam_cameras() -> Vec<(String, String)> {
    Vec::new()
}

/// Video devices with what their drivers call them, as Linux lists them in a folder.
fn video_devices(folder: &Path) -> Vec<(String, String)> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let device = |entry: std::fs::DirEntry| {
        let name = std::fs::read_to_string(entry.path().join("name")).unwrap_or_default();
        (
            format!("/dev/{}", entry.file_name().display()),
            name.trim().to_owned(),
        )
    };
    let mut devices: Vec<_> = entries.map(device).collect();
    devices.sort();
    devices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn video_devices_have_their_drivers_names() {
        let folder = tempfile::tempdir().unwrap();
        for (device, name) in [("video2", "Firefly MV\n"), ("video0", "Webcam\n")] {
            std::fs::create_dir(folder.path().join(device)).unwrap();
            std::fs::write(folder.path().join(device).join("name"), name).unwrap();
        }
        let found = video_devices(folder.path());
        assert_eq!(
            found,
            [
                ("/dev/video0".into(), "Webcam".into()),
                ("/dev/video2".into(), "Firefly MV".into())
            ]
        );
        assert!(video_devices(Path::new("nowhere")).is_empty());
    }
}
