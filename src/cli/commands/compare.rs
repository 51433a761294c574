//! `svl compare`: compares reports.

use crate::cli::shared::report::AreaArgs;
use crate::cli::shared::terminal::{print, print_json, style};
use crate::cli::shared::usage;
use anyhow::bail;
use clap::builder::NonEmptyStringValueParser;
use std::path::{Path, PathBuf};
use svl::files;
use svl::losses::Incomplete;
use svl::outputs::{Outputs, write};
use svl::report::compare::{
    AlgorithmChange, Change, Comparison, ComparisonPage, Judgement, ScoredRun,
};
use svl::report::{TestCase, TestResult, junit};
use svl::score::{Better, ColumnChoice, Metric, MetricUnit};
use svl::sink::find_left;

/// Compare reports: changes of metrics, with confidence intervals
///
/// Every report is compared with the first, algorithm by algorithm, over the pairs of both, without
/// stress. The first line is the verdict, by the headline metrics. A change has a 95 % bootstrap
/// interval over the pairs, drawn in blocks, as neighbouring pairs are correlated. It is called
/// better or worse only where the interval excludes 0, and never for fewer than eight blocks or
/// scenes. Times are shown as ratios and never called better or worse, as the machine may have been
/// slower that day. Drives are compared course by course, by an exact sign test.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl compare reports/before reports/after
  svl compare reports/before reports/after -o compare.html
  svl compare reports/arena#v1 reports/arena#v3     two algorithms of a report
  svl compare reports/a reports/b --map v3=v3:smoothing_sigma=0
  svl compare reports/main reports/branch --fail-on worse
      for a CI: exit 3 when a metric of any algorithm became worse, when one
      failed on pairs that it had results of, or when too few pairs or an
      absent algorithm leave that open
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
    /// Write the page of two reports: changes, and the frames or courses that changed most
    #[arg(short, long, value_name = "FILE.html", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Fail if a metric became worse: any, or those named. Pairs on which an algorithm failed, but
    /// not in the first report, always count as worse
    #[arg(long, value_name = "worse[:METRIC]", value_parser = fail_on, help_heading = "Scoring")]
    fail_on: Vec<FailOn>,
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

