//! The pictures of a report, chosen from those of its units.

use super::pictures::{BlockPictures, CheckpointShot};
use super::plan::{BLOCK, ReportPlan};
use super::run_units::RunUnits;
use super::store::Units;
use super::unit::StoredUnit;
use super::worst::{MAX_WORST, WorstFrame, WorstFrames, WorstPicture};
use crate::pages::html::figures::{CheckpointFigure, FrameShot, Rank, SceneFigure};
use crate::results::summary::ReportTables;
use crate::rows::held::{PairOrigin, Row, RowRef};
use std::collections::BTreeMap;
use std::path::Path;
use svl_core::Result;
use svl_score::judge::{Checkpoint, CheckpointTally, PieceConfig};

/// Limit of the frames shown of recordings, over all runs.
pub const MAX_SAMPLES: u64 = 12;
/// Limit of the scenes shown.
pub const MAX_SCENES: u64 = 20;

/// The least power of two that leaves at most `limit` of so many frames.
pub fn stride(frames: u64, limit: u64) -> u64 {
    let mut stride = 1;
    while frames.div_ceil(stride) > limit {
        stride *= 2;
    }
    stride
}

/// The stride of the frames to keep up to a place in a run of so many pairs, or fewer: it is at
/// most a block, so that a run which ends early has frames.
pub fn stride_so_far(pairs: u64, place: u64, limit: u64) -> u64 {
    let least = stride(pairs, limit).min(BLOCK);
    least.max(stride(place + 1, limit))
}

/// The figures of checkpoints, or of frames spread over recordings, and the scenes of data sets.
///
/// # Errors
/// [`svl_core::Error::Io`], [`svl_core::Error::Format`] with the file of the pictures.
pub fn for_runs(
    plan: &ReportPlan,
    runs: &[RunUnits],
) -> Result<(Vec<CheckpointFigure>, Vec<SceneFigure>)> {
    let mut chosen = ChosenPictures::new(plan)?;
    for (i, run) in runs.iter().enumerate() {
        for unit in run.all() {
            if let Some(pictures) = unit.pictures()? {
                chosen.add((i, run.run.seed), unit, pictures);
            }
        }
        // A run that was interrupted has as many pairs as are known.
        let pairs = run.facts.pairs.len() as u64;
        chosen.samples.end_run(pairs, MAX_SAMPLES);
        chosen.scenes.end_run(pairs, MAX_SCENES);
    }
    chosen.finish(plan)
}

/// The two seconds before the fastest collision of each algorithm, in the order of the labels.
///
/// # Errors
/// The errors of [`for_runs`].
pub fn for_drives(
    labels: &[&str],
    runs: &[RunUnits],
    tables: &ReportTables,
) -> Result<Vec<CheckpointFigure>> {
    let mut figures = Vec::new();
    for label in labels {
        let hits = tables.tracks.iter().filter(|row| {
            let is_hit = row.event.as_deref() == Some("collision");
            row.algorithm == *label && row.stress.is_none() && is_hit
        });
        // The first of equal speeds.
        let fastest = hits.reduce(|best, row| {
            if row.speed_m_per_s > best.speed_m_per_s {
                row
            } else {
                best
            }
        });
        let Some(seed) = fastest.map(|row| row.seed) else {
            continue;
        };
        let mut course_runs = runs.iter();
        let run = course_runs.find(|run| run.run.seed == Some(seed) && run.run.stress.is_none());
        if let Some(drive) = run.and_then(|run| run.unit(label, 0))
            && let Some(pictures) = drive.pictures()?
        {
            figures.extend(pictures.samples.into_iter().map(|(_, figure)| figure));
        }
    }
    Ok(figures)
}

/// The frames that the units of a report show: not of all pairs.
#[derive(Default)]
pub(crate) struct StoredShots {
    /// Per seed, recording and number of a pair the units with pictures that show it.
    units: BTreeMap<(Option<u64>, Option<String>, u64), Vec<StoredUnit>>,
}

