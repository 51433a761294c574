//! The judge of a scored run: rows for the tables, verdicts of the checkpoints, and the frames that
//! a report shows.

use super::Sink;
use super::rows::{Identity, Judged};
use crate::error::Result;
use crate::files;
use crate::overlay::{self, Nearness, Picture};
use crate::report::html::{Figure, Rank, Scene, SceneShot, Shot};
use crate::report::{CheckpointRow, Row, Summary, Tables};
use crate::score::{Checkpoint, CheckpointFrame, CheckpointTally, true_grid};
use crate::stereo::{DepthGrid, Estimate, Frame, Plane};

/// Widest picture of a frame, pixels: as wide as the arena's.
const WIDTH: usize = 320;
/// Widest picture of a scene: nineteen scenes through seven algorithms are a page of 5 MB, which
/// mail still takes.
const SCENE_WIDTH: usize = 288;

/// Algorithms with pictures at most, spread over those of the run: a page is to be sent around.
const PICTURED: usize = 8;

/// What a judged run comes to.
pub struct Findings {
    pub summary: Summary,
    /// Per algorithm what each pair took, ms.
    pub times_ms: Vec<(String, Vec<f64>)>,
    /// Per checkpoint the worst and the best frame of every algorithm (thesis, figure 7.3).
    pub figures: Vec<Figure>,
    /// One per frame where there are no checkpoints and frames have names.
    pub scenes: Vec<Scene>,
}

/// Takes the frames of one run after the other; [`Judge::begin_run`] and [`Judge::end_run`] stand
/// around each.
pub struct Judge {
    identity: Identity,
    algorithms: Vec<String>,
    checkpoints: Vec<Checkpoint>,
    tables: Tables,
    /// Of the run being read: checkpoint by checkpoint, algorithm by algorithm, with the leading
    /// frames' sequences.
    run: Vec<Vec<CheckpointTally<u64>>>,
    /// Of all runs, with what a figure needs of the leading frames.
    all: Vec<Vec<CheckpointTally<Shot>>>,
    times_ms: Vec<(String, Vec<f64>)>,
    scenes: Vec<Scene>,
}

impl Judge {
    /// `algorithms`: labels of the estimates.
    pub fn new(
        identity: Identity,
        algorithms: Vec<String>,
        checkpoints: Vec<Checkpoint>,
        tables: Tables,
    ) -> Self {
        let all = checkpoints
            .iter()
            .map(|_| {
                algorithms
                    .iter()
                    .map(|_| CheckpointTally::default())
                    .collect()
            })
            .collect();
        Self {
            identity,
            algorithms,
            checkpoints,
            tables,
            run: Vec::new(),
            all,
            times_ms: Vec::new(),
            scenes: Vec::new(),
        }
    }

