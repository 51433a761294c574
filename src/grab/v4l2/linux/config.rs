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
    /// Left and right.
    pub devices: [PathBuf; 2],
    /// Columns and rows; `None` lets svl choose.
    pub size: Option<(usize, usize)>,
    pub format: Option<PixelFormat>,
}

impl V4l2Config {
    /// # Errors
    /// [`Error::Usage`] and [`Error::ParameterValue`].
    pub(super) fn parse(driver: &Driver, text: &str) -> Result<Self> {
        let mut parts = text.split(',').map(str::trim);
        let mut device = || {
            parts
                .next()
                // An option in place of a device: one camera is missing.
                .filter(|name| !name.is_empty() && !name.contains('='))
        };
        let (Some(left), Some(right)) = (device(), device()) else {
            let cure = "`svl record --list` lists them";
            return Err(Error::Usage(format!(
                "v4l2: expected two devices, v4l2:LEFT,RIGHT, not '{text}'; {cure}"
            )));
        };
        if left == right {
            return Err(Error::Usage(format!(
                "v4l2: {left} is named twice; left and right are two cameras"
            )));
        }
        let mut config = Self {
            devices: [left.into(), right.into()],
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
        let parse = |text| V4l2Config::parse(&DRIVER, text);
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
    }
}
