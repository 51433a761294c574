//! Results of a search: for the terminal, as Markdown and as the TOML of a scenario.

use super::goal::Goal;
use super::search::Evaluated;
use super::values::TrialValues;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use svl_core::Result;
use svl_core::counted;
use svl_core::filter::FilterKind;
use svl_report::compare::{Change, Judgement, change_table, signed};
use svl_report::table::{NONE, Table, TerminalStyle, escape, wrapped};
use svl_score::judge::{METRICS, Metric};
use svl_score::scenario::{Scenario, ScenarioFilter};

/// Facts of a search.
#[derive(Clone, Debug, Serialize)]
pub struct TuneFacts {
    /// In words, as [`Goal::words`].
    pub goal: String,
    /// Runs or scenes of the search by name, and the number of their pairs.
    pub training: Vec<String>,
    pub training_pairs: usize,
    /// Runs or scenes of the test.
    pub test: Vec<String>,
    /// Reason why the test is weaker than it could be.
    pub caution: Option<String>,
    pub interrupted: bool,
    /// Names and values of the manifest.
    pub made: Vec<(String, String)>,
}

/// Results for one algorithm.
#[derive(Clone, Debug, Serialize)]
pub struct TunedAlgorithm {
    /// The reference and the best, as `--algo` takes them.
    pub reference: String,
    pub best: String,
    /// Name of the metric that was optimized.
    pub objective: &'static str,
    /// Axes of the search.
    pub axes: Vec<String>,
    /// Number of settings that were tried beside the reference, and of those among them that were
    /// run on all training pairs.
    pub tried: usize,
    pub finalists: usize,
    /// The settings that no other one dominates, with their values on the training pairs.
    pub front: Vec<FrontEntry>,
    /// From the reference to the best.
    pub training: Vec<Change>,
    /// The same on the test pairs, and their number.
    pub test: Vec<Change>,
    pub test_pairs: usize,
}

/// A setting of the Pareto front.
#[derive(Clone, Debug, Serialize)]
pub struct FrontEntry {
    pub setting: String,
    /// True if it keeps the constraints.
    pub is_allowed: bool,
    /// In the order of METRICS.
    pub values: Vec<(&'static str, f64)>,
}

/// All results of the search.
#[derive(Clone, Debug, Serialize)]
pub struct TuneOutcome {
    #[serde(flatten)]
    pub facts: TuneFacts,
    pub algorithms: Vec<TunedAlgorithm>,
}

impl FrontEntry {
    pub fn new(evaluated: &Evaluated, goal: &Goal, reference: &TrialValues) -> Self {
        let values = METRICS.iter();
        let values = values.filter_map(|metric| Some((metric.name, evaluated.values.get(metric)?)));
        Self {
            setting: evaluated.algorithm.written(),
            is_allowed: goal.violation(&evaluated.values, reference) == 0.0,
            values: values.collect(),
        }
    }

    fn show(&self, metric: &Metric) -> String {
        let mut values = self.values.iter();
        let found = values.find(|(name, _)| *name == metric.name);
        found.map_or(NONE.to_owned(), |(_, value)| metric.show(*value))
    }
}

impl TunedAlgorithm {
    /// True if the reference is the best that was found.
    pub fn is_unchanged(&self) -> bool {
        self.best == self.reference
    }

    /// Result of the test of the best setting, in words; none if it was not tested.
    pub fn verdict(&self) -> Option<String> {
        let sought = Metric::find(self.objective)?;
        let change = self.test.iter().find(|change| change.metric == sought)?;
        let (words, difference) = (sought.words, signed(sought, change.difference));
        Some(match change.judgement {
            Judgement::Better => format!("the test confirms it: {words} {difference}"),
            Judgement::Worse => {
                format!("the test refutes it: {words} {difference}; keep the reference")
            }
            Judgement::Equal => {
                format!("the test does not confirm it: {words} are equal; keep the reference")
            }
            Judgement::TooFew => format!(
                "the test has too few pairs to tell ({words} {difference}); use longer recordings"
            ),
            _ => format!(
                "the test does not confirm it: {words} {difference}, no difference within its \
                 interval; keep the reference"
            ),
        })
    }

