//! `svl compare`: compares reports.

use crate::cli::shared::report::AreaArgs;
use crate::cli::shared::terminal::{print, print_json, style};
use crate::cli::shared::usage;
use clap::builder::NonEmptyStringValueParser;
use std::path::{Path, PathBuf};
use svl::evaluation::find_left;
use svl::files;
use svl::losses::Incomplete;
use svl::outputs::{Outputs, write};
use svl::report::compare::{Comparison, Join, ScoredRun, Trend, page};
use svl::report::{TestCase, TestResult, junit};
use svl::score::{Better, ColumnChoice, Metric};

/// Compare reports: changes of metrics, with confidence intervals
///
/// Every report is compared with the first, algorithm by algorithm, over the pairs of both, without
/// stress; an algorithm with other parameters is compared with its namesake. The first line is the
/// verdict, by the headline metrics but checkpoints: right, wrong, missed, false and found, tested
/// at once, with Holm's correction, over blocks of pairs, as neighbouring pairs are correlated;
/// never for fewer than eight blocks or scenes. Any other change is called better or worse where
/// its 95 % interval excludes 0. Times are shown as ratios and never called better or worse, as the
/// machine may have been slower that day. Drives are compared course by
/// course, by an exact sign test.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl compare reports/before reports/after
  svl compare reports/before reports/after -o compare.html
  svl compare reports/1 reports/2 reports/3 -o trend.html
  svl compare reports/arena#v1 reports/arena#v3     two algorithms of a report
  svl compare reports/a reports/b --map v3=v3:smoothing_sigma=0
  svl compare reports/main reports/branch --fail-on worse
      for a CI: exit 3 when a metric of the verdict became worse, when one
      failed on more pairs than allow_loss, or when too few pairs or an
      absent algorithm leave that open; others by name, as worse:passed
  svl compare reports/main reports/branch --markdown >> $GITHUB_STEP_SUMMARY
  svl compare reports/arena reports/range --json \\
      | jq '.[0].algorithms[0].metrics'")]
pub(crate) struct Args {
    /// Folders that `svl score` wrote, or one algorithm of them; the others are compared with the
    /// first
    #[arg(
        required = true, num_args = 2.., value_name = "REPORT[#ALGORITHM]",
        value_parser = NonEmptyStringValueParser::new()
    )]
    reports: Vec<String>,
    /// Compare the algorithm BASE of the first report with OTHER of the others; those of equal
    /// names are compared, too
    #[arg(long, value_name = "BASE=OTHER", help_heading = "Input")]
    map: Vec<String>,
    /// Write a page: the changes, and the frames or courses that changed most; of three reports or
    /// more, and as .json, the headline metrics, the newest last; as .md, what --markdown prints
    #[arg(
        short, long, value_name = "FILE.html",
        value_parser = usage::ending(&["html", "json", "md"]), help_heading = "Output"
    )]
    output: Option<PathBuf>,
    /// Fail if a metric became worse: one of the verdict, or those named. More pairs on which an
    /// algorithm failed, but not in the first report, than its allow_loss count as worse
    #[arg(long, value_name = "worse[:METRIC]", value_parser = fail_on, help_heading = "Scoring")]
    fail_on: Vec<FailOn>,
    /// The least share of the first report's pairs that a verdict needs
    #[arg(
        long, value_name = "P%", default_value = "90%", value_parser = percent,
        help_heading = "Scoring", hide_short_help = true
    )]
    min_common: f64,
    #[command(flatten)]
    area: AreaArgs,
    /// Metrics that are shown: all or NAME,… [default: the headline ones]
    ///
    /// `svl columns metrics` lists them.
    #[arg(
        long, value_name = "NAMES", conflicts_with_all = ["markdown", "json"],
        help_heading = "Output"
    )]
    columns: Option<ColumnChoice>,
    /// Write the metrics of --fail-on as JUnit's XML
    #[arg(
        long,
        value_name = "FILE.xml",
        value_parser = usage::ending(&["xml"]),
        requires = "fail_on",
        help_heading = "Output",
        hide_short_help = true
    )]
    junit: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    force: bool,
    /// Print at most ten lines of Markdown per comparison, for a pull request
    #[arg(long, conflicts_with = "json", help_heading = "Output")]
    markdown: bool,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// A share, written as `90%`.