impl StoredShots {
    /// The frames of a report's folder; none without units of this version of svl.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`], [`svl_core::Error::Format`] with the file.
    pub fn find(folder: &Path) -> Result<Self> {
        let (units, mut found) = (Units::for_report(folder), Self::default());
        let Ok(plan) = units.plan() else {
            return Ok(found);
        };
        let sessions = units.sessions()?;
        for run in &plan.runs {
            let kept = RunUnits::read(&units, &plan, run, &sessions, |_| ())?;
            for unit in kept.all() {
                for sequence in unit.pictures()?.iter().flat_map(BlockPictures::sequences) {
                    let key = (run.seed, run.run.clone(), sequence);
                    found.units.entry(key).or_default().push(unit.clone());
                }
            }
        }
        Ok(found)
    }

    /// The units that show a pair, those of the algorithm first.
    fn units(&self, pair: PairOrigin<'_>, algorithm: &str) -> Vec<&StoredUnit> {
        let key = (pair.seed, pair.run.map(str::to_owned), pair.sequence);
        let mut units: Vec<_> = self.units.get(&key).into_iter().flatten().collect();
        units.sort_by_key(|unit| unit.label != algorithm);
        units
    }

    /// True if the row's pair is there, as its algorithm matched it.
    pub(crate) fn hold(&self, row: RowRef<'_>) -> bool {
        let units = self.units(row.origin(), row.algorithm());
        units.iter().any(|unit| unit.label == row.algorithm())
    }

    /// A frame of the row's pair: of its algorithm, else of any other.
    ///
    /// # Errors
    /// The errors of [`StoredShots::find`].
    pub fn read(&self, row: &Row) -> Result<Option<FrameShot>> {
        for unit in self.units(row.origin(), &row.algorithm) {
            if let Some(pictures) = unit.pictures()?
                && let Some(shot) = pictures.shot(row)?
            {
                return Ok(Some(shot));
            }
        }
        Ok(None)
    }
}

/// A pair, by the places of its run and of itself in it.
type ShotPlace = (usize, u64);

/// The pictures of the runs so far.
#[derive(Default)]
struct ChosenPictures {
    checkpoints: Vec<Checkpoint>,
    /// The leading shots by checkpoint and algorithm.
    shots: BTreeMap<(u32, String), CheckpointTally<CheckpointShot>>,
    samples: SpreadPictures<CheckpointFigure>,
    scenes: SpreadPictures<SceneFigure>,
    /// The test pieces that the runs approach.
    pieces: Option<PieceConfig>,
    /// The worst frames by algorithm and number of a test piece.
    worst: BTreeMap<(String, usize), WorstFrames<WorstPicture>>,
}

impl ChosenPictures {
    fn new(plan: &ReportPlan) -> Result<Self> {
        Ok(Self {
            checkpoints: plan.manifest.part("checkpoint")?.unwrap_or_default(),
            pieces: plan.manifest.part("piece")?,
            ..Self::default()
        })
    }

    /// Adds the pictures of a unit of a run, with the place of the run and its seed.
    fn add(
        &mut self,
        (run, seed): (usize, Option<u64>),
        unit: &StoredUnit,
        mut pictures: BlockPictures,
    ) {
        let piece = self.pieces.as_ref().map_or(0, |own| own.number(seed));
        for frame in &pictures.worst {
            if let Some(picture) = pictures.worst_picture(frame) {
                let frame = WorstFrame { run, ..frame.key() };
                let own = self.worst.entry((unit.label.clone(), piece)).or_default();
                own.add(frame, || picture);
            }
        }
        // The first of equal ones leads.
        pictures.checkpoints.sort_by_key(|shot| shot.sequence);
        for shot in pictures.checkpoints {
            let key = (shot.checkpoint, shot.algorithm.clone());
            let tally = self.shots.entry(key).or_default();
            tally.add(shot.frame, || shot.clone());
        }
        for (place, figure) in pictures.samples {
            match self.samples.run.get_mut(&(run, place)) {
                Some(own) => own.shots.extend(figure.shots),
                None => drop(self.samples.run.insert((run, place), figure)),
            }
        }
        for (place, scene) in pictures.scenes {
            match self.scenes.run.get_mut(&(run, place)) {
                Some(own) => own.shots.extend(scene.shots),
                None => drop(self.scenes.run.insert((run, place), scene)),
            }
        }
    }

