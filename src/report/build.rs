//! Builds a report from its folder: the tables of its units, then plots, page and summaries.

use crate::pages::html::figures::{CheckpointFigure, ReportPage, SceneFigure, shown_frames};
use crate::pages::html::replays::Replays;
use crate::pages::html::timeline::{Timeline, WorstSecond};
use crate::pages::maps::maps;
use crate::pages::sweeps::sweeps;
use crate::results::algorithm_parameters::write_algorithms;
use crate::results::descriptions::TABLES;
use crate::results::gate::{GateResult, limit_results};
use crate::results::summary::{ReportTables, ResultParts, Results, Shown, TopicDelay, pairs_hash};
use crate::rows::held::{RowRef, Rows};
use crate::rows::samples::grouped;
use crate::subjects::drives::{COURSES, CoursePlan};
use crate::subjects::kept::cell_rule;
use crate::subjects::sources::{SUMMARY, Sources};
use crate::units::latencies::Latencies;
use crate::units::plan::ReportPlan;
use crate::units::run_units::RunUnits;
use crate::units::shots;
use crate::units::store::{REPORT_LIST, StoredSession, UNITS, Units};
use crate::units::tables::{collect_tables, made_of, read_tables, write_tables};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use svl_core::matcher::ProgramRecord;
use svl_core::{Error, Result, counted, joined};
use svl_files::outputs::{
    FolderRule, Outputs, remove_file, remove_special_files, write, write_json,
};
use svl_score::judge::{AreaChoice, ColumnChoice, Metric, RobotSize};
use svl_score::losses::{EndState, Ending, FailedPairs, LossLimit};
use svl_score::manifest::{AlgorithmRecord, Manifest};
use svl_score::notice::Notice;
use svl_score::scenario::{Limit, RangeEnds, SourceOptions};

/// What a report shows of its units.
#[derive(Clone, Copy, Default)]
pub struct BuildOptions<'a> {
    /// Metrics that the tables show, in place of the scenario's.
    pub columns: Option<&'a ColumnChoice>,
    /// The cells that metrics of an area are of.
    pub area: AreaChoice,
    /// Metric that the algorithms are sorted by.
    pub sort: Option<&'static Metric>,
    /// True if the limits of the scenario are checked.
    pub gate: bool,
    /// The folder for the plots as files.
    pub figures: Option<&'a Path>,
    /// The limit of losses, in place of the scenario's.
    pub allow_loss: Option<LossLimit>,
    /// Warnings of the command besides those of its units.
    pub warnings: &'a [Notice],
}

/// A report that is built.
pub struct BuiltReport {
    /// Name of the scenario.
    pub scenario: String,
    pub summary: Results,
    /// The results of the limits, if they were asked for.
    pub gate: Vec<GateResult>,
    /// The beginning of the last session whose results it has.
    pub last_session: Option<String>,
    /// Per algorithm the number of its results by session, in the order of the algorithms.
    pub results: Vec<(String, BTreeMap<String, u64>)>,
}