    /// The Pareto front.
    fn front_table(&self) -> Table {
        let objectives = self.objectives();
        let heads = objectives.iter().map(|metric| metric.words);
        let table = Table::new("Pareto front", "setting").with_columns(heads);
        let mut table = table.with_texts(["bounds"]);
        for entry in &self.front {
            let values = objectives.iter().map(|metric| entry.show(metric));
            let bounds = if entry.is_allowed { "" } else { "broken" };
            table.push(&entry.setting, values.chain([bounds.to_owned()]));
        }
        table.remove_empty_columns();
        table
    }

    /// The metrics of the front that were measured.
    fn objectives(&self) -> Vec<&'static Metric> {
        let names = ["right", "wrong", "unrivalled", "coverage", "time"];
        let is_measured = |metric: &&Metric| {
            let mut front = self.front.iter();
            front.any(|entry| entry.values.iter().any(|(name, _)| *name == metric.name))
        };
        let metrics = names.into_iter().filter_map(Metric::find);
        metrics.filter(is_measured).collect()
    }
}

impl TuneOutcome {
    /// The best settings and the references, each once.
    pub fn settings(&self) -> Vec<String> {
        let mut settings = Vec::new();
        for algorithm in &self.algorithms {
            for written in [&algorithm.best, &algorithm.reference] {
                if !settings.contains(written) {
                    settings.push(written.clone());
                }
            }
        }
        settings
    }

    /// The changes on the training pairs, and on the test pairs if there are some.
    fn parts(&self, algorithm: &TunedAlgorithm) -> Vec<Table> {
        let TuneFacts {
            training,
            training_pairs,
            test,
            ..
        } = &self.facts;
        let names = |names: &[String]| match names {
            [first, .., last] if names.len() > 4 => {
                format!("{first} to {last}, {} runs", names.len())
            }
            names => names.join(", "),
        };
        let parts = [
            ("training", *training_pairs, training, &algorithm.training),
            ("test", algorithm.test_pairs, test, &algorithm.test),
        ];
        let parts = parts
            .into_iter()
            .filter(|(.., changes)| !changes.is_empty());
        let table = |(part, pairs, runs, changes): (_, _, &Vec<_>, &Vec<Change>)| {
            let changes = changes.iter();
            let changes = changes.map(|change| (change.metric.words.to_owned(), change));
            let pairs = counted(pairs as u64, "pair");
            Table {
                title: format!("{part}: {pairs} of {}", names(runs)),
                ..change_table(["reference", "best"], changes)
            }
        };
        parts.map(table).collect()
    }

    /// The outcome as Markdown with a title.
    pub fn markdown(&self, title: &str) -> String {
        let facts = &self.facts;
        let mut text = format!("# {title}\n\nSought: {}.\n", facts.goal);
        for note in self.notes() {
            let _ = write!(text, "\n**{note}**\n");
        }
        for algorithm in &self.algorithms {
            let _ = write!(text, "\n## {}\n\n", algorithm.reference);
            let _ = writeln!(text, "Best: `{}`\n", algorithm.best);
            if let Some(verdict) = algorithm.verdict() {
                let _ = writeln!(text, "**{verdict}**\n");
            }
            let _ = writeln!(
                text,
                "{} tried, {} of them on all training pairs. Varied: `{}`.",
                counted(algorithm.tried as u64, "setting"),
                algorithm.finalists,
                algorithm.axes.join(" ")
            );
            for table in self.parts(algorithm) {
                let _ = write!(text, "\nOn the {}:\n\n", escape(&table.title));
                text += &table.markdown();
            }
            let _ = write!(
                text,
                "\nThe Pareto front on the training pairs: no other setting is as good by all of \
                 these metrics and better by one:\n\n{}",
                algorithm.front_table().markdown()
            );
        }
        text += "\n## How it was made\n\n";
        for (name, value) in &facts.made {
            let _ = writeln!(text, "- {name}: {value}");
        }
        text
    }

    /// The outcome for the terminal: the best, its changes on the test set and the Pareto front.
    pub fn terminal(&self, style: TerminalStyle) -> String {
        let mut lines = vec![format!("sought: {}", self.facts.goal)];
        lines.extend(self.notes());
        let mut text = String::new();
        for algorithm in &self.algorithms {
            lines.extend([String::new(), algorithm.reference.clone()]);
            lines.push(if algorithm.is_unchanged() {
                format!("best is the reference itself, of {} tried", algorithm.tried)
            } else {
                format!("best of {} tried: {}", algorithm.tried, algorithm.best)
            });
            lines.extend(algorithm.verdict());
            for line in lines.drain(..) {
                text += &wrapped(&line, 2, style.width);
            }
            // Training pairs are shown only without a test: the file beside the output has both.
            let changes = self
                .parts(algorithm)
                .pop()
                .filter(|_| !algorithm.is_unchanged());
            let front = (!algorithm.front.is_empty()).then(|| algorithm.front_table());
            for table in changes.iter().chain(&front) {
                let title = wrapped(&table.title, 2, style.width);
                text += &format!("\n{title}{}", table.terminal(style));
            }
        }
        text
    }

