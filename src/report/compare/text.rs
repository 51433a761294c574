//! A comparison on the terminal and as Markdown.

use super::matched::map_options;
use super::{AlgorithmChange, Change, Comparison, Judgement, ReportOrigin};
use crate::results::caution;
use crate::table::{
    NONE, Table, TableCell, TableColumn, TerminalStyle, escape, escape_prose, wrapped,
};
use std::fmt::{self, Display, Formatter};
use svl_core::counted;
use svl_score::bootstrap::Interval;
use svl_score::judge::{Better, ColumnChoice, Metric, MetricUnit, TruthLevel};

/// Limit of the metrics that are listed as worse besides the headline.
const MAX_BESIDES: usize = 3;
/// Limit of the changes in Markdown, with the line of what is not compared.
const MAX_LINES: usize = 4;

impl Comparison {
    /// The verdict, parts that are not compared, the origins of the two, a row for each algorithm
    /// or the table of a single one; tables of all if `columns` is all.
    pub fn terminal(&self, columns: &ColumnChoice, style: TerminalStyle) -> String {
        let fit = |line: String| wrapped(&line, 7, style.width);
        let lines = [self.verdict()].into_iter();
        let lines = lines.chain(self.not_compared()).chain(self.origin_lines());
        let mut text: String = lines.chain(self.cautions()).map(fit).collect();
        let is_all = *columns == ColumnChoice::All;
        if self.algorithms.len() > 1 && !is_all {
            let table = self.overview(columns).terminal(style);
            text.push_str(&format!("\n{table}\n"));
        } else {
            for algorithm in &self.algorithms {
                let head = wrapped(
                    &format!("{}: {}", algorithm.title(), algorithm.extent()),
                    2,
                    style.width,
                );
                let table = change_table(["before", "after"], algorithm.shown(columns).into_iter());
                text.push_str(&format!("\n{head}{}\n", table.terminal(style)));
            }
        }
        let courses = self.algorithms.iter();
        let courses = courses.filter_map(AlgorithmChange::course_words);
        text.extend(courses.map(|line| wrapped(&line, 2, style.width)));
        if *columns == ColumnChoice::Headline {
            let besides = self.algorithms.iter();
            let besides = besides.filter_map(AlgorithmChange::besides_words);
            text.extend(besides.map(|line| wrapped(&line, 2, style.width)));
        }
        match self.algorithms.len() {
            _ if is_all => {}
            1 => text.push_str("more   -o FILE.html, --columns all, --json\n"),
            _ => text.push_str("more   REPORT#ALGORITHM for intervals, -o FILE.html, --json\n"),
        }
        text
    }

    /// The changes of the algorithms, a row each.
    pub(super) fn overview(&self, columns: &ColumnChoice) -> Table {
        let has = |metric: &&Metric| {
            let mut changes = self
                .algorithms
                .iter()
                .flat_map(|algorithm| &algorithm.metrics);
            changes.any(|change| change.metric == *metric)
        };
        let metrics = columns.metrics(self.algorithms[0].kind()).into_iter();
        let metrics: Vec<_> = metrics.filter(has).collect();
        let optional = |column| TableColumn {
            is_optional: *columns == ColumnChoice::Headline,
            ..column
        };
        let mut table = Table::new("", "change");
        table.columns.extend(metrics.iter().map(|metric| {
            let column = TableColumn::text(metric.group, metric.head);
            match metric.better {
                Better::Neither => optional(column),
                _ if metric.unit == MetricUnit::Ms => optional(column),
                _ => column,
            }
        }));
        let things = format!("{}s", self.algorithms[0].things());
        table.columns.push(optional(TableColumn::new("", &things)));
        for algorithm in &self.algorithms {
            let cell = |metric: &&Metric| {
                let change = algorithm
                    .metrics
                    .iter()
                    .find(|change| change.metric == *metric);
                change.map_or_else(|| TableCell::Text(NONE.to_owned()), Change::cell)
            };
            let changes = metrics.iter().map(cell);
            let [name, pairs] =
                [algorithm.title(), algorithm.pairs.to_string()].map(TableCell::Text);
            table
                .rows
                .push([name].into_iter().chain(changes).chain([pairs]).collect());
        }
        table
    }

