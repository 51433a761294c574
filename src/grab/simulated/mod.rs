//! Two simulated cameras before the arena, each as slow, jittery or broken as one likes.

mod camera;
mod config;
mod pictures;
mod sensor;
mod wire;

pub use camera::{Drive, SimulatedCamera, Temper};
pub use config::SimulatedConfig;
pub use pictures::Pictures;
pub use wire::{Cabled, SimulatedTrigger, Wire};
