//! Features of a GenICam camera, and the cameras on this network and bus.

use crate::camera::{Limits, Settings};
use crate::camera_error;
use crate::driver::ListedCamera;
use aravis::glib::prelude::Cast;
use aravis::prelude::*;
use aravis::{Aravis, Auto, DeviceError, GcFloat, glib};
use parking_lot::{Mutex, MutexGuard};
use std::fmt::Display;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};
use svl_core::{Error, Result};

/// Result of a call to aravis.
type AravisResult<T> = std::result::Result<T, glib::Error>;

/// Trigger of a camera (SFNC `TriggerMode`, `TriggerSource`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TriggerMode {
    /// [`super::trigger::SoftwareTrigger`].
    Software,
    /// A rising edge on the camera's first trigger line.
    Line,
    /// No trigger: its own clock.
    FreeRunning { rate_hz: f64 },
}

/// The cameras that answer discovery, which takes about a second.
pub(super) fn list() -> Vec<ListedCamera> {
    static ARAVIS: LazyLock<Option<Mutex<Aravis>>> =
        LazyLock::new(|| Aravis::initialize().ok().map(Mutex::new));
    let Some(aravis) = &*ARAVIS else {
        return Vec::new();
    };
    let devices = aravis.lock().get_device_list();
    let text = |text: std::ffi::CString| text.to_string_lossy().into_owned();
    let listed = devices.into_iter().map(|device| ListedCamera {
        name: format!("genicam:{}", text(device.id)),
        // The protocol is GigEVision or USB3Vision.
        description: format!(
            "{} {}, {}, {}",
            text(device.vendor),
            text(device.model),
            text(device.protocol),
            text(device.address)
        ),
        modes: Vec::new(),
    });
    listed.collect()
}

/// The error for a name that cannot be opened.
fn unknown(name: &str, error: &glib::Error) -> Error {
    let answering: Vec<_> = list()
        .into_iter()
        .map(|camera| camera.name.trim_start_matches("genicam:").to_owned())
        .collect();
    let cure = if answering.is_empty() {
        "no camera answers: check its power, its cable, and that this computer is in its \
                 network"
            .to_owned()
    } else {
        format!("those that answer: {}", answering.join(", "))
    };
    camera_error(
        name,
        format!("cannot be opened: {}; {cure}", error.message()),
    )
}

/// A camera's features. Its acquisition thread and the trigger's share them.
pub(super) struct GenicamDevice {
    pub(super) name: String,
    camera: Mutex<aravis::Camera>,
    /// Set by aravis once the camera no longer answers.
    lost: Arc<AtomicBool>,
}

impl GenicamDevice {
    pub(super) fn open(name: &str) -> Result<Self> {
        // Without a name aravis would open any camera.
        let camera = aravis::Camera::new(Some(name)).map_err(|e| unknown(name, &e))?;
        let lost = Arc::new(AtomicBool::new(false));
        if let Some(device) = camera.device() {
            let lost = lost.clone();
            device.connect_control_lost(move |_| lost.store(true, Ordering::Release));
            if device
                .downcast_ref::<aravis::GvDevice>()
                // A GigE camera lets others read while one program controls it, so opening
                // succeeds.
                .is_some_and(|device| !device.is_controller())
            {
                return Err(camera_error(
                    name,
                    "is in use already: by another program, or it is named twice",
                ));
            }
        }
        Ok(Self {
            name: name.to_owned(),
            camera: Mutex::new(camera),
            lost,
        })
    }