/// Builds the report of a folder from its units.
///
/// # Errors
/// [`Error::Invalid`] for a folder without units; [`Error::Io`], [`Error::Format`] with the file.
pub fn build(folder: &Path, options: &BuildOptions<'_>) -> Result<BuiltReport> {
    let units = Units::for_report(folder);
    if !units.exist() {
        return Err(Error::Invalid(format!(
            "{}: is not a report of `svl score`: it has no {REPORT_LIST}",
            folder.display()
        )));
    }
    // Another file is not written through a link in the place of one of the report's.
    remove_special_files(folder, &REPORT)?;
    units.remove_links()?;
    let (plan, sessions) = (units.plan()?, units.sessions()?);
    let runs = plan.runs.iter().map(|run| {
        RunUnits::read(&units, &plan, run, &sessions, |file| {
            let file = file.display();
            tracing::warn!("{file}: was cut or edited; `svl score` matches its pairs again");
        })
    });
    let runs = runs.collect::<Result<Vec<_>>>()?;
    let known = Sources::read(folder).unwrap_or_default();
    let mut outputs = Outputs::remake(folder, &REPORT);
    outputs.begin()?;
    let new = outputs.place(folder);
    let made_of = made_of(&plan, &runs);
    let is_known = known.units == made_of && known.changed(folder, true).is_none();
    let latencies = Latencies::new(&plan, &sessions, || {
        let tables = collect_tables(&plan, &runs, None, |_| Ok(()))?;
        Ok(Results::from_rows(&tables.rows, &[], None))
    })?;
    let (place, tables) = if is_known {
        let warnings = known.doubts;
        let tables = read_tables(folder, &plan)?;
        (folder, ReportTables { warnings, ..tables })
    } else {
        (&*new, write_tables(&new, &plan, &runs, &latencies)?)
    };
    let names: Vec<_> = TABLES.iter().map(|table| table.name).collect();
    let mut sources = Sources::for_folder(place, made_of, &names)?;
    sources.doubts.clone_from(&tables.warnings);
    let built = Report {
        folder: &new,
        options,
        plan: &plan,
        sessions: &sessions,
        runs: &runs,
        latencies: &latencies,
        tables,
    }
    .write(sources)?;
    // Without them, the report is incomplete.
    for file in SUMMARIES.iter().filter(|file| !new.join(file).exists()) {
        remove_file(&folder.join(file))?;
    }
    outputs.commit()?;
    Ok(built)
}

/// The results of a report's units.
pub struct ResultsSoFar {
    /// The results of the checkpoints, as Markdown.
    pub verdicts: String,
    /// That of the best algorithm.
    pub worst: Option<WorstSecond>,
}

/// The results of the units so far.
///
/// # Errors
/// The errors of [`build`].
pub fn results_so_far(folder: &Path) -> Result<ResultsSoFar> {
    let units = Units::for_report(folder);
    let (plan, sessions) = (units.plan()?, units.sessions()?);
    let runs = plan.runs.iter();
    let runs = runs.map(|run| RunUnits::read(&units, &plan, run, &sessions, |_| ()));
    let runs = runs.collect::<Result<Vec<_>>>()?;
    let tables = collect_tables(&plan, &runs, None, |_| Ok(()))?;
    let summary = Results::from_rows(&tables.rows, &tables.checkpoints, None);
    let replays = replays(&plan, &runs)?;
    Ok(ResultsSoFar {
        verdicts: summary.verdicts_markdown(&plan.manifest.scenario),
        worst: (summary.cited()).and_then(|best| WorstSecond::new(&tables.rows, best, &replays)),
    })
}

/// The recordings of the runs.
fn replays(plan: &ReportPlan, runs: &[RunUnits]) -> Result<Replays> {
    let source: SourceOptions = plan.manifest.part("source")?.unwrap_or_default();
    let runs = || runs.iter().filter(|own| own.run.stress.is_none());
    let untimed = runs().filter(|own| own.facts.record.as_ref().is_some_and(|own| own.is_untimed));
    let files = runs().filter_map(|RunUnits { run, facts, .. }| {
        // The arena is recorded first.
        let made = || Some(facts.files.first()?.path().display().to_string());
        let record = facts.record.as_ref().map(|record| record.path.clone());
        // Pairs in a folder are replayed once they are recorded.
        let file = record
            .or_else(made)
            .filter(|file| !Path::new(file).is_dir())?;
        Some(((run.seed, run.run.clone()), (file, facts.start_ns?)))
    });
    Ok(Replays {
        runs: files.collect(),
        untimed: untimed.filter_map(|own| own.run.run.clone()).collect(),
        options: source.words()?,
        algorithms: plan.manifest.part("algorithms")?.unwrap_or_default(),
    })
}

