//! Time per stage of a frame, and the clock that measures it.

use std::time::{Duration, Instant};

/// A named stage of a method. The names are columns of the reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    Smoothing,
    Texture,
    /// Matching cost, aggregation and the search for the winner.
    Matching,
    Checks,
    /// Detection by filters in the left image ([`crate::filter`]).
    Filters,
}

impl Stage {
    /// All stages, in the order they run.
    pub const ALL: [Stage; 5] = [
        Stage::Smoothing,
        Stage::Texture,
        Stage::Matching,
        Stage::Checks,
        Stage::Filters,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Stage::Smoothing => "smoothing",
            Stage::Texture => "texture",
            Stage::Matching => "matching",
            Stage::Checks => "checks",
            Stage::Filters => "filters",
        }
    }
}

/// Time per stage of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageTimes([Duration; Stage::ALL.len()]);

impl StageTimes {
    pub fn get(&self, stage: Stage) -> Duration {
        self.0[stage as usize]
    }

    pub fn add(&mut self, stage: Stage, time: Duration) {
        self.0[stage as usize] += time;
    }

    /// Sum over the stages.
    pub fn total(&self) -> Duration {
        self.0.iter().sum()
    }
}

/// Attributes the time since its last lap to stages.
pub struct Clock {
    last: Instant,
    times: StageTimes,
}

impl Clock {
    pub fn start() -> Self {
        Self {
            last: Instant::now(),
            times: StageTimes::default(),
        }
    }

    /// Ends the lap: the time since the last one belongs to `stage`.
    pub fn lap(&mut self, stage: Stage) {
        let now = Instant::now();
        self.times.add(stage, now - self.last);
        self.last = now;
    }

    /// Ends the lap and charges `time` for it, spent in it or before it.
    pub fn lap_with(&mut self, stage: Stage, time: Duration) {
        self.times.add(stage, time);
        self.last = Instant::now();
    }

    /// Ends the lap: the time since the last one is divided among the stages in proportion to
    /// `times`, the sums over parallel threads.
    pub fn lap_as(&mut self, times: StageTimes) {
        let now = Instant::now();
        let share =
            // Without any time the quotient is NaN; this way every fraction is 0.
            (now - self.last).as_secs_f64() / times.total().as_secs_f64().max(f64::MIN_POSITIVE);
        for stage in Stage::ALL {
            self.times.add(
                stage,
                Duration::try_from_secs_f64(share * times.get(stage).as_secs_f64())
                    .unwrap_or_default(),
            );
        }
        self.last = now;
    }

    pub fn times(&self) -> StageTimes {
        self.times
    }
}
