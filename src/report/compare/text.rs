//! A comparison in words: at most three sentences and its tables, for terminal, Markdown and page.

use super::join::map_options;
use super::{AlgorithmChange, Change, Comparison, Conclusion, Judgement, ReportOrigin};
use crate::results::caution;
use crate::table::{
    NONE, Table, TableCell, TableColumn, TerminalStyle, escape, escape_prose, wrapped,
};
use std::fmt::{self, Display, Formatter};
use svl_core::{counted, joined};
use svl_score::judge::{Better, ColumnChoice, Metric, MetricOrigin, MetricUnit, RunKind};

/// Limit of the changes that a sentence lists: of one direction, and of each of both.
const MAX_LISTED: [usize; 2] = [2, 1];
/// Limit of the changes in Markdown, with the line of what is not compared.
const MAX_LINES: usize = 4;

impl Conclusion {
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Better => "better",
            Self::Worse => "worse",
            Self::Mixed => "mixed",
            Self::NoChange => "no change",
            Self::TooFewPairs => "too few pairs",
            Self::TooFewCourses => "too few courses",
            Self::NotComparable => "not comparable",
        }
    }
}

impl Comparison {
    /// The verdict: its word, then what changed, by how much, and whether that is real.
    pub(super) fn sentence(&self) -> String {
        let ranked = self.ranked();
        let pairs = self.pairs_words();
        let tested = format!("at {} over {pairs}", self.method.level);
        let fewest = self.method.fewest_blocks;
        let reason = match self.conclusion {
            Conclusion::NotComparable if !self.is_judged() => {
                let differences = self.differences.join("; ");
                format!("scored differently ({differences}): nothing is called better or worse")
            }
            Conclusion::NotComparable => "they have no headline metric in common".to_owned(),
            Conclusion::TooFewPairs => format!(
                "{pairs} are in fewer than {fewest} independent blocks, so there is no interval; \
                 score more pairs"
            ),
            Conclusion::TooFewCourses => {
                format!("fewer than {fewest} of {pairs} differ; drive more, as with --seeds 1..100")
            }
            Conclusion::NoChange if self.are_equal() => {
                format!("the results of {pairs} are equal to the bit")
            }
            Conclusion::NoChange => {
                let metrics = counted(ranked.len(), "headline metric");
                format!("none of {metrics} differs {tested}")
            }
            Conclusion::Better | Conclusion::Worse | Conclusion::Mixed => {
                let is_mixed = self.conclusion == Conclusion::Mixed;
                let list = |judgement, word: &str| {
                    let list = listed(&ranked, judgement, MAX_LISTED[usize::from(is_mixed)])?;
                    Some(if is_mixed {
                        format!("{word}: {list}")
                    } else {
                        list
                    })
                };
                let [worse, better] = [(Judgement::Worse, "worse"), (Judgement::Better, "better")]
                    .map(|(judgement, word)| list(judgement, word));
                let real = worse.is_some() || better.is_some();
                let real = real.then(|| format!("real {tested}"));
                let failures = self
                    .algorithms
                    .iter()
                    .filter_map(|own| Some(format!("{} {}", own.title(), own.failures()?)));
                let parts = failures.chain(worse).chain(better).chain(real);
                parts.collect::<Vec<_>>().join("; ")
            }
        };
        let besides = match self.conclusion {
            Conclusion::Better | Conclusion::NoChange => self.named(AlgorithmChange::besides),
            _ => Vec::new(),
        };
        let besides = listed(&besides, Judgement::Worse, MAX_LISTED[0]);
        let besides = besides.map_or_else(String::new, |list| format!("; worse besides: {list}"));
        format!("{}: {reason}{besides}", self.conclusion.word())
    }

    /// Algorithms and pairs that are not compared, each with the reason, in a sentence.
    pub(super) fn not_compared(&self) -> Option<String> {
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
        let mut algorithms = self.algorithms.iter();
        let is_partial = algorithms.any(|own| own.has_partial_checkpoints);
        let checkpoints = is_partial.then(|| {
            "checkpoints, which are counted over whole runs: score the same pairs".to_owned()
        });
        let unmatched = self.algorithms.iter().filter(|own| own.unmatched > 0);
        let unmatched = unmatched.map(|own| {
            let pairs = counted(own.unmatched, own.things());
            format!("{pairs} of {} in one report alone", own.title())
        });
        let cure = map_options(&self.proposed_maps);
        let parts = alone.chain(left_out).chain(cells).chain(checkpoints);
        let parts: Vec<_> = parts.chain(unmatched).chain(cure).collect();
        (!parts.is_empty()).then(|| format!("not compared: {}", parts.join("; ")))
    }

