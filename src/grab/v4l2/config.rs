//! Which cameras and how, as text: `/dev/video0,/dev/video2,size=640x480,format=YUYV`.

use super::mode::Format;
use crate::error::Error;
use crate::stereo::MAX_SIDE;
use std::path::PathBuf;
use std::str::FromStr;

/// Two cameras of this machine.
#[derive(Clone, Debug, PartialEq)]
pub struct V4l2Config {
    /// Left and right.
    pub devices: [PathBuf; 2],
    /// Columns and rows; else svl chooses.
    pub size: Option<(usize, usize)>,
    pub format: Option<Format>,
}

const USAGE: &str = "v4l2:LEFT,RIGHT[,size=WxH][,format=GREY|YUYV|MJPG]";

impl FromStr for V4l2Config {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let mut parts = text.split(',').map(str::trim);
        let mut device = || {
            parts
                .next()
                .filter(|name| !name.is_empty() && !name.contains('='))
        };
        let (Some(left), Some(right)) = (device(), device()) else {
            let cure = "`svl record --list` shows what there is";
            return Err(Error::Invalid(format!(
                "v4l2: expected two devices, {USAGE}, not '{text}'; {cure}"
            )));
        };
        if left == right {
            return Err(Error::Invalid(format!(
                "v4l2: {left} is named twice; left and right are two cameras"
            )));
        }
        let mut config = Self {
            devices: [left.into(), right.into()],
            size: None,
            format: None,
        };
        for setting in parts {
            let (key, value) = setting.split_once('=').unwrap_or((setting, ""));
            let understood = config.set(key.trim(), value.trim());
            understood.map_err(|expected| {
                Error::Invalid(format!("v4l2: '{setting}': expected {expected}"))
            })?;
        }
        Ok(config)
    }
}

impl V4l2Config {
    /// # Errors
    /// What was expected instead.
    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "size" => {
                let side = |text: &str| {
                    text.parse()
                        .ok()
                        .filter(|side| (1..=MAX_SIDE).contains(side))
                };
                let sides = value
                    .split_once('x')
                    .and_then(|(width, height)| Some((side(width)?, side(height)?)));
                self.size =
                    Some(sides.ok_or_else(|| format!("WxH in pixels, each 1 to {MAX_SIDE}"))?);
            }
            "format" => {
                self.format = Some(value.parse().map_err(|()| "format=GREY, YUYV or MJPG")?)
            }
            _ => return Err(USAGE.to_owned()),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_devices_and_what_is_asked_of_both() {
        let config: V4l2Config =
            "/dev/video0, /dev/v4l/by-path/pci-0:14.0-video-index0,size=320x240"
                .parse()
                .unwrap();
        assert_eq!(
            config.devices[1].to_str(),
            Some("/dev/v4l/by-path/pci-0:14.0-video-index0")
        );
        assert_eq!((config.size, config.format), (Some((320, 240)), None));
        let config: V4l2Config = "a,b,format=MJPG".parse().unwrap();
        assert_eq!((config.size, config.format), (None, Some(Format::Mjpeg)));
        for (wrong, expected) in [
            ("", "v4l2:LEFT,RIGHT"),
            ("/dev/video0", "v4l2:LEFT,RIGHT"),
            ("/dev/video0,", "v4l2:LEFT,RIGHT"),
            ("a,size=3x3", "v4l2:LEFT,RIGHT"),
            ("a,a", "a is named twice"),
            ("a,b,c", "v4l2:LEFT,RIGHT"),
            (
                "a,b,size=0x9",
                "'size=0x9': expected WxH in pixels, each 1 to",
            ),
            (
                "a,b,format=RGB3",
                "'format=RGB3': expected format=GREY, YUYV or MJPG",
            ),
            ("a,b,", "v4l2:LEFT,RIGHT"),
        ] {
            let error = wrong.parse::<V4l2Config>().unwrap_err().to_string();
            assert!(error.contains(expected) && !error.contains('\n'), "{error}");
        }
    }
}
