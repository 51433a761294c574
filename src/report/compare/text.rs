//! A comparison on the terminal and as Markdown.

use super::{AlgorithmChange, Change, Comparison, Judgement, ReportOrigin};
use crate::summary::caution;
use crate::table::{NONE, Table, TableCell, TableColumn, TerminalStyle, escape, wrapped};
use std::fmt::{self, Display, Formatter};
use svl_core::counted;
use svl_score::bootstrap::Interval;
use svl_score::judge::{Better, ColumnChoice, Metric, MetricOrigin, MetricUnit, RunKind};

/// Limit of the metrics that the answer lists of each kind.
const MAX_LISTED: usize = 3;

impl Comparison {
    /// Parts that are not compared, the origins of the two, a row for each algorithm or the table
    /// of a single one; tables of all if `columns` is all.
    pub fn terminal(&self, columns: &ColumnChoice, style: TerminalStyle) -> String {
        let fit = |line: String| wrapped(&line, 7, style.width);
        let mut text: String = self.head().into_iter().map(fit).collect();
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
                let table = change_table(["base", "other"], algorithm.shown(columns).into_iter());
                text.push_str(&format!("\n{head}{}\n", table.terminal(style)));
            }
        }
        let besides = self
            .algorithms
            .iter()
            .flat_map(|algorithm| algorithm.worse_besides(columns));
        for line in besides {
            text.push_str(&wrapped(&line, 2, style.width));
        }
        match self.algorithms.len() {
            _ if is_all => {}
            1 => text.push_str("more   --columns all, --json\n"),
            _ => text.push_str("more   REPORT#ALGORITHM for intervals, --columns all, --json\n"),
        }
        text
    }

    /// The changes of the algorithms, a row each.
    fn overview(&self, columns: &ColumnChoice) -> Table {
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
        table.columns.push(optional(TableColumn::new("", "pairs")));
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

    /// The answer in a sentence: the headline metrics that became worse and better.
    fn answer(&self) -> Option<String> {
        let shown = self.algorithms.iter().flat_map(|algorithm| {
            let shown = algorithm.shown(&ColumnChoice::Headline).into_iter();
            shown.map(|(name, change)| (format!("{} {name}", algorithm.title()), change))
        });
        let is_ranked = |change: &Change| {
            change.metric.better != Better::Neither && change.metric.unit != MetricUnit::Ms
        };
        let changes: Vec<_> = shown.filter(|(_, change)| is_ranked(change)).collect();
        if changes.is_empty() || !self.differences.is_empty() {
            return None;
        }
        let among_all = format!("of {}", counted(changes.len() as u64, "headline metric"));
        let listed = |(judgement, word): (Judgement, &str)| {
            let found = changes
                .iter()
                .filter(|(_, change)| change.judgement == judgement);
            let mut words: Vec<_> = found
                .map(|(name, change)| {
                    format!("{name} {}", signed(change.metric, change.difference))
                })
                .collect();
            let count = words.len();
            if count > MAX_LISTED {
                words.truncate(MAX_LISTED);
                words.push(format!("{} more", count - MAX_LISTED));
            }
            let listed = match self.algorithms.len() {
                1 => String::new(),
                _ => format!(" ({})", words.join(", ")),
            };
            (count > 0).then(|| format!("{word} in {count}{listed}"))
        };
        let parts = [(Judgement::Worse, "worse"), (Judgement::Better, "better")];
        let parts: Vec<_> = parts.into_iter().filter_map(listed).collect();
        let [base, other] = [&self.base, &self.other].map(|folder| folder.display());
        let mut unequal = changes
            .iter()
            .filter(|(_, change)| change.judgement != Judgement::Equal)
            .peekable();
        Some(if !parts.is_empty() {
            format!("{other} is {} {among_all}.", parts.join(" and "))
        } else if unequal.peek().is_none() {
            format!("{other} equals {base} in each {among_all}.")
        } else if unequal.all(|(_, change)| change.interval.is_none()) {
            format!("{other} and {base}: too few pairs to tell; score more pairs.")
        } else {
            format!("{other} and {base}: no significant difference in any {among_all}.")
        })
    }

    /// The same as Markdown, for a pull request.
    pub fn markdown(&self) -> String {
        let (base, other) = (self.base.display(), self.other.display());
        let mut page = format!("### {}: `{base}` → `{other}`\n\n", self.scenario);
        for line in self.head() {
            page.push_str(&format!("{line}  \n"));
        }
        for algorithm in &self.algorithms {
            let (title, extent) = (escape(&algorithm.title()), escape(&algorithm.extent()));
            let table = change_table(["base", "other"], algorithm.changes()).markdown();
            page.push_str(&format!("\n**{title}**: {extent}\n\n{table}"));
        }
        page
    }

    /// Algorithms and pairs that are not compared, a line each report and each algorithm.
    fn not_compared(&self) -> impl Iterator<Item = String> {
        let sides = [
            (&self.only_in_base, &self.base),
            (&self.only_in_other, &self.other),
        ];
        let sides = sides.into_iter().filter(|(labels, _)| !labels.is_empty());
        let alone = sides.map(|(labels, folder)| {
            let folder = folder.display();
            format!("not compared: {}, only in {folder}", labels.join(", "))
        });
        let algorithms = self.algorithms.iter();
        alone.chain(algorithms.filter_map(AlgorithmChange::missing))
    }

    /// Parts that are not compared, origin of the two reports, and the reasons why nothing is
    /// called better or worse.
    fn head(&self) -> Vec<String> {
        let mut lines: Vec<_> = self.not_compared().collect();
        let sides = [("base ", &self.base), ("other", &self.other)];
        let [base, other] = &self.origins;
        let is_one = base == other;
        for (((name, folder), truths), origin) in sides.iter().zip(&self.truths).zip(&self.origins)
        {
            let caution = caution(truths).map_or_else(String::new, |words| format!(": {words}"));
            lines.push(format!("{name}  {}{caution}", folder.display()));
            if !is_one {
                lines.push(format!("       {origin}"));
            }
        }
        if is_one {
            lines.push(format!("both   {base}"));
        }
        let differs = [
            ("svl", base.svl != other.svl),
            ("CPU", base.processor != other.processor),
            ("instruction set", base.isa != other.isa),
            ("threads", base.threads != other.threads),
            ("the timed work", base.times != other.times),
        ];
        let differs: Vec<_> = differs.iter().filter(|d| d.1).map(|d| d.0).collect();
        if !differs.is_empty() {
            let what = differs.join(", ");
            lines.push(format!(
                "Different: {what}; ratios of times are of that, too."
            ));
        }
        let incomplete = self.incomplete.iter();
        lines.extend(
            incomplete.map(|(folder, why)| format!("{} is incomplete: {why}", folder.display())),
        );
        if !self.differences.is_empty() {
            let differences = self.differences.join("; ");
            lines.push(format!(
                "Scored differently ({differences}): nothing is called better or worse."
            ));
        }
        lines.extend(self.answer());
        lines
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
    fn kind(&self) -> RunKind {
        RunKind::from_measured(|name| self.metrics.iter().any(|change| change.metric.name == name))
    }

    /// The changes of these columns; of checkpoints where their column is one.
    fn shown(&self, columns: &ColumnChoice) -> Vec<(String, &Change)> {
        let metrics = columns.metrics(self.kind());
        let is_shown = |(_, change): &(String, &Change)| metrics.contains(&change.metric);
        self.changes().filter(is_shown).collect()
    }

    /// The headline does not show what else became worse.
    fn worse_besides(&self, columns: &ColumnChoice) -> Option<String> {
        let metrics = columns.metrics(self.kind());
        let worse = self.metrics.iter().filter(|change| {
            change.judgement == Judgement::Worse && !metrics.contains(&change.metric)
        });
        let words = |change: &Change| {
            format!(
                "{} {}",
                change.metric.words,
                signed(change.metric, change.difference)
            )
        };
        let words: Vec<_> = worse.map(words).collect();
        let is_shown = *columns == ColumnChoice::Headline && !words.is_empty();
        is_shown.then(|| format!("{}: WORSE besides: {}", self.title(), words.join(", ")))
    }

    /// Pairs that the second run alone failed on, in words.
    pub fn failures(&self) -> Option<String> {
        let pairs = counted(self.newly_failed as u64, "pair");
        (self.newly_failed > 0).then(|| format!("failed on {pairs} that the base has results for"))
    }

    /// The pairs that are compared.
    fn extent(&self) -> String {
        let pairs = counted(self.pairs, "pair");
        format!("{pairs}, {} with equal results", self.equal_results)
    }

    /// The pairs that are not compared.
    fn missing(&self) -> Option<String> {
        let title = self.title();
        let unmatched = (self.unmatched > 0).then(|| {
            let pairs = counted(self.unmatched, "pair");
            format!("not compared: {pairs} of {title} in one report alone")
        });
        let failures = self.failures().map(|words| format!("{title}: {words}"));
        let parts: Vec<_> = [unmatched, failures].into_iter().flatten().collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

impl Change {
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
pub fn change_table<'a>(
    heads: [&str; 2],
    changes: impl Iterator<Item = (String, &'a Change)>,
) -> Table {
    let table = Table::new("", "metric").with_columns(heads.into_iter().chain(["change"]));
    let mut table = table.with_texts(["95 % interval", "result"]);
    for (name, change) in changes {
        let metric = change.metric;
        let [base, other] = [change.base, change.other].map(|value| metric.show(value));
        let interval = change.interval.map(|interval| between(metric, interval));
        let too_few = match metric.origin {
            MetricOrigin::Checkpoints => "too few frames",
            _ => "too few pairs",
        };
        let interval = interval.unwrap_or_else(|| too_few.to_owned());
        let difference = signed(metric, change.difference);
        let cells = [name, base, other, difference, interval];
        let result = verdict(change.judgement).to_owned();
        let result = match change.judgement {
            Judgement::Worse => TableCell::Alert(result),
            _ => TableCell::Text(result),
        };
        let cells = cells.into_iter().map(TableCell::Text);
        table.rows.push(cells.chain([result]).collect());
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

/// A difference with its sign; of times a ratio.
pub fn signed(metric: &Metric, v: f64) -> String {
    // Rounded first, as a small negative value would be shown as -0.0.
    let is_negative = v < 0.0 && !metric.show(-v).starts_with("0.0 ");
    match metric.unit {
        MetricUnit::Ms => metric.show_relative(v),
        _ if is_negative => format!("-{}", metric.show(v.abs())),
        _ => format!("+{}", metric.show(v.abs())),
    }
}

/// A word for the result; none without a difference.
fn verdict(judgement: Judgement) -> &'static str {
    match judgement {
        Judgement::Unclear => "",
        Judgement::Equal => "equal",
        Judgement::Better => "better",
        Judgement::Worse => "WORSE",
        Judgement::Differs => "differs",
    }
}