    /// The verdict, the changes that matter most, and the two reports: at most ten lines of
    /// Markdown, for a pull request.
    pub fn markdown(&self) -> String {
        let conclusion = self.conclusion();
        let reason = escape(&self.verdict_reason(conclusion));
        let mut page = format!("**{}**: {reason}", conclusion.word());
        let not_compared: Vec<_> = self.not_compared().collect();
        let courses = self.algorithms.iter();
        let courses: Vec<_> = courses.filter_map(AlgorithmChange::course_words).collect();
        let mut lines = MAX_LINES;
        for said in [not_compared, courses] {
            if !said.is_empty() {
                page.push_str(&format!("  \n{}", escape_prose(&said.join("; "))));
                lines -= 1;
            }
        }
        let changes = self.leading_changes(lines);
        let table = change_table(["before", "after"], changes.into_iter()).markdown();
        page.push_str(&format!("\n\n{table}\n{}\n", self.footer()));
        page
    }

    /// The headline's changes that are worse, then those that are better, then what is worse
    /// besides, then the others.
    fn leading_changes(&self, count: usize) -> Vec<(String, &Change)> {
        let headline = || self.named_changes(&ColumnChoice::Headline).into_iter();
        let of_judgement = |judgement| {
            headline().filter(move |(_, change): &(String, &Change)| change.judgement == judgement)
        };
        let besides = self.algorithms.iter().flat_map(|algorithm| {
            let besides = algorithm.worse_besides().into_iter();
            besides.map(|(name, change)| (self.name(algorithm, &name), change))
        });
        let is_rest = |(_, change): &(String, &Change)| {
            !matches!(change.judgement, Judgement::Worse | Judgement::Better)
        };
        let worse = of_judgement(Judgement::Worse).chain(of_judgement(Judgement::Better));
        let all = worse.chain(besides).chain(headline().filter(is_rest));
        all.take(count).collect()
    }

    /// The name of a change, with that of its algorithm where there are several.
    pub(super) fn name(&self, algorithm: &AlgorithmChange, name: &str) -> String {
        match self.algorithms.len() {
            1 => name.to_owned(),
            _ => format!("{} {name}", algorithm.title()),
        }
    }

    /// The origin of the numbers of the Markdown, in a line.
    fn footer(&self) -> String {
        let (base, other) = (self.base.display(), self.other.display());
        let count = |judgement| {
            let changes = self.algorithms.iter().flat_map(AlgorithmChange::changes);
            changes
                .filter(|(_, change)| change.judgement == judgement)
                .count()
        };
        let (better, worse) = (count(Judgement::Better), count(Judgement::Worse));
        let scenario = escape(&self.scenario);
        let counts = format!(
            "{better} better and {worse} worse of {} metrics",
            self.tested
        );
        let cautions: String = self
            .cautions()
            .map(|line| format!(". {}", escape(&line)))
            .collect();
        let shown = if self.is_driven() {
            "courses"
        } else {
            "frames"
        };
        format!(
            "{scenario}, `{base}` → `{other}`: {counts}; `-o FILE.html` shows {shown}{cautions}"
        )
    }

    /// Algorithms and pairs that are not compared, each with the reason.
    pub(super) fn not_compared(&self) -> impl Iterator<Item = String> {
        let sides = [
            (&self.only_in_base, &self.base),
            (&self.only_in_other, &self.other),
        ];
        let sides = sides.into_iter().filter(|(labels, _)| !labels.is_empty());
        let alone = sides
            .map(|(labels, folder)| format!("{}, only in {}", labels.join(", "), folder.display()));
        let left_out = (!self.left_out.is_empty())
            .then(|| format!("{}, whose namesake --map names", self.left_out.join(", ")));
        let cells = self.without_cells.iter();
        let cells = cells.map(|why| format!("errors of distances: {why}"));
        let checkpoints = self
            .algorithms
            .iter()
            .any(|own| own.has_partial_checkpoints);
        let checkpoints = checkpoints.then(|| {
            "checkpoints, which are counted over whole runs: score the same pairs".to_owned()
        });
        let lines = alone.chain(left_out).chain(cells).chain(checkpoints);
        let lines = lines.map(|words| format!("not compared: {words}"));
        let cure = (!self.proposed_maps.is_empty()).then(|| {
            let options = map_options(&self.proposed_maps);
            format!("add `{options}` to compare other parameters")
        });
        let algorithms = self.algorithms.iter();
        lines
            .chain(cure)
            .chain(algorithms.filter_map(AlgorithmChange::missing))
    }