/// A report whose tables are written.
struct Report<'a> {
    folder: &'a Path,
    options: &'a BuildOptions<'a>,
    plan: &'a ReportPlan,
    sessions: &'a [StoredSession],
    runs: &'a [RunUnits],
    latencies: &'a Latencies,
    tables: ReportTables,
}

impl Report<'_> {
    // The area is set before anything is computed of the rows. The results are complete before the
    // manifest, which records their warnings and labels; gates read both. The page shows all of
    // these. The summaries are written last and for a whole report only: a report that has them is
    // complete.
    fn write(mut self, sources: Sources) -> Result<BuiltReport> {
        let (folder, plan, options) = (self.folder, self.plan, self.options);
        let tables = &mut self.tables;
        tables.rows.select(options.area);
        tables.references.select(options.area);
        let tables = &self.tables;
        let mut manifest = self.manifest();
        let parts = ResultParts {
            ending: self.ending()?,
            latency: self.latency(),
            made_of: sources,
            manifest: Some(&manifest),
            is_measured: !plan.is_driven(),
            time_groups: self.time_groups(),
        };
        let columns: Option<ColumnChoice> = plan.manifest.part("columns")?;
        let shown = Shown {
            columns: options.columns.cloned().or(columns).unwrap_or_default(),
            sort: options.sort,
            rule: cell_rule(&plan.manifest)?,
        };
        let mut summary = Results::new(tables, parts, shown)?;
        let untold = self.options_of_truth(&summary)?;
        for warning in nothing_scored(&manifest, &summary)
            .into_iter()
            .chain(untold)
            .chain(self.untold_latency(&summary))
            .chain(tables.warnings.iter().cloned())
        {
            tracing::warn!("{warning}");
            summary.warnings.push(warning);
        }
        summary.complete(&mut manifest);
        for run in &mut manifest.runs {
            run.pairs_hash = recording_hash(&tables.rows, &run.name);
        }
        write_algorithms(folder, &manifest.algorithms)?;
        write_json(&folder.join(MANIFEST), &manifest)?;
        let mut limits: Vec<Limit> = plan.manifest.part("gate")?.unwrap_or_default();
        for (limit, line) in limits.iter_mut().zip(&plan.limit_lines) {
            limit.line = *line;
        }
        let limits = limits.iter().filter(|_| options.gate);
        let gate = limits.flat_map(|limit| limit_results(limit, &summary, &manifest));
        let gate: Vec<_> = gate.collect();
        let last_session = manifest.sessions.last().map(|last| last.began.clone());
        let candidates = summary.candidate_labels();
        let (figures, scenes) = self.pictures(&candidates)?;
        let replays = replays(plan, self.runs)?;
        let page = ReportPage {
            gate: (gate.iter())
                .map(|result| (result.state, result.to_string()))
                .collect(),
            description: plan.manifest.part("description")?.unwrap_or_default(),
            times_ms: times_ms(&tables.rows),
            timeline: Timeline::new(&tables.rows, &shown_frames(&figures), &replays),
            replays,
            cases: summary.case_table(&tables.rows, &tables.drives),
            summary: summary.clone(),
            sweeps: sweeps(&manifest.algorithms),
            figures,
            scenes,
            maps: self.maps(&candidates)?,
            files: self.files(summary.ending.is_whole())?,
            manifest,
        };
        page.write(&folder.join("index.html"))?;
        // The figures and the summaries are those of a whole report.
        if summary.ending.is_whole() {
            summary.write_tables(folder)?;
            write(
                &folder.join("summary.md"),
                summary.markdown(&plan.manifest.scenario),
            )?;
            if let Some(figures) = options.figures {
                page.write_figures(figures)?;
            }
            write_json(&folder.join(SUMMARY), &summary)?;
        }
        let results = plan.labels().into_iter().map(|label| {
            let mut counts = BTreeMap::new();
            for row in tables.rows.iter().filter(|row| row.algorithm() == label) {
                *counts.entry(row.session().to_owned()).or_default() += 1;
            }
            (label.to_owned(), counts)
        });
        let results = results.collect();
        Ok(BuiltReport {
            results,
            scenario: plan.manifest.scenario.clone(),
            summary,
            gate,
            last_session,
        })
    }

    /// The names of the files beside the page, with those of the summary if it is written.
    fn files(&self, has_summary: bool) -> Result<Vec<String>> {
        let is_file = |name: &String| {
            let ends = [".csv", ".parquet", ".json", ".rrd", ".mcap"];
            ends.iter().any(|end| name.ends_with(end)) && !name.starts_with("summary.")
        };
        let read = || -> std::io::Result<Vec<_>> {
            let names = std::fs::read_dir(self.folder)?.map(|own| Ok(own?.file_name()));
            names.collect()
        };
        let names = read().map_err(|e| Error::io(self.folder, e))?.into_iter();
        let names = names.filter_map(|name| name.into_string().ok());
        let summary = ["csv", "json", "md", "parquet"].map(|end| format!("summary.{end}"));
        let summary = summary.into_iter().filter(|_| has_summary);
        let names = names.filter(is_file).chain(summary);
        Ok(names.collect::<BTreeSet<_>>().into_iter().collect())
    }

    /// Cautions of late cells, and the reason if no cell is scored late.
    fn untold_latency(&self, summary: &Results) -> Vec<String> {
        let mut cautions = self.latencies.cautions(self.plan, self.runs);
        let late = Metric::find("right_late").into_iter();
        let mut values = late.flat_map(|late| {
            summary
                .algorithms
                .iter()
                .map(|a| a.totals.measured(late, AreaChoice::All))
        });
        if self.latencies.are_asked() && values.all(|own| own.is_none()) {
            cautions.push(
                "--latency: no cell is scored late, as that needs the truths of two pairs, with \
                 stamps at most 0.5 s apart, around the arrival of an answer before the run ends"
                    .to_owned(),
            );
        }
        cautions
    }

    /// A warning of options that need distances of a truth, which no pair has.
    fn options_of_truth(&self, summary: &Results) -> Result<Option<String>> {
        let manifest = &self.plan.manifest;
        let rule = cell_rule(manifest)?;
        let source: SourceOptions = manifest.part("source")?.unwrap_or_default();
        let ranges: Option<RangeEnds> = manifest.part("ranges")?;
        // The way of a robot needs the floor below its camera.
        let has_robot = manifest.part::<RobotSize>("robot")?.is_some();
        let has = [
            ("--area", self.options.area != AreaChoice::default()),
            ("--beyond", rule.beyond_m().is_some()),
            (
                "--camera-height",
                source.camera_height_m.is_some() && !has_robot,
            ),
            ("--ranges", ranges.is_some_and(|ranges| !ranges.is_empty())),
        ];
        let named: Vec<_> = has.iter().filter(|own| own.1).map(|own| own.0).collect();
        let is_untold = !self.plan.is_driven() && !named.is_empty();
        let mut estimates = summary.estimates.iter();
        let is_estimated = estimates.any(|row| row.estimated_sure_wrong.is_some());
        let is_untold = is_untold && summary.has_answers() && !summary.has_areas() && !is_estimated;
        let words = || {
            let verb = if named.len() == 1 { "needs" } else { "need" };
            let named = joined(named.iter().copied());
            format!("{named} {verb} a ground truth with distances, which no pair has")
        };
        Ok(is_untold.then(words))
    }

    /// The manifest of the plan with what the sessions know.
    fn manifest(&self) -> Manifest {
        let mut manifest = self.plan.manifest.clone();
        manifest.runs = self.runs.iter().filter_map(RunUnits::record).collect();
        let used = |label: &str| {
            let units = self.runs.iter().flat_map(|run| run.units(label));
            units.map(|(_, unit)| unit.session.as_str()).collect()
        };
        let mut all = BTreeSet::new();
        for record in &mut manifest.algorithms {
            let used: BTreeSet<&str> = used(&record.label);
            for session in self.sessions {
                if used.contains(session.manifest.run_id.as_str()) {
                    add_measurements(record, &session.manifest);
                }
            }
            let failures = self.tables.failures.iter();
            let mut own = failures.filter(|row| row.algorithm == record.label);
            record.failed_pairs = own.clone().count() as u64;
            record.failure = own.next_back().map(|row| row.reason.clone());
            all.extend(used);
        }
        let sessions = self.sessions.iter().map(|session| &session.manifest);
        let sessions = sessions.filter(|session| all.contains(session.run_id.as_str()));
        let sessions: Vec<_> = sessions.collect();
        if let Some(last) = sessions.last() {
            // The report is of what was measured, not of the command that builds it.
            let last = (*last).clone();
            manifest.run_id = last.run_id;
            manifest.began = last.began;
            manifest.svl = last.svl;
            manifest.git_revision = last.git_revision;
            manifest.profile = last.profile;
            manifest.machine = last.machine;
            manifest.times = last.times;
        }
        manifest.sessions = sessions.into_iter().map(Manifest::session).collect();
        let labels = self.plan.labels();
        let mut run_warnings = Vec::new();
        for run in self.runs {
            run.add_warnings(self.plan, &mut run_warnings);
        }
        for warning in &mut run_warnings {
            let order = |own: &String| labels.iter().position(|label| label == own);
            warning.algorithms.sort_by_key(order);
        }
        let given = self.options.warnings.iter().cloned();
        let failed = failure_warnings(&labels, &self.tables);
        let programs = manifest.algorithms.iter();
        let programs = programs.flat_map(AlgorithmRecord::warnings);
        let all = given.chain(run_warnings).chain(failed).chain(programs);
        for warning in all.map(|warning| warning.to_string()).collect::<Vec<_>>() {
            if !manifest.warnings.contains(&warning) {
                manifest.warnings.push(warning);
            }
        }
        manifest
    }

    /// The delays of the topics of all runs.
    fn latency(&self) -> Vec<TopicDelay> {
        let facts = self.runs.iter().filter(|run| run.run.stress.is_none());
        let delays = facts.flat_map(|run| {
            run.facts.latency.iter().map(|delay| TopicDelay {
                run: run.run.run.clone(),
                ..delay.clone()
            })
        });
        delays.collect()
    }

    /// The end of the run: what is missing of it.
    fn ending(&self) -> Result<Ending> {
        let plan = self.plan;
        let mut missing = plan.lost.clone().unwrap_or_default();
        for run in self.runs {
            // A perturbed run is of the same input, whose losses count once.
            let losses = run.facts.losses.as_ref();
            if let Some(losses) = losses.filter(|_| run.run.stress.is_none()) {
                missing.pairs += run.facts.pairs.len() as u64;
                missing.losses.add(losses.clone());
            }
            missing.add_doubts(run.doubts());
        }
        missing.add_doubts(plan.manifest.doubts.clone());
        let ReportTables {
            rows,
            failures,
            drives,
            ..
        } = &self.tables;
        if plan.is_driven() {
            missing.pairs += drives.iter().map(|drive| drive.frames).sum::<u64>();
        }
        for label in plan.labels() {
            let failed = failures.iter().filter(|row| row.algorithm == label).count() as u64;
            let pairs = if plan.is_driven() {
                let own = drives.iter().filter(|drive| drive.algorithm == label);
                own.map(|drive| drive.frames - drive.skipped).sum()
            } else {
                rows.iter().filter(|row| row.algorithm() == label).count() as u64 + failed
            };
            missing.add_failures(label.to_owned(), FailedPairs { pairs, failed });
        }
        let mut runs = self.runs.iter();
        if let Some(error) = runs.find_map(|run| run.facts.error.as_ref()) {
            return Ok(Ending::early(EndState::Failed, error.clone(), missing));
        }
        let partial = self.runs.iter().filter(|run| !run.is_whole(plan));
        let partial: Vec<_> = partial.map(|run| run.run.words()).collect();
        if let Some(first) = partial.first() {
            let what = if plan.is_driven() { "course" } else { "run" };
            let shard = |session: &StoredSession| session.manifest.shard.is_some();
            let cure = if self.sessions.iter().any(shard) {
                "the same command continues a shard, and `svl report PART… -o FOLDER` joins all"
            } else {
                "`svl score` with the same options continues"
            };
            let words = format!(
                "{} of {} incomplete, from {first} on; {cure}",
                partial.len(),
                counted(self.runs.len() as u64, what)
            );
            return Ok(Ending::early(EndState::Incomplete, words, missing));
        }
        let allowed = plan.manifest.allow_loss()?;
        Ok(Ending::new(missing, self.options.allow_loss.or(allowed)))
    }

    /// The algorithms whose times may be compared, by a number that they share: those of each block
    /// are of one session.
    fn time_groups(&self) -> BTreeMap<String, usize> {
        let mut groups: Vec<BTreeMap<(usize, u64), &String>> = Vec::new();
        let mut group_by_label = BTreeMap::new();
        for label in self.plan.labels() {
            let mut sessions = BTreeMap::new();
            for (i, run) in self.runs.iter().enumerate() {
                let units = run.units(label);
                sessions.extend(units.map(|(block, unit)| ((i, block), &unit.session)));
            }
            let group = groups.iter().position(|own| *own == sessions);
            let group = group.unwrap_or_else(|| {
                groups.push(sessions);
                groups.len() - 1
            });
            group_by_label.insert(label.to_owned(), group);
        }
        group_by_label
    }

    /// The pictures; those of drives begin with the candidates.
    fn pictures(&self, candidates: &[&str]) -> Result<(Vec<CheckpointFigure>, Vec<SceneFigure>)> {
        if self.plan.is_driven() {
            let mut labels = self.plan.labels();
            labels.sort_by_key(|label| !candidates.contains(label));
            let figures = shots::for_drives(&labels, self.runs, &self.tables)?;
            return Ok((figures, Vec::new()));
        }
        shots::for_runs(self.plan, self.runs)
    }

    fn maps(&self, candidates: &[&str]) -> Result<Vec<crate::show::plot::map::CourseMap>> {
        if !self.plan.is_driven() {
            return Ok(Vec::new());
        }
        let mut plans: Vec<CoursePlan> = Vec::new();
        for run in self.runs {
            let course = run.all().filter_map(|unit| unit.drive.as_ref()).next();
            if let Some(drive) = course
                && plans.iter().all(|plan| plan.seed != drive.course.seed)
            {
                plans.push(drive.course.clone());
            }
        }
        write_json(&self.folder.join(COURSES), &plans)?;
        let ReportTables { drives, tracks, .. } = &self.tables;
        Ok(maps(&plans, drives, tracks, candidates))
    }
}