    /// Cautions about the verdict, in a sentence: incomplete reports, other pairs before, other
    /// machines.
    pub(super) fn caution(&self) -> Option<String> {
        let incomplete = self.incomplete.iter();
        let incomplete =
            incomplete.map(|(folder, why)| format!("{} is incomplete: {why}", folder.display()));
        let with_past = self.algorithms.iter().filter(|own| own.other_past > 0);
        let with_past: Vec<_> = with_past.map(AlgorithmChange::labels).collect();
        let past = (!with_past.is_empty()).then(|| {
            let options = match &self.selections[..] {
                [] => String::new(),
                options => format!(" ({})", options.join(", ")),
            };
            let labels = joined(&with_past);
            format!(
                "the pairs before each pair differ{options}, on which results of {labels} depend"
            )
        });
        let [base, other] = &self.origins;
        let differs = [
            ("svl", base.svl != other.svl),
            ("CPU", base.processor != other.processor),
            ("instruction set", base.isa != other.isa),
            ("threads", base.threads != other.threads),
            ("the timed work", base.times != other.times),
        ];
        let differs: Vec<_> = differs
            .iter()
            .filter(|own| own.1)
            .map(|own| own.0)
            .collect();
        let times = (!differs.is_empty())
            .then(|| format!("ratios of times are of another {}, too", differs.join(", ")));
        let parts: Vec<_> = incomplete.chain(past).chain(times).collect();
        (!parts.is_empty()).then(|| format!("caution: {}", parts.join("; ")))
    }

    /// The sentences, the origins of the two, a row for each algorithm or the table of a single
    /// one; tables of all if `columns` is all.
    pub fn terminal(&self, columns: &ColumnChoice, style: TerminalStyle) -> String {
        let fit = |line: &str, indent| wrapped(line, indent, style.width);
        let mut text = fit(&self.verdict, 7);
        text.extend(self.not_compared().map(|line| fit(&line, 7)));
        text.extend(self.origin_lines().iter().map(|line| fit(line, 7)));
        text.extend(self.caution().map(|line| fit(&line, 7)));
        let is_all = *columns == ColumnChoice::All;
        let is_overview = self.algorithms.len() > 1 && !is_all;
        if is_overview {
            text += &format!("\n{}\n", self.overview(columns).terminal(style));
        } else {
            for own in &self.algorithms {
                let head = fit(&format!("{}: {}", own.title(), own.extent()), 2);
                text += &format!("\n{head}{}\n", own.table(columns).terminal(style));
            }
        }
        let courses = self
            .algorithms
            .iter()
            .filter_map(AlgorithmChange::course_words);
        text.extend(courses.map(|line| fit(&line, 2)));
        text += match (is_all, is_overview) {
            (true, _) => "",
            (_, true) => "more   REPORT#ALGORITHM for intervals, -o FILE.html, --json\n",
            _ => "more   -o FILE.html, --columns all, --json\n",
        };
        text
    }

    /// The origins of the two reports.
    fn origin_lines(&self) -> Vec<String> {
        let [base, other] = &self.origins;
        let names = ["before", "after "];
        let side = |side: usize, folder: &std::path::Path| {
            let caution = caution(&self.truths[side]).map(|words| format!(": {words}"));
            format!(
                "{} {}{}",
                names[side],
                folder.display(),
                caution.unwrap_or_default()
            )
        };
        let (before, after) = (side(0, &self.base), side(1, &self.other));
        if base == other {
            vec![before, after, format!("both   {base}")]
        } else {
            vec![
                before,
                format!("       {base}"),
                after,
                format!("       {other}"),
            ]
        }
    }

    /// The sentences, the changes that matter most, and the two reports: at most ten lines of
    /// Markdown, for a pull request.
    pub fn markdown(&self) -> String {
        let word = self.conclusion.word();
        let reason = escape(self.verdict.strip_prefix(word).unwrap_or_default());
        let mut page = format!("**{word}**{reason}");
        let courses = self
            .algorithms
            .iter()
            .filter_map(AlgorithmChange::course_words);
        let courses = Some(courses.collect::<Vec<_>>().join("; "));
        let courses = courses.filter(|words| !words.is_empty());
        let mut lines = MAX_LINES;
        for said in [self.not_compared(), courses].into_iter().flatten() {
            page += &format!("  \n{}", escape_prose(&said));
            lines -= 1;
        }
        let mut changes = self.named(|own| own.rows(&ColumnChoice::Headline));
        // The sort is stable.
        changes.sort_by_key(|(_, change)| match change.judgement {
            Judgement::Worse => 0,
            Judgement::Better => 1,
            _ => 2,
        });
        let table = change_table(changes.into_iter().take(lines)).markdown();
        let (base, other) = (self.base.display(), self.other.display());
        let caution = self.caution().map(|line| escape(&format!("; {line}")));
        let shown = if self.is_driven() {
            "courses"
        } else {
            "frames"
        };
        page + &format!(
            "\n\n{table}\n{}, `{base}` → `{other}`: {} metrics are tested; `-o FILE.html` shows \
             {shown}{}\n",
            escape(&self.scenario),
            self.tested,
            caution.unwrap_or_default()
        )
    }

