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
    ready: VecDeque<Frame>,
}

/// Frames rendered at once: enough to keep the cores busy, few enough to hold.
const BATCH: u64 = 8;

impl ArenaSource {
    pub fn new(arena: Arena, seed: u64) -> Self {
        Self {
            arena,
            seed,
            next: 0,
            ready: VecDeque::new(),
        }
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
            let batch = self.next..self.arena.frames().min(self.next + BATCH);
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

    fn seek(&mut self, index: u64) -> Result<bool> {
        let ready = self.ready.front().map_or(self.next, |frame| frame.sequence);
        match index.checked_sub(ready) {
            Some(skipped) if skipped <= self.ready.len() as u64 => {
                self.ready.drain(..skipped as usize);
            }
            _ => {
                self.ready.clear();
                self.next = index.min(self.arena.frames());
            }
        }
        Ok(true)
    }
}
