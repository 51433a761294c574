//! Two simulated cameras in the arena, each with its own delays and faults.

mod cable;
mod camera;
mod config;
mod pictures;
mod sensor;

pub use cable::{CabledTrigger, SimulatedTrigger, TriggerCable};
pub use camera::{CameraBehavior, SimulatedCamera, TriggerInput};
pub use config::SimulatedConfig;
pub use pictures::RenderedPictures;

use super::camera::Camera;
use super::driver::{self, CameraPair, CameraRequest, Driver, DriverFunctions, ListedCamera};
use super::trigger::{Trigger, TriggerSource};
use crate::camera_error;
use std::sync::Arc;
use svl_core::stereo::Side;
use svl_core::{Result, counted};

pub const DRIVER: Driver = Driver {
    name: "sim",
    cameras: "",
    help: "two simulated cameras that see the arena, in real time",
    options: config::OPTIONS,
    camera_options: config::CAMERA_OPTIONS,
    can_be_triggered: true,
    can_be_split: false,
    default_seed: Some(1),
    functions: Ok(DriverFunctions { open, list }),
};

/// Pixels of pictures that are rendered in an instant.
const SILENT_PIXELS: usize = 500_000;

fn open(request: &CameraRequest<'_>) -> Result<CameraPair> {
    let config = SimulatedConfig::parse(request.driver, request.text)?;
    // A missing controller is reported before the pictures are rendered, which takes seconds.
    let controller = request.controller()?;
    let (rate_hz, seed, host) = (request.rate_hz, request.seed, request.host);
    let pictures = request.pairs.map_or(config.pictures, |pairs| {
        config.pictures.min(pairs.max(1) as usize)
    });
    // The number of the board's pictures is fixed.
    let count = (!config.board).then_some(pictures as u64);
    if pictures * config.size.0 * config.size.1 > SILENT_PIXELS {
        let words = count.map_or("the board's pictures".to_owned(), |n| counted(n, "picture"));
        (host.preparing)(&format!("sim: renders {words} first"));
    }
    let go_on = || {
        (host.progress)(count);
        !(host.stopped)()
    };
    let pictures = if config.board {
        RenderedPictures::render_board(config.size, seed, go_on)?
    } else {
        RenderedPictures::render(config.size, rate_hz, pictures, seed, go_on)?
    };
    let pictures =
        Arc::new(pictures.ok_or_else(|| camera_error("sim", "stopped before the cameras began"))?);
    let cable = TriggerCable::new(request.clock);
    let trigger: Option<Box<dyn Trigger>> = match request.trigger {
        TriggerSource::FreeRunning => None,
        TriggerSource::Software | TriggerSource::FixedRate(_) => {
            Some(Box::new(SimulatedTrigger::new(&cable)))
        }
        TriggerSource::Serial(_) => controller
            .map(|controller| Box::new(CabledTrigger::new(Box::new(controller), &cable)) as _),
    };
    let camera = |side: Side| -> Box<dyn Camera> {
        let input = match trigger {
            None => TriggerInput::FreeRunning {
                period_ns: driver::period_ns(rate_hz),
            },
            Some(_) => TriggerInput::Cable(cable.clone()),
        };
        let behavior = config.behaviors[side as usize].clone();
        let camera = SimulatedCamera::new(
            side,
            request.clock,
            input,
            &pictures,
            config.light,
            behavior,
        );
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