fn percent(text: &str) -> Result<f64, String> {
    let number = text
        .strip_suffix('%')
        .and_then(|number| number.trim().parse().ok());
    let share = number.map(|percent: f64| percent / 100.0);
    let is_share = |share: &f64| (0.0..=1.0).contains(share);
    share
        .filter(is_share)
        .ok_or_else(|| "expected a percentage, as 90%".to_owned())
}

/// Metrics that must not become worse; `None`: those of the verdict.
type FailOn = Option<&'static Metric>;

fn fail_on(text: &str) -> Result<FailOn, String> {
    match text.split_once(':') {
        None if text == "worse" => Ok(None),
        Some(("worse", name)) => {
            let metric = usage::metric(name).map_err(|fault| fault.to_string())?;
            if metric.better == Better::Neither {
                let why = if metric.name == "floor" {
                    ", as it counts true distances"
                } else {
                    ""
                };
                let cure = "name one that has, as `svl columns metrics` says";
                return Err(format!("'{name}' has no better direction{why}; {cure}"));
            }
            if metric.estimated().is_some() {
                return Err(format!(
                    "'{name}' is an estimate, of which no test tells if a change is chance; limit \
                     its end by [[gate]]"
                ));
            }
            Ok(Some(metric))
        }
        _ => Err("expected worse, or worse:METRIC".to_owned()),
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let mut outputs = claim(args)?;
    let runs = args.reports.iter();
    let runs = runs.map(|name| ScoredRun::read(name, args.area.area));
    let runs = runs.collect::<Result<Vec<_>, _>>()?;
    let mut joins = Vec::new();
    // Why reports are not compared.
    let mut reasons = Vec::new();
    for other in &runs[1..] {
        match Join::new(&runs[0], other, &args.map) {
            Ok(join) => joins.push(join),
            Err(error) if !args.fail_on.is_empty() && !error.is_usage() => {
                return Err(usage::gate(error));
            }
            Err(error) => match error.downcast_ref() {
                Some(Incomplete(why)) => reasons.push(why.clone()),
                None => return Err(error.into()),
            },
        }
    }
    let comparisons = joins.iter();
    let comparisons = comparisons.map(|join| Comparison::new(join, args.min_common));
    let comparisons = comparisons.collect::<Result<Vec<_>, _>>()?;
    let cases = gate_cases(&comparisons, &args.fail_on)?;
    let page = match (&comparisons[..], &args.output) {
        ([], _) | (_, None) => None,
        (_, Some(path)) if files::has_ending(path, "json") => {
            Some(serde_json::to_string_pretty(&Trend::new(&runs)?)? + "\n")
        }
        (_, Some(path)) if files::has_ending(path, "md") => {
            Some(joined(&comparisons, &reasons, &Comparison::markdown))
        }
        ([comparison], Some(_)) if runs.len() == 2 => {
            Some(page(comparison, &joins[0], &find_left)?)
        }
        _ => Some(Trend::new(&runs)?.page()?),
    };
    // Nothing replaces an earlier page if nothing was compared.
    if args.output.is_some() == page.is_some() {
        outputs.begin()?;
        if let Some(path) = &args.junit {
            write(&outputs.place(path), junit("svl compare", &strict(&cases)))?;
        }
        if let Some((path, page)) = args.output.as_ref().zip(page) {
            write(&outputs.place(path), page)?;
        }
        outputs.commit()?;
    }
    show(args, &comparisons, &reasons)?;
    match &complaints(&cases)[..] {
        [] => all_compared(&comparisons, reasons, args.columns.as_ref()),
        [one] => Err(usage::gate(one)),
        [first, more @ ..] => Err(usage::gate(format!("{first}; and {} more", more.len()))),
    }
}

/// The cases of --fail-on, if it is given.
///
/// # Errors
/// For reports that cannot be compared, and if none measures the metrics.
fn gate_cases(comparisons: &[Comparison], fail_on: &[FailOn]) -> anyhow::Result<Vec<TestCase>> {
    let mut cases = Vec::new();
    if fail_on.is_empty() {
        return Ok(cases);
    }
    for comparison in comparisons {
        let (base, other) = (comparison.base.display(), comparison.other.display());
        if !comparison.is_judged() {
            let differences = comparison.differences.join("; ");
            return Err(usage::gate(format!(
                "{base}, {other}: were scored differently ({differences}), so --fail-on cannot \
                 compare them"
            )));
        }
        if let Some((folder, why)) = comparison.incomplete.first() {
            let folder = folder.display();
            return Err(usage::gate(format!(
                "{folder}: is incomplete ({why}), so --fail-on cannot compare it"
            )));
        }
        cases.extend(comparison.cases(fail_on).into_iter().map(|mut case| {
            // Names are unique in a file.
            if comparisons.len() > 1 {
                case.name = format!("{other}: {}", case.name);
            }
            case
        }));
    }
    let mut algorithms = comparisons.iter().flat_map(|own| &own.algorithms);
    let are_measured = algorithms.any(|own| own.tested(fail_on).next().is_some());
    if !are_measured && complaints(&cases).is_empty() {
        return Err(usage::gate("--fail-on: no report measures these metrics"));
    }
    Ok(cases)
}

/// Claims the page and the file of the cases.
fn claim(args: &Args) -> anyhow::Result<Outputs> {
    let outputs = [&args.output, &args.junit].into_iter().flatten();
    for path in outputs.clone() {
        let shown = path.display();
        let folder = path.parent().unwrap_or(Path::new(""));
        if folder.join("manifest.json").is_file() {
            return Err(usage::wrong(format!(
                "{shown}: is in the folder of a report, whose files svl replaces; name another \
                 place"
            )));
        }
    }
    let outputs = outputs.map(PathBuf::as_path);
    Ok(Outputs::claim(args.force, [], outputs)?)
}

/// The comparisons as texts, below `reasons`: those of the reports without one.
fn joined(
    comparisons: &[Comparison],
    reasons: &[String],
    text: &dyn Fn(&Comparison) -> String,
) -> String {
    let reasons = reasons.iter().map(|why| format!("not comparable: {why}\n"));
    let parts: Vec<_> = reasons.chain(comparisons.iter().map(text)).collect();
    parts.join("\n")
}

/// Prints the comparisons. `reasons`: those of the reports without one.
fn show(args: &Args, comparisons: &[Comparison], reasons: &[String]) -> anyhow::Result<()> {
    let joined = |text: &dyn Fn(&Comparison) -> String| joined(comparisons, reasons, text);
    if args.json {
        print_json(&comparisons)
    } else if comparisons.is_empty() {
        // The error names the reasons.
        Ok(())
    } else if args.markdown {
        print(&joined(&Comparison::markdown))
    } else {
        let columns = args.columns.clone().unwrap_or_default();
        let style = style();
        let mut text = joined(&|comparison| comparison.terminal(&columns, style));
        if let Some(path) = &args.output {
            text += &format!("page   {}\n", path.display());
        }
        print(&text)
    }
}

/// The reasons to fail: metrics that became worse come before those that could not be tested.
fn complaints(cases: &[TestCase]) -> Vec<String> {
    let open = |is_failure: bool| {
        cases.iter().filter_map(move |case| match &case.result {
            TestResult::Failed(why) if is_failure => Some(format!("{}: {why}", case.name)),
            TestResult::Skipped(why) if !is_failure => Some(format!("{}: {why}", case.name)),
            _ => None,
        })
    };
    open(true).chain(open(false)).collect()
}

/// The cases for a CI server, which takes a skipped test for passed: one that cannot be tested
/// fails here, as it does by the exit status.
fn strict(cases: &[TestCase]) -> Vec<TestCase> {
    let strict = cases.iter().map(|case| TestCase {
        name: case.name.clone(),
        result: match &case.result {
            TestResult::Passed(words) => TestResult::Passed(words.clone()),
            TestResult::Failed(why) | TestResult::Skipped(why) => TestResult::Failed(why.clone()),
        },
    });
    strict.collect()
}

/// Fails if a report has nothing that was compared, or none of the metrics that were asked for.
/// `reasons`: those without a comparison.
fn all_compared(
    comparisons: &[Comparison],
    mut reasons: Vec<String>,
    columns: Option<&ColumnChoice>,
) -> anyhow::Result<()> {
    let measured = comparisons.iter().filter(|own| own.has_pairs());
    let lacks = |own: &Comparison| own.lacks(columns?);
    reasons.extend(measured.filter_map(lacks));
    let without_pairs = comparisons.iter().filter(|own| !own.has_pairs());
    reasons.extend(without_pairs.map(|own| {
        let (base, other) = (own.base.display(), own.other.display());
        format!("{base} and {other}: {other} has no result of the pairs of {base}")
    }));
    if reasons.is_empty() {
        return Ok(());
    }
    let words = format!("nothing was compared: {}", reasons.join("; "));
    Err(usage::incomplete(words))
}
