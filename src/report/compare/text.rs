//! A comparison in words: at most three sentences and its tables, for terminal, Markdown and page.

use super::comparison::{AlgorithmChange, Comparison, Conclusion};
use super::courses::CourseChanges;
use super::join::{Join, MAP};
use super::scored_run::ScoredRun;
use crate::pages::summary_tables::accuracy_tables;
use crate::results::change::{Change, Judgement, is_ranked};
use crate::results::summary::caution;
use crate::show::table::markdown::{escape, escape_prose};
use crate::show::table::model::{Table, TableCell, TableColumn};
use crate::show::table::terminal::{TerminalStyle, wrapped};
use crate::show::words::NONE;
use crate::subjects::accuracy::AccuracyRow;
use svl_core::{counted, joined};
use svl_score::judge::{ColumnChoice, Metric, MetricOrigin, MetricUnit, TruthLevel};

/// The unit of differences of shares.
const POINTS: &str = "points";
/// Limit of the changes in Markdown, with the line of what is not compared.
const MAX_LINES: usize = 4;

impl Conclusion {
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Better => "better",
            Self::Worse => "worse",
            Self::Mixed => "mixed",
            Self::NoChange => "no change",
            Self::NotToldApart => "not told apart",
            Self::FewInCommon => "few in common",
            Self::TooFewPairs => "too few pairs",
            Self::TooFewCourses => "too few courses",
            Self::NotComparable => "not comparable",
        }
    }
}

impl Comparison {
    /// The verdict: its word, then what changed, by how much, and whether that is real.
    pub(super) fn sentence(&self) -> String {
        let (pairs, ranked) = (self.pairs_words(), self.ranked());
        let fewest = self.method.fewest_blocks;
        let level = match self.tested {
            0 | 1 => self.method.level.to_owned(),
            _ => format!("{} (Holm)", self.method.level),
        };
        let differences = self.differences.join("; ");
        let reason = match self.conclusion {
            Conclusion::NotComparable if !self.is_judged() => {
                format!("scored differently ({differences}): nothing is called better or worse")
            }
            Conclusion::NotComparable if !self.has_pairs() => {
                let failed = self.algorithms.iter();
                let failed = failed
                    .filter_map(|own| Some(format!("; {} {}", own.labels(), own.failures()?)));
                let things = self.things();
                format!("no {things} of both{}", failed.collect::<String>())
            }
            Conclusion::NotComparable | Conclusion::FewInCommon => {
                "they have no headline metric in common that a test decides".to_owned()
            }
            Conclusion::TooFewPairs => format!(
                "fewer than {fewest} independent blocks in {pairs}, so there is no interval; score \
                 more pairs"
            ),
            Conclusion::TooFewCourses => {
                format!(
                    "{pairs}, of which at least {fewest} have to differ; --seeds 1..100 drives more"
                )
            }
            Conclusion::NoChange => format!("the results of {pairs} are equal to the bit"),
            Conclusion::NotToldApart => {
                let is_few = |change: &Change| change.judgement == Judgement::TooFew;
                let tested = ranked.iter().filter(|(_, change)| !is_few(change));
                let metrics = counted(tested.count(), "headline metric");
                format!("none of {metrics} is told from chance at {level} over {pairs}")
            }
            Conclusion::Better | Conclusion::Worse | Conclusion::Mixed => {
                let (limit, words) = match self.conclusion {
                    Conclusion::Mixed => (1, ["worse: ", "better: "]),
                    _ => (2, [""; 2]),
                };
                let lists = [Judgement::Worse, Judgement::Better].into_iter().zip(words);
                let lists = lists.filter_map(|(judgement, word)| {
                    Some(format!("{word}{}", listed(&ranked, judgement, limit)?))
                });
                let lists: Vec<_> = lists.collect();
                let real = format!("real at {level} over {pairs}");
                let real = (!lists.is_empty()).then_some(real);
                let failed = self.algorithms.iter();
                let failed = failed.filter(|own| own.exceeds_losses);
                let failed =
                    failed.filter_map(|own| Some(format!("{} {}", own.labels(), own.failures()?)));
                let failed = failed.chain(lists).chain(real).collect::<Vec<_>>();
                failed.join("; ")
            }
        };
        let besides = self.named(AlgorithmChange::besides);
        let besides = listed(&besides, Judgement::Worse, 1);
        let besides = besides.map(|list| format!("worse besides: {list}"));
        let more = besides.into_iter().chain(self.ambiguous.iter().cloned());
        let parts: Vec<_> = [reason].into_iter().chain(more).collect();
        format!("{}: {}", self.conclusion.word(), parts.join("; "))
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
        let left_out = Some(join.left_out().join(", ")).filter(|labels| !labels.is_empty());
        let left_out = left_out.map(|labels| format!("{labels}, whose namesake --map names"));
        let cells = join.runs.iter();
        let cells = cells.filter(|run| !join.is_driven && !run.has_cells());
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
        let absent = self.algorithms.iter().filter(|own| own.pairs == 0);
        let absent = joined(absent.map(AlgorithmChange::labels));
        let absent = (self.has_pairs() && !absent.is_empty()).then(|| {
            format!(
                "{absent}, of which no {} has results in both",
                self.things()
            )
        });
        let are_both = !self.only_in_base.is_empty() && !self.only_in_other.is_empty();
        let parts = alone.chain(are_both.then(|| MAP.to_owned()));
        let parts = parts.chain(left_out).chain(absent);
        let parts = parts.chain(cells).chain(checkpoints).chain(unmatched);
        let mut parts: Vec<_> = parts.collect();
        parts.dedup();
        parts
    }

