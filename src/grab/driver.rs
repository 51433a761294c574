//! Camera drivers: the fields of a row of [`super::DRIVERS`], and the options that follow the names
//! of its cameras.

use super::camera::Camera;
use super::clock::GrabClock;
use super::serial::SerialTrigger;
use super::trigger::{Trigger, TriggerSource};
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;
use svl_core::matcher::{Parameter, Value};
use svl_core::stereo::{Rig, Side};
use svl_core::{Error, Result, did_you_mean, joined};
use svl_files::SideBySide;

/// A camera driver. Users write `NAME:CAMERAS,option=value,…`.
pub struct Driver {
    pub name: &'static str,
    /// Placeholder of its two cameras, as `LEFT,RIGHT`; empty if there is nothing to name.
    pub cameras: &'static str,
    /// One line: its kind of cameras.
    pub help: &'static str,
    pub options: &'static [Parameter],
    /// Options of both cameras, or of one if `left.` or `right.` precedes the name.
    pub camera_options: &'static [Parameter],
    /// True if svl can trigger the cameras by command, and so knows the pulse of each image.
    /// Otherwise they are free-running or triggered by the controller, and are paired by stamp.
    pub can_be_triggered: bool,
    /// True if one device may deliver both images as the halves of one.
    pub can_be_split: bool,
    /// Seed of the images if they depend on one.
    pub default_seed: Option<u64>,
    /// Functions of the driver, or how to get an svl that has them.
    pub functions: std::result::Result<DriverFunctions, &'static str>,
}

/// Functions of a driver.
pub struct DriverFunctions {
    /// Opens two cameras and starts them.
    ///
    /// # Errors
    /// [`Error::Usage`] and [`Error::ParameterValue`] for errors in the user's text,
    /// [`crate::CameraError`] for the state of cameras and triggers.
    pub open: fn(&CameraRequest<'_>) -> Result<CameraPair>,
    /// The cameras connected now.
    pub list: fn() -> Vec<ListedCamera>,
}

/// A request to a driver.
pub struct CameraRequest<'a> {
    pub driver: &'static Driver,
    /// Names and options: the text after the colon.
    pub text: &'a str,
    /// The places of both images in those of one device, if the user names one.
    pub side_by_side: Option<SideBySide>,
    pub trigger: &'a TriggerSource,
    pub rate_hz: f64,
    /// Pairs that are taken at most, if that is known.
    pub pairs: Option<u64>,
    pub clock: &'a Arc<GrabClock>,
    /// Seed of the driver's images if they depend on one, else 0.
    pub seed: u64,
    pub host: Host<'a>,
}

/// The program that opens cameras.
#[derive(Clone, Copy)]
pub struct Host<'a> {
    /// True if the request was cancelled; polled while waiting for cameras and triggers.
    pub stopped: fn() -> bool,
    /// Called before a long preparation, with a line that says what it is.
    pub preparing: &'a dyn Fn(&str),
    /// Called after each step of a long preparation, on any thread, with the number of steps if it
    /// is known.
    pub progress: &'a (dyn Fn(Option<u64>) + Sync),
}

impl Default for Host<'_> {
    fn default() -> Self {
        Self {
            stopped: || false,
            preparing: &|_| (),
            progress: &|_| (),
        }
    }
}

/// Two opened cameras.
pub struct CameraPair {
    /// Left, right.
    pub cameras: [Box<dyn Camera>; 2],
    /// Trigger of both; `None` if they are free-running.
    pub trigger: Option<Box<dyn Trigger>>,
    /// Images per second of each camera: the requested rate, or the rate that free-running cameras
    /// achieve.
    pub rate_hz: f64,
    /// Their rig, if images are rectified and the driver knows it.
    pub rig: Option<Rig>,
}

/// A connected camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ListedCamera {
    /// Name of the camera in a source.
    pub name: String,
    pub description: String,
    /// A line for each kind of images that it offers.
    pub modes: Vec<String>,
}

