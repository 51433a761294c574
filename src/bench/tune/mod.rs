//! Tuning by hand: the knobs of an algorithm, frames that stay in memory, and the scenario of a
//! setting.

mod estimates;
mod knob;
mod sample;
mod scenario;

pub use estimates::SampleCells;
pub use knob::{Knob, KnobPart, TunedSetting};
pub use sample::{Sampler, evaluate, spread_order};
pub use scenario::scenario_toml;