    /// Doubts about the verdict: incomplete reports, other pairs before, other machines.
    pub(super) fn doubts(&self, join: &Join<'_>) -> Vec<String> {
        let incomplete = self.incomplete.iter();
        let incomplete =
            incomplete.map(|(folder, why)| format!("{} is incomplete: {why}", folder.display()));
        let with_past = self.algorithms.iter().filter(|own| own.other_past > 0);
        let with_past = joined(with_past.map(AlgorithmChange::labels));
        let past = (!with_past.is_empty()).then(|| {
            format!(
                "the pairs before each pair differ, on which results of {with_past} depend: score \
                 both with equal --every, --from and --to"
            )
        });
        let [base, other] = join.runs.map(|run| run.manifest.times.as_deref());
        let [base, other] = [base, other].map(|work| work.unwrap_or("other work"));
        let machine = (self.origins[0] != self.origins[1]).then_some("another program or machine");
        let work = (base != other).then(|| format!("{base} and then of {other}"));
        let other = machine.map(str::to_owned).into_iter().chain(work);
        let other = other.collect::<Vec<_>>().join(", ");
        let times = match join.runs.map(ScoredRun::has_times) {
            [true, true] if other.is_empty() => None,
            [true, true] => Some(format!("ratios of times are also those of {other}")),
            [false, false] => None,
            [has_times, _] => {
                let untimed = join.runs[usize::from(has_times)].name.display();
                Some(format!("times are not compared: {untimed} has none"))
            }
        };
        let allowed = self.algorithms.iter().filter(|own| !own.exceeds_losses);
        let allowed = allowed.filter_map(|own| {
            let failures = own.failures()?;
            Some(format!("{} {failures}, as allow_loss allows", own.labels()))
        });
        incomplete.chain(past).chain(times).chain(allowed).collect()
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

    /// The reason why there is none of these metrics; none if one is compared.
    pub fn lacks(&self, columns: &ColumnChoice) -> Option<String> {
        let mut algorithms = self.algorithms.iter();
        let has_none = algorithms.all(|own| own.rows(columns).is_empty());
        let reasons = self.not_compared.join("; ");
        let (base, other) = (self.base.display(), self.other.display());
        has_none.then(|| match &*reasons {
            "" => format!("{base} and {other}: one of them measures none of these metrics"),
            _ => reasons,
        })
    }

    /// The sentences, the origins of the two, and of each algorithm the pairs and the changes.
    pub fn terminal(&self, columns: &ColumnChoice, style: TerminalStyle) -> String {
        let [not_compared, caution] = self.remarks();
        let lines = [self.verdict.clone()].into_iter().chain(not_compared);
        let lines = lines.chain(self.origin_lines()).chain(caution);
        let mut text: String = lines.map(|line| wrapped(&line, 7, style.width)).collect();
        if self.algorithms.len() > 1 && *columns == ColumnChoice::Headline {
            text += &format!("\n{}", self.overview().terminal(style));
            let courses = self.algorithms.iter().filter(|own| own.courses.is_some());
            let courses =
                courses.filter_map(|own| Some(format!("{}: {}", own.labels(), own.item_words()?)));
            text.extend(courses.map(|line| "\n".to_owned() + &wrapped(&line, 2, style.width)));
        } else {
            for own in &self.algorithms {
                let items = own.item_words().map(|words| format!("; {words}"));
                let items = items.unwrap_or_default();
                let line = format!("{}: {}{items}", own.title(), own.extent());
                text += &format!("\n{}", wrapped(&line, 2, style.width));
                if !own.rows(columns).is_empty() {
                    text += &own.table(columns).terminal(style);
                }
            }
        }
        text + "\nmore   -o FILE.html, --columns all, --json\n"
    }

    /// A row per algorithm: the change of each headline metric.
    pub(super) fn overview(&self) -> Table {
        let mut metrics = self.algorithms[0].metrics(&ColumnChoice::Headline);
        metrics.retain(|metric| {
            self.algorithms
                .iter()
                .any(|own| own.change(metric).is_some())
        });
        let mut table = Table::new("", "change");
        table.columns.extend(metrics.iter().map(|metric| {
            let [group, head] = [metric.group, metric.head].map(|w| w.replace('%', POINTS));
            TableColumn {
                is_optional: !is_ranked(metric),
                ..TableColumn::text(group, head)
            }
        }));
        for own in &self.algorithms {
            let cells = metrics.iter().map(|metric| own.change(metric));
            let cells = cells.map(|change| match change {
                Some(change) => change.cell(),
                None => TableCell::Text(NONE.to_owned()),
            });
            let name = TableCell::Text(own.title());
            table.rows.push([name].into_iter().chain(cells).collect());
        }
        table
    }

    /// The origins of the two reports.
    fn origin_lines(&self) -> Vec<String> {
        let truth = |side: usize| caution(&self.truths[side]).map(|words| format!(": {words}"));
        let [a, b] = [0, 1].map(|side| truth(side).unwrap_or_default());
        let before = format!("before {}{a}", self.base.display());
        let after = format!("after  {}{b}", self.other.display());
        let [base, other] = &self.origins;
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
        let changed = self.algorithms.iter();
        let changed = changed.filter(|own| own.equal_results < own.pairs);
        let items =
            changed.filter_map(|own| Some(format!("{}: {}", own.labels(), own.item_words()?)));
        let items = items.collect::<Vec<_>>().join("; ");
        let [not_compared, caution] = self.remarks();
        let notes = [not_compared.unwrap_or_default(), items].map(|note| escape_prose(&note));
        let notes = notes.into_iter().filter(|note| !note.is_empty());
        let said: Vec<_> = [format!("**{word}**{reason}")]
            .into_iter()
            .chain(notes)
            .collect();
        let mut changes = self.named(|own| own.rows(&ColumnChoice::Headline));
        // The sort is stable.
        changes.sort_by_key(|(_, own)| match own.judgement {
            Judgement::Worse => 0,
            Judgement::Better => 1,
            _ => 2,
        });
        changes.truncate(MAX_LINES + 1 - said.len());
        let all = || self.algorithms.iter().flat_map(AlgorithmChange::changes);
        let count = |judgement| all().filter(|own| own.judgement == judgement).count();
        let tested = all().count();
        let things = if self.is_driven() {
            "courses"
        } else {
            "frames"
        };
        let table = match &changes[..] {
            [] => String::new(),
            changes => change_table(changes).markdown() + "\n",
        };
        format!(
            "{}\n\n{table}{}, `{}` → `{}`: {} better and {} worse of {} metrics; `-o FILE.html` \
             shows {things}{}\n",
            said.join("  \n"),
            escape(&self.scenario),
            self.base.display(),
            self.other.display(),
            count(Judgement::Better),
            count(Judgement::Worse),
            tested,
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
    pub(super) fn are_equal(&self) -> bool {
        let mut algorithms = self.algorithms.iter();
        algorithms.all(|own| own.equal_results == own.pairs)
    }

    /// The things that are compared.
    fn things(&self) -> &'static str {
        if self.is_driven() { "course" } else { "pair" }
    }

    /// The numbers of pairs of the algorithms that have some.
    fn pairs_words(&self) -> String {
        let pairs = || self.algorithms.iter().map(|own| own.pairs);
        let pairs = || pairs().filter(|pairs| *pairs > 0);
        let (fewest, most) = (pairs().min().unwrap_or(0), pairs().max().unwrap_or(0));
        let things = self.things();
        if fewest == most {
            counted(most, things)
        } else {
            format!("{fewest} to {most} {things}s")
        }
    }
}

/// The changes of that judgement, the first of them with their values: the surest change, but more
/// missed obstacles and collisions before all others.
fn listed(changes: &[(String, &Change)], judgement: Judgement, limit: usize) -> Option<String> {
    let own = changes.iter();
    let own = own.filter(|(_, change)| change.judgement == judgement);
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
        let exact = change.exact_words();
        format!("{name} {base} → {other} ({difference}{magnitude}{exact})")
    });
    let listed = words.collect::<Vec<_>>().join(", ");
    match own.len().saturating_sub(limit) {
        _ if own.is_empty() => None,
        0 => Some(listed),
        more => Some(format!("{listed} and {more} more")),
    }
}