    fn notes(&self) -> Vec<String> {
        let interrupted = self.facts.interrupted;
        let interrupted = interrupted.then(|| "Interrupted: the best so far.".to_owned());
        interrupted
            .into_iter()
            .chain(self.facts.caution.clone())
            .collect()
    }
}

/// The scenario that repeats a run with these algorithms, as a file of `folder`: the contents of
/// `scenario` without its limits, which are for other algorithms. `filters` replace its own.
///
/// # Errors
/// Those of [`Scenario::to_toml`], and for a label that is not an algorithm.
pub fn scenario_toml(
    scenario: &Scenario,
    algorithms: &[String],
    filters: &[(FilterKind, PathBuf)],
    folder: &Path,
) -> Result<String> {
    let own = filters.iter().map(|(kind, file)| ScenarioFilter {
        detects: *kind,
        file: Some(file.clone()),
        scenario: Vec::new(),
        seeds: None,
    });
    let algorithms = algorithms.iter().map(|text| text.parse());
    let scenario = Scenario {
        algorithms: algorithms.collect::<Result<_>>()?,
        filters: match filters {
            [] => scenario.filters.clone(),
            _ => own.collect(),
        },
        gate: Vec::new(),
        ..scenario.clone()
    };
    scenario.to_toml(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scenario_can_lie_elsewhere_with_its_filters() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
        let scenario = Scenario::read(&folder.join("floor.toml")).unwrap();
        let algorithms = ["v3:max_disparity=64", "v3"].map(str::to_owned);
        let elsewhere = tempfile::tempdir().unwrap();
        let written = |filters: &[(FilterKind, PathBuf)]| {
            let toml = scenario_toml(&scenario, &algorithms, filters, elsewhere.path()).unwrap();
            Scenario::parse(&toml, &elsewhere.path().join("best.toml")).unwrap()
        };
        let moved = written(&[]);
        assert_eq!(moved.labels(), ["v3:max_disparity=64", "v3"]);
        assert_eq!(
            (moved.grid, moved.cells, &moved.source),
            (scenario.grid, scenario.cells, &scenario.source)
        );
        let own = [&moved, &scenario].map(|scenario| {
            scenario.filters[0].training(scenario).unwrap()[0]
                .name
                .clone()
        });
        assert_eq!(own[0], own[1]);
        assert!(moved.gate.is_empty());
        let kind = scenario.filters[0].detects;
        let other = written(&[(kind, "/filters/own.safetensors".into())]);
        let file = other.filters[0].file.as_deref();
        assert!(file.unwrap().ends_with("filters/own.safetensors"));
    }

    #[test]
    fn the_verdict_follows_from_the_test_pairs() {
        let mut tuned = TunedAlgorithm {
            reference: "v3".into(),
            best: "v3:max_disparity=64".into(),
            objective: "right",
            axes: Vec::new(),
            tried: 9,
            finalists: 3,
            front: Vec::new(),
            training: Vec::new(),
            test: Vec::new(),
            test_pairs: 9,
        };
        assert_eq!(tuned.verdict(), None);
        let interval = Some((-0.1, 0.3));
        for (judgement, interval, words) in [
            (
                Judgement::Better,
                interval,
                "confirms it: right cells +10.0 %",
            ),
            (Judgement::Unclear, interval, "does not confirm it"),
            (Judgement::TooFew, None, "too few pairs to tell"),
            (Judgement::Worse, interval, "refutes it"),
        ] {
            tuned.test = vec![Change {
                metric: Metric::find("right").unwrap(),
                base: 0.5,
                other: 0.6,
                difference: 0.1,
                interval,
                judgement,
            }];
            let verdict = tuned.verdict().unwrap();
            assert!(verdict.contains(words), "{verdict}");
        }
    }
}
