//! `svl tune --auto`: searches for better settings.

use super::Args;
use crate::cli::shared::progress::Terminal;
use crate::cli::shared::terminal::{print, print_json, style};
use crate::cli::shared::usage;
use anyhow::{Context, bail};
use std::path::Path;
use svl::console::{Console, Unit};
use svl::grab;
use svl::manifest::Manifest;
use svl::matcher::Algorithm;
use svl::outputs::{Outputs, write_with_page};
use svl::runs;
use svl::scenario::{Scenario, ScenarioKind, SourceOptions};
use svl::score::Metric;
use svl::tune::{
    Evaluator, Goal, HeldRun, HeldRuns, Search, SearchData, SearchPlan, Space, TrialLog, TuneFacts,
    TuneOutcome, found, scenario_toml,
};

/// Pairs that show which metrics there are.
const FIRST_PAIRS: usize = 8;

pub(super) fn run(args: &Args, quiet: bool) -> anyhow::Result<()> {
    let terminal = &Terminal { quiet };
    let out = args.output.as_deref().context("-o is required")?;
    if let Some(cameras) = args.what.iter().find(|name| grab::driver(name).is_some()) {
        let cure = format!("record them first: svl record {cameras}");
        return Err(usage::wrong(format!("{cameras}: are cameras; {cure}")));
    }
    let (page, log) = (out.with_extension("md"), out.with_extension("csv"));
    let may_replace = args.force || args.search.resume;
    // Results of a search are replaced by those of its continuation; its log is continued.
    let claimed = Outputs::claim(may_replace, [], [out, &page])?;
    let logs = Outputs::claim(may_replace, [], [log.as_path()])?;
    let filters = args.filters.models()?;
    let files = args.filters.files(&filters);
    let algorithms = args.algorithms()?;
    let spaces = algorithms.iter().map(|algorithm| {
        let base: Algorithm = algorithm.written().parse()?;
        Space::new(base.filtered(&filters), &args.search.vary)
    });
    let spaces = spaces.collect::<svl::Result<Vec<_>>>()?;
    let plan = SearchPlan {
        trials: args.search.trials,
        pairs: args.search.pairs,
        seed: args.search.search_seed,
    };

    let mut scenario = args.scenario_of(&args.what)?;
    runs::change(
        std::slice::from_mut(&mut scenario),
        &args.source,
        &args.what[0],
    )?;
    let SearchData {
        training,
        test,
        caution,
        tested,
    } = SearchData::read(
        &scenario,
        tested(args, &scenario)?,
        &algorithms,
        args.search.pairs,
        terminal,
    )?;
    let frames = || training.iter().chain(&test).flat_map(|part| &part.frames);
    let pairs: usize = training.iter().map(|part| part.frames.len()).sum();
    if pairs == 0 {
        bail!("{}: has no pairs", args.what[0]);
    }
    let has_truth = frames().any(|frame| frame.truth.is_some());
    let mut goal = goal(args, has_truth)?;
    let plan = SearchPlan {
        pairs: plan.pairs.min(pairs),
        ..plan
    };
    let mut log = TrialLog::open(&log, &training, &filters, args.search.resume, logs)?;
    let mut evaluator = HeldRuns {
        parts: &training,
        has_truth,
        bar: None,
    };
    let bases: Vec<_> = spaces.iter().map(|space| space.base.clone()).collect();
    let Some(values) = evaluator.evaluate(&bases, plan.pairs.min(FIRST_PAIRS))? else {
        bail!("interrupted; nothing is written");
    };
    let is_measured = |metric: &Metric| {
        let mut values = values.iter().flatten();
        values.all(|values| values.get(metric).is_some())
    };
    if args.search.subject_to.is_empty() {
        // A bound on a metric that these pairs do not have cannot be kept.
        goal.constraints.retain(|of| is_measured(of.metric));
    } else if let Some(other) = goal.metrics().find(|metric| !is_measured(metric)) {
        let name = other.name;
        return Err(usage::wrong(format!(
            "{name}: is not measured on these pairs"
        )));
    }
    let mut tuned = Vec::new();
    let mut was_interrupted = false;
    for space in &spaces {
        let known = log.known(&space.base);
        let title = format!("search {}", space.base.label());
        let matchings = Search::matchings(plan);
        evaluator.bar = Some(terminal.bar(&title, Unit::Pairs, Some(matchings)));
        let mut search = Search::new(space, &goal, plan, known);
        let ran = search.run(&mut evaluator, &mut |trial| log.write(&space.base, trial));
        evaluator.bar = None;
        ran?;
        was_interrupted |= search.was_interrupted();
        tuned.push(found(
            space, &search, &goal, &training, &test, has_truth, terminal,
        )?);
        if was_interrupted {
            break;
        }
    }
    let manifest = Manifest::new("tune", &algorithms)?;
    let names = |parts: &[HeldRun]| parts.iter().map(|part| part.name.clone()).collect();
    let outcome = TuneOutcome {
        facts: TuneFacts {
            goal: goal.words(),
            training: names(&training),
            training_pairs: plan.pairs,
            test: names(&test),
            caution,
            interrupted: was_interrupted,
            made: manifest.entries(),
        },
        algorithms: tuned,
    };
    let mut best = Vec::new();
    for of in &outcome.algorithms {
        for written in [&of.best, &of.reference] {
            if !best.contains(written) {
                best.push(written.clone());
            }
        }
    }
    let folder = out.parent().unwrap_or(Path::new(""));
    let head = format!(
        "# Found by `svl tune --auto`, svl {}, {}: {}.\n",
        manifest.svl,
        manifest.began,
        goal.words()
    );
    let toml = head + &scenario_toml(&tested.unwrap_or(scenario), &best, &files, folder)?;
    let markdown = outcome.markdown(&format!("Tuned on {}", args.what.join(", ")));
    drop(claimed);
    let written = write_with_page(out, &toml, &markdown, may_replace)?;
    if args.search.json {
        print_json(&outcome)?;
    } else {
        print(&format!("{}\n{written}\n", outcome.terminal(style())))?;
    }
    if was_interrupted {
        bail!("interrupted; the best so far is kept, and the same command with --resume continues");
    }
    Ok(())
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