impl AlgorithmChange {
    /// The headline metrics, or those of a choice.
    pub(super) fn metrics(&self, columns: &ColumnChoice) -> Vec<&'static Metric> {
        let has = |name: &str| self.metrics.iter().any(|change| change.metric.name == name);
        columns.metrics(TruthLevel::from_measured(has))
    }

    /// The change of a metric of all pairs.
    fn change(&self, metric: &Metric) -> Option<&Change> {
        self.metrics.iter().find(|change| change.metric == metric)
    }

    /// The changes of these columns; of checkpoints where their column is one.
    pub(super) fn shown(&self, columns: &ColumnChoice) -> Vec<&Change> {
        let metrics = self.metrics(columns);
        let changes = self.changes();
        let changes = changes.filter(|change| metrics.contains(&change.metric));
        changes.collect()
    }

    /// The changes for the worse that are not in the headline.
    fn besides(&self) -> Vec<&Change> {
        let headline = self.metrics(&ColumnChoice::Headline);
        let worse = self.changes();
        let worse = worse.filter(|change| change.judgement == Judgement::Worse);
        let worse = worse.filter(|own| !headline.contains(&own.metric) || !is_ranked(own.metric));
        worse.collect()
    }

    /// The changes that a table of these columns has: of checkpoints in the headline those that
    /// differ, and below are others for the worse.
    fn rows(&self, columns: &ColumnChoice) -> Vec<&Change> {
        let mut rows = self.shown(columns);
        if *columns == ColumnChoice::Headline {
            rows.retain(|own| own.checkpoint.is_none() || own.difference != 0.0);
            let mut besides = self.besides();
            besides.retain(|own| !rows.iter().any(|row| std::ptr::eq(*row, *own)));
            rows.extend(besides);
        }
        rows
    }

    pub(super) fn table(&self, columns: &ColumnChoice) -> Table {
        let rows = self.rows(columns).into_iter();
        change_table(&rows.map(|own| (own.name(), own)).collect::<Vec<_>>())
    }

    /// The table with a bar for each interval, behind the change.
    pub(super) fn drawn_table(&self, columns: &ColumnChoice) -> Table {
        let (mut table, rows) = (self.table(columns), self.rows(columns));
        if rows.iter().any(|change| change.interval.is_some()) {
            table.columns.insert(4, TableColumn::text("", ""));
            for (row, change) in table.rows.iter_mut().zip(&rows) {
                let bar = interval_cell(change, &rows);
                row.insert(4, bar.unwrap_or(TableCell::Text(String::new())));
            }
        }
        table
    }

    /// The errors by distance, those of both beside each other.
    pub(super) fn distance_tables(&self) -> Vec<Table> {
        let Some([before, after]) = &self.by_distance else {
            return Vec::new();
        };
        let names = match self.other_algorithm == self.algorithm {
            true => ["before", "after"],
            false => [&*self.algorithm, &self.other_algorithm],
        };
        let key = |row: &AccuracyRow| (row.is_of_pixels, row.range());
        let rows = before.iter().flat_map(|row| {
            let other = after.iter().find(|other| key(other) == key(row));
            let both = [Some(row), other].into_iter().zip(names);
            both.filter_map(|(row, name)| {
                let algorithm = name.to_owned();
                Some(AccuracyRow {
                    algorithm,
                    ..row?.clone()
                })
            })
        });
        accuracy_tables(rows)
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

    /// The courses that changed, or the numbers of frames that did, in a line.
    pub(super) fn item_words(&self) -> Option<String> {
        let frames = self.frames.filter(|own| own.unscored < self.pairs);
        let courses = self.courses.as_ref().map(CourseChanges::words);
        let words = courses.or_else(|| Some(frames?.words()));
        words.filter(|words| !words.is_empty())
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
    /// True for a change that is not chance.
    fn is_told(self) -> bool {
        matches!(self, Self::Better | Self::Worse | Self::Differs)
    }

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
    table.columns.push(TableColumn {
        is_optional: true,
        ..TableColumn::text("", "over")
    });
    for (name, change) in changes {
        let metric = change.metric;
        let is_magnitude = metric.is_signed();
        let value = |value: f64| metric.show(if is_magnitude { value.abs() } else { value });
        // The unit is beside it.
        let bounds = change.interval.map(|(low, high)| [low, high]);
        let bounds = bounds.map(|own| own.map(|bound| unitless(metric, bound)).join(" .. "));
        let no_bounds = match change.judgement {
            Judgement::TooFew => change.too_few_words(),
            _ => NONE,
        };
        let word = change.judgement.word();
        let cells = [
            value(change.base),
            value(change.other),
            signed(metric, change.difference),
            bounds.unwrap_or_else(|| no_bounds.to_owned()),
            word.to_owned(),
            change.cases_words(),
        ];
        table.push(
            name.clone() + if is_magnitude { ", magnitude" } else { "" },
            cells,
        );
        if let (Judgement::Worse, Some(row)) = (change.judgement, table.rows.last_mut()) {
            row[5] = TableCell::Alert(word.to_owned());
        }
    }
    table.remove_empty_columns();
    table
}

/// The difference of a change with its interval; those of shares have one scale.
fn interval_cell(change: &Change, all: &[&Change]) -> Option<TableCell> {
    // Times change by a ratio.
    let zero = match change.metric.unit {
        MetricUnit::Ms => 1.0,
        _ => 0.0,
    };
    let scale = |own: &Change| (own.metric.unit, own.checkpoint.is_some());
    let is_alike = |own: &&&Change| {
        let are_shares = change.metric.unit == MetricUnit::Share && scale(own) == scale(change);
        are_shares || std::ptr::eq(**own, change)
    };
    let alike = all.iter().filter(is_alike);
    let ends = alike.filter_map(|own| own.interval);
    let reach = ends.fold(f64::MIN_POSITIVE, |reach, (low, high)| {
        reach.max((low - zero).abs()).max((high - zero).abs())
    });
    let (low, high) = change.interval?;
    let place = |value: f64| 50.0 + 48.0 * (value - zero) / reach;
    Some(TableCell::Interval {
        low: place(low),
        high: place(high),
        value: place(change.difference),
    })
}

impl Change {
    /// The difference, and the word of one that is told from chance.
    fn cell(&self) -> TableCell {
        let difference = unitless(self.metric, self.difference);
        match (self.judgement, self.judgement.word()) {
            (Judgement::Equal, word) => TableCell::Text(word.to_owned()),
            (Judgement::Worse, word) => TableCell::Alert(format!("{difference} {word}")),
            (own, word) if own.is_told() => TableCell::Text(format!("{difference} {word}")),
            _ => TableCell::Text(difference),
        }
    }

    /// The cases that the two numbers rest on.
    fn cases_words(&self) -> String {
        let words = self
            .cases
            .map(|both| both.map(|own| self.metric.cases_words(&own)));
        match words {
            None => NONE.to_owned(),
            Some([base, other]) if base == other => base,
            Some([base, other]) => format!("{base} → {other}"),
        }
    }

    /// The number of the exact distances, behind another one.
    pub(super) fn exact_words(&self) -> String {
        let exact = self.exact.map(|exact| self.metric.show(exact));
        exact.map_or_else(String::new, |exact| format!("; exact distances {exact}"))
    }

    /// The things of which there are too few for an interval.
    pub(super) fn too_few_words(&self) -> &'static str {
        match self.metric.origin {
            MetricOrigin::Checkpoints => "too few frames",
            MetricOrigin::Drives(_) => "too few courses",
            MetricOrigin::Pieces { .. } => "too few approaches",
            _ => "too few pairs",
        }
    }
}

