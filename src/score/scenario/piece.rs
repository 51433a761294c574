//! `[piece]`: the test pieces that the runs of a scenario approach.

use super::{Scenario, ScenarioSource};
use crate::judge::PieceConfig;
use svl_core::stereo::CellRule;
use svl_core::{Error, Result};

impl Scenario {
    /// Sets the test pieces, and places them in the arena.
    ///
    /// # Errors
    /// [`Error::Invalid`] for sizes out of range, and for a scenario without approaches.
    pub fn set_piece(&mut self, piece: PieceConfig) -> Result<()> {
        let invalid = |what: &str| Err(Error::Invalid(what.to_owned()));
        piece.validate()?;
        if matches!(self.cells, CellRule::Disparity { .. }) {
            return invalid("piece: it has a distance, and cells are judged by disparities");
        }
        match &mut self.source {
            ScenarioSource::Arena { config, .. } if config.random.is_none() => {
                if !(config.world.blocks.is_empty() && config.world.balls.is_empty()) {
                    return invalid(
                        "piece: it is the only object of its arena: set blocks = [] and balls = [] \
                         in [arena.world]",
                    );
                }
                config.pieces_m.clone_from(&piece.sizes_m);
            }
            ScenarioSource::Recording(_) if piece.sizes_m.len() == 1 => {}
            ScenarioSource::Recording(_) => {
                return invalid("piece.sizes_m: a recording has one piece");
            }
            _ => {
                return invalid(
                    "piece: it is approached in the arena or in recordings, not in random scenes, \
                     scenes of data sets or drives",
                );
            }
        }
        self.piece = Some(piece);
        Ok(())
    }
}