    /// The origins of the two reports.
    fn origin_lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let sides = [("before", &self.base), ("after ", &self.other)];
        let [base, other] = &self.origins;
        let is_one = base == other;
        for (((name, folder), truths), origin) in sides.iter().zip(&self.truths).zip(&self.origins)
        {
            let caution = caution(truths).map_or_else(String::new, |words| format!(": {words}"));
            lines.push(format!("{name} {}{caution}", folder.display()));
            if !is_one {
                lines.push(format!("       {origin}"));
            }
        }
        if is_one {
            lines.push(format!("both   {base}"));
        }
        lines
    }

    /// Cautions about the verdict: other machines, incomplete reports.
    pub(super) fn cautions(&self) -> impl Iterator<Item = String> {
        let [base, other] = &self.origins;
        let differs = [
            ("svl", base.svl != other.svl),
            ("CPU", base.processor != other.processor),
            ("instruction set", base.isa != other.isa),
            ("threads", base.threads != other.threads),
            ("the timed work", base.times != other.times),
        ];
        let differs: Vec<_> = differs.iter().filter(|d| d.1).map(|d| d.0).collect();
        let times = (!differs.is_empty()).then(|| {
            let what = differs.join(", ");
            format!("Different: {what}; ratios of times are of that, too.")
        });
        let incomplete = self.incomplete.iter();
        let incomplete =
            incomplete.map(|(folder, why)| format!("{} is incomplete: {why}", folder.display()));
        incomplete.chain(times)
    }
}

impl Display for ReportOrigin {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let threads = counted(self.threads, "thread");
        write!(
            f,
            "svl {}, {}, {}, {threads}",
            self.svl, self.processor, self.isa
        )
    }
}

impl AlgorithmChange {
    /// The kind of the runs by what was measured.
    fn kind(&self) -> TruthLevel {
        TruthLevel::from_measured(|name| {
            self.metrics.iter().any(|change| change.metric.name == name)
        })
    }

    /// The changes of these columns; of checkpoints where their column is one.
    pub(super) fn shown(&self, columns: &ColumnChoice) -> Vec<(String, &Change)> {
        let metrics = columns.metrics(self.kind());
        let is_shown = |(_, change): &(String, &Change)| metrics.contains(&change.metric);
        self.changes().filter(is_shown).collect()
    }

    /// The changes for the worse that are not in the headline, the surest first.
    pub(super) fn worse_besides(&self) -> Vec<(String, &Change)> {
        let metrics = ColumnChoice::Headline.metrics(self.kind());
        let mut worse: Vec<_> = self
            .changes()
            .filter(|(_, change)| {
                change.judgement == Judgement::Worse && !metrics.contains(&change.metric)
            })
            .collect();
        // Stable: of equally sure ones the first.
        worse.sort_by(|(_, a), (_, b)| b.certainty().total_cmp(&a.certainty()));
        worse
    }

    fn besides_words(&self) -> Option<String> {
        let worse = self.worse_besides();
        let shown = worse.iter().take(MAX_BESIDES);
        let shown: Vec<_> = shown
            .map(|(name, change)| format!("{name} {}", change.difference_words()))
            .collect();
        let more = match worse.len().saturating_sub(MAX_BESIDES) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let words = shown.join(", ");
        (!worse.is_empty()).then(|| format!("{}: WORSE besides: {words}{more}", self.title()))
    }

    /// Pairs that the second run alone failed on, in words.
    pub fn failures(&self) -> Option<String> {
        let pairs = counted(self.newly_failed as u64, "pair");
        (self.newly_failed > 0).then(|| format!("failed on {pairs} that the base has results for"))
    }

    /// The pairs that are compared.
    pub fn extent(&self) -> String {
        let pairs = counted(self.pairs, self.things());
        format!("{pairs}, {} with equal results", self.equal_results)
    }

