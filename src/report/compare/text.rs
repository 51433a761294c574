//! A comparison in words: at most three sentences and its tables, for terminal, Markdown and page.

use super::{AlgorithmChange, Change, Comparison, Conclusion, Join, Judgement};
use crate::results::caution;
use crate::table::{
    NONE, Table, TableCell, TableColumn, TerminalStyle, escape, escape_prose, wrapped,
};
use svl_core::{counted, joined};
use svl_score::judge::{Better, ColumnChoice, Metric, MetricOrigin, MetricUnit, TruthLevel};

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
                    let list = listed(&ranked, judgement, if is_mixed { 1 } else { 2 });
                    list.map(|list| {
                        if is_mixed {
                            format!("{word}: {list}")
                        } else {
                            list
                        }
                    })
                };
                let failures = self.algorithms.iter();
                let failures = failures
                    .filter_map(|own| Some(format!("{} {}", own.labels(), own.failures()?)));
                let mut parts: Vec<_> = failures.collect();
                let failed = parts.len();
                parts.extend(list(Judgement::Worse, "worse"));
                parts.extend(list(Judgement::Better, "better"));
                parts.extend((parts.len() > failed).then(|| format!("real {tested}")));
                parts.join("; ")
            }
        };
        let besides = self.named(AlgorithmChange::besides);
        let besides = listed(&besides, Judgement::Worse, 1);
        let besides = besides.map_or_else(String::new, |list| format!("; worse besides: {list}"));
        format!("{}: {reason}{besides}", self.conclusion.word())
    }

    /// The reasons why algorithms, pairs and metrics are not compared.
    pub(super) fn why_not(&self, join: &Join<'_>) -> Vec<String> {
        let sides = [
            (&self.only_in_base, &self.base),
            (&self.only_in_other, &self.other),
        ];
        let sides = sides.into_iter().filter(|(labels, _)| !labels.is_empty());
        let alone = sides
            .map(|(labels, folder)| format!("{}, only in {}", labels.join(", "), folder.display()));
        let left_out = Some(join.left_out()).filter(|labels| !labels.is_empty());
        let left_out =
            left_out.map(|labels| format!("{}, whose namesake --map names", labels.join(", ")));
        let cells = join
            .runs
            .iter()
            .filter(|run| !join.is_driven && !run.has_cells());
        let cells = cells.map(|run| format!("errors of distances: {}", run.without_cells()));
        let mut algorithms = self.algorithms.iter();
        let is_partial = algorithms.any(|own| own.has_partial_checkpoints);
        let checkpoints = is_partial.then(|| {
            "checkpoints, which are counted over whole runs: score the same pairs".to_owned()
        });
        let unmatched = self.algorithms.iter().filter(|own| own.unmatched > 0);
        let unmatched = unmatched.map(|own| {
            let pairs = counted(own.unmatched, own.things());
            format!("{pairs} of {} in one report alone", own.labels())
        });
        let parts = alone.chain(left_out).chain(cells).chain(checkpoints);
        let mut parts: Vec<_> = parts.chain(unmatched).chain(join.map_options()).collect();
        parts.dedup();
        parts
    }

    /// Doubts about the verdict: incomplete reports, other pairs before, other machines.
    pub(super) fn doubts(&self, join: &Join<'_>) -> Vec<String> {
        let incomplete = self.incomplete.iter();
        let incomplete =
            incomplete.map(|(folder, why)| format!("{} is incomplete: {why}", folder.display()));
        let with_past = self.algorithms.iter().filter(|own| own.other_past > 0);
        let with_past: Vec<_> = with_past.map(AlgorithmChange::labels).collect();
        let past = (!with_past.is_empty()).then(|| {
            let labels = joined(&with_past);
            format!(
                "the pairs before each pair differ, on which results of {labels} depend: score \
                 both with equal --every, --from and --to"
            )
        });
        let work = join
            .runs
            .map(|run| run.manifest.times.as_deref().unwrap_or("other work"));
        let other = [
            (self.origins[0] != self.origins[1]).then(|| "another program or machine".to_owned()),
            (work[0] != work[1]).then(|| format!("{} and then of {}", work[0], work[1])),
        ];
        let other: Vec<_> = other.into_iter().flatten().collect();
        let times = (!other.is_empty())
            .then(|| format!("ratios of times are also those of {}", other.join(", ")));
        incomplete.chain(past).chain(times).collect()
    }

    /// What is not compared, in a sentence, and the cautions in another.
    pub(super) fn remarks(&self) -> [Option<String>; 2] {
        let remarks = [
            ("not compared", &self.not_compared),
            ("caution", &self.cautions),
        ];
        remarks.map(|(word, parts)| {
            (!parts.is_empty()).then(|| format!("{word}: {}", parts.join("; ")))
        })
    }

    /// The sentences, the origins of the two, and of each algorithm the pairs and the changes.
    pub fn terminal(&self, columns: &ColumnChoice, style: TerminalStyle) -> String {
        let [not_compared, caution] = self.remarks();
        let lines = [self.verdict.clone()].into_iter().chain(not_compared);
        let lines = lines.chain(self.origin_lines()).chain(caution);
        let mut text: String = lines.map(|line| wrapped(&line, 7, style.width)).collect();
        let is_short = self.algorithms.len() > 1 && *columns != ColumnChoice::All;
        if is_short {
            text += &format!("\n{}", self.overview(columns).terminal(style));
        }
        for own in &self.algorithms {
            let extent = format!("\n{}: {}", own.title(), own.extent());
            let courses = own.course_words();
            let courses = courses.map(|words| format!("{}: {words}", own.labels()));
            let extent = (!is_short).then_some(extent);
            let lines = extent.into_iter().chain(courses);
            text.extend(lines.map(|line| wrapped(&line, 2, style.width)));
            if !is_short {
                text += &own.table(columns).terminal(style);
            }
        }
        text + "\nmore   -o FILE.html, --columns all, --json\n"
    }

    /// The differences of the algorithms, a row each.
    pub(super) fn overview(&self, columns: &ColumnChoice) -> Table {
        fn find<'a>(own: &'a AlgorithmChange, metric: &Metric) -> Option<&'a Change> {
            own.metrics.iter().find(|change| change.metric == metric)
        }
        let mut metrics = columns.metrics(self.algorithms[0].kind());
        metrics.retain(|metric| {
            self.algorithms
                .iter()
                .any(|own| find(own, metric).is_some())
        });
        let mut table = Table::new("", "change");
        table
            .columns
            .extend(metrics.iter().map(|metric| TableColumn {
                is_optional: *columns == ColumnChoice::Headline && !is_ranked(metric),
                ..TableColumn::text(metric.group, metric.head)
            }));
        table.columns.push(TableColumn {
            is_optional: *columns == ColumnChoice::Headline,
            ..TableColumn::new("", format!("{}s", self.algorithms[0].things()))
        });
        for own in &self.algorithms {
            let cells = metrics.iter().map(|metric| match find(own, metric) {
                Some(change) => change.cell(),
                None => TableCell::Text(NONE.to_owned()),
            });
            let [name, pairs] = [own.title(), own.pairs.to_string()].map(TableCell::Text);
            table
                .rows
                .push([name].into_iter().chain(cells).chain([pairs]).collect());
        }
        table
    }

    /// The origins of the two reports.
    fn origin_lines(&self) -> Vec<String> {
        let caution = |side: usize| caution(&self.truths[side]).map(|words| format!(": {words}"));
        let [a, b] = [0, 1].map(|side| caution(side).unwrap_or_default());
        let mut lines = vec![
            format!("before {}{a}", self.base.display()),
            format!("after  {}{b}", self.other.display()),
        ];
        let [base, other] = &self.origins;
        if base == other {
            lines.push(format!("both   {base}"));
        } else {
            lines.insert(1, format!("       {base}"));
            lines.push(format!("       {other}"));
        }
        lines
    }

    /// The sentences, the changes that matter most, and the two reports: at most ten lines of
    /// Markdown, for a pull request.
    pub fn markdown(&self) -> String {
        let word = self.conclusion.word();
        let reason = escape(self.verdict.strip_prefix(word).unwrap_or_default());
        let courses = self
            .algorithms
            .iter()
            .filter_map(AlgorithmChange::course_words);
        let courses = courses.collect::<Vec<_>>().join("; ");
        let [not_compared, caution] = self.remarks();
        let notes = [
            not_compared,
            Some(courses).filter(|words| !words.is_empty()),
        ];
        let notes: Vec<_> = notes
            .iter()
            .flatten()
            .map(|note| escape_prose(note))
            .collect();
        let mut changes = self.named(|own| own.rows(&ColumnChoice::Headline));
        // The sort is stable.
        changes.sort_by_key(|(_, own)| match own.judgement {
            Judgement::Worse => 0,
            Judgement::Better => 1,
            _ => 2,
        });
        changes.truncate(MAX_LINES - notes.len());
        let count = |judgement| {
            let changes = self.algorithms.iter().flat_map(AlgorithmChange::changes);
            changes.filter(|own| own.judgement == judgement).count()
        };
        let said = [vec![format!("**{word}**{reason}")], notes]
            .concat()
            .join("  \n");
        format!(
            "{said}\n\n{}\n{}, `{}` → `{}`: {} better and {} worse of {} metrics; `-o FILE.html` \
             shows {}{}\n",
            change_table(&changes).markdown(),
            escape(&self.scenario),
            self.base.display(),
            self.other.display(),
            count(Judgement::Better),
            count(Judgement::Worse),
            self.tested,
            if self.is_driven() {
                "courses"
            } else {
                "frames"
            },
            caution.map_or_else(String::new, |line| escape(&format!("; {line}"))),
        )
    }

    /// The changes of each algorithm, with its name where there are several.
    pub(super) fn named<'a>(
        &'a self,
        changes: impl Fn(&'a AlgorithmChange) -> Vec<&'a Change>,
    ) -> Vec<(String, &'a Change)> {
        let named = self.algorithms.iter().flat_map(|own| {
            let title = match self.algorithms.len() {
                1 => String::new(),
                _ => own.labels() + " ",
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
        if fewest == most {
            counted(most, things)
        } else {
            format!("{fewest} to {most} {things}s")
        }
    }
}

/// True for a metric that decides: it has a better direction, and is tested.
pub(super) fn is_ranked(metric: &Metric) -> bool {
    metric.better != Better::Neither && metric.unit != MetricUnit::Ms
}

/// The changes of that judgement, the first of them with their values: the surest change, but more
/// missed obstacles and collisions before all others.
fn listed(changes: &[(String, &Change)], judgement: Judgement, limit: usize) -> Option<String> {
    let own = changes
        .iter()
        .filter(|(_, change)| change.judgement == judgement);
    let mut own: Vec<_> = own.collect();
    let is_other = |change: &Change| {
        judgement != Judgement::Worse || !["missed", "collisions"].contains(&change.metric.name)
    };
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

impl AlgorithmChange {
    /// The kind of the runs by what was measured.
    fn kind(&self) -> TruthLevel {
        TruthLevel::from_measured(|name| {
            self.metrics.iter().any(|change| change.metric.name == name)
        })
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
        change_table(&rows.map(|own| (own.name(), own)).collect::<Vec<_>>())
    }

    /// The label of the algorithm, or those of two.
    pub(super) fn labels(&self) -> String {
        if self.other_algorithm == self.algorithm {
            self.algorithm.clone()
        } else {
            format!("{} → {}", self.algorithm, self.other_algorithm)
        }
    }

    /// The labels, and that one has other parameters.
    pub(super) fn title(&self) -> String {
        let is_other = self.algorithm == self.other_algorithm && !self.same_parameters;
        self.labels() + if is_other { " (other parameters)" } else { "" }
    }

    /// The things that are compared: pairs, or the courses of drives.
    pub(super) fn things(&self) -> &'static str {
        match self.courses {
            Some(_) => "course",
            None => "pair",
        }
    }

    /// The courses that changed, in a line.
    pub(super) fn course_words(&self) -> Option<String> {
        let words = self.courses.as_ref()?.words();
        Some(words).filter(|words| !words.is_empty())
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
}

/// A row per change.
fn change_table(changes: &[(String, &Change)]) -> Table {
    let table = Table::new("", "metric").with_columns(["before", "after", "change"]);
    let mut table = table.with_texts(["95 % interval", "real?"]);
    for (name, change) in changes {
        let metric = change.metric;
        let is_magnitude = metric.is_signed();
        let value = |value: f64| metric.show(if is_magnitude { value.abs() } else { value });
        // The unit is beside it.
        let interval = change.interval;
        let interval = interval.map(|own| [own.0, own.1].map(|bound| unitless(metric, bound)));
        let word = change.judgement.word();
        table.push(
            name.clone() + if is_magnitude { ", magnitude" } else { "" },
            [
                value(change.base),
                value(change.other),
                signed(metric, change.difference),
                match (change.judgement, interval) {
                    (_, Some(bounds)) => bounds.join(" .. "),
                    (Judgement::TooFew, None) => change.too_few_words().to_owned(),
                    (_, None) => NONE.to_owned(),
                },
                word.to_owned(),
            ],
        );
        if let (Judgement::Worse, Some(row)) = (change.judgement, table.rows.last_mut()) {
            row[5] = TableCell::Alert(word.to_owned());
        }
    }
    table.remove_empty_columns();
    table
}

impl Change {
    /// The difference, and the word of one that has been told from chance.
    fn cell(&self) -> TableCell {
        let difference = unitless(self.metric, self.difference);
        let word = self.judgement.word();
        match self.judgement {
            Judgement::Equal => TableCell::Text(word.to_owned()),
            Judgement::Worse => TableCell::Alert(format!("{difference} {word}")),
            Judgement::Better | Judgement::Differs => {
                TableCell::Text(format!("{difference} {word}"))
            }
            _ => TableCell::Text(difference),
        }
    }

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
