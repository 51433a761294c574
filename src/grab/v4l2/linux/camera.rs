//! A V4L2 camera: arm, capture, settling after a change of settings.

use super::control::Controls;
use super::device::trouble;
use super::pixels::Layout;
use super::stamp::Times;
use super::stream::{Fault, VideoStream};
use crate::camera::{Camera, Capture, Limits, Settings, Taken};
use crate::camera_error;
use rustix::io::Errno;
use std::time::Duration;
use svl_core::{Error, Result};

/// Images of a free-running camera that may still have the earlier settings: the one being exposed,
/// and the one being read out.
const SETTLING: u32 = 2;
/// Limit on stale buffers that are discarded, more than any driver has.
const WAITING: u32 = 64;

/// A V4L2 camera that streams.
pub(super) struct V4l2Camera<D> {
    name: String,
    driver: D,
    layout: Layout,
    controls: Controls,
    /// True if a controller triggers it; else it is free-running.
    triggered: bool,
    /// Settings ordered, and in effect.
    settings: Option<[Settings; 2]>,
    /// Number of coming images that do not have these settings yet.
    unsettled: u32,
    times: Times,
    /// False and true after the first image without stamp or with damage: one warning each.
    has_stamps: bool,
    has_damaged: bool,
}

impl<D: VideoStream> V4l2Camera<D> {
    /// A camera whose images have `layout`. Turns automatic exposure off if the exposure can be
    /// set.
    ///
    /// # Errors
    /// [`crate::CameraError`] if it cannot be set.
    pub(super) fn new(
        name: String,
        mut driver: D,
        layout: Layout,
        triggered: bool,
        times: Times,
    ) -> Result<Self> {
        let controls = Controls::take(&mut driver);
        let controls = controls
            .map_err(|errno| camera_error(&name, format!("cannot be set: {}", trouble(errno))))?;
        Ok(Self {
            name,
            driver,
            layout,
            controls,
            triggered,
            settings: None,
            unsettled: 0,
            times,
            has_stamps: true,
            has_damaged: false,
        })
    }

    fn error(&self, errno: Errno) -> Error {
        camera_error(&self.name, trouble(errno))
    }

    /// Warns of the first damaged image; all are counted.
    fn damaged(&mut self, reason: impl std::fmt::Display) -> Taken {
        if !std::mem::replace(&mut self.has_damaged, true) {
            tracing::warn!(
                "{}: an image arrived damaged ({reason}); others like it are only counted",
                self.name
            );
        }
        Taken::Damaged
    }

    /// Discards images that were exposed before.
    fn discard(&mut self) -> Result<()> {
        for _ in 0..WAITING {
            match self.driver.next(Duration::ZERO, |_, _| ()) {
                Ok(None) => break,
                Ok(Some(())) | Err(Fault::Buffer(_)) => {}
                Err(Fault::Stream(errno)) => return Err(self.error(errno)),
            }
        }
        Ok(())
    }
}

impl<D: VideoStream> Camera for V4l2Camera<D> {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn limits(&self) -> Limits {
        self.controls.limits()
    }

    /// Free-running: waiting images are kept as long as the settings are unchanged, as their stamps
    /// give their time.
    fn arm(&mut self, settings: Settings) -> Result<()> {
        if self.settings.is_none_or(|[ordered, _]| ordered != settings) {
            let applied = self
                .controls
                .apply(settings, &mut self.driver)
                .map_err(|errno| {
                    camera_error(
                        &self.name,
                        format!("cannot be set to {settings}: {}", trouble(errno)),
                    )
                })?;
            self.settings = Some([settings, applied]);
            // A controller sends its pulse after both cameras were set, so nothing is in progress.
            self.unsettled = if self.triggered { 0 } else { SETTLING };
        }
        if self.triggered {
            self.discard()
        } else {
            Ok(())
        }
    }

    fn capture(&mut self, timeout: Duration) -> Result<Option<Taken>> {
        let Some([ordered, settings]) = self.settings else {
            return Ok(None);
        };
        let layout = self.layout;
        let (image, stamp) = match self
            .driver
            .next(timeout, |data, stamp| (layout.read(data), stamp))
        {
            Ok(None) => return Ok(None),
            Ok(Some((Ok(image), stamp))) => (image, stamp),
            Ok(Some((Err(fault), _))) => return Ok(Some(self.damaged(fault))),
            Err(Fault::Buffer(reason)) => return Ok(Some(self.damaged(reason))),
            Err(Fault::Stream(errno)) => return Err(self.error(errno)),
        };
        if self.unsettled > 0 {
            self.unsettled -= 1;
            return Ok(Some(Taken::Unready));
        }
        let middle_ns = stamp.middle_ns(settings.shutter_us, self.times.earliest_ns);
        if middle_ns.is_none() && std::mem::take(&mut self.has_stamps) {
            tracing::warn!(
                "{}: its driver gives no times; stamps are of the arrival of images",
                self.name
            );
        }
        let stamp_ns = middle_ns
            .unwrap_or(stamp.arrived_ns)
            .wrapping_add(self.times.offset_ns);
        Ok(Some(Taken::Image(Capture {
            image,
            stamp_ns,
            trigger_id: None,
            ordered,
            settings,
        })))
    }
}
