//! The camera interface of the grabber: settings, limits, captured images.

use std::fmt;
use std::ops::RangeInclusive;
use std::time::Duration;
use svl_core::stereo::{Gray, Side};
use svl_core::{Error, Result};

/// Failure of a camera or its trigger, in an [`Error::Other`]. Earlier frames are valid.
#[derive(Debug, thiserror::Error)]
#[error("{camera}: {reason}")]
pub struct CameraError {
    pub camera: String,
    pub reason: String,
}

/// A [`CameraError`].
pub fn camera_error(camera: impl Into<String>, reason: impl Into<String>) -> Error {
    let (camera, reason) = (camera.into(), reason.into());
    Error::other(CameraError { camera, reason })
}

/// The error of one side's camera, with the side before the camera's name.
pub(super) fn on_side(side: Side, error: Error) -> Error {
    match error.downcast_ref() {
        Some(CameraError { camera, reason }) => {
            camera_error(format!("{} camera, {camera}", side.name()), reason)
        }
        None => error,
    }
}

/// Exposure time and gain of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    pub shutter_us: u32,
    /// Thousandths of a decibel.
    pub gain_mdb: i32,
}

impl Settings {
    /// Microseconds, thousandths of a decibel.
    pub const fn new(shutter_us: u32, gain_mdb: i32) -> Self {
        Self {
            shutter_us,
            gain_mdb,
        }
    }

    /// True if two exposures are practically equal: cameras round, and one per cent is not visible.
    pub(super) fn is_near(self, other: Self) -> bool {
        let (a, b) = (self.shutter_us, other.shutter_us);
        a.abs_diff(b) <= 1 + a.max(b) / 100 && self.gain_mdb.abs_diff(other.gain_mdb) <= 100
    }
}

impl fmt::Display for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let gain_db = f64::from(self.gain_mdb) / 1e3;
        write!(f, "{} µs and {gain_db:.1} dB", self.shutter_us)
    }
}

/// The range of settings of a camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    pub shutter_us: RangeInclusive<u32>,
    pub gain_mdb: RangeInclusive<i32>,
}

impl Limits {
    /// Microseconds, thousandths of a decibel.
    pub const fn new(shutter_us: RangeInclusive<u32>, gain_mdb: RangeInclusive<i32>) -> Self {
        Self {
            shutter_us,
            gain_mdb,
        }
    }

    /// The settings common to both cameras.
    ///
    /// # Errors
    /// [`CameraError`] if there are none.
    pub fn common(&self, other: &Self) -> Result<Self> {
        let common = Self {
            shutter_us: intersection(&self.shutter_us, &other.shutter_us),
            gain_mdb: intersection(&self.gain_mdb, &other.gain_mdb),
        };
        let nothing = |what: &str, left: String, right: String| {
            let reason = format!(
                "no {what} in common: left {left}, right {right}; use two of one \
                                  model"
            );
            Err(camera_error("the cameras", reason))
        };
        if common.shutter_us.is_empty() {
            let words = |limits: &Self| match (limits.shutter_us.start(), limits.shutter_us.end()) {
                // Reported by V4L2 cameras without an exposure control.
                (0, 0) => "cannot be set".to_owned(),
                (shortest, longest) => format!("{shortest} to {longest} µs"),
            };
            return nothing("shutter time", words(self), words(other));
        }
        if common.gain_mdb.is_empty() {
            let db = |mdb: &i32| f64::from(*mdb) / 1e3;
            let words = |limits: &Self| {
                let (least, greatest) = (limits.gain_mdb.start(), limits.gain_mdb.end());
                format!("{} to {} dB", db(least), db(greatest))
            };
            return nothing("gain", words(self), words(other));
        }
        Ok(common)
    }

    /// The nearest settings within the limits.
    pub(super) fn clamp(&self, settings: Settings) -> Settings {
        let (shutter_us, gain_mdb) = (&self.shutter_us, &self.gain_mdb);
        Settings::new(
            settings
                .shutter_us
                .clamp(*shutter_us.start(), *shutter_us.end()),
            settings.gain_mdb.clamp(*gain_mdb.start(), *gain_mdb.end()),
        )
    }
}

fn intersection<T: Copy + Ord>(a: &RangeInclusive<T>, b: &RangeInclusive<T>) -> RangeInclusive<T> {
    *a.start().max(b.start())..=*a.end().min(b.end())
}

/// One image of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    pub image: Gray,
    /// Middle of the exposure, nanoseconds.
    pub stamp_ns: u64,
    /// The pulse that triggered it, if the camera reports it.
    pub trigger_id: Option<u64>,
    /// The settings that the camera was armed with,
    pub ordered: Settings,
    /// and those it used: cameras have steps of their own.
    pub settings: Settings,
}

/// The outcome of an exposure.
#[derive(Clone, Debug, PartialEq)]
pub enum Taken {
    Image(Capture),
    /// Part of the image was lost in transfer.
    Damaged,
    /// An image from before the settings took effect. The ordered one comes after it.
    Unready,
}

/// A camera. Only its own acquisition thread uses it, so calls may block.
pub trait Camera: Send {
    /// Name for messages.
    fn name(&self) -> String;

    fn limits(&self) -> Limits;

    /// Prepares for one exposure. After it returns, the next trigger exposes; images that were
    /// armed or exposed before and not captured are discarded.
    ///
    /// # Errors
    /// [`CameraError`] if it fails.
    fn arm(&mut self, settings: Settings) -> Result<()>;

    /// Waits for the exposure and its image; `None` if none arrived within `timeout`. After that,
    /// and after [`Taken::Unready`], it may be called again without arming.
    ///
    /// # Errors
    /// [`CameraError`] if the camera is gone.
    fn capture(&mut self, timeout: Duration) -> Result<Option<Taken>>;
}
