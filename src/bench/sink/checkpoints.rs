//! Rows of the checkpoints: in how many frames each passes, per run and algorithm.

use super::table::RunIdentity;
use super::{Outbox, RunEnd, RunStart, Sink};
use crate::report::{CheckpointRow, TableWriter};
use std::path::Path;
use svl_core::Result;
use svl_data::score::{Checkpoint, CheckpointTally, Judged};

/// Writes one row per run, checkpoint and algorithm.
pub struct CheckpointSink {
    table: TableWriter<CheckpointRow>,
    identity: RunIdentity,
    algorithms: Vec<String>,
    checkpoints: Vec<Checkpoint>,
    /// Tallies of the run under way, by checkpoint and algorithm, with the sequences of leading
    /// frames.
    tallies: Vec<Vec<CheckpointTally<u64>>>,
    /// True for each algorithm that takes part in the run under way.
    took_part: Vec<bool>,
    kept: Vec<CheckpointRow>,
    outbox: Outbox<Vec<CheckpointRow>>,
}

impl CheckpointSink {
    /// Writes `checkpoints` into a folder, as `.csv` and `.parquet`, and leaves all rows in
    /// `outbox`.
    ///
    /// # Errors
    /// As [`TableWriter::create`].
    pub fn in_folder(folder: &Path, outbox: &Outbox<Vec<CheckpointRow>>) -> Result<Self> {
        Ok(Self {
            table: TableWriter::create_both(folder, "checkpoints")?,
            identity: RunIdentity::default(),
            algorithms: Vec::new(),
            checkpoints: Vec::new(),
            tallies: Vec::new(),
            took_part: Vec::new(),
            kept: Vec::new(),
            outbox: outbox.clone(),
        })
    }
}

impl Sink for CheckpointSink {
    fn begin_run(&mut self, start: &RunStart<'_>) -> Result<()> {
        self.identity = RunIdentity::new(start);
        self.algorithms = start.manifest.labels().map(str::to_owned).collect();
        self.checkpoints.clone_from(&start.judge.checkpoints);
        let tallies = vec![CheckpointTally::default(); self.algorithms.len()];
        self.tallies = vec![tallies; self.checkpoints.len()];
        self.took_part = vec![false; self.algorithms.len()];
        Ok(())
    }

    fn take(&mut self, judged: &Judged) -> Result<()> {
        for scored in &judged.estimates {
            let mut labels = self.algorithms.iter();
            let Some(a) = labels.position(|label| *label == scored.estimate.algorithm) else {
                continue;
            };
            self.took_part[a] = true;
            for (c, verdict) in &scored.checkpoints {
                self.tallies[*c][a].add(*verdict, || judged.frame.sequence);
            }
        }
        Ok(())
    }

    fn end_run(&mut self, _: &RunEnd<'_>) -> Result<()> {
        for (checkpoint, tallies) in self
            .checkpoints
            .iter()
            .zip(std::mem::take(&mut self.tallies))
        {
            let algorithms = self.algorithms.iter().zip(&tallies).zip(&self.took_part);
            for ((algorithm, tally), _) in algorithms.filter(|(_, took_part)| **took_part) {
                let row = CheckpointRow {
                    run_id: self.identity.run_id.clone(),
                    scenario: self.identity.scenario.clone(),
                    seed: self.identity.seed,
                    checkpoint: checkpoint.number,
                    name: checkpoint.name.clone(),
                    algorithm: algorithm.clone(),
                    frames: tally.frames as u64,
                    passed: tally.passed as u64,
                    share: tally.share(),
                    best_sequence: tally.best.as_ref().map(|(sequence, _)| *sequence),
                    best_passed: tally.best.as_ref().map(|(_, frame)| frame.passed),
                    worst_sequence: tally.worst.as_ref().map(|(sequence, _)| *sequence),
                    worst_passed: tally.worst.as_ref().map(|(_, frame)| frame.passed),
                    run: self.identity.run.clone(),
                    stress: self.identity.stress.clone(),
                };
                self.table.push([row.clone()])?;
                self.kept.push(row);
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.outbox.put(self.kept);
        self.table.finish()
    }
}
