//! `svl tune --auto`: searches for better settings.

use super::Args;
use crate::cli::shared::progress::Terminal;
use crate::cli::shared::terminal::{print, print_json, style};
use crate::cli::shared::usage;
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use svl::console::{Console, Unit};
use svl::filter::FilterModel;
use svl::manifest::Manifest;
use svl::matcher::Algorithm;
use svl::outputs::{Outputs, write_with_page};
use svl::runs;
use svl::scenario::{Scenario, ScenarioKind, SourceOptions};
use svl::score::Metric;
use svl::source::SourceKind;
use svl::tune::{
    Evaluator, Goal, HeldRun, Search, SearchData, SearchPlan, Space, TrialLog, TuneFacts,
    TuneOutcome, TunedAlgorithm, found, scenario_toml,
};

/// Pairs that show which metrics there are.
const FIRST_PAIRS: usize = 8;

/// The first line of the file.
fn head(manifest: &Manifest, goal: &Goal) -> String {
    let Manifest { svl, began, .. } = manifest;
    let words = goal.words();
    format!("# Found by `svl tune --auto`, svl {svl}, {began}: {words}.\n")
}

/// Seed of the search: the same search tries the same settings, as far as times allow.
const SEARCH_SEED: u64 = 1;

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let terminal = &Terminal { quiet };
    let files = SearchFiles::claim(args)?;
    let filters = args.filters.models()?;
    let algorithms = args.algorithms()?;
    let spaces = spaces(args, &algorithms, &filters)?;
    let mut scenario = args.scenario_of(&args.what)?;
    let scenarios = std::slice::from_mut(&mut scenario);
    runs::change(scenarios, &args.source, &args.what[0])?;
    let tested = tested(args, &scenario)?;
    let data = SearchData::read(&scenario, tested, &algorithms, args.search.pairs, terminal)?;
    if data.training_pairs() == 0 {
        bail!("{}: has no pairs", args.what[0]);
    }
    let goal = goal(args, data.has_truth())?;
    let plan = SearchPlan {
        trials: args.search.trials,
        pairs: args.search.pairs.min(data.training_pairs()),
        seed: SEARCH_SEED,
    };
    let (resume, logs) = (args.search.resume, files.logs);
    let log = TrialLog::open(&files.log, &data.training, &filters, resume, logs)?;
    let goal = measured_goal(args, goal, &spaces, &data, plan)?;
    let (tuned, interrupted) = search(&spaces, &goal, &data, plan, log, terminal)?;

    let manifest = Manifest::new("tune", &algorithms)?;
    let head = head(&manifest, &goal);
    let outcome = TuneOutcome {
        facts: TuneFacts {
            goal: goal.words(),
            training: names(&data.training),
            training_pairs: plan.pairs,
            test: names(&data.test),
            caution: data.caution,
            interrupted,
            made: manifest.entries(),
        },
        algorithms: tuned,
    };
    let filters = args.filters.files(&filters);
    let folder = files.out.parent().unwrap_or(Path::new(""));
    let scenario = data.tested.unwrap_or(scenario);
    let toml = head + &scenario_toml(&scenario, &outcome.settings(), &filters, folder)?;
    let markdown = outcome.markdown(&format!("Tuned on {}", args.what.join(", ")));
    drop(files.claimed);
    let written = write_with_page(files.out, &toml, &markdown, files.may_replace)?;
    if args.search.json {
        print_json(&outcome)?;
    } else {
        print(&format!("{}\n{written}\n", outcome.terminal(style())))?;
    }
    if interrupted {
        bail!("interrupted; the best so far is kept, and the same command with --resume continues");
    }
    Ok(())
}

/// The files of a search.
struct SearchFiles<'a> {
    /// The scenario with the best settings; a page is beside it.
    out: &'a Path,
    log: PathBuf,
    claimed: Outputs,
    logs: Outputs,
    may_replace: bool,
}

impl<'a> SearchFiles<'a> {
    fn claim(args: &'a Args) -> anyhow::Result<Self> {
        let out = args.output.as_deref().context("-o is required")?;
        if let Some(cameras) = args.what.iter().find(|name| SourceKind::are_cameras(name)) {
            let cure = format!("record them first: svl record {cameras}");
            return Err(usage::wrong(format!("{cameras}: are cameras; {cure}")));
        }
        let (page, log) = (out.with_extension("md"), out.with_extension("csv"));
        let may_replace = args.force || args.search.resume;
        // Results of a search are replaced by those of its continuation; its log is continued.
        Ok(Self {
            claimed: Outputs::claim(may_replace, [], [out, &page])?,
            logs: Outputs::claim(may_replace, [], [log.as_path()])?,
            out,
            log,
            may_replace,
        })
    }
}

