//! What `svl record --list` finds.

use super::output::print;
use std::path::Path;

/// Prints what could be recorded from, and what could trigger it.
pub(super) fn list() -> anyhow::Result<()> {
    let mut lines = vec!["sim                     two simulated cameras".to_owned()];
    let cameras = video_devices(Path::new("/sys/class/video4linux"));
    lines.extend(cameras.iter().map(|(device, name)| format!("{device:<22}  camera: {name}")));
    let genicam = genicam_cameras();
    lines.extend(genicam.iter().map(|(name, what)| format!("{name:<22}  camera: {what}")));
    let ports = serial2::SerialPort::available_ports().unwrap_or_default();
    lines.extend(ports.iter().map(|port| format!("serial:{:<15}  serial port", port.display())));
    if cameras.is_empty() && genicam.is_empty() {
        lines.push("no camera of this machine found".to_owned());
    }
    lines.push(String::new());
    print(&lines.join("\n"))
}

/// GigE Vision and USB3 Vision cameras that answer within a second, with what they are.
#[cfg(feature = "genicam")]
fn genicam_cameras() -> Vec<(String, String)> {
    let what = |found: svl::grab::genicam::Found| {
        (format!("genicam:{}", found.id), format!("{}, {}, {}", found.model, found.protocol, found.address))
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
        (format!("/dev/{}", entry.file_name().display()), name.trim().to_owned())
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
        assert_eq!(found, [("/dev/video0".into(), "Webcam".into()), ("/dev/video2".into(), "Firefly MV".into())]);
        assert!(video_devices(Path::new("nowhere")).is_empty());
    }
}
