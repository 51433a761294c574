//! The runs of a scenario through its algorithms, one after the other, into a report.

use super::folder::{MANIFEST, ReportContent};
use super::part::{ReportPart, ReportRun};
use super::plan::{EndedRun, EvaluationPlan};
use crate::console::{Console, Watch};
use crate::outputs::{Outputs, write_json};
use crate::report::{GateResult, ResultLog, Summary};
use crate::run::{Matchers, Outcome, Pace, ending, run_through};
use crate::runs::{self, ScoredSource, warn_of_own_reference};
use crate::sink::{LiveTable, RunInfo, RunStart, SinkRequest, Sinks, ViewerRequest};
use crate::source::{PairRegister, RunSource, Source};
use std::path::PathBuf;
use svl_core::{Error, Result};
use svl_data::losses::RunEnding;
use svl_data::manifest::Manifest;
use svl_data::scenario::{PairRange, Scenario, ScenarioSource};
use svl_data::score::Judge;
use svl_data::stress::Stress;

/// Most algorithms that Rerun shows.
const MAX_SHOWN: usize = 32;

struct ScoreReport {
    folder: PathBuf,
    manifest: Manifest,
    /// Results of an earlier part of the run.
    log: ResultLog,
    sinks: Sinks,
    live: LiveTable,
    pace: Pace,
}

impl ScoreReport {
    fn begin(
        plan: &EvaluationPlan<'_>,
        (manifest, log): (Manifest, ResultLog),
        live: &LiveTable,
        pace: Pace,
    ) -> Result<Self> {
        let (scenario, folder) = (plan.scenario, plan.folder);
        write_json(&folder.join(MANIFEST), &manifest)?;
        let info = RunInfo::new(&manifest, scenario.wireframe(None));
        let mut sinks = Sinks::open(SinkRequest {
            report: Some(folder),
            // More do not fit into a viewer, nor the file on a disk.
            viewer: (plan.viewer.clone())
                .filter(|_| scenario.algorithms.len() <= MAX_SHOWN)
                .map(|(viewer, target, detail)| ViewerRequest {
                    viewer,
                    target,
                    detail,
                    info,
                }),
            ..SinkRequest::default()
        })?;
        sinks.push(live.clone());
        Ok(Self {
            folder: folder.to_owned(),
            manifest,
            log,
            sinks,
            live: live.clone(),
            pace,
        })
    }

    /// Scores a run.
    fn take(
        &mut self,
        (run, judge): &mut (RunSource, Judge),
        matchers: &mut Matchers,
        console: &dyn Console,
    ) -> (Outcome, Result<()>) {
        let start = RunStart {
            manifest: &self.manifest,
            log: Some(&self.log),
            seed: run.seed,
            judge,
        };
        let title = match run.seed {
            Some(seed) => format!("score {}, seed {seed}", self.manifest.scenario),
            None => format!("score {}", run.name()),
        };
        let title = match &judge.run.stress {
            Some(stress) => format!("{title}, {stress}"),
            None => title,
        };
        let watch = Watch::new(console, &title, run.pairs(), Some(&self.live));
        let sinks = match &judge.run.stress {
            None => self.sinks.as_mut_slice(),
            Some(_) => self.sinks.tables_mut(),
        };
        run_through(run, matchers, &start, self.pace, sinks, watch)
    }

    fn finish(
        self,
        plan: &EvaluationPlan<'_>,
        matchers: &Matchers,
        ending: RunEnding,
        console: &dyn Console,
    ) -> Result<(Summary, Vec<GateResult>)> {
        let Self {
            folder,
            mut manifest,
            ..
        } = self;
        let (results, finished) = self.sinks.finish();
        finished?;
        matchers.complete(&mut manifest);
        let collected = ReportContent {
            rows: results.rows,
            checkpoints: results.checkpoints,
            pictures: results.pictures,
            ..ReportContent::default()
        };
        collected.write(&folder, plan.head(true), manifest, ending, console)
    }
}