    /// Sets 8-bit grey images and the trigger mode, and turns automatic exposure and gain off.
    pub(super) fn prepare(&self, mode: TriggerMode) -> Result<()> {
        let camera = self.lock();
        let formats = camera
            .dup_available_pixel_formats_as_strings()
            .map_err(|e| self.failed(&e))?;
        if !formats.iter().any(|format| format == MONO8) {
            return Err(self.error(format!(
                "has no {MONO8}, only {}; svl needs grey cameras",
                formats.join(", ")
            )));
        }
        let prepared = || -> AravisResult<()> {
            camera.set_pixel_format_from_string(MONO8)?;
            // Automatic controls of two cameras diverge; svl's exposure balance sets both equally.
            if camera.is_exposure_auto_available()? {
                camera.set_exposure_time_auto(Auto::Off)?;
            }
            if camera.is_gain_auto_available()? {
                camera.set_gain_auto(Auto::Off)?;
            }
            camera.set_acquisition_mode(aravis::AcquisitionMode::Continuous)
        };
        prepared().map_err(|e| self.failed(&e))?;
        let driven = match mode {
            TriggerMode::FreeRunning { rate_hz } => camera
                .clear_triggers()
                .and_then(|()| camera.set_frame_rate(rate_hz)),
            TriggerMode::Software => camera.set_trigger("Software"),
            TriggerMode::Line => {
                let sources = camera
                    .dup_available_trigger_sources()
                    .map_err(|e| self.failed(&e))?;
                let line = sources.iter().find(|source| source.starts_with("Line"));
                let no_line =
                    || self.error(format!("has no trigger line, only {}", sources.join(", ")));
                camera.set_trigger(line.ok_or_else(no_line)?)
            }
        };
        driven.map_err(|e| self.failed(&e))
    }

    /// Limits of the camera; no gain if that is not in decibels.
    pub(super) fn limits(&self) -> Result<Limits> {
        let camera = self.lock();
        let (shortest_us, longest_us) =
            camera.exposure_time_bounds().map_err(|e| self.failed(&e))?;
        // Bounds alone do not distinguish decibels from raw register values.
        let gain = camera
            .device()
            .and_then(|device| device.feature(GAIN)?.dynamic_cast::<GcFloat>().ok());
        let (least_db, most_db) = match gain.and_then(|gain| gain.unit()) {
            Some(unit) if unit.eq_ignore_ascii_case("dB") => {
                camera.float_bounds(GAIN).map_err(|e| self.failed(&e))?
            }
            _ => (0.0, 0.0),
        };
        // Casts saturate.
        Ok(Limits::new(
            (shortest_us.ceil() as u32).max(1)..=longest_us.floor() as u32,
            (least_db * 1e3).ceil() as i32..=(most_db * 1e3).floor() as i32,
        ))
    }

    /// Sets shutter and gain and returns the nearest values that the camera applied.
    pub(super) fn expose(&self, settings: Settings, limits: &Limits) -> Result<Settings> {
        let camera = self.lock();
        let exposed = || -> AravisResult<Settings> {
            camera.set_exposure_time(settings.shutter_us.into())?;
            // Casts saturate.
            let shutter_us = camera.exposure_time()?.round() as u32;
            if limits.gain_mdb.start() == limits.gain_mdb.end() {
                return Ok(Settings {
                    shutter_us,
                    ..settings
                });
            }
            camera.set_float(GAIN, f64::from(settings.gain_mdb) / 1e3)?;
            Ok(Settings {
                shutter_us,
                gain_mdb: (camera.float(GAIN)? * 1e3).round() as i32,
            })
        };
        exposed().map_err(|e| self.failed(&e))
    }

    pub(super) fn trigger(&self) -> Result<()> {
        self.answers()?;
        self.lock().software_trigger().map_err(|e| self.failed(&e))
    }

    /// Calls aravis; an error gets the camera's name.
    pub(super) fn ask<T>(
        &self,
        question: impl Fn(&aravis::Camera) -> AravisResult<T>,
    ) -> Result<T> {
        question(&self.lock()).map_err(|e| self.failed(&e))
    }

    /// # Errors
    /// [`crate::CameraError`] if it is gone.
    pub(super) fn answers(&self) -> Result<()> {
        if self.lost.load(Ordering::Acquire) {
            Err(self.error(SILENT))
        } else {
            Ok(())
        }
    }

    fn failed(&self, error: &glib::Error) -> Error {
        match error.kind() {
            Some(DeviceError::Timeout | DeviceError::NotConnected | DeviceError::TransferError) => {
                self.error(SILENT)
            }
            _ => self.error(error.message()),
        }
    }

    pub(super) fn error(&self, reason: impl Display) -> Error {
        camera_error(&self.name, reason.to_string())
    }

    fn lock(&self) -> MutexGuard<'_, aravis::Camera> {
        self.camera.lock()
    }
}

const SILENT: &str = "does not answer; check its power and its cable, and record again";
const MONO8: &str = "Mono8";
/// In decibels or another unit (SFNC); some cameras only have a raw one under another name.
const GAIN: &str = "Gain";
