//! What the grabber asks of a camera.

use crate::error::{Error, Result};
use crate::stereo::Gray;
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
            Error::Camera { camera, reason } => Error::camera(format!("{} camera, {camera}", self.name()), reason),
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

/// What a camera can be set to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    pub shutter_us: RangeInclusive<u32>,
    pub gain_mdb: RangeInclusive<i32>,
}

impl Limits {
    /// What both cameras can be set to.
    ///
    /// # Errors
    /// [`Error::Invalid`] when there is nothing.
    pub fn common(&self, other: &Self) -> Result<Self> {
        let (a, b) = (self, other);
        let shutter_us = *a.shutter_us.start().max(b.shutter_us.start())..=*a.shutter_us.end().min(b.shutter_us.end());
        let gain_mdb = *a.gain_mdb.start().max(b.gain_mdb.start())..=*a.gain_mdb.end().min(b.gain_mdb.end());
        if shutter_us.is_empty() || gain_mdb.is_empty() {
            return Err(Error::Invalid(format!(
                "the cameras have no exposure in common: {a:?} and {b:?}; use two alike"
            )));
        }
        Ok(Self { shutter_us, gain_mdb })
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
    /// What it was exposed with.
    pub settings: Settings,
}

/// What came of an exposure.
#[derive(Clone, Debug, PartialEq)]
pub enum Taken {
    Image(Capture),
    /// Part of the image was lost on its way.
    Damaged,
}

/// A camera. Only its own acquisition thread calls it, so calls may block.
pub trait Camera: Send {
    /// What a person calls it.
    fn name(&self) -> String;

    fn limits(&self) -> Limits;

    /// Prepares for one exposure. When it returns, the next trigger exposes; what was armed or exposed before and not
    /// captured is discarded.
    ///
    /// # Errors
    /// [`Error::Camera`] when it cannot.
    fn arm(&mut self, settings: Settings) -> Result<()>;

    /// Waits for the exposure and for its image; nothing when none came in that time, after which it may be asked again.
    ///
    /// # Errors
    /// [`Error::Camera`] when the camera is gone.
    fn capture(&mut self, patience: Duration) -> Result<Option<Taken>>;
}
