//! What the grabber asks of a camera.

use crate::error::{Error, Result};
use crate::stereo::Gray;
use std::fmt;
use std::ops::RangeInclusive;
use std::time::Duration;

/// One of the two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    Left,
    Right,
}

impl Side {
    pub const BOTH: [Side; 2] = [Side::Left, Side::Right];

    pub fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }

    /// An error of this side's camera, which says so.
    pub(super) fn blame(self, error: Error) -> Error {
        match error {
            Error::Camera { camera, reason } => {
                Error::camera(format!("{} camera, {camera}", self.name()), reason)
            }
            other => other,
        }
    }
}

/// How long and how strongly a camera exposes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    pub shutter_us: u32,
    /// Thousandths of a decibel.
    pub gain_mdb: i32,
}

impl Settings {
    /// Whether two exposures are alike: cameras round, and a hundredth is not seen.
    pub(super) fn is_near(self, other: Self) -> bool {
        let (a, b) = (self.shutter_us, other.shutter_us);
        a.abs_diff(b) <= 1 + a.max(b) / 100 && self.gain_mdb.abs_diff(other.gain_mdb) <= 100
    }
}

impl fmt::Display for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} µs and {:.1} dB",
            self.shutter_us,
            f64::from(self.gain_mdb) / 1e3
        )
    }
}

/// What a camera can be set to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    pub shutter_us: RangeInclusive<u32>,
    pub gain_mdb: RangeInclusive<i32>,
}

impl Limits {
    /// The settings that both cameras have.
    ///
    /// # Errors
    /// [`Error::Camera`] when there are none.
    pub fn common(&self, other: &Self) -> Result<Self> {
        let (a, b) = (self, other);
        let nothing = |what: &str, a: String, b: String| {
            let reason = format!("no {what} in common: left {a}, right {b}; use two alike");
            Err(Error::camera("the cameras", reason))
        };
        let shutter_us = *a.shutter_us.start().max(b.shutter_us.start())
            ..=*a.shutter_us.end().min(b.shutter_us.end());
        let gain_mdb =
            *a.gain_mdb.start().max(b.gain_mdb.start())..=*a.gain_mdb.end().min(b.gain_mdb.end());
        if shutter_us.is_empty() {
            let words = |range: &RangeInclusive<u32>| match (range.start(), range.end()) {
                (0, 0) => "has none to be set".to_owned(),
                (shortest, longest) => format!("{shortest} to {longest} µs"),
            };
            return nothing("shutter time", words(&a.shutter_us), words(&b.shutter_us));
        }
        if gain_mdb.is_empty() {
            let db = |mdb: &i32| f64::from(*mdb) / 1e3;
            let words = |range: &RangeInclusive<i32>| {
                format!("{} to {} dB", db(range.start()), db(range.end()))
            };
            return nothing("gain", words(&a.gain_mdb), words(&b.gain_mdb));
        }
        Ok(Self {
            shutter_us,
            gain_mdb,
        })
    }
}

/// One image as a camera took it.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    pub image: Gray,
    /// Middle of the exposure, nanoseconds.
    pub stamp_ns: u64,
    /// The pulse that fired it, where the camera knows.
    pub trigger_id: Option<u64>,
    /// What the camera was armed with ...
    pub ordered: Settings,
    /// ... and what it made of that: cameras have steps of their own.
    pub settings: Settings,
}

/// What came of an exposure.
#[derive(Clone, Debug, PartialEq)]
pub enum Taken {
    Image(Capture),
    /// Part of the image was lost on its way.
    Damaged,
    /// An image from before the settings were in force. The one that was ordered comes after it.
    Unready,
}

/// A camera. Only its own acquisition thread calls it, so calls may block.
pub trait Camera: Send {
    /// What a person calls it.
    fn name(&self) -> String;

    fn limits(&self) -> Limits;

    /// Prepares for one exposure. When it returns, the next trigger exposes; what was armed or
    /// exposed before and not captured is discarded.
    ///
    /// # Errors
    /// [`Error::Camera`] when it cannot.
    fn arm(&mut self, settings: Settings) -> Result<()>;

    /// Waits for the exposure and for its image; nothing when none came in that time. After that,
    /// and after [`Taken::Unready`], it may be asked again.
    ///
    /// # Errors
    /// [`Error::Camera`] when the camera is gone.
    fn capture(&mut self, patience: Duration) -> Result<Option<Taken>>;
}