/// A warning per failure of an algorithm, but not while it fails for the same reason pair after
/// pair.
fn failure_warnings(labels: &[&str], tables: &ReportTables) -> Vec<Notice> {
    let mut warnings = Vec::new();
    for label in labels {
        let failures = tables.failures.iter().filter(|row| row.algorithm == *label);
        if failures.clone().next().is_none() {
            continue;
        }
        let rows = tables.rows.iter().filter(|row| row.algorithm() == *label);
        let key = |run, seed, stress| (stress, run, seed);
        let answered = rows.map(|row| {
            (
                key(row.run(), row.seed(), row.stress()),
                row.sequence(),
                None,
            )
        });
        let failed = failures.map(|row| {
            let run_key = key(row.run.as_deref(), row.seed, row.stress.as_deref());
            (run_key, row.sequence, Some(row.reason.as_str()))
        });
        let mut pairs: Vec<_> = answered.chain(failed).collect();
        pairs.sort();
        let mut before = None;
        for (_, sequence, reason) in pairs {
            if let Some(reason) = reason.filter(|reason| before != Some(*reason)) {
                warnings.push(Notice::on_pair(label, sequence, reason));
            }
            before = reason;
        }
    }
    warnings
}

/// Adds what a session measured of an algorithm to its record.
fn add_measurements(record: &mut AlgorithmRecord, session: &Manifest) {
    let mut own = session.algorithms.iter();
    let Some(own) = own.find(|own| own.label == record.label) else {
        return;
    };
    record.has_run_memory |= own.has_run_memory;
    record.memory_bytes = record.memory_bytes.max(own.memory_bytes);
    record.program = match (own.program.clone(), record.program.take()) {
        (Some(own), Some(earlier)) => Some(ProgramRecord::after(own, &earlier)),
        (own, earlier) => own.or(earlier),
    };
}

