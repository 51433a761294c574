//! The judge of a scored run: rows for the tables, verdicts of the checkpoints, and the frames that a report shows.

use super::Sink;
use super::rows::{Identity, Judged};
use crate::error::Result;
use crate::files;
use crate::overlay::{self, Nearness};
use crate::report::html::{Figure, Rank, Shot};
use crate::report::{CheckpointRow, Summary, Tables};
use crate::score::{Checkpoint, CheckpointFrame, CheckpointTally, true_grid};
use crate::stereo::{DepthGrid, Estimate, Frame};

/// Takes the frames of one run after the other; [`Judge::begin_run`] and [`Judge::end_run`] stand around each.
pub struct Judge {
    identity: Identity,
    algorithms: Vec<String>,
    checkpoints: Vec<Checkpoint>,
    tables: Tables,
    /// Of the run being read: checkpoint by checkpoint, algorithm by algorithm, with the leading frames' sequences.
    run: Vec<Vec<CheckpointTally<u64>>>,
    /// Of all runs, with what a figure needs of the leading frames.
    all: Vec<Vec<CheckpointTally<Shot>>>,
    /// One figure per frame where there are no checkpoints and frames have names.
    scenes: Vec<Figure>,
}

impl Judge {
    /// `algorithms`: labels of the estimates.
    pub fn new(identity: Identity, algorithms: Vec<String>, checkpoints: Vec<Checkpoint>, tables: Tables) -> Self {
        let all = checkpoints.iter().map(|_| algorithms.iter().map(|_| CheckpointTally::default()).collect()).collect();
        Self { identity, algorithms, checkpoints, tables, run: Vec::new(), all, scenes: Vec::new() }
    }

    /// What follows belongs to the run of that seed.
    pub fn begin_run(&mut self, seed: Option<u64>) {
        self.identity.seed = seed;
        let tallies = || self.algorithms.iter().map(|_| CheckpointTally::default()).collect();
        self.run = self.checkpoints.iter().map(|_| tallies()).collect();
    }

    /// Writes the run's checkpoints.
    ///
    /// # Errors
    /// What keeps them from being written.
    pub fn end_run(&mut self) -> Result<()> {
        for (checkpoint, tallies) in self.checkpoints.iter().zip(std::mem::take(&mut self.run)) {
            for (algorithm, tally) in self.algorithms.iter().zip(tallies) {
                self.tables.push_checkpoint(CheckpointRow {
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
                })?;
            }
        }
        Ok(())
    }

    /// Completes the tables and hands over the summary with the figures: per checkpoint the worst and the best frame
    /// of every algorithm (thesis, figure 7.3), or one per scene.
    ///
    /// # Errors
    /// What keeps the tables from being written.
    pub fn finish(self) -> Result<(Summary, Vec<Figure>)> {
        let figure = |(checkpoint, tallies): (Checkpoint, Vec<CheckpointTally<Shot>>)| Figure {
            title: format!("{}. {}", checkpoint.number, checkpoint.name),
            about: checkpoint.description,
            shots: tallies.into_iter().flat_map(leading_shots).collect(),
        };
        let mut figures: Vec<_> = self.checkpoints.into_iter().zip(self.all).map(figure).collect();
        figures.extend(self.scenes);
        Ok((self.tables.finish()?, figures))
    }

    fn checkpoints(&mut self, frame: &Frame, estimates: &[Estimate], judged: &[Judged]) -> Result<()> {
        let Some(pose) = &frame.pose else { return Ok(()) };
        for (c, checkpoint) in self.checkpoints.iter().enumerate().filter(|(_, checkpoint)| checkpoint.covers(pose)) {
            for (estimate, judged) in estimates.iter().zip(judged) {
                let Some(judgements) = &judged.judgements else { continue };
                let Some(a) = self.algorithms.iter().position(|label| *label == estimate.algorithm) else { continue };
                let verdict = checkpoint.judge(&estimate.grid, judgements);
                self.run[c][a].add(verdict, || frame.sequence);
                let (best, worst) = self.all[c][a].would_lead(&verdict);
                let shot = if best || worst { Some(shot(frame, estimate, judged, Some(verdict))?) } else { None };
                // A shot is there exactly when the frame leads, which is when it is asked for.
                self.all[c][a].add(verdict, || shot.clone().expect("a leading frame has its shot"));
            }
        }
        Ok(())
    }
}

impl Sink for Judge {
    fn push(&mut self, frame: &Frame, estimates: &[Estimate]) -> Result<()> {
        let judged = self.identity.judge(frame, estimates);
        for judged in &judged {
            self.tables.push(judged.row.clone(), judged.cells.iter().cloned())?;
        }
        self.checkpoints(frame, estimates, &judged)?;
        if let (true, Some(name)) = (self.checkpoints.is_empty(), &frame.name) {
            let shots = estimates.iter().zip(&judged).map(|(estimate, judged)| shot(frame, estimate, judged, None));
            let shots = shots.collect::<Result<_>>()?;
            self.scenes.push(Figure { title: name.clone(), about: String::new(), shots });
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}

fn leading_shots(tally: CheckpointTally<Shot>) -> Vec<Shot> {
    let ranked = |lead: Option<(Shot, CheckpointFrame)>, rank| lead.map(|(shot, _)| Shot { rank: Some(rank), ..shot });
    ranked(tally.worst, Rank::Worst).into_iter().chain(ranked(tally.best, Rank::Best)).collect()
}

fn shot(frame: &Frame, estimate: &Estimate, judged: &Judged, verdict: Option<CheckpointFrame>) -> Result<Shot> {
    let (width, height) = frame.pair.size();
    let nearness = Nearness::of_frame(frame);
    let marks = |grid: &DepthGrid| overlay::marks(grid, (width, height), nearness);
    let left: Vec<u8> = frame.pair.left().pixels().collect();
    let preview = overlay::preview(&estimate.disparity, nearness.near_px() as f32);
    Ok(Shot {
        row: judged.row.clone(),
        cells: judged.cells.clone(),
        rank: None,
        passed: verdict.map(|v| v.passed),
        left_png: files::encode_png(width, height, &left)?,
        size: (width, height),
        estimate: marks(&estimate.grid),
        truth: true_grid(frame, estimate.grid.shape()).as_ref().map(marks),
        preview_png: Some(files::encode_png(width, height, &preview)?),
    })
}
