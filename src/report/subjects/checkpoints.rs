//! How often a run passes its checkpoints.

use crate::rows::held::Row;
use crate::rows::records::{CheckpointRow, FrameRow};
use svl_score::judge::{Checkpoint, CheckpointFrame, CheckpointTally};

/// The checkpoints of a run, by checkpoint and algorithm.
pub(crate) struct CheckpointTallies<'a> {
    checkpoints: &'a [Checkpoint],
    labels: Vec<&'a str>,
    tallies: Vec<Vec<CheckpointTally<u64>>>,
    took_part: Vec<bool>,
}

impl<'a> CheckpointTallies<'a> {
    /// Empty tallies of these algorithms.
    pub(crate) fn new(labels: Vec<&'a str>, checkpoints: &'a [Checkpoint]) -> Self {
        let tallies = vec![CheckpointTally::default(); labels.len()];
        Self {
            checkpoints,
            tallies: vec![tallies; checkpoints.len()],
            took_part: vec![false; labels.len()],
            labels,
        }
    }

    pub(crate) fn add(&mut self, rows: &[Row], frames: &[FrameRow]) {
        for row in rows {
            if let Some(a) = self.place(&row.algorithm) {
                self.took_part[a] = true;
            }
        }
        for frame in frames {
            let mut checkpoints = self.checkpoints.iter();
            let c = checkpoints.position(|own| own.number == frame.checkpoint);
            if let Some((c, a)) = c.zip(self.place(&frame.algorithm)) {
                self.tallies[c][a].add(frame.scored(), || frame.sequence);
            }
        }
    }

    fn place(&self, label: &str) -> Option<usize> {
        self.labels.iter().position(|own| *own == label)
    }

    /// The rows, without what is the run's.
    pub(crate) fn into_rows(self) -> Vec<CheckpointRow> {
        let mut rows = Vec::new();
        for (checkpoint, tallies) in self.checkpoints.iter().zip(&self.tallies) {
            let algorithms = self.labels.iter().zip(tallies).zip(&self.took_part);
            for ((label, tally), _) in algorithms.filter(|(_, took_part)| **took_part) {
                let (best, worst) = (tally.best.as_ref(), tally.worst.as_ref());
                rows.push(CheckpointRow {
                    scenario: String::new(),
                    seed: None,
                    checkpoint: checkpoint.number,
                    name: checkpoint.name.clone(),
                    algorithm: (*label).to_owned(),
                    frames: tally.frames as u64,
                    passed: tally.passed as u64,
                    share: tally.share(),
                    best_sequence: best.map(|(sequence, _)| *sequence),
                    best_passed: best.map(|(_, frame)| frame.passed),
                    worst_sequence: worst.map(|(sequence, _)| *sequence),
                    worst_passed: worst.map(|(_, frame)| frame.passed),
                    run: None,
                    stress: None,
                });
            }
        }
        rows
    }
}

impl FrameRow {
    /// The result of a checkpoint as a row.
    pub fn new(
        sequence: u64,
        algorithm: &str,
        checkpoint: &Checkpoint,
        frame: &CheckpointFrame,
    ) -> Self {
        Self {
            sequence,
            algorithm: algorithm.to_owned(),
            checkpoint: checkpoint.number,
            passed: frame.passed,
            missing: frame.missing as u64,
            wrong: frame.wrong as u64,
            order_holds: frame.order_holds,
            error: frame.error,
        }
    }

    /// The result of the checkpoint.
    pub fn scored(&self) -> CheckpointFrame {
        CheckpointFrame {
            passed: self.passed,
            missing: self.missing as usize,
            wrong: self.wrong as usize,
            order_holds: self.order_holds,
            error: self.error,
        }
    }
}
