//! The simulated calibration board as a source.

use crate::source::frames::Source;
use svl_calibrate::simulated::{MovingBoard, RATE_HZ};
use svl_core::Result;
use svl_core::stereo::{Exposure, Frame, Geometry};

/// Renders a board moved in front of two cameras; the pairs are raw.
pub struct BoardSource {
    board: MovingBoard,
    seed: u64,
    next: u64,
}

impl BoardSource {
    /// # Errors
    /// The errors of [`MovingBoard::new`].
    pub fn new(seed: u64) -> Result<Self> {
        Ok(Self {
            board: MovingBoard::new(seed)?,
            seed,
            next: 0,
        })
    }
}

impl Source for BoardSource {
    fn name(&self) -> String {
        format!("board, seed {}", self.seed)
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        if self.next >= self.board.pairs() {
            return Ok(None);
        }
        let sequence = self.next;
        self.next += 1;
        Ok(Some(Frame {
            sequence,
            stamp_ns: (sequence as f64 / RATE_HZ * 1e9).round() as u64,
            exposure: Exposure {
                trigger_id: sequence,
                skew_ns: Some(0),
                ..Exposure::default()
            },
            ..Frame::new(self.board.pair(sequence)?, Geometry::Raw)
        }))
    }

    fn pairs(&self) -> Option<u64> {
        Some(self.board.pairs())
    }
}
