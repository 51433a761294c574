//! Opens a serial port exclusively for this program.

use crate::camera_error;
use serial2::SerialPort;
use std::io;
use std::path::{Path, PathBuf};
use svl_core::Result;

const BAUD: u32 = 500_000;

/// Opens a port and locks it.
///
/// # Errors
/// [`crate::CameraError`] with the remedy.
pub(super) fn open(device: &Path) -> Result<SerialPort> {
    let open = || {
        let port = SerialPort::open(device, BAUD)?;
        lock(&port)?;
        Ok(port)
    };
    open().map_err(|e| {
        camera_error(
            device.display().to_string(),
            reason(&e, group(device).as_deref()),
        )
    })
}

/// The serial ports of this machine; empty if the system does not list them.
pub fn serial_ports() -> Vec<PathBuf> {
    SerialPort::available_ports().unwrap_or_default()
}

/// Two programs on one line would read each other's answers. The lock ends with the port.
#[cfg(unix)]
fn lock(port: &SerialPort) -> io::Result<()> {
    use std::os::fd::AsFd;
    // The lock belongs to the open file description, so it outlives this duplicate handle.
    let handle = std::fs::File::from(port.as_fd().try_clone_to_owned()?);
    match handle.try_lock() {
        Err(std::fs::TryLockError::WouldBlock) => Err(io::ErrorKind::ResourceBusy.into()),
        // Some systems cannot lock ports: recording without a lock is better than not at all.
        Err(std::fs::TryLockError::Error(_)) | Ok(()) => Ok(()),
    }
}

/// Windows opens a port only once.
#[cfg(not(unix))]
fn lock(_: &SerialPort) -> io::Result<()> {
    Ok(())
}

fn reason(cause: &io::Error, group: Option<&str>) -> String {
    use io::ErrorKind::{NotFound, PermissionDenied, ResourceBusy};
    let words = match (cause.kind(), group) {
        (ResourceBusy, _) => return "is in use by another program; end that one first".to_owned(),
        (NotFound, _) => "no such device; plug it in; `svl record --list` lists the serial ports",
        (PermissionDenied, Some(group)) => {
            let join = format!("sudo usermod -aG {group} $USER");
            return format!(
                "cannot be opened: it is for the group {group}; `{join}`, then log in again"
            );
        }
        (PermissionDenied, None) => "permission denied; change its permissions",
        _ => {
            return format!(
                "is not a serial port with {BAUD} baud ({cause}); `svl record --list` lists the \
                 serial ports"
            );
        }
    };
    format!("cannot be opened: {words}")
}

/// The group that has access to a device, unless that is root.
#[cfg(unix)]
fn group(device: &Path) -> Option<String> {
    use std::os::unix::fs::MetadataExt;
    const USE_BY_GROUP: u32 = 0o060;
    let device = device.metadata().ok()?;
    let groups = std::fs::read_to_string("/etc/group").ok()?;
    let name = groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(device.gid())).then_some(name)
    });
    name.filter(|_| device.gid() != 0 && device.mode() & USE_BY_GROUP == USE_BY_GROUP)
        .map(str::to_owned)
}

#[cfg(not(unix))]
fn group(_: &Path) -> Option<String> {
    None
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use std::os::fd::AsRawFd;

    #[test]
    fn a_port_is_for_one_program() {
        let (_theirs, ours) = SerialPort::pair().unwrap();
        let path = std::fs::read_link(format!("/proc/self/fd/{}", ours.as_raw_fd())).unwrap();
        lock(&ours).unwrap();
        let error = open(&path).map(drop).unwrap_err().to_string();
        assert_eq!(
            error,
            format!(
                "{}: is in use by another program; end that one first",
                path.display()
            )
        );
        drop(ours);
        open(&path).unwrap();
    }

    #[test]
    fn errors_of_opening_have_a_cure() {
        for (device, words) in [
            (
                "/dev/nowhere",
                "cannot be opened: no such device; plug it in",
            ),
            ("/dev/null", "is not a serial port with 500000 baud"),
            ("/", "is not a serial port with 500000 baud"),
        ] {
            let error = open(Path::new(device)).map(drop).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("{device}: {words}"))
                    && error.contains("svl record --list"),
                "{error}"
            );
        }
        let denied = io::Error::from(io::ErrorKind::PermissionDenied);
        assert_eq!(
            reason(&denied, Some("dialout")),
            "cannot be opened: it is for the group dialout; `sudo usermod -aG dialout $USER`, \
             then log in again"
        );
        assert_eq!(
            reason(&denied, None),
            "cannot be opened: permission denied; change its permissions"
        );
    }
}
