//! Errors of two settings over a sample without truth, by the witness.

use crate::sink::{RowIdentity, Sink};
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::sync::Arc;
use svl_core::Result;
use svl_core::stereo::{CellRule, Rig};
use svl_report::compare::{Change, estimated_changes};
use svl_report::{CellRow, ComparedPair, EstimateRow, WitnessTally};
use svl_score::judge::{AreaChoice, Judged};

/// A frame through both settings, beside the witness.
struct SampledFrame {
    infinity_px: Option<f32>,
    cells: Vec<CellRow>,
    seen: Vec<CellRow>,
}

/// The cells of the frames of a sample, by their numbers. Clones share them.
#[derive(Clone, Default)]
pub struct SampleCells(Arc<Mutex<BTreeMap<u64, SampledFrame>>>);

impl Sink for SampleCells {
    fn take(&mut self, judged: &Judged) -> Result<()> {
        let rows = RowIdentity::default();
        let cells = |scored| rows.cells(judged, scored);
        let frame = SampledFrame {
            infinity_px: judged.frame.rig().map(Rig::infinity_px),
            cells: judged.estimates.iter().flat_map(cells).collect(),
            seen: judged.witness.iter().flat_map(cells).collect(),
        };
        self.0.lock().insert(judged.frame.sequence, frame);
        Ok(())
    }
}

impl SampleCells {
    /// Forgets all frames: a setting is another one now.
    pub fn clear(&self) {
        self.0.lock().clear();
    }

    /// The changes of the estimated errors from a setting to another, over all frames.
    pub fn changes(&self, labels: [&str; 2], rule: CellRule) -> Vec<Change> {
        let frames = self.0.lock();
        let tally = tallied(rule, frames.values());
        let rows = tally.into_rows(labels, |_| None);
        let own = |label: &str| {
            let is_own =
                |row: &&EstimateRow| row.algorithm == label && row.area == AreaChoice::default();
            rows.iter().find(is_own)
        };
        estimated_changes(labels.map(own))
    }

    /// The estimated right cells of a setting in a frame.
    pub fn right(&self, frame: u64, label: &str, rule: CellRule) -> Option<f64> {
        let frames = self.0.lock();
        tallied(rule, frames.get(&frame)).right(label)
    }
}

fn tallied<'a>(rule: CellRule, frames: impl IntoIterator<Item = &'a SampledFrame>) -> WitnessTally {
    let mut tally = WitnessTally::new(rule);
    for frame in frames.into_iter().filter(|frame| !frame.seen.is_empty()) {
        let pair = ComparedPair {
            stamp_ns: None,
            infinity_px: frame.infinity_px,
            floor: None,
        };
        tally.add(&pair, &frame.cells, &frame.seen);
    }
    tally.end_run();
    tally
}