    /// The changes of the algorithms, a row each.
    pub(super) fn overview(&self, columns: &ColumnChoice) -> Table {
        let find = |own: &'_ AlgorithmChange, metric: &Metric| {
            own.metrics
                .iter()
                .find(|change| change.metric == metric)
                .cloned()
        };
        let mut metrics = columns.metrics(self.algorithms[0].kind());
        metrics.retain(|metric| {
            self.algorithms
                .iter()
                .any(|own| find(own, metric).is_some())
        });
        let column = |column: TableColumn, is_essential: bool| TableColumn {
            is_optional: !is_essential && *columns == ColumnChoice::Headline,
            ..column
        };
        let mut table = Table::new("", "change");
        table.columns.extend(metrics.iter().map(|metric| {
            let is_tested = metric.better != Better::Neither && metric.unit != MetricUnit::Ms;
            column(TableColumn::text(metric.group, metric.head), is_tested)
        }));
        let things = format!("{}s", self.algorithms[0].things());
        table
            .columns
            .push(column(TableColumn::new("", things), false));
        for own in &self.algorithms {
            let changes = metrics.iter().map(|metric| find(own, metric));
            let cells = changes.map(|change| match change {
                Some(change) => change.judgement.cell(&match change.judgement {
                    Judgement::Equal => String::new(),
                    _ => unitless(change.metric, change.difference),
                }),
                None => TableCell::Text(NONE.to_owned()),
            });
            let [name, pairs] = [own.title(), own.pairs.to_string()].map(TableCell::Text);
            table
                .rows
                .push([name].into_iter().chain(cells).chain([pairs]).collect());
        }
        table
    }

    /// The changes of each algorithm, with its name where there are several.
    pub(super) fn named<'a>(
        &'a self,
        changes: impl Fn(&'a AlgorithmChange) -> Vec<&'a Change>,
    ) -> Vec<(String, &'a Change)> {
        let named = self.algorithms.iter().flat_map(|own| {
            let title = match self.algorithms.len() {
                1 => String::new(),
                _ => own.title() + " ",
            };
            let changes = changes(own).into_iter();
            changes.map(move |change| (title.clone() + &change.name(), change))
        });
        named.collect()
    }

    /// True if all pairs have equal results.
    fn are_equal(&self) -> bool {
        self.algorithms
            .iter()
            .all(|own| own.equal_results == own.pairs)
    }

    /// The numbers of pairs of the algorithms.
    fn pairs_words(&self) -> String {
        let pairs = || self.algorithms.iter().map(|own| own.pairs);
        let (fewest, most) = (pairs().min().unwrap_or(0), pairs().max().unwrap_or(0));
        let things = self
            .algorithms
            .first()
            .map_or("pair", AlgorithmChange::things);
        match fewest == most {
            true => counted(most, things),
            false => format!("{fewest} to {most} {things}s"),
        }
    }
}

