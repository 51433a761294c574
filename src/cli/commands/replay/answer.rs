//! What a replay did, and its answer to the user.

use super::Args;
use super::verify::{Earlier, Verification};
use crate::cli::shared::terminal::{print, print_json, style};
use crate::cli::shared::viewer::RerunChoice;
use std::collections::BTreeMap;
use std::path::Path;
use svl::losses::Ending;
use svl::manifest::Manifest;
use svl::matcher::Algorithm;
use svl::outputs::Outputs;
use svl::pass::{Outcome, complete, ending};
use svl::recording::AlgorithmCells;
use svl::report::{ReportTables, ResultParts, Results, Row, Shown, shell_word};
use svl::sink::RerunTarget;
use svl::{Result, counted, joined};

/// Newest rows that the summary of live topics has: the topics have no end.
pub(super) const LIVE_ROWS: usize = 3000;

/// A replay after its last pair.
pub(super) struct Replayed {
    /// Name of the source.
    title: String,
    /// The same as a user named it.
    name: String,
    is_live: bool,
    outcome: Outcome,
    ran: Result<()>,
    /// Result of the sinks.
    finished: Result<()>,
    ending: Ending,
    tables: ReportTables,
    summary: Option<Results>,
    verification: Option<Verification>,
}

impl Replayed {
    pub(super) fn new(
        (title, name): (String, String),
        is_live: bool,
        outcome: Outcome,
        (ran, finished): (Result<()>, Result<()>),
        rows: Vec<Row>,
        args: &Args,
    ) -> Self {
        Self {
            title,
            name,
            is_live,
            ending: ending(&ran, outcome.missing(), args.options.allow_loss),
            outcome,
            ran,
            finished,
            tables: ReportTables {
                rows: rows.into_iter().collect(),
                ..ReportTables::default()
            },
            summary: None,
            verification: None,
        }
    }

    /// Commits the files of a whole run. Those of another are kept beside the earlier ones.
    pub(super) fn keep(&self, outputs: Outputs) -> Result<()> {
        match (&self.ran, &self.finished) {
            (Ok(()), Ok(())) => return outputs.commit(),
            (Err(_), _) if self.outcome.frames == 0 => {}
            _ => outputs.keep_both(),
        }
        Ok(())
    }

    pub(super) fn has_results(&self) -> bool {
        self.finished.is_ok() && (self.ran.is_ok() || self.outcome.frames > 0)
    }

    pub(super) fn summarize(&mut self, manifest: &mut Manifest) -> anyhow::Result<()> {
        let parts = ResultParts {
            ending: self.ending.clone(),
            manifest: Some(&*manifest),
            ..ResultParts::default()
        };
        let summary = Results::new(&self.tables, parts, Shown::default())?;
        summary.complete(manifest);
        self.summary = Some(summary);
        Ok(())
    }

    pub(super) fn verify(
        &mut self,
        earlier: &Earlier,
        cells: &[AlgorithmCells],
        algorithms: &[Algorithm],
    ) -> anyhow::Result<()> {
        self.verification = Some(earlier.compare(&self.tables.rows, cells, algorithms)?);
        Ok(())
    }

    /// Prints the summary, if there are results.
    pub(super) fn print(&self, args: &Args) -> anyhow::Result<()> {
        let Some(summary) = &self.summary else {
            return Ok(());
        };
        if !args.json {
            let text = summary.terminal(&self.title, style(), false);
            return print(&(text + &self.received() + &written(args)));
        }
        let grabber = self.outcome.losses.grabber.as_ref();
        print_json(&Answer {
            summary,
            received: grabber.map(|grabber| &grabber.facts),
            verification: &self.verification,
        })
    }

    /// Checks that the replay ran to its end, and that the earlier results are proved.
    pub(super) fn check(self, args: &Args) -> anyhow::Result<()> {
        self.ran?;
        self.finished?;
        if let Some(verification) = self.verification {
            let proved = verification.proved()?;
            if !args.json {
                print(&proved)?;
            }
        }
        complete(&self.ending)?;
        match (args.json, &self.summary) {
            (false, Some(summary)) => {
                let labels = joined(summary.algorithms.iter().map(|a| a.algorithm.as_str()));
                let pairs = counted(self.outcome.frames, "pair");
                let losses = &self.outcome.losses;
                let replaced = match losses.replaced {
                    0 => String::new(),
                    n => format!("; {n} replaced by newer ones"),
                };
                let lost = if losses.lost() > 0 { "" } else { "; none lost" };
                let next = next(args, &self.name, self.is_live)?;
                print(&format!(
                    "\n{pairs} replayed through {labels}{replaced}{lost}.\nnext     {next}\n"
                ))
            }
            _ => Ok(()),
        }
    }

    /// Lines on live topics.
    fn received(&self) -> String {
        let grabber = self.outcome.losses.grabber.as_ref();
        let received = grabber.map(|grabber| format!("\nreceived {}\n", grabber.text));
        let received = received.unwrap_or_default();
        if self.is_live && self.tables.rows.len() >= LIVE_ROWS {
            format!("\nsummary  of the last {LIVE_ROWS} results\n{received}")
        } else {
            received
        }
    }
}

/// A line on the files.
fn written(args: &Args) -> String {
    let files = [&args.output, &args.rows, &args.cells];
    let files = files.into_iter().flatten();
    let files: Vec<_> = files.map(|file| file.display().to_string()).collect();
    match files.len() {
        0 => String::new(),
        _ => format!("\nwritten  {}\n", files.join(", ")),
    }
}

/// The next command, unless it would have to repeat options of the source.
fn next(args: &Args, name: &str, is_live: bool) -> Result<String> {
    let name = shell_word(name);
    let algorithms = args.algo.iter().map(Algorithm::written);
    let algorithms: String = algorithms
        .map(|written| format!(" --algo {}", shell_word(&written)))
        .collect();
    let viewed = args.rerun.as_ref().and_then(RerunChoice::target);
    // The maps of another program are in its recording alone.
    let has_maps = args.algo.iter().any(|own| own.spec().is_recorded());
    let has_options = !args.options.keys()?.is_empty();
    let file = |path: &Path| shell_word(&path.display().to_string());
    Ok(match (&args.output, viewed.and_then(RerunTarget::file)) {
        _ if is_live => format!("svl record {name} -o run.mcap  # keeps the pairs"),
        (Some(output), _) if args.verify.is_none() && !(has_maps && has_options) => {
            let output = file(output);
            let replayed = if has_maps {
                format!("{name} --verify={output}")
            } else {
                format!("{output} --verify")
            };
            format!("svl replay {replayed}  # the same results again?")
        }
        (_, Some(viewed)) => format!("svl view {}  # the run in Rerun", file(viewed)),
        _ if !has_options => {
            format!("svl score {name}{algorithms}  # a report with its frames")
        }
        _ => "the same with --rerun spawn, to watch it".to_owned(),
    })
}

/// The JSON that `--json` prints.
#[derive(serde::Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    summary: &'a Results,
    /// The counts of live topics.
    #[serde(skip_serializing_if = "Option::is_none")]
    received: Option<&'a BTreeMap<String, String>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    verification: &'a Option<Verification>,
}