/// A warning if frames have a truth, but no cell has enough of it to be scored.
fn nothing_scored(manifest: &Manifest, summary: &Results) -> Option<String> {
    let mut algorithms = summary.algorithms.iter();
    let algorithm =
        algorithms.find(|algorithm| algorithm.scored().is_some_and(|(_, cells)| cells == 0))?;
    Some(format!(
        "{}: no cell of {} has enough of a ground truth to be scored against it",
        manifest.scenario,
        counted(algorithm.pairs, "pair")
    ))
}

/// Digest of the unperturbed pairs of a recording.
fn recording_hash(rows: &Rows, run: &str) -> Option<String> {
    let own = rows.iter();
    let own = own.filter(|row| row.run() == Some(run) && row.stress().is_none());
    pairs_hash(&own.collect::<Vec<_>>())
}

/// Per algorithm the time of each pair, ms.
fn times_ms(rows: &Rows) -> Vec<(String, Vec<f64>)> {
    let timed = rows.iter();
    let timed = timed.filter(|row| row.stress().is_none() && row.total_us().is_some());
    let times = |own: &[RowRef<'_>]| {
        let times = own.iter().filter_map(|row| row.total_us());
        let times = times.map(|us| us as f64 / 1e3).collect();
        (own[0].algorithm().to_owned(), times)
    };
    grouped(&timed.collect::<Vec<_>>(), |row| row.algorithm(), times)
}

