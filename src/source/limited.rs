//! The beginning of another source.

use super::Source;
use crate::error::Result;
use crate::score::Judged;
use crate::stereo::{Frame, Losses};

/// Ends a source after so many frames or so much of its time.
pub struct Limited {
    source: Box<dyn Source>,
    frames: Option<u64>,
    duration_ns: Option<u64>,
    taken: u64,
    first_ns: Option<u64>,
}

impl Limited {
    pub fn new(source: Box<dyn Source>, frames: Option<u64>, duration_ns: Option<u64>) -> Self {
        Self {
            source,
            frames,
            duration_ns,
            taken: 0,
            first_ns: None,
        }
    }
}

impl Source for Limited {
    fn name(&self) -> String {
        self.source.name()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        if self.frames.is_some_and(|frames| self.taken >= frames) {
            return Ok(None);
        }
        let Some(frame) = self.source.next()? else {
            return Ok(None);
        };
        let first_ns = *self.first_ns.get_or_insert(frame.stamp_ns);
        if self
            .duration_ns
            .is_some_and(|duration| frame.stamp_ns.saturating_sub(first_ns) >= duration)
        {
            return Ok(None);
        }
        self.taken += 1;
        Ok(Some(frame))
    }

    fn pairs(&self) -> Option<u64> {
        match (self.source.pairs(), self.frames) {
            _ if self.duration_ns.is_some() => None,
            (Some(all), Some(frames)) => Some(all.min(frames)),
            (all, frames) => frames.or(all),
        }
    }

    fn finish(&mut self, taken: u64) -> Losses {
        self.source.finish(taken)
    }

    fn listens(&self) -> bool {
        self.source.listens()
    }

    fn hear(&mut self, judged: &Judged) {
        self.source.hear(judged);
    }
}