impl CameraRequest<'_> {
    /// The trigger controller, if it is the trigger source.
    ///
    /// # Errors
    /// The errors of [`SerialTrigger::open`].
    pub fn controller(&self) -> Result<Option<SerialTrigger>> {
        let TriggerSource::Serial(device) = self.trigger else {
            return Ok(None);
        };
        let period_ns = period_ns(self.rate_hz);
        SerialTrigger::open(Path::new(device), period_ns, self.clock, self.host.stopped).map(Some)
    }
}

/// Nanoseconds from one image to the next.
pub(super) fn period_ns(rate_hz: f64) -> u64 {
    (1e9 / rate_hz).round() as u64
}

/// An option and its value, which is in the range of the driver's table.
pub(super) struct Setting {
    pub name: &'static str,
    /// The cameras that it applies to.
    pub sides: &'static [Side],
    pub value: Value,
}

impl Driver {
    /// Text form of a source of this driver: `sim`, `v4l2:LEFT,RIGHT`.
    pub fn source(&self) -> String {
        match self.cameras {
            "" => self.name.to_owned(),
            cameras => format!("{}:{cameras}", self.name),
        }
    }

    /// Checks options written `name=value`.
    ///
    /// # Errors
    /// [`Error::Usage`] for a name that is not in the table, [`Error::ParameterValue`] for a value
    /// that is out of range.
    pub(super) fn settings<'a>(
        &self,
        texts: impl IntoIterator<Item = &'a str>,
    ) -> Result<Vec<Setting>> {
        texts.into_iter().map(|text| self.setting(text)).collect()
    }

    fn setting(&self, text: &str) -> Result<Setting> {
        // A name without a value is an error of the value, whose message gives the expected one.
        let (name, value) = text.split_once('=').unwrap_or((text, ""));
        let (name, value) = (name.trim(), value.trim());
        let (sides, bare_name) = match name.split_once('.') {
            Some(("left", bare_name)) => (&[Side::Left][..], bare_name),
            Some(("right", bare_name)) => (&[Side::Right][..], bare_name),
            _ => (&Side::BOTH[..], name),
        };
        // Only options of a camera may have a side prefix.
        let of_both = (bare_name == name).then_some(self.options);
        let mut options = of_both.into_iter().chain([self.camera_options]).flatten();
        let option = options
            .find(|option| option.name == bare_name)
            .ok_or_else(|| self.unknown_option(name))?;
        let value = option
            .range
            .parse(value)
            .ok_or_else(|| self.out_of_range(option.name, value, option.range.to_string()))?;
        Ok(Setting {
            name: option.name,
            sides,
            value,
        })
    }

    fn unknown_option(&self, name: &str) -> Error {
        let names = |options: &'static [Parameter]| options.iter().map(|option| option.name);
        let both = names(self.options).chain(names(self.camera_options));
        let nearest = did_you_mean(name, both);
        let of_one_camera = match self.camera_options {
            [] => String::new(),
            options => {
                let options = joined(names(options));
                format!(", or of both cameras or after left. or right.: {options}")
            }
        };
        let options = joined(names(self.options));
        let what = format!("no option '{name}'{nearest}; options are {options}{of_one_camera}");
        Error::Usage(format!("{}: {what}", self.name))
    }

    /// The error for a value that is not `expected`.
    pub(super) fn out_of_range(&self, option: &str, value: &str, expected: String) -> Error {
        Error::ParameterValue {
            algorithm: self.name,
            name: option.to_owned(),
            value: value.to_owned(),
            expected,
        }
    }

    /// Width and height in pixels from `WxH`.
    ///
    /// # Errors
    /// [`Error::ParameterValue`] if the text is malformed, or a side is out of range.
    pub(super) fn size(&self, text: &str, sides: RangeInclusive<usize>) -> Result<(usize, usize)> {
        let side = |text: &str| text.parse().ok().filter(|side| sides.contains(side));
        text.split_once('x')
            .and_then(|(width, height)| Some((side(width)?, side(height)?)))
            .ok_or_else(|| {
                let (min, max) = (sides.start(), sides.end());
                let expected = format!("WxH in pixels, each {min} to {max}");
                self.out_of_range("size", text, expected)
            })
    }
}
