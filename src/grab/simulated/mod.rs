//! Two simulated cameras in the arena, with delays and faults that can be set for each.

mod camera;
mod config;
mod pictures;
mod sensor;
mod wire;

pub use camera::{Drive, SimulatedCamera, Temper};
pub use config::SimulatedConfig;
pub use pictures::Pictures;
pub use wire::{Cabled, SimulatedTrigger, Wire};

use super::camera::{Camera, Side};
use super::driver::{self, CameraPair, CameraRequest, Driver, DriverFunctions, ListedCamera};
use super::trigger::{Trigger, TriggerSource};
use crate::error::{Error, Result};
use std::sync::Arc;

pub const DRIVER: Driver = Driver {
    name: "sim",
    cameras: "",
    help: "two simulated cameras that see the arena, in real time",
    options: config::OPTIONS,
    camera_options: config::CAMERA_OPTIONS,
    can_be_triggered: true,
    default_seed: Some(1),
    functions: Ok(DriverFunctions { open, list }),
};

fn open(request: &CameraRequest<'_>) -> Result<CameraPair> {
    let config = SimulatedConfig::parse(request.driver, request.text)?;
    let count = (!config.board).then_some(config.pictures as u64);
    let (rate_hz, seed, host) = (request.rate_hz, request.seed, request.host);
    let go_on = || {
        (host.progress)(count);
        !(host.stopped)()
    };
    let pictures = match config.board {
        true => Pictures::of_board(config.size, seed, go_on)?,
        false => Pictures::render(config.size, rate_hz, config.pictures, seed, go_on)?,
    };
    let pictures =
        Arc::new(pictures.ok_or_else(|| Error::camera("sim", "stopped before the cameras began"))?);
    let wire = Wire::new(request.clock);
    let trigger: Option<Box<dyn Trigger>> = match request.trigger {
        TriggerSource::FreeRunning => None,
        TriggerSource::Software | TriggerSource::FixedRate(_) => {
            Some(Box::new(SimulatedTrigger::new(&wire)))
        }
        TriggerSource::Serial(_) => request
            .controller()?
            .map(|controller| Box::new(Cabled::new(Box::new(controller), &wire)) as _),
    };
    let camera = |side: Side| -> Box<dyn Camera> {
        let drive = match trigger {
            None => Drive::FreeRunning {
                period_ns: driver::period_ns(rate_hz),
            },
            Some(_) => Drive::Wire(wire.clone()),
        };
        let temper = config.tempers[side as usize].clone();
        let camera =
            SimulatedCamera::new(side, request.clock, drive, &pictures, config.light, temper);
        Box::new(camera)
    };
    Ok(CameraPair {
        cameras: Side::BOTH.map(camera),
        trigger,
        rate_hz,
        rig: pictures.rig(),
    })
}

fn list() -> Vec<ListedCamera> {
    vec![ListedCamera {
        name: DRIVER.name.to_owned(),
        description: DRIVER.help.to_owned(),
        modes: Vec::new(),
    }]
}
