//! Errors of two settings over a sample without truth, by the witness.

use crate::sink::{RowIdentity, Sink};
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::sync::Arc;
use svl_core::Result;
use svl_core::stereo::{CellRule, Rig};
use svl_report::compare::{Change, untested_changes};
use svl_report::{CellRow, ComparedPair, EstimateRow, WitnessTally};
use svl_score::judge::{AreaChoice, Judged};

/// A pair, with the cells of the settings and those of the witness.
type ComparedCells = (ComparedPair, [Vec<CellRow>; 2]);

/// The cells of the settings and of the witness, by the number of the frame. Clones share them.
#[derive(Clone, Default)]
pub struct SampleCells(Arc<Mutex<BTreeMap<u64, ComparedCells>>>);

impl Sink for SampleCells {
    fn take(&mut self, judged: &Judged) -> Result<()> {
        let rows = RowIdentity::default();
        let cells = |scored| rows.cells(judged, scored);
        let pair = ComparedPair {
            infinity_px: judged.frame.rig().map(Rig::infinity_px),
            ..ComparedPair::default()
        };
        if let Some(witness) = &judged.witness {
            let own = judged.estimates.iter().flat_map(cells).collect();
            let both = [own, cells(witness)];
            self.0.lock().insert(judged.frame.sequence, (pair, both));
        }
        Ok(())
    }
}

impl SampleCells {
    /// Forgets all frames: a setting is another one now.
    pub fn clear(&self) {
        self.0.lock().clear();
    }

    fn tally<'a>(&self, frames: impl IntoIterator<Item = &'a u64>, rule: CellRule) -> WitnessTally {
        let (mut tally, own) = (WitnessTally::new(rule), self.0.lock());
        for (pair, [cells, witness]) in frames.into_iter().filter_map(|frame| own.get(frame)) {
            tally.add(pair, cells, witness);
        }
        tally.end_run();
        tally
    }

    /// The changes of the estimated errors from a setting to another, over frames.
    pub fn changes<'a>(
        &self,
        frames: impl IntoIterator<Item = &'a u64>,
        labels: [&str; 2],
        rule: CellRule,
    ) -> Vec<Change> {
        let rows = self.tally(frames, rule).into_rows(labels, |_| None);
        let rows = rows.iter().filter(|row| row.area == AreaChoice::default());
        let rows: Vec<&EstimateRow> = rows.collect();
        untested_changes(|metric, side| rows.get(side)?.about(metric.estimated()?))
    }

    /// The estimated right cells of a setting in a frame.
    pub fn right(&self, frame: u64, label: &str, rule: CellRule) -> Option<f64> {
        self.tally([&frame], rule).right(label)
    }
}