/// Metrics that must not become worse; `None`: any.
#[derive(Clone, Copy)]
struct FailOn(Option<&'static Metric>);

fn fail_on(text: &str) -> Result<FailOn, String> {
    match text.split_once(':') {
        None if text == "worse" => Ok(FailOn(None)),
        Some(("worse", name)) => {
            let metric = Metric::named(name, |_| true)?;
            if metric.better == Better::Neither {
                let cure = "name one that has, as `svl columns metrics` says";
                return Err(format!("'{name}' has no better direction; {cure}"));
            }
            Ok(FailOn(Some(metric)))
        }
        _ => Err("expected worse, or worse:METRIC".to_owned()),
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let outputs = claim(args)?;
    let runs = args.reports.iter().map(|text| ScoredRun::named(text));
    let mut runs = runs.collect::<Result<Vec<_>, _>>()?;
    let [base, others @ ..] = &mut runs[..] else {
        bail!("name two reports or more")
    };
    base.select(args.area.area);
    for other in &mut *others {
        other.select(args.area.area);
        other.align_with(base);
    }
    let (mut comparisons, mut not_compared) = (Vec::new(), Vec::new());
    for other in &*others {
        match Comparison::from_runs(base, other, &args.map) {
            Ok(comparison) => comparisons.push(comparison),
            Err(error) if !args.fail_on.is_empty() && !error.is_usage() => {
                return Err(usage::gate(error));
            }
            Err(error) => match error.downcast_ref() {
                Some(Incomplete(why)) => not_compared.push(why.clone()),
                None => return Err(error.into()),
            },
        }
    }
    let cases = if args.fail_on.is_empty() {
        Vec::new()
    } else {
        gate_cases(&comparisons, &args.fail_on)?
    };
    let page = match (&comparisons[..], &others[..], &args.output) {
        ([comparison], [other], Some(path)) => Some((
            path,
            ComparisonPage::new(comparison, base, other, &find_left)?.render()?,
        )),
        _ => None,
    };
    // Nothing replaces an earlier page if nothing was compared.
    if args.output.is_some() == page.is_some() {
        write_files(args, outputs, &cases, page)?;
    }
    show(args, &comparisons, &not_compared)?;
    match &complaints(&cases)[..] {
        [] => all_compared(&comparisons, &not_compared),
        [one] => Err(usage::gate(one)),
        [first, more @ ..] => Err(usage::gate(format!("{first}; and {} more", more.len()))),
    }
}

/// The cases of --fail-on.
///
/// # Errors
/// For reports that cannot be compared, and if none measures the metrics.
fn gate_cases(comparisons: &[Comparison], fail_on: &[FailOn]) -> anyhow::Result<Vec<TestCase>> {
    if let Some(unlike) = comparisons.iter().find(|c| !c.is_judged()) {
        let (base, other) = (unlike.base.display(), unlike.other.display());
        let differences = unlike.differences.join("; ");
        return Err(usage::gate(format!(
            "{base}, {other}: were scored differently ({differences}), so --fail-on cannot \
             compare them"
        )));
    }
    let mut incomplete = comparisons
        .iter()
        .flat_map(|comparison| &comparison.incomplete);
    if let Some((folder, why)) = incomplete.next() {
        let folder = folder.display();
        return Err(usage::gate(format!(
            "{folder}: is incomplete ({why}), so --fail-on cannot compare it"
        )));
    }
    let named = |comparison: &Comparison, case: TestCase| match comparisons.len() {
        1 => case,
        // Names are unique in a file.
        _ => TestCase {
            name: format!("{}: {}", comparison.other.display(), case.name),
            ..case
        },
    };
    let cases = comparisons.iter().flat_map(|comparison| {
        let cases = cases(comparison, fail_on).into_iter();
        cases.map(move |case| named(comparison, case))
    });
    let cases: Vec<_> = cases.collect();
    let mut algorithms = comparisons.iter().flat_map(|c| &c.algorithms);
    let are_measured = algorithms.any(|own| tested_changes(own, fail_on).next().is_some());
    if !are_measured && complaints(&cases).is_empty() {
        return Err(usage::gate("--fail-on: no report measures these metrics"));
    }
    Ok(cases)
}

/// Claims the page and the file of the cases.
fn claim(args: &Args) -> anyhow::Result<Outputs> {
    for (path, ending) in [(&args.output, "html"), (&args.junit, "xml")] {
        if let Some(path) = path
            .as_ref()
            .filter(|path| !files::has_ending(path, ending))
        {
            let words = format!("{}: must end in .{ending}", path.display());
            return Err(usage::wrong(words));
        }
    }
    if args.output.is_some() && args.reports.len() != 2 {
        let words = "-o: the page is of two reports; call svl once for each other report";
        return Err(usage::wrong(words));
    }
    let outputs = [&args.output, &args.junit].into_iter().flatten();
    if let Some(path) = outputs.clone().find(|path| is_in_report(path)) {
        let words = "is in the folder of a report, whose files svl replaces; name another place";
        return Err(usage::wrong(format!("{}: {words}", path.display())));
    }
    Ok(Outputs::claim(
        args.force,
        [],
        outputs.map(PathBuf::as_path),
    )?)
}

/// True for a file in the folder of a report.
fn is_in_report(file: &Path) -> bool {
    let folder = file.parent().unwrap_or(Path::new(""));
    folder.join("manifest.json").is_file()
}

/// Writes the cases and the page, where they are asked for.
fn write_files(
    args: &Args,
    mut outputs: Outputs,
    cases: &[TestCase],
    page: Option<(&PathBuf, String)>,
) -> anyhow::Result<()> {
    outputs.set_aside()?;
    if let Some(path) = &args.junit {
        write(path, junit("svl compare", cases))?;
    }
    if let Some((path, page)) = page {
        write(path, page)?;
    }
    outputs.commit();
    Ok(())
}

/// Prints the comparisons. `not_compared`: the reasons of the reports without one.
fn show(args: &Args, comparisons: &[Comparison], not_compared: &[String]) -> anyhow::Result<()> {
    let joined = |text: &dyn Fn(&Comparison) -> String| {
        let reasons = not_compared
            .iter()
            .map(|why| format!("not comparable: {why}\n"));
        let parts: Vec<_> = reasons.chain(comparisons.iter().map(text)).collect();
        parts.join("\n")
    };
    if args.json {
        print_json(
            &comparisons
                .iter()
                .map(Comparison::judged)
                .collect::<Vec<_>>(),
        )
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
    let failed = cases.iter().filter_map(|case| match &case.result {
        TestResult::Failed(why) => Some(format!("{}: {why}", case.name)),
        _ => None,
    });
    let skipped = cases.iter().filter_map(|case| match &case.result {
        TestResult::Skipped(why) => Some(format!("{}: {why}", case.name)),
        _ => None,
    });
    failed.chain(skipped).collect()
}

/// Fails if a report has nothing that was compared. `reasons`: those without a comparison.
fn all_compared(comparisons: &[Comparison], reasons: &[String]) -> anyhow::Result<()> {
    let without_pairs = comparisons
        .iter()
        .filter(|comparison| !comparison.has_pairs())
        .map(|comparison| {
            let (base, other) = (comparison.base.display(), comparison.other.display());
            format!("{base} and {other}: {other} has no result of the pairs of {base}")
        });
    let reasons: Vec<_> = reasons.iter().cloned().chain(without_pairs).collect();
    if reasons.is_empty() {
        Ok(())
    } else {
        let words = format!("nothing was compared: {}", reasons.join("; "));
        Err(usage::incomplete(words))
    }
}

/// The changes of the metrics of `fail_on`, which has some.
fn tested_changes<'a>(
    algorithm: &'a AlgorithmChange,
    fail_on: &[FailOn],
) -> impl Iterator<Item = (String, &'a Change)> {
    let is_named = |metric: &Metric| {
        let mut named = fail_on.iter().filter_map(|limit| limit.0);
        named.any(|named| named == metric)
    };
    // Times are not tested where all metrics are: the machine varies between runs.
    let are_all = fail_on.iter().any(|limit| limit.0.is_none());
    let is_tested = move |change: &Change| {
        is_named(change.metric) || are_all && change.metric.unit != MetricUnit::Ms
    };
    let changes = algorithm.changes();
    changes.filter(move |(_, change)| is_tested(change))
}

/// A case for the pairs or courses of each algorithm, as more failures leave fewer of them for
/// every metric, and one for each metric of `fail_on`.
fn cases(comparison: &Comparison, fail_on: &[FailOn]) -> Vec<TestCase> {
    let things = (comparison.algorithms.first()).map_or("pair", AlgorithmChange::things);
    let of_pairs = |subject: &str, result| TestCase {
        name: format!("{subject}: {things}s"),
        result,
    };
    let mut cases = Vec::new();
    for algorithm in &comparison.algorithms {
        let subject = algorithm.labels();
        let compared = match (algorithm.failures(), algorithm.pairs) {
            (Some(words), _) => TestResult::Failed(words),
            (None, 0) => TestResult::Skipped(format!("no {things} in common")),
            _ => TestResult::Passed(algorithm.extent()),
        };
        cases.push(of_pairs(&subject, compared));
        let tested = tested_changes(algorithm, fail_on);
        cases.extend(tested.map(|(name, change)| TestCase {
            name: format!("{subject}: {name}"),
            result: test(change, algorithm.blocks, comparison.method.fewest_blocks),
        }));
    }
    let gone = comparison.only_in_base.iter();
    cases.extend(gone.map(|label| {
        let words = format!("is not in {}", comparison.other.display());
        of_pairs(label, TestResult::Failed(words))
    }));
    cases
}

/// The result for a change over that many blocks of pairs.
fn test(change: &Change, blocks: usize, min_blocks: usize) -> TestResult {
    let show = |value| change.metric.show(value);
    let (base, other) = (show(change.base), show(change.other));
    let is_of_pairs = change.metric.is_of_frames();
    match change.judgement {
        Judgement::Worse => TestResult::Failed(format!("became worse, {base} to {other}")),
        _ if change.metric.unit == MetricUnit::Ms => TestResult::Skipped(
            "times of two runs vary with the machine; a [[gate]] of the ratio to another \
             algorithm tests them"
                .to_owned(),
        ),
        Judgement::TooFew if blocks < min_blocks && is_of_pairs => TestResult::Skipped(format!(
            "{base} to {other}, but too few independent pairs for an interval ({blocks} blocks, \
             at least {min_blocks}): score more pairs"
        )),
        Judgement::TooFew if change.is_for_the_worse() => TestResult::Skipped(format!(
            "{base} to {other}, but {} to tell: score more",
            change.too_few_words()
        )),
        Judgement::TooFew => {
            TestResult::Passed(format!("{base} to {other}, {}", change.too_few_words()))
        }
        _ => TestResult::Passed(format!("{base} to {other}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A change without an interval.
    fn change(name: &str, base: f64, other: f64) -> Change {
        Change {
            metric: Metric::find(name).unwrap(),
            base,
            other,
            difference: other - base,
            interval: None,
            judgement: Judgement::TooFew,
        }
    }

    #[test]
    fn too_few_values_leave_only_a_change_for_the_worse_open() {
        let is_open = |name, base, other, blocks| {
            matches!(
                test(&change(name, base, other), blocks, 8),
                TestResult::Skipped(_)
            )
        };
        assert!(is_open("wrong", 0.1, 0.2, 20) && is_open("right", 0.2, 0.1, 20));
        assert!(!is_open("wrong", 0.2, 0.1, 20) && !is_open("right", 0.1, 0.2, 20));
        // Nothing is known of too few blocks.
        assert!(is_open("wrong", 0.2, 0.1, 7) && is_open("right", 0.1, 0.2, 7));
    }
}
