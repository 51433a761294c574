//! Programs whose results are kept: one pair of each block is matched again, as a command may run
//! another program than before, or the same one with other files.

use super::run_opener::OpenedRun;
use super::work::EvaluationWork;
use crate::source::Chain;
use std::time::{SystemTime, UNIX_EPOCH};
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput};
use svl_core::stereo::hash_words;
use svl_core::{Error, Result, interrupt};
use svl_report::Row;
use svl_score::notice::Notice;

/// What came of matching pairs again.
enum ProgramAnswer {
    Same,
    /// That of the pair with this number is another.
    Other(u64),
    /// The pairs are not those of the results.
    OtherPairs,
}

impl EvaluationWork<'_> {
    /// Matches a pair of each block again by each program that results are kept of, in each session
    /// another one, and forgets them if an answer is another. Pairs that a program failed on are
    /// matched again.
    pub(super) fn check_programs(&mut self) -> Result<()> {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        let place = since.map_or(0, |since| since.as_millis() as usize);
        for algorithm in &self.plan.scenario.algorithms {
            if algorithm.spec().is_program() {
                let compared = self.check_program(algorithm, place)?;
                let label = algorithm.label();
                let runs = self.session.runs.iter();
                let kept = runs.filter(|run| run.units(label).next().is_some());
                let kept: usize = kept.map(|run| run.facts.pairs.len()).sum();
                let words =
                    format!("{compared} of {kept} kept results were computed again, as before");
                let note = Notice::new([label], words).to_string();
                let notes = &mut self.session.list.manifest.warnings;
                notes.extend((compared > 0).then_some(note));
            }
        }
        Ok(())
    }

    /// Returns the number of pairs whose results are as before; 0 if any is another.
    fn check_program(&mut self, algorithm: &Algorithm, place: usize) -> Result<usize> {
        let label = algorithm.label();
        let mut compared = 0;
        for run in &mut self.session.runs {
            run.retain(|own, _, unit| own != label || !unit.has_failures());
        }
        let has_memory = self.run_memory.contains(label);
        for i in 0..self.runs.len() {
            let units = self.session.runs[i].units(label);
            // With a memory of the run, results of later blocks depend on all earlier pairs.
            let units = units.filter(|(block, _)| *block == 0 || !has_memory);
            // The first result of a memory needs no earlier pairs.
            let place = if has_memory { 0 } else { place };
            let rows = units.map(|(_, unit)| unit.row(place));
            let rows: Vec<Row> = rows.filter_map(Result::transpose).collect::<Result<_>>()?;
            if rows.is_empty() {
                continue;
            }
            let mut opener = self.opener()?;
            let opened = opener.open(self.runs[i])?;
            drop(opener);
            match answers(algorithm, opened, &rows)? {
                ProgramAnswer::Same => compared += rows.len(),
                ProgramAnswer::Other(sequence) => {
                    self.session.forget_algorithm(label, sequence);
                    return Ok(0);
                }
                ProgramAnswer::OtherPairs => {
                    let changed: Vec<_> = (0..self.runs.len()).map(|j| j == i).collect();
                    self.compare(&changed)?;
                }
            }
        }
        Ok(compared)
    }
}

/// Matches the pairs of these rows again.
fn answers(algorithm: &Algorithm, opened: OpenedRun, rows: &[Row]) -> Result<ProgramAnswer> {
    let judge = opened.judge;
    let mut source = Chain::for_matching(None).over(Box::new(opened.source))?;
    let (mut matcher, mut output) = (algorithm.build()?, MatchOutput::new()?);
    let mut rows = rows.iter().peekable();
    while let Some(row) = rows.peek() {
        let Some(frame) = source.next()? else {
            return Ok(ProgramAnswer::OtherPairs);
        };
        if interrupt::requested() {
            return Err(Error::Interrupted);
        }
        if frame.sequence != row.sequence {
            continue;
        }
        if hash_words(frame.input_hash(frame.pair.hash())) != row.input_hash {
            return Ok(ProgramAnswer::OtherPairs);
        }
        let context = MatchContext::for_frame(&frame, judge.grid, judge.cells);
        output.begin();
        let matched = matcher.compute(frame.rectified()?, &context, &mut output);
        let hash = output.disparity.hash();
        let hash = output.grid.as_ref().map_or(hash, |grid| grid.hash(hash));
        if matched.is_err() || hash_words(hash) != row.result_hash {
            return Ok(ProgramAnswer::Other(row.sequence));
        }
        rows.next();
    }
    Ok(ProgramAnswer::Same)
}