/// The file that identifies the run of a report.
pub const MANIFEST: &str = "manifest.json";

/// True if a file of that name is the recording of a drive, or a run for Rerun.
fn is_recording(name: &str) -> bool {
    name.starts_with("course-") && name.ends_with(".mcap")
        || name.starts_with("run-") && name.ends_with(".rrd")
}

fn is_table(name: &str) -> bool {
    let stem = name.strip_suffix(".csv").or(name.strip_suffix(".parquet"));
    let mut names = TABLES.iter().map(|table| table.name).chain(["algorithms"]);
    stem.is_some_and(|stem| names.any(|own| own == stem))
}

/// The folder of a report.
pub const REPORT: FolderRule = FolderRule {
    kind: "a report",
    owns: |name| REPORT_FILES.contains(&name) || is_table(name) || is_recording(name),
    inner: Some(UNITS),
    mark: REPORT_LIST,
    cure: "name another folder with -o",
};

const REPORT_FILES: &[&str] = &[
    REPORT_LIST,
    MANIFEST,
    COURSES,
    "summary.md",
    SUMMARY,
    "index.html",
];

/// The files of a complete report alone.
const SUMMARIES: [&str; 6] = [
    SUMMARY,
    "summary.md",
    "summary.csv",
    "summary.parquet",
    "verdicts.csv",
    "verdicts.parquet",
];