/// The changes of that judgement, the first of them with their values: the surest change, but more
/// missed obstacles before all others.
fn listed(changes: &[(String, &Change)], judgement: Judgement, limit: usize) -> Option<String> {
    let own = changes
        .iter()
        .filter(|(_, change)| change.judgement == judgement);
    let mut own: Vec<_> = own.collect();
    let is_other =
        |change: &Change| judgement != Judgement::Worse || change.metric.name != "missed";
    own.sort_by(|(_, a), (_, b)| {
        let surest = b.sureness().total_cmp(&a.sureness());
        is_other(a).cmp(&is_other(b)).then(surest)
    });
    let words = own.iter().take(limit).map(|(name, change)| {
        let [base, other] = [change.base, change.other].map(|value| change.metric.show(value));
        let magnitude = if change.metric.is_signed() {
            " in magnitude"
        } else {
            ""
        };
        let difference = signed(change.metric, change.difference);
        format!("{name} {base} → {other} ({difference}{magnitude})")
    });
    let listed = words.collect::<Vec<_>>().join(", ");
    match own.len().saturating_sub(limit) {
        _ if own.is_empty() => None,
        0 => Some(listed),
        more => Some(format!("{listed} and {more} more")),
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
    pub(super) fn shown(&self, columns: &ColumnChoice) -> Vec<&Change> {
        let metrics = columns.metrics(self.kind());
        let changes = self.changes();
        changes
            .filter(|change| metrics.contains(&change.metric))
            .collect()
    }

    /// The changes for the worse that are not in the headline.
    fn besides(&self) -> Vec<&Change> {
        let headline = ColumnChoice::Headline.metrics(self.kind());
        let worse = self
            .changes()
            .filter(|change| change.judgement == Judgement::Worse);
        worse
            .filter(|change| !headline.contains(&change.metric))
            .collect()
    }

    /// The changes that a table of these columns has: below those of the headline are others for
    /// the worse.
    fn rows(&self, columns: &ColumnChoice) -> Vec<&Change> {
        let mut rows = self.shown(columns);
        if *columns == ColumnChoice::Headline {
            rows.extend(self.besides());
        }
        rows
    }

    pub(super) fn table(&self, columns: &ColumnChoice) -> Table {
        let rows = self.rows(columns).into_iter();
        change_table(rows.map(|change| (change.name(), change)))
    }

    /// The label of the algorithm, or those of two.
    pub(super) fn labels(&self) -> String {
        match self.other_algorithm == self.algorithm {
            true => self.algorithm.clone(),
            false => format!("{} → {}", self.algorithm, self.other_algorithm),
        }
    }

    /// The subject of the comparison: one algorithm, or two.
    pub(super) fn title(&self) -> String {
        match self.other_algorithm != self.algorithm || self.same_parameters {
            true => self.labels(),
            false => format!("{} (other parameters)", self.algorithm),
        }
    }

    /// The things that are compared: pairs, or the courses of drives.
    pub(super) fn things(&self) -> &'static str {
        match self.courses {
            Some(_) => "course",
            None => "pair",
        }
    }

    /// The courses that changed, in a line.
    fn course_words(&self) -> Option<String> {
        let words = self.courses.as_ref()?.words();
        (!words.is_empty()).then(|| format!("{}: {words}", self.title()))
    }

    /// Pairs that the second report alone failed on, in words.
    pub(super) fn failures(&self) -> Option<String> {
        let pairs = counted(self.newly_failed, "pair");
        (self.newly_failed > 0).then(|| format!("failed on {pairs} that the base has results for"))
    }

    /// The pairs that are compared.
    pub(super) fn extent(&self) -> String {
        let pairs = counted(self.pairs, self.things());
        format!("{pairs}, {} with equal results", self.equal_results)
    }
}

impl Judgement {
    /// The answer to whether a change is real.
    fn word(self) -> &'static str {
        match self {
            Self::Equal => "equal",
            Self::Better => "better",
            Self::Worse => "WORSE",
            Self::Differs => "differs",
            Self::Unjudged => "untested",
            Self::Unclear => "no",
            // The place of the interval says so.
            Self::TooFew => NONE,
        }
    }

    /// A difference with its word, where it has been told from chance.
    fn cell(self, difference: &str) -> TableCell {
        let word = match self {
            Self::Unjudged | Self::Unclear | Self::TooFew if !difference.is_empty() => "",
            _ => self.word(),
        };
        let text = format!("{difference} {word}").trim().to_owned();
        match self {
            Self::Worse => TableCell::Alert(text),
            _ => TableCell::Text(text),
        }
    }
}

/// A row per change.
fn change_table<'a>(changes: impl Iterator<Item = (String, &'a Change)>) -> Table {
    let table = Table::new("", "metric").with_columns(["before", "after", "change"]);
    let mut table = table.with_texts(["95 % interval", "real?"]);
    for (name, change) in changes {
        let metric = change.metric;
        let [base, other] = [change.base, change.other].map(|value| match metric.is_signed() {
            true => metric.show(value.abs()),
            false => metric.show(value),
        });
        let name = name
            + if metric.is_signed() {
                ", magnitude"
            } else {
                ""
            };
        let interval = match (change.judgement, change.interval) {
            (_, Some((low, high))) => {
                // The unit is beside it.
                format!("{} .. {}", unitless(metric, low), unitless(metric, high))
            }
            (Judgement::TooFew, None) => change.too_few_words().to_owned(),
            (_, None) => NONE.to_owned(),
        };
        let difference = signed(metric, change.difference);
        let cells = [name, base, other, difference, interval].map(TableCell::Text);
        table.rows.push(
            cells
                .into_iter()
                .chain([change.judgement.cell("")])
                .collect(),
        );
    }
    table.remove_empty_columns();
    table
}

impl Change {
    /// The things of which there are too few for an interval.
    pub(super) fn too_few_words(&self) -> &'static str {
        match self.metric.origin {
            MetricOrigin::Checkpoints => "too few frames",
            MetricOrigin::Drives(_) => "too few courses",
            _ => "too few pairs",
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_that_rounds_to_0_keeps_its_side() {
        let wrong = Metric::find("wrong").unwrap();
        let shown = [-0.003, -0.0001, 0.0, 0.0001].map(|value| unitless(wrong, value));
        assert_eq!(shown, ["-0.3", "-0.0", "+0.0", "+0.0"]);
    }
}