    /// What follows belongs to the run of that seed.
    pub fn begin_run(&mut self, seed: Option<u64>) {
        self.identity.seed = seed;
        let tallies = || {
            self.algorithms
                .iter()
                .map(|_| CheckpointTally::default())
                .collect()
        };
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

    /// Completes the tables and tells what the run comes to.
    ///
    /// # Errors
    /// What keeps the tables from being written.
    pub fn finish(self) -> Result<Findings> {
        let pictured = pictured(&self.algorithms);
        let figure = |(checkpoint, tallies): (Checkpoint, Vec<CheckpointTally<Shot>>)| Figure {
            title: format!("{}. {}", checkpoint.number, checkpoint.name),
            about: checkpoint.description,
            shots: tallies
                .into_iter()
                .flat_map(leading_shots)
                .filter(|(_, shot)| pictured.contains(&shot.row.algorithm.as_str()))
                .collect(),
        };
        Ok(Findings {
            summary: self.tables.finish()?,
            times_ms: self.times_ms,
            figures: self
                .checkpoints
                .into_iter()
                .zip(self.all)
                .map(figure)
                .collect(),
            scenes: self.scenes,
        })
    }

    fn time(&mut self, row: &Row) {
        let ms = row.total_us as f64 / 1e3;
        match self
            .times_ms
            .iter_mut()
            .find(|(algorithm, _)| *algorithm == row.algorithm)
        {
            Some((_, times)) => times.push(ms),
            None => self.times_ms.push((row.algorithm.clone(), vec![ms])),
        }
    }

    fn checkpoints(
        &mut self,
        frame: &Frame,
        estimates: &[Estimate],
        judged: &[Judged],
    ) -> Result<()> {
        let Some(pose) = &frame.pose else {
            return Ok(());
        };
        for (c, checkpoint) in self
            .checkpoints
            .iter()
            .enumerate()
            .filter(|(_, checkpoint)| checkpoint.covers(pose))
        {
            for (estimate, judged) in estimates.iter().zip(judged) {
                let Some(judgements) = &judged.judgements else {
                    continue;
                };
                let Some(a) = self
                    .algorithms
                    .iter()
                    .position(|label| *label == estimate.algorithm)
                else {
                    continue;
                };
                let verdict = checkpoint.judge(&estimate.grid, judgements);
                self.run[c][a].add(verdict, || frame.sequence);
                let (best, worst) = self.all[c][a].would_lead(&verdict);
                let shot = if best || worst {
                    Some(shot(frame, estimate, judged, verdict)?)
                } else {
                    None
                };
                // A shot is there exactly when the frame leads, which is when it is asked for.
                self.all[c][a].add(verdict, || {
                    shot.clone().expect("a leading frame has its shot")
                });
            }
        }
        Ok(())
    }
}

impl Sink for Judge {
    fn push(&mut self, frame: &Frame, estimates: &[Estimate]) -> Result<()> {
        let judged = self.identity.judge(frame, estimates);
        for judged in &judged {
            self.time(&judged.row);
            self.tables
                .push(judged.row.clone(), judged.cells.iter().cloned())?;
        }
        self.checkpoints(frame, estimates, &judged)?;
        if let (true, Some(name)) = (self.checkpoints.is_empty(), &frame.name) {
            let pictured = pictured(&self.algorithms);
            let shown = estimates
                .iter()
                .zip(&judged)
                .filter(|(e, _)| pictured.contains(&e.algorithm.as_str()));
            self.scenes.push(scene(name, frame, shown)?);
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}

/// The algorithms whose pictures are shown: the first, the last, and what stands evenly between.
fn pictured(algorithms: &[String]) -> Vec<&str> {
    let count = algorithms.len().min(PICTURED);
    let place = |i: usize| i * (algorithms.len() - 1) / (count - 1).max(1);
    (0..count).map(|i| algorithms[place(i)].as_str()).collect()
}

fn leading_shots(tally: CheckpointTally<Shot>) -> impl Iterator<Item = (Rank, Shot)> {
    let leading = [(Rank::Worst, tally.worst), (Rank::Best, tally.best)];
    leading
        .into_iter()
        .filter_map(|(rank, lead)| Some((rank, lead?.0)))
}

fn shot(
    frame: &Frame,
    estimate: &Estimate,
    judged: &Judged,
    verdict: CheckpointFrame,
) -> Result<Shot> {
    let size = frame.pair.size();
    let nearness = Nearness::of_frame(frame);
    let marks = |grid: &DepthGrid| overlay::marks(grid, size, nearness);
    Ok(Shot {
        row: judged.row.clone(),
        cells: judged.cells.clone(),
        passed: verdict.passed,
        left: files::encode_jpeg(frame.pair.left(), WIDTH)?,
        size,
        estimate: marks(&estimate.grid),
        truth: true_grid(frame, estimate.grid.shape()).as_ref().map(marks),
        preview: png(
            overlay::disparities(estimate.disparity.disparity(), nearness.near_px() as f32),
            WIDTH,
        )?,
    })
}

fn scene<'a>(
    name: &str,
    frame: &Frame,
    shown: impl Iterator<Item = (&'a Estimate, &'a Judged)>,
) -> Result<Scene> {
    let max_px = Nearness::of_frame(frame).near_px();
    let disparities =
        |plane: &Plane<f32>| png(overlay::disparities(plane, max_px as f32), SCENE_WIDTH);
    let shot = |(estimate, judged): (&Estimate, &Judged)| {
        let errors = frame.truth.as_ref().map(|truth| {
            png(
                overlay::errors::errors(&estimate.disparity, truth),
                SCENE_WIDTH,
            )
        });
        Ok(SceneShot {
            row: judged.row.clone(),
            disparities: disparities(estimate.disparity.disparity())?,
            errors: errors.transpose()?,
        })
    };
    Ok(Scene {
        title: name.to_owned(),
        size: frame.pair.size(),
        left: files::encode_jpeg(frame.pair.left(), SCENE_WIDTH)?,
        max_px,
        truth: frame
            .truth
            .as_ref()
            .map(|truth| disparities(&truth.disparity))
            .transpose()?,
        shots: shown.map(shot).collect::<Result<_>>()?,
    })
}

fn png(picture: Picture, width: usize) -> Result<Vec<u8>> {
    let Picture { codes, palette } = picture.at_most(width);
    files::encode_palette_png(&codes, &palette)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_spread_over_the_algorithms() {
        let names = |n: usize| (0..n).map(|i| i.to_string()).collect::<Vec<_>>();
        assert_eq!(pictured(&names(3)), ["0", "1", "2"]);
        assert_eq!(
            pictured(&names(32)),
            ["0", "4", "8", "13", "17", "22", "26", "31"]
        );
        assert!(pictured(&[]).is_empty());
    }
}