/// A difference with its sign, without its unit.
pub fn unitless(metric: &Metric, difference: f64) -> String {
    let text = signed(metric, difference);
    text.split(' ').next().unwrap_or_default().to_owned()
}

/// A difference with its sign, also where it rounds to 0: a bound of `-0.0` excludes 0. Of times a
/// ratio, of shares in points.
fn signed(metric: &Metric, v: f64) -> String {
    let shown = metric.show(v.abs()).replace('%', POINTS);
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

    #[test]
    fn bars_of_shares_have_one_scale_and_times_no_difference_at_1() {
        let change = |name, difference, interval| {
            let metric = Metric::find(name).unwrap();
            Change::new(metric, [0.1, 0.2], difference, interval)
        };
        let all = [
            change("right", 0.1, Some((-0.1, 0.2))),
            change("wrong", -0.05, Some((-0.1, 0.0))),
            change("missed", 3.0, Some((2.0, 4.0))),
            change("time", 1.5, Some((1.0, 2.0))),
            change("found", 0.3, None),
        ];
        let all: Vec<_> = all.iter().collect();
        let places = all
            .iter()
            .filter_map(|own| match interval_cell(own, &all)? {
                TableCell::Interval { low, high, value } => {
                    Some([low, value, high].map(f64::round))
                }
                _ => None,
            });
        let places: Vec<_> = places.collect();
        assert_eq!(places[0], [26.0, 74.0, 98.0]);
        assert_eq!(places[1], [26.0, 38.0, 50.0]);
        assert_eq!(places[2], [74.0, 86.0, 98.0]);
        assert_eq!(places[3], [50.0, 74.0, 98.0]);
        assert_eq!(places.len(), 4);
    }
}