    fn finish(mut self, plan: &ReportPlan) -> Result<(Vec<CheckpointFigure>, Vec<SceneFigure>)> {
        let (labels, pictured) = (plan.labels(), plan.pictured());
        let order = |label: &str| labels.iter().position(|own| *own == label);
        let checkpoints = std::mem::take(&mut self.checkpoints);
        let figure = |checkpoint: Checkpoint| {
            let mut shots = Vec::new();
            for label in &pictured {
                let key = (checkpoint.number, (*label).to_owned());
                let tally = self.shots.remove(&key).unwrap_or_default();
                for (rank, lead) in [(Rank::Worst, tally.worst), (Rank::Best, tally.best)] {
                    let shot = lead.map(|(shot, _)| shot.shot()).transpose()?;
                    shots.extend(shot.map(|shot| (rank, shot)));
                }
            }
            Ok(CheckpointFigure {
                checkpoint: Some(checkpoint.number),
                title: format!("{} {}", checkpoint.number, checkpoint.name),
                about: checkpoint.description,
                shots,
                ..CheckpointFigure::default()
            })
        };
        let figures = checkpoints.into_iter().map(figure);
        let mut figures = figures.collect::<Result<Vec<_>>>()?;
        let is_pictured = |row: &Row| pictured.contains(&row.algorithm.as_str());
        let mut samples = self.samples.into_kept();
        let mut scenes = self.scenes.into_kept();
        // One for each of several pieces.
        let has_sizes = self.pieces.is_some_and(|own| own.sizes_m.len() > 1);
        let most = if has_sizes { 1 } else { MAX_WORST };
        for (_, worst) in std::mem::take(&mut self.worst) {
            for (rank, frame) in (1..).zip(worst.finish().into_iter().take(most)) {
                let place = (frame.run, frame.place);
                match frame.picture {
                    WorstPicture::Frame(figure) => add_worst(&mut samples, place, *figure, rank),
                    WorstPicture::Scene(scene) => add_scene(&mut scenes, place, *scene),
                    // The choice has the picture itself.
                    WorstPicture::Sample => {}
                }
            }
        }
        let mut samples: Vec<_> = samples.into_values().collect();
        for sample in &mut samples {
            sample.shots.retain(|(_, shot)| is_pictured(&shot.row));
            sample
                .shots
                .sort_by_key(|(_, shot)| order(&shot.row.algorithm));
        }
        samples.retain(|sample| !sample.shots.is_empty());
        figures.extend(samples);
        let mut scenes: Vec<_> = scenes.into_values().collect();
        for scene in &mut scenes {
            scene.shots.retain(|shot| is_pictured(&shot.row));
            scene.shots.sort_by_key(|shot| order(&shot.row.algorithm));
        }
        scenes.retain(|scene| !scene.shots.is_empty());
        Ok((figures, scenes))
    }
}

/// Adds one of the worst frames of an algorithm, in the place of its sample of the same pair.
fn add_worst(
    samples: &mut BTreeMap<ShotPlace, CheckpointFigure>,
    place: ShotPlace,
    mut figure: CheckpointFigure,
    rank: usize,
) {
    for (own, _) in &mut figure.shots {
        *own = Rank::Failed(rank);
    }
    match samples.get_mut(&place) {
        Some(sample) => {
            let is_new = |label: &str| {
                figure
                    .shots
                    .iter()
                    .all(|(_, own)| own.row.algorithm != label)
            };
            sample.shots.retain(|(_, shot)| is_new(&shot.row.algorithm));
            sample.shots.append(&mut figure.shots);
        }
        None => drop(samples.insert(place, figure)),
    }
}

