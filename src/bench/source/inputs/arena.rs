//! The simulated arena as a source.

use crate::source::frames::Source;
use rayon::prelude::*;
use std::collections::VecDeque;
use svl_core::Result;
use svl_core::stereo::{Frame, hash_words};
use svl_files::BuildInfo;
use svl_sim::arena::{self, Arena, ArenaConfig};

/// Renders an arena's run, a few frames ahead and in parallel.
pub struct ArenaSource {
    arena: Arena,
    seed: u64,
    next: u64,
    /// Frames of the next batch: a frame per thread at the start and after a seek, then twice as
    /// many as before, so that a run of few frames, or of every tenth, renders few others.
    batch: u64,
    ready: VecDeque<Frame>,
}

/// Limit of the frames rendered at once: enough to keep the cores busy, few enough to hold.
const MAX_BATCH: u64 = 8;

/// A frame per thread.
fn first_batch() -> u64 {
    (rayon::current_num_threads() as u64).min(MAX_BATCH)
}

impl ArenaSource {
    pub fn new(arena: Arena, seed: u64) -> Self {
        Self {
            arena,
            seed,
            next: 0,
            batch: first_batch(),
            ready: VecDeque::new(),
        }
    }

    /// The number of the next frame.
    fn place(&self) -> u64 {
        self.ready.front().map_or(self.next, |frame| frame.sequence)
    }

    /// Hash of everything that the pixels of a run depend on.
    pub fn hash(config: &ArenaConfig, seed: u64) -> String {
        // A configuration is plain numbers and text, which JSON can hold.
        let config = serde_json::to_string(config).unwrap_or_default();
        let (version, revision) = (BuildInfo::current().version, arena::REVISION);
        let text = format!("svl {version} arena {revision} seed {seed} {config}");
        hash_words(xxhash_rust::xxh3::xxh3_128(text.as_bytes()))
    }
}

impl Source for ArenaSource {
    fn name(&self) -> String {
        format!("arena, seed {}", self.seed)
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        if self.ready.is_empty() {
            let batch = self.next..self.arena.frames().min(self.next + self.batch);
            self.batch = (2 * self.batch).min(MAX_BATCH);
            self.next = batch.end;
            self.ready = batch
                .into_par_iter()
                .map(|i| self.arena.frame(i))
                .collect::<Result<_>>()?;
        }
        Ok(self.ready.pop_front())
    }

    fn pairs(&self) -> Option<u64> {
        Some(self.arena.frames())
    }

    fn skip(&mut self, frames: u64) -> Result<u64> {
        let here = self.place();
        let there = self.arena.frames().min(here + frames);
        self.seek(there)?;
        Ok(there - here)
    }

    fn seek(&mut self, index: u64) -> Result<bool> {
        match index.checked_sub(self.place()) {
            Some(skipped) if skipped <= self.ready.len() as u64 => {
                self.ready.drain(..skipped as usize);
            }
            _ => {
                self.ready.clear();
                self.batch = first_batch();
                self.next = index.min(self.arena.frames());
            }
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_are_left_out_are_not_rendered() {
        let arena = Arena::new(&ArenaConfig::default(), 1).unwrap();
        let frames = arena.frames();
        let mut source = ArenaSource::new(arena, 1);
        assert!(source.next().unwrap().is_some());
        assert_eq!(source.skip(frames).unwrap(), frames - 1);
        assert!(source.ready.is_empty() && source.next().unwrap().is_none());
    }
}
