//! The synchronized frame grabber (thesis, section 4.2).
//!
//! ```text
//! camera ──▶ acquisition ──armed, captured──┐                 ┌─▶ pairing ─▶ exposure balance
//!                                           ├─▶ coordinator ──┤
//! camera ──▶ acquisition ──armed, captured──┘      │          └─▶ bounded queue ─▶ writer
//!    ▲            ▲──── order: arm, settings ──────┤
//!    └─────── trigger ◀── when both are armed ─────┘
//! ```
//!
//! Two cameras on a trigger of fixed rate get out of step as soon as one of them is not ready for a
//! pulse (figure 4.2). So here the coordinator triggers, and only when both are armed (figure 4.3):
//! a slow camera slows the rate, and both images of a pair always belong to one pulse. The other
//! policies show the difference, or serve cameras that cannot be triggered.
//!
//! Stamps mark the middle of the exposure. Every image is in a pair or counted with its reason, and
//! every pair is read or counted ([`Tally`]).

mod acquire;
mod camera;
mod clock;
mod coordinator;
mod device_clock;
mod driver;
mod exposure;
pub mod genicam;
mod grabber;
mod mailbox;
mod pairing;
mod queue;
mod request;
mod serial;
pub mod simulated;
#[cfg(target_os = "linux")]
mod split;
mod tally;
mod trigger;
mod triggering;
pub mod v4l2;
mod watchdog;

pub use camera::{Camera, CameraError, Capture, Limits, Settings, Taken, camera_error};
pub use clock::{GrabClock, Participant};
pub use device_clock::DeviceClock;
pub use driver::{CameraPair, CameraRequest, Driver, DriverFunctions, Host, ListedCamera};
pub use exposure::Balance;
pub use grabber::{Grabber, Setup};
pub use pairing::{ARRIVAL_BYTES, Pairing, Rule, Unpaired, UnpairedCounts, WAITING};
pub use queue::{Pushed, Queue, WhenFull};
pub use request::{GrabRequest, PairBy};
pub use serial::{SerialTrigger, serial_ports};
pub use tally::Tally;
pub use trigger::{Policy, Pulse, RATES_HZ, Trigger, TriggerSource};

use std::time::Duration;
use svl_core::{Error, Result};

/// Every camera driver of svl. A new one is its folder and one line here.
pub const DRIVERS: &[Driver] = &[simulated::DRIVER, v4l2::DRIVER, genicam::DRIVER];

/// The driver of the cameras named in `source`, such as `v4l2:/dev/video0,/dev/video2`.
pub fn driver(source: &str) -> Option<&'static Driver> {
    let name = source.split(':').next();
    DRIVERS.iter().find(|driver| Some(driver.name) == name)
}

/// Settings of both cameras before the exposure balance has seen a pair.
const FIRST: Settings = Settings::new(4_000, 0);
/// Pairs from one step of the exposure balance to the next.
const BALANCE_EVERY: u32 = 10;
const QUEUE: usize = 64;
const TIMEOUT: Duration = Duration::from_secs(1);

/// Opens the two cameras that `source` names and grabs from them.
///
/// # Errors
/// [`Error::Usage`] and [`Error::ParameterValue`] for a request that contradicts itself or its
/// driver, [`CameraError`] for the state of cameras and triggers, or after [`Host::stopped`].
pub fn open(source: &str, request: &GrabRequest, host: Host<'_>) -> Result<Grabber> {
    let driver = driver(source).ok_or_else(|| {
        let sources: Vec<_> = DRIVERS.iter().map(Driver::source).collect();
        Error::Usage(format!(
            "{source}: no such cameras; expected {}",
            sources.join(" or ")
        ))
    })?;
    let trigger = request.trigger_source(driver, source)?;
    let is_free = trigger == TriggerSource::FreeRunning;
    if request.side_by_side.is_some() && !(driver.can_be_split && is_free) {
        let why = "--side-by-side is for one free-running device of v4l2";
        return Err(Error::Usage(format!("{source}: {why}")));
    }
    let functions = driver.functions.as_ref();
    let functions = functions.map_err(|cure| {
        camera_error(
            source,
            format!("this svl was built without {}; {cure}", driver.name),
        )
    })?;
    let clock = GrabClock::real();
    let rate_hz = request.rate_hz(&trigger);
    let pair = (functions.open)(&CameraRequest {
        driver,
        text: source.split_once(':').map_or("", |(_, text)| text),
        side_by_side: request.side_by_side,
        trigger: &trigger,
        rate_hz,
        pairs: request.most_pairs(rate_hz),
        clock: &clock,
        seed: request.seed.or(driver.default_seed).unwrap_or(0),
        host,
    })?;
    let period_ns = driver::period_ns(pair.rate_hz);
    let policy = match (pair.trigger, &trigger) {
        (None, _) => Policy::FreeRunning { period_ns },
        (Some(trigger), TriggerSource::FixedRate(_)) => Policy::FixedRate { trigger, period_ns },
        (Some(trigger), _) => Policy::Coordinated { trigger, period_ns },
    };
    Grabber::start(Setup {
        clock,
        cameras: pair.cameras,
        policy,
        rule: request.rule(driver, &trigger, period_ns),
        settings: FIRST,
        // The other half of a period is left for arming and transfer.
        max_shutter_us: (period_ns / 2_000).min(u32::MAX.into()) as u32,
        balance_every: BALANCE_EVERY,
        timeout: request.timeout.unwrap_or(TIMEOUT),
        queue: request.queue.unwrap_or(QUEUE),
        when_full: request.when_full.unwrap_or(WhenFull::Drop),
        rig: pair.rig,
    })
}
