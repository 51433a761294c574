//! Plausibility of a truth: pixels that cannot be, a unit that cannot be, and a constant factor
//! against every algorithm of a run; and of a map beside its truth.

mod floor;
mod map;
mod pictures;
mod pixels;
mod place;
mod scale;
mod unit;

pub use floor::{FloorPoints, FloorSeen};
pub use map::{map_doubt, sign_doubt, without};
pub use pictures::is_better_match;
pub use pixels::{PixelCheck, Spread, TruthSpread, remove_impossible};
pub use place::PlaceWatch;
pub use scale::{AlgorithmScale, MeasuredScales, SCALE_FRAMES, TruthScales, sampled_places};
pub use unit::split_unit;