/// The space of each algorithm.
fn spaces(
    args: &Args,
    algorithms: &[Algorithm],
    filters: &[Arc<FilterModel>],
) -> svl::Result<Vec<Space>> {
    let space = |algorithm: &Algorithm| {
        let base: Algorithm = algorithm.written().parse()?;
        Space::new(base.filtered(filters), &args.search.vary)
    };
    algorithms.iter().map(space).collect()
}

fn names(parts: &[HeldRun]) -> Vec<String> {
    parts.iter().map(|part| part.name.clone()).collect()
}

/// The goal without its default bounds on metrics that these pairs do not have. Bounds of the user
/// must be measured.
fn measured_goal(
    args: &Args,
    mut goal: Goal,
    spaces: &[Space],
    data: &SearchData,
    plan: SearchPlan,
) -> anyhow::Result<Goal> {
    let bases: Vec<_> = spaces.iter().map(|space| space.base.clone()).collect();
    let values = data
        .evaluator()
        .evaluate(&bases, plan.pairs.min(FIRST_PAIRS))?;
    let Some(values) = values else {
        bail!("interrupted; nothing is written");
    };
    let is_measured = |metric: &Metric| {
        let mut values = values.iter().flatten();
        values.all(|values| values.get(metric).is_some())
    };
    if args.search.subject_to.is_empty() {
        goal.constraints
            .retain(|constraint| is_measured(constraint.metric));
    } else if let Some(other) = goal.metrics().find(|metric| !is_measured(metric)) {
        let name = other.name;
        return Err(usage::wrong(format!(
            "{name}: is not measured on these pairs"
        )));
    }
    Ok(goal)
}

/// Searches space after space. Returns true beside the settings if that was interrupted.
fn search(
    spaces: &[Space],
    goal: &Goal,
    data: &SearchData,
    plan: SearchPlan,
    mut log: TrialLog,
    terminal: &Terminal,
) -> anyhow::Result<(Vec<TunedAlgorithm>, bool)> {
    let mut evaluator = data.evaluator();
    let mut tuned = Vec::new();
    for space in spaces {
        let known = log.known(&space.base);
        let title = format!("search {}", space.base.label());
        let matchings = Search::matchings(plan);
        evaluator.bar = Some(terminal.bar(&title, Unit::Pairs, Some(matchings)));
        let mut search = Search::new(space, goal, plan, known);
        let ran = search.run(&mut evaluator, &mut |trial| log.write(&space.base, trial));
        evaluator.bar = None;
        ran?;
        tuned.push(found(space, &search, goal, data, terminal)?);
        if search.was_interrupted() {
            return Ok((tuned, true));
        }
    }
    Ok((tuned, false))
}

/// The scenario of the test, if it is another.
fn tested(args: &Args, scenario: &Scenario) -> anyhow::Result<Option<Scenario>> {
    Ok(match (&args.search.test[..], &args.search.test_seeds) {
        ([], None) => None,
        ([], Some(seeds)) => {
            if scenario.options.kind != ScenarioKind::Arena {
                return Err(usage::wrong(format!(
                    "{}: is not of the arena; --test-seeds is for scenarios that are",
                    args.what[0]
                )));
            }
            Some(scenario.with(&SourceOptions {
                seeds: Some(seeds.clone()),
                ..SourceOptions::default()
            })?)
        }
        // Read as the pairs of the search, but with other seeds or scenes.
        (named, _) => Some(args.scenario_of(named)?.with(&SourceOptions {
            seeds: None,
            scenes: Vec::new(),
            ..args.source.clone()
        })?),
    })
}

/// The goal, checked against the metrics that the pairs have.
fn goal(args: &Args, has_truth: bool) -> anyhow::Result<Goal> {
    let search = &args.search;
    let default = Goal::by_default(has_truth)?;
    let constraints = match &search.subject_to[..] {
        [] => default.constraints.clone(),
        given => given.to_vec(),
    };
    let goal = match (&search.maximize, &search.minimize) {
        (Some(name), _) => Goal::new(name, true, constraints)?,
        (None, Some(name)) => Goal::new(name, false, constraints)?,
        (None, None) => Goal {
            constraints,
            ..default
        },
    };
    if let Some(needs) = goal
        .metrics()
        .find(|metric| metric.against_truth && !has_truth)
    {
        let cure = "use unrivalled or coverage, or name a reference algorithm with --reference";
        return Err(usage::wrong(format!(
            "{} needs a truth, and no pair has one; {cure}",
            needs.name
        )));
    }
    if has_truth && goal.objective.name == "unrivalled" {
        let cure = "use right, as the truth is known";
        return Err(usage::wrong(format!(
            "unrivalled is for pairs without truth; {cure}"
        )));
    }
    if !goal.is_sensible() {
        let name = goal.objective.name;
        tracing::warn!("{name}: is better the other way round");
    }
    Ok(goal)
}
