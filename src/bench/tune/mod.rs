//! Tuning: what of an algorithm can be turned, frames that stay in memory, and a search for better
//! settings.

mod goal;
mod knob;
mod outcome;
mod sample;
mod search;
mod space;
mod values;

pub use goal::{Bound, Constraint, Goal};
pub use knob::{Knob, KnobPart, TunedSetting};
pub use outcome::{FrontEntry, TuneFacts, TuneOutcome, TunedAlgorithm, scenario_toml};
pub use sample::{Sampler, evaluate, spread_order};
pub use search::{Evaluated, Evaluator, Known, LoggedTrial, Search, SearchPlan};
pub use space::{SearchAxis, Space, quasi_random};
pub use values::TrialValues;