    /// The pairs that are not compared.
    fn missing(&self) -> Option<String> {
        let title = self.title();
        let unmatched = (self.unmatched > 0).then(|| {
            let pairs = counted(self.unmatched, self.things());
            format!("not compared: {pairs} of {title} in one report alone")
        });
        let failures = self.failures().map(|words| format!("{title}: {words}"));
        let parts: Vec<_> = [unmatched, failures].into_iter().flatten().collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

impl Change {
    /// The values and the difference.
    pub(super) fn words(&self) -> String {
        let [base, other] = [self.base, self.other].map(|value| self.metric.show(value));
        format!("{base} → {other} ({})", self.difference_words())
    }

    fn difference_words(&self) -> String {
        let difference = signed(self.metric, self.difference);
        match self.metric.better {
            Better::Zero => format!("{difference} in magnitude"),
            _ => difference,
        }
    }

    /// The difference in widths of its interval.
    fn certainty(&self) -> f64 {
        let width = self
            .interval
            .map_or(f64::INFINITY, |(low, high)| high - low);
        self.difference.abs() / width
    }

    /// The answer to whether the change is real.
    fn is_real_words(&self) -> &'static str {
        match self.judgement {
            Judgement::Equal => "equal",
            Judgement::Better => "better",
            Judgement::Worse => "WORSE",
            Judgement::Differs => "differs",
            Judgement::Unjudged => "untested",
            Judgement::Unclear => "no",
            // The place of the interval says so.
            Judgement::TooFew => NONE,
        }
    }

    /// The difference and its name.
    fn cell(&self) -> TableCell {
        let number = unitless(self.metric, self.difference);
        match self.judgement {
            Judgement::Equal => TableCell::Text("equal".to_owned()),
            Judgement::Worse => TableCell::Alert(format!("{number} {}", verdict(self.judgement))),
            other => TableCell::Text(format!("{number} {}", verdict(other)).trim_end().to_owned()),
        }
    }
}

/// A row per change; `heads` are of the values before and after.
pub(super) fn change_table<'a>(
    heads: [&str; 2],
    changes: impl Iterator<Item = (String, &'a Change)>,
) -> Table {
    let table = Table::new("", "metric").with_columns(heads.into_iter().chain(["change"]));
    let mut table = table.with_texts(["95 % interval", "real?"]);
    for (name, change) in changes {
        let metric = change.metric;
        let is_magnitude = metric.better == Better::Zero;
        let value = |value: f64| metric.show(if is_magnitude { value.abs() } else { value });
        let [base, other] = [change.base, change.other].map(value);
        let name = if is_magnitude {
            format!("{name}, magnitude")
        } else {
            name
        };
        let interval = match (change.judgement, change.interval) {
            (_, Some(interval)) => between(metric, interval),
            (Judgement::TooFew, None) => change.too_few_words().to_owned(),
            (_, None) => NONE.to_owned(),
        };
        let difference = signed(metric, change.difference);
        let cells = [name, base, other, difference, interval];
        let real = change.is_real_words().to_owned();
        let real = match change.judgement {
            Judgement::Worse => TableCell::Alert(real),
            _ => TableCell::Text(real),
        };
        let cells = cells.into_iter().map(TableCell::Text);
        table.rows.push(cells.chain([real]).collect());
    }
    table.remove_empty_columns();
    table
}

/// An interval of differences, beside which their unit is shown.
fn between(metric: &Metric, (low, high): Interval) -> String {
    let [low, high] = [low, high].map(|value| unitless(metric, value));
    format!("{low} .. {high}")
}

fn unitless(metric: &Metric, difference: f64) -> String {
    let text = signed(metric, difference);
    text.split(' ').next().unwrap_or_default().to_owned()
}

/// A difference with its sign, also where it rounds to 0: a bound of `-0.0` excludes 0. Of times a
/// ratio.
pub fn signed(metric: &Metric, v: f64) -> String {
    let shown = metric.show(v.abs());
    match metric.unit {
        MetricUnit::Ms => metric.show_relative(v),
        _ if v < 0.0 => format!("-{shown}"),
        _ => format!("+{shown}"),
    }
}

/// A word for the result; none without a difference.
fn verdict(judgement: Judgement) -> &'static str {
    match judgement {
        Judgement::Unclear | Judgement::TooFew | Judgement::Unjudged => "",
        Judgement::Equal => "equal",
        Judgement::Better => "better",
        Judgement::Worse => "WORSE",
        Judgement::Differs => "differs",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_that_rounds_to_0_keeps_its_side() {
        let wrong = Metric::find("wrong").unwrap();
        assert_eq!(between(wrong, (-0.003, -0.0001)), "-0.3 .. -0.0");
        assert_eq!(between(wrong, (0.0, 0.0001)), "+0.0 .. +0.0");
    }
}
