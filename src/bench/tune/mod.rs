//! Tuning: the knobs of an algorithm, frames that stay in memory, and a search for better settings.

mod goal;
mod held;
mod knob;
mod outcome;
mod sample;
mod search;
mod space;
mod trial_log;
mod values;

pub use goal::{Bound, Constraint, Goal};
pub use held::{HeldRun, HeldRuns, SearchData, found};
pub use knob::{Knob, KnobPart, TunedSetting};
pub use outcome::{FrontEntry, TuneFacts, TuneOutcome, TunedAlgorithm, scenario_toml};
pub use sample::{Sampler, evaluate, spread_order};
pub use search::{Evaluated, Evaluator, Known, LoggedTrial, Search, SearchPlan};
pub use space::{SearchAxis, Space, quasi_random};
pub use trial_log::TrialLog;
pub use values::TrialValues;