/// Adds one of the worst scenes of an algorithm, if it is not shown.
fn add_scene(
    scenes: &mut BTreeMap<ShotPlace, SceneFigure>,
    place: ShotPlace,
    mut worst: SceneFigure,
) {
    match scenes.get_mut(&place) {
        Some(scene) => {
            let is_shown = |label: &str| scene.shots.iter().any(|own| own.row.algorithm == label);
            worst.shots.retain(|own| !is_shown(&own.row.algorithm));
            scene.shots.append(&mut worst.shots);
        }
        None => drop(scenes.insert(place, worst)),
    }
}

/// Pictures that are spread evenly over each run, and, if these are too many, over all runs.
struct SpreadPictures<T> {
    /// Pictures of the run that is read.
    run: BTreeMap<ShotPlace, T>,
    /// Pictures of the runs before, with their numbers among all.
    kept: Vec<(u64, ShotPlace, T)>,
    count: u64,
}

impl<T> Default for SpreadPictures<T> {
    fn default() -> Self {
        Self {
            run: BTreeMap::new(),
            kept: Vec::new(),
            count: 0,
        }
    }
}

impl<T> SpreadPictures<T> {
    /// Keeps at most `limit` pictures of a run with that number of pairs, and of all.
    fn end_run(&mut self, pairs: u64, limit: u64) {
        let step = stride(pairs, limit);
        for (place, picture) in std::mem::take(&mut self.run) {
            if place.1.is_multiple_of(step) {
                self.kept.push((self.count, place, picture));
                self.count += 1;
            }
        }
        // Later strides are multiples of this one.
        let step = stride(self.count, limit);
        self.kept.retain(|(number, ..)| number.is_multiple_of(step));
    }

    fn into_kept(self) -> BTreeMap<ShotPlace, T> {
        let kept = self.kept.into_iter();
        kept.map(|(_, place, picture)| (place, picture)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_halved_until_few_are_left() {
        for (frames, expected) in [(0, 1), (12, 1), (13, 2), (24, 2), (25, 4), (10_000, 1024)] {
            assert_eq!(stride(frames, MAX_SAMPLES), expected, "{frames}");
        }
    }

    #[test]
    fn the_frames_that_are_kept_are_those_that_are_shown() {
        assert_eq!(stride_so_far(280, 0, MAX_SAMPLES), 32);
        for pairs in [0, 30, 97, 280, 640, 10_000] {
            // All of a run, or one that ended early or of unknown length, of which the first frames
            // of blocks are certain.
            for frames in [1, 30, 97, 280, 640, 10_000] {
                let shown = (0..frames).step_by(stride(frames, MAX_SAMPLES) as usize);
                let is_certain =
                    |place: &u64| pairs == 0 || pairs == frames || place.is_multiple_of(BLOCK);
                for place in shown.filter(is_certain) {
                    let kept = stride_so_far(pairs, place, MAX_SAMPLES);
                    assert!(place.is_multiple_of(kept), "{pairs} {frames} {place}");
                }
            }
        }
    }

    #[test]
    fn pictures_of_runs_one_by_one_are_those_of_all() {
        for runs in 1..40 {
            let mut spread = SpreadPictures::default();
            let mut all = Vec::new();
            for run in 0..runs {
                let pairs = (7 * run as u64) % 30;
                for place in 0..pairs {
                    spread.run.insert((run, place), ());
                    let is_kept = place.is_multiple_of(stride(pairs, 12));
                    all.extend(is_kept.then_some((run, place)));
                }
                spread.end_run(pairs, 12);
            }
            let step = stride(all.len() as u64, 12) as usize;
            let expected: Vec<_> = all.into_iter().step_by(step).collect();
            let kept: Vec<_> = spread.into_kept().into_keys().collect();
            assert_eq!(kept, expected, "{runs}");
        }
    }

    #[test]
    fn a_stride_of_more_frames_is_a_multiple() {
        for frames in 1..2000 {
            let (few, more) = (stride(frames, 12), stride(frames + 1, 12));
            assert!(more.is_multiple_of(few) && frames.div_ceil(few) <= 12);
        }
    }
}
