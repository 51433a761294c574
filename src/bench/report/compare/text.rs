//! A comparison on the terminal and as Markdown.

use super::{AlgorithmChange, Change, Comparison, Judgement, ReportOrigin};
use crate::report::summary::caution;
use crate::report::table::{Table, TableCell, TerminalStyle, escape, wrapped};
use svl_core::counted;
use svl_data::bootstrap::Interval;
use svl_data::score::{Metric, MetricUnit};

impl Comparison {
    /// The origins of the two, a table for each algorithm, and what is not compared.
    pub fn terminal(&self, style: TerminalStyle) -> String {
        let mut text = self.head().join("\n") + "\n";
        for of in &self.algorithms {
            let head = format!("{}: {}", of.title(), of.extent());
            let head = wrapped(&head, 2, style.width);
            text.push_str(&format!("\n{head}{}", of.table().terminal(style)));
        }
        for line in self.left_out() {
            text.push_str(&format!("\n{}", wrapped(&line, 2, style.width)));
        }
        text
    }

    /// The same as Markdown, for a pull request.
    pub fn markdown(&self) -> String {
        let (base, other) = (self.base.display(), self.other.display());
        let mut page = format!("### {}: `{base}` → `{other}`\n\n", self.scenario);
        for line in self.head() {
            page.push_str(&format!("{line}  \n"));
        }
        for of in &self.algorithms {
            let (title, extent) = (escape(&of.title()), escape(&of.extent()));
            let table = of.table().markdown();
            page.push_str(&format!("\n**{title}**: {extent}\n\n{table}"));
        }
        for line in self.left_out() {
            page.push_str(&format!("\n{}\n", escape(&line)));
        }
        page
    }

    /// The algorithms of one report alone, a line each report.
    fn left_out(&self) -> impl Iterator<Item = String> {
        let sides = [
            (&self.only_in_base, &self.base),
            (&self.only_in_other, &self.other),
        ];
        let sides = sides.into_iter().filter(|(labels, _)| !labels.is_empty());
        sides.map(|(labels, folder)| {
            let folder = folder.display();
            format!("only in {folder}, not compared: {}", labels.join(", "))
        })
    }

    /// Origin of the two reports, and the reasons that forbid a judgement.
    pub(super) fn head(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let sides = [("base ", &self.base), ("other", &self.other)];
        for (((name, folder), truths), origin) in sides.iter().zip(&self.truths).zip(&self.origins)
        {
            let caution = caution(truths).map_or_else(String::new, |words| format!(": {words}"));
            lines.push(format!("{name}  {}{caution}", folder.display()));
            let ReportOrigin {
                svl,
                processor,
                isa,
                threads,
                times: _,
            } = origin;
            let threads = counted(*threads, "thread");
            lines.push(format!("       svl {svl}, {processor}, {isa}, {threads}"));
        }
        let [base, other] = &self.origins;
        let differs = [
            ("svl", base.svl != other.svl),
            ("CPU", base.processor != other.processor),
            ("instruction set", base.isa != other.isa),
            ("threads", base.threads != other.threads),
            ("what was timed", base.times != other.times),
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
        lines
    }
}

impl AlgorithmChange {
    /// Pairs that the second run alone failed on, in words.
    pub fn failures(&self) -> Option<String> {
        let pairs = counted(self.newly_failed as u64, "pair");
        (self.newly_failed > 0).then(|| format!("failed on {pairs} that the base has results of"))
    }

    /// The pairs that are compared, and those that are not.
    fn extent(&self) -> String {
        let pairs = counted(self.pairs, "pair");
        let compared = format!("{pairs}, {} with equal results", self.equal_results);
        let unmatched = (self.unmatched > 0).then(|| {
            let pairs = counted(self.unmatched, "pair");
            format!("not compared: {pairs} of one run alone")
        });
        let parts = [Some(compared), unmatched, self.failures()];
        parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
    }

    fn table(&self) -> Table {
        change_table(["base", "other"], self.changes())
    }
}

/// A row per change; `heads` are of the values before and after.
pub(crate) fn change_table<'a>(
    heads: [&str; 2],
    changes: impl Iterator<Item = (String, &'a Change)>,
) -> Table {
    let table = Table::new("", "metric").with_columns(heads.into_iter().chain(["change"]));
    let mut table = table.with_texts(["95 % interval", "result"]);
    for (name, change) in changes {
        let metric = change.metric;
        let [base, other] = [change.base, change.other].map(|value| metric.show(value));
        let interval = change.interval.map(|interval| between(metric, interval));
        let interval = interval.unwrap_or_else(|| "too few pairs".to_owned());
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

/// An interval of differences, its unit once.
fn between(metric: &Metric, (low, high): Interval) -> String {
    let [low, high] = [low, high].map(|value| signed(metric, value));
    let low = low.split(' ').next().unwrap_or_default();
    format!("{low} .. {high}")
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

/// A word for what was found; none where that is nothing.
fn verdict(judgement: Judgement) -> &'static str {
    match judgement {
        Judgement::Unclear => "",
        Judgement::Equal => "equal",
        Judgement::Better => "better",
        Judgement::Worse => "WORSE",
        Judgement::Differs => "differs",
    }
}
