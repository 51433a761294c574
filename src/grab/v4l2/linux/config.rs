//! Names and options of two V4L2 cameras: `/dev/video0,/dev/video2,size=640x480,format=YUYV`.

use super::mode::PixelFormat;
use crate::driver::{Driver, Setting};
use std::path::PathBuf;
use svl_core::matcher::Value;
use svl_core::stereo::MAX_SIDE;
use svl_core::{Error, Result};

/// Two cameras of this machine.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct V4l2Config {
    /// Left and right, or one of both.
    pub devices: Vec<PathBuf>,
    /// Columns and rows; `None` lets svl choose.
    pub size: Option<(usize, usize)>,
    pub format: Option<PixelFormat>,
}

impl V4l2Config {
    /// # Errors
    /// [`Error::Usage`] and [`Error::ParameterValue`].
    pub(super) fn parse(driver: &Driver, text: &str, is_side_by_side: bool) -> Result<Self> {
        // An option in place of a device: one camera is missing.
        let is_device = |name: &&str| !name.is_empty() && !name.contains('=');
        let mut parts = text.split(',').map(str::trim).peekable();
        let devices = std::iter::from_fn(|| parts.next_if(is_device));
        let devices: Vec<_> = devices.take(2).collect();
        let expected = match devices[..] {
            [_] if is_side_by_side => None,
            _ if is_side_by_side => Some("one device, v4l2:BOTH, with --side-by-side"),
            [left, right] if left == right => {
                return Err(Error::Usage(format!(
                    "v4l2: {left} is named twice; left and right are two cameras, or one with \
                     --side-by-side"
                )));
            }
            [_, _] => None,
            _ => Some("two devices, v4l2:LEFT,RIGHT, or one with --side-by-side"),
        };
        if let Some(expected) = expected {
            let cure = "`svl record --list` lists them";
            return Err(Error::Usage(format!(
                "v4l2: expected {expected}, not '{text}'; {cure}"
            )));
        }
        let mut config = Self {
            devices: devices.into_iter().map(PathBuf::from).collect(),
            size: None,
            format: None,
        };
        for Setting { name, value, .. } in driver.settings(parts)? {
            match (name, value) {
                ("size", Value::Text(size)) if size != "auto" => {
                    config.size = Some(driver.size(&size, 1..=MAX_SIDE)?);
                }
                ("format", Value::Choice(name)) => config.format = PixelFormat::from_name(name),
                _ => {}
            }
        }
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v4l2::DRIVER;

    #[test]
    fn two_devices_and_options_of_both() {
        let parse = |text| V4l2Config::parse(&DRIVER, text, false);
        let text = "/dev/video0, /dev/v4l/by-path/pci-0:14.0-video-index0,size=320x240";
        let config = parse(text).unwrap();
        assert_eq!(
            config.devices[1].to_str(),
            Some("/dev/v4l/by-path/pci-0:14.0-video-index0")
        );
        assert_eq!((config.size, config.format), (Some((320, 240)), None));
        let config = parse("a,b,format=MJPG").unwrap();
        assert_eq!(
            (config.size, config.format),
            (None, Some(PixelFormat::Mjpeg))
        );
        let config = parse("a,b,format=auto,size=auto").unwrap();
        assert_eq!((config.size, config.format), (None, None));
        for (wrong, expected) in [
            ("", "v4l2:LEFT,RIGHT"),
            ("/dev/video0", "v4l2:LEFT,RIGHT"),
            ("/dev/video0,", "v4l2:LEFT,RIGHT"),
            ("a,size=3x3", "v4l2:LEFT,RIGHT"),
            ("a,a", "a is named twice"),
            ("a,b,c", "no option 'c'; options are size, format"),
            ("a,b,size=0x9", "size=0x9 is not WxH in pixels, each 1 to"),
            (
                "a,b,format=RGB3",
                "format=RGB3 is not one of auto, GREY, YUYV, UYVY, MJPG",
            ),
            ("a,b,", "no option ''"),
        ] {
            let error = parse(wrong).unwrap_err().to_string();
            assert!(error.contains(expected) && !error.contains('\n'), "{error}");
        }
        let both = |text| V4l2Config::parse(&DRIVER, text, true);
        let config = both("/dev/video0,size=1280x480").unwrap();
        assert_eq!((config.devices.len(), config.size), (1, Some((1280, 480))));
        for wrong in ["a,b", "", "size=3x3"] {
            let error = both(wrong).unwrap_err().to_string();
            assert!(error.contains("expected one device, v4l2:BOTH"), "{error}");
        }
    }
}
