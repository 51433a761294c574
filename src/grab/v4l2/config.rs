//! Which cameras and how, as text: `/dev/video0,/dev/video2,size=640x480,format=YUYV`.

use super::mode::Format;
use crate::error::{Error, Result};
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

    fn from_str(text: &str) -> Result<Self> {
        let mut parts = text.split(',').map(str::trim);
        let mut device = || parts.next().filter(|name| !name.is_empty() && !name.contains('='));
        let (Some(left), Some(right)) = (device(), device()) else {
            return Err(Error::Invalid(format!(
                "v4l2:{text}: name two devices, {USAGE}; `svl record --list` shows what there is"
            )));
        };
        let mut config = Self { devices: [left.into(), right.into()], size: None, format: None };
        for setting in parts {
            let understood = setting.split_once('=').and_then(|(key, value)| config.set(key.trim(), value.trim()));
            understood.ok_or_else(|| Error::Invalid(format!("v4l2: '{setting}' is not of {USAGE}")))?;
        }
        Ok(config)
    }
}

impl V4l2Config {
    fn set(&mut self, key: &str, value: &str) -> Option<()> {
        match key {
            "size" => {
                let (width, height) = value.split_once('x')?;
                let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIDE).contains(side));
                self.size = Some((side(width)?, side(height)?));
            }
            "format" => self.format = Some(value.parse().ok()?),
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_devices_and_what_is_asked_of_both() {
        let config: V4l2Config = "/dev/video0, /dev/v4l/by-path/pci-0:14.0-video-index0,size=320x240".parse().unwrap();
        assert_eq!(config.devices[1].to_str(), Some("/dev/v4l/by-path/pci-0:14.0-video-index0"));
        assert_eq!((config.size, config.format), (Some((320, 240)), None));
        let config: V4l2Config = "a,b,format=MJPG".parse().unwrap();
        assert_eq!((config.size, config.format), (None, Some(Format::Mjpeg)));
        for wrong in
            ["", "/dev/video0", "/dev/video0,", "a,size=3x3", "a,b,c", "a,b,size=0x9", "a,b,format=RGB3", "a,b,"]
        {
            let error = wrong.parse::<V4l2Config>().unwrap_err().to_string();
            assert!(error.contains("v4l2:LEFT,RIGHT") && !error.contains('\n'), "{error}");
        }
    }
}