/// Scores the runs of a scenario, one after the other.
pub(super) fn evaluate(
    plan: &EvaluationPlan<'_>,
    outputs: &mut Outputs,
    console: &dyn Console,
) -> Result<EndedRun> {
    let (scenario, folder) = (plan.scenario, plan.folder);
    let mut matchers =
        Matchers::new(&scenario.algorithms).map_err(|error| match plan.algorithms_file {
            // The file is wrong, not the command line.
            Some(file) => Error::format(file, error.to_string()),
            None => error,
        })?;
    let runs = runs::runs(scenario, console)?;
    warn_of_own_reference(&scenario.options, &scenario.algorithms)?;
    let pace = Pace::Measured {
        rounds: plan.rounds,
    };
    let key = |(stress, place): (Option<Stress>, usize)| ReportRun {
        run: runs[place].record().map(|record| record.name),
        seed: runs[place].seed(),
        stress: stress.map(|stress| stress.to_string()),
    };
    let keys = groups(plan, runs.len()).map(key).collect();
    let records = runs.iter().filter_map(ScoredSource::record);
    let mut manifest = plan.manifest(pace)?;
    manifest.runs = records.collect();
    let live = LiveTable::default();
    let units = RunUnit::all(plan, &runs);
    let mut runs: Vec<_> = runs.into_iter().map(Some).collect();
    let mut registers = RunRegisters::new(scenario)?;
    let mut open = |unit: &RunUnit| {
        let register = registers.before(unit, console)?;
        // Perturbed runs are opened again.
        let run = match runs[unit.place].take_if(|_| unit.stress.is_none()) {
            Some(run) => run,
            None => runs::run_at(scenario, unit.place, console)?,
        };
        let (run, mut judge) = run.open(scenario, console, Some(&live))?;
        let mut run = run.registered(&scenario.name, &register, true);
        if plan.shard.is_some() {
            run = run.digested();
        }
        if let Some(stress) = unit.stress {
            run = run.stressed(stress);
            judge = run.judge(&scenario.judge())?;
        }
        Result::Ok((run, judge))
    };
    // The first is opened before the report is begun: Ctrl-C until then leaves an earlier report
    // unchanged.
    let mut first = units.first().map(&mut open).transpose()?;
    let log = if plan.resume {
        ResultLog::read(folder, &mut manifest, scenario.grid)?
    } else {
        ResultLog::default()
    };
    let others = log.others().to_vec();
    outputs.set_aside()?;
    if let Some(shard) = plan.shard {
        ReportPart::write(folder, scenario, shard, keys)?;
    }
    let mut report = ScoreReport::begin(plan, (manifest, log), &live, pace)?;
    let (mut missing, mut inputs) = (plan.lost.clone().unwrap_or_default(), Vec::new());
    let ran = units.iter().try_for_each(|unit| {
        let mut run = first.take().map_or_else(|| open(unit), Ok)?;
        let mut own = matchers.take(&unit.labels);
        let (outcome, ran) = report.take(&mut run, &mut own, console);
        matchers.append(own);
        missing.add(outcome.missing());
        ran?;
        inputs.extend(run.0.inputs());
        if outcome.interrupted {
            return Err(Error::Invalid(
                "interrupted; the report has what was scored before, and --resume continues \
                 it"
                .to_owned(),
            ));
        }
        if scenario.options.range() == PairRange::default() {
            run.0.warn_beyond(&run.1);
        }
        Ok(())
    });
    // The pairs before an error or Ctrl-C are reported nevertheless.
    let pairs = missing.pairs;
    let ending = ending(&ran, missing, scenario.options.allow_loss);
    let finished = report.finish(plan, &matchers, ending, console);
    Ok(EndedRun {
        ran,
        finished,
        pairs,
        others,
        holds_earlier: false,
        inputs,
    })
}

/// The pairs of a scenario's runs, of each perturbation anew.
struct RunRegisters<'a> {
    scenario: &'a Scenario,
    stress: Option<Stress>,
    register: PairRegister,
    /// Number of runs that were registered.
    runs: usize,
}

impl<'a> RunRegisters<'a> {
    fn new(scenario: &'a Scenario) -> Result<Self> {
        Ok(Self {
            scenario,
            stress: None,
            register: PairRegister::new(&scenario.algorithms)?,
            runs: 0,
        })
    }

    /// The register with the recordings before that of the unit: those of other shards are read
    /// now.
    fn before(&mut self, unit: &RunUnit<'_>, console: &dyn Console) -> Result<PairRegister> {
        if self.stress != unit.stress {
            // The user was warned of what was fitted to.
            (self.stress, self.register, self.runs) = (unit.stress, PairRegister::default(), 0);
        }
        if matches!(self.scenario.source, ScenarioSource::Recording(_)) {
            for place in self.runs..unit.place {
                let run = runs::run_at(self.scenario, place, console)?;
                let (run, _) = run.open(self.scenario, console, None)?;
                let mut run = run.registered(&self.scenario.name, &self.register, true);
                // The shard that scores it reports what cannot be read, and an error.
                while let Ok(Some(_)) = run.next() {}
            }
        }
        self.runs = unit.place + 1;
        Ok(self.register.clone())
    }
}

/// A run through some of the algorithms, unperturbed or perturbed.
struct RunUnit<'a> {
    /// Place of the run among those of the scenario.
    place: usize,
    stress: Option<Stress>,
    labels: Vec<&'a str>,
}

impl<'a> RunUnit<'a> {
    /// Those of a shard, in their order. The algorithms of a run of the arena are shared out; of
    /// other runs all stay together, as without truth they are compared with each other.
    fn all(plan: &EvaluationPlan<'a>, runs: &[ScoredSource]) -> Vec<Self> {
        let (scenario, shard) = (plan.scenario, plan.shard);
        let labels = scenario.labels();
        let shares_out = matches!(scenario.source, ScenarioSource::Arena { .. });
        let groups = groups(plan, runs.len());
        let unit = |(group, (stress, place)): (usize, (Option<Stress>, usize))| {
            let takes = |unit: usize| shard.is_none_or(|shard| shard.takes(unit));
            let labels = labels.iter().enumerate().filter(|(i, _)| {
                if shares_out {
                    takes(group * labels.len() + i)
                } else {
                    takes(group)
                }
            });
            Self {
                place,
                stress,
                labels: labels.map(|(_, label)| *label).collect(),
            }
        };
        let units = groups.enumerate().map(unit);
        units.filter(|unit| !unit.labels.is_empty()).collect()
    }
}

/// All runs of a scenario, first unperturbed, then perturbed.
fn groups(plan: &EvaluationPlan<'_>, runs: usize) -> impl Iterator<Item = (Option<Stress>, usize)> {
    plan.stresses()
        .flat_map(move |stress| (0..runs).map(move |place| (stress, place)))
}
