//! The verdict of a comparison: a word, and the sentence that every form of it begins with.

use super::{AlgorithmChange, Change, Comparison, Judgement};
use serde::Serialize;
use svl_core::counted;
use svl_score::judge::{Better, ColumnChoice, MetricUnit};

/// Limit of the changes that the sentence has: of one direction, and of each of both.
const MAX_LISTED: [usize; 2] = [2, 1];

/// The verdict in a word, by the headline metrics that have a better direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Conclusion {
    Better,
    Worse,
    /// Some metrics are better, others worse.
    Mixed,
    NoChange,
    /// There is no interval.
    TooFewPairs,
    /// The same of drives.
    TooFewCourses,
    NotComparable,
}

impl Conclusion {
    pub fn word(self) -> &'static str {
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

/// A comparison with its verdict, for programs.
#[derive(Serialize)]
pub struct JudgedComparison<'a> {
    conclusion: Conclusion,
    /// The first line on the terminal.
    verdict: String,
    #[serde(flatten)]
    comparison: &'a Comparison,
}

impl Comparison {
    /// The comparison as JSON shows it.
    pub fn judged(&self) -> JudgedComparison<'_> {
        JudgedComparison {
            conclusion: self.conclusion(),
            verdict: self.verdict(),
            comparison: self,
        }
    }

    /// The verdict. A pair that the second run alone failed on is worse.
    pub fn conclusion(&self) -> Conclusion {
        let ranked = self.ranked();
        let has = |judgement| {
            let mut changes = ranked.iter();
            changes.any(|(_, change)| change.judgement == judgement)
        };
        let is_open = |change: &Change| change.judgement == Judgement::TooFew;
        let has_failed = self.algorithms.iter().any(|own| own.newly_failed > 0);
        let is_worse = has(Judgement::Worse) || has_failed;
        let mut unequal = ranked
            .iter()
            .filter(|(_, change)| change.judgement != Judgement::Equal)
            .peekable();
        match (is_worse, has(Judgement::Better)) {
            _ if !self.is_judged() => Conclusion::NotComparable,
            (true, true) => Conclusion::Mixed,
            (true, false) => Conclusion::Worse,
            (false, true) => Conclusion::Better,
            _ if ranked.is_empty() => Conclusion::NotComparable,
            _ if unequal.peek().is_some() && unequal.all(|(_, change)| is_open(change)) => {
                if self.is_driven() {
                    Conclusion::TooFewCourses
                } else {
                    Conclusion::TooFewPairs
                }
            }
            _ => Conclusion::NoChange,
        }
    }

    /// The verdict in a sentence, which begins with its word: what changed, by how much, and
    /// whether that is real.
    pub fn verdict(&self) -> String {
        let conclusion = self.conclusion();
        format!("{}: {}", conclusion.word(), self.verdict_reason(conclusion))
    }

    /// The verdict without its word.
    pub(super) fn verdict_reason(&self, conclusion: Conclusion) -> String {
        let reason = self.headline_reason(conclusion);
        let besides = match (conclusion, self.besides()) {
            (Conclusion::Better | Conclusion::NoChange, besides @ 1..) => {
                Some(format!("besides, {} worse", counted_are(besides)))
            }
            _ => None,
        };
        let parts = self.past_words().into_iter().chain([reason]).chain(besides);
        parts.collect::<Vec<_>>().join("; ")
    }

    /// Number of metrics that are worse and not in the headline.
    fn besides(&self) -> usize {
        let besides = self.algorithms.iter().map(|own| own.worse_besides().len());
        besides.sum()
    }

    fn headline_reason(&self, conclusion: Conclusion) -> String {
        let ranked = self.ranked();
        let tested = self.tested_words();
        match conclusion {
            Conclusion::NotComparable if !self.is_judged() => {
                let differences = self.differences.join("; ");
                format!("scored differently ({differences}): nothing is called better or worse")
            }
            Conclusion::NotComparable => "they have no headline metric in common".to_owned(),
            _ if self.is_driven() && !self.are_equal() => self.drive_reason(conclusion),
            Conclusion::TooFewPairs | Conclusion::TooFewCourses => format!(
                "{} are in fewer than {} independent blocks, so there is no interval; score more \
                 pairs",
                self.pairs_words(),
                self.method.fewest_blocks
            ),
            Conclusion::NoChange if self.are_equal() => {
                let equal = format!("the results of {} are equal to the bit", self.pairs_words());
                if self.is_partial() {
                    equal + "; other algorithms were not compared"
                } else {
                    equal
                }
            }
            Conclusion::NoChange => {
                let metrics = counted(ranked.len() as u64, "headline metric");
                format!("none of {metrics} differs {tested}")
            }
            Conclusion::Better | Conclusion::Worse | Conclusion::Mixed => {
                let limit = MAX_LISTED[usize::from(conclusion == Conclusion::Mixed)];
                let list = |judgement| listed(&ranked, judgement, limit);
                let word = |list: String, word: &str| match conclusion {
                    Conclusion::Mixed => format!("{word}: {list}"),
                    _ => list,
                };
                let better = list(Judgement::Better).map(|list| word(list, "better"));
                let worse = list(Judgement::Worse).map(|list| word(list, "worse"));
                let real = (better.is_some() || worse.is_some()).then(|| format!("real {tested}"));
                let failures = self.algorithms.iter().filter_map(|algorithm| {
                    let words = algorithm.failures()?;
                    Some(format!("{} {words}", algorithm.title()))
                });
                let parts: Vec<_> = failures.chain(worse).chain(better).chain(real).collect();
                parts.join("; ")
            }
        }
    }

    /// The advice for a change that is to be merged.
    pub(super) fn advice(&self) -> String {
        let conclusion = self.conclusion();
        let besides = self.besides();
        let words = match conclusion {
            Conclusion::NoChange if self.are_equal() && self.is_partial() => {
                "Cannot be told: what was compared is equal.".to_owned()
            }
            Conclusion::NoChange if self.are_equal() => "Yes: no result changed.".to_owned(),
            Conclusion::Better | Conclusion::NoChange if besides > 0 => {
                let metrics = counted_are(besides);
                format!("Not before a look below: {metrics} worse besides the headline.")
            }
            Conclusion::Better => "Yes: nothing that was measured is worse.".to_owned(),
            Conclusion::NoChange => {
                let unseen = if self.is_driven() {
                    "A small change takes more courses to be seen."
                } else {
                    "A change smaller than the intervals would not be seen."
                };
                format!("Nothing that was measured speaks against it. {unseen}")
            }
            Conclusion::Worse => {
                "No, unless something that is not measured here outweighs it.".to_owned()
            }
            Conclusion::Mixed => "Only if what is better is worth what is worse.".to_owned(),
            Conclusion::TooFewPairs => "Cannot be told: score more pairs.".to_owned(),
            Conclusion::TooFewCourses => {
                "Cannot be told: drive more courses, as with --seeds 1..100.".to_owned()
            }
            Conclusion::NotComparable => {
                "Cannot be told: score both by the same scenario.".to_owned()
            }
        };
        let partial = if self.is_partial() {
            " The algorithms that were not compared may have changed, too."
        } else {
            ""
        };
        let past = match self.past_words() {
            Some(_) => " Score both with equal options to see the change alone.",
            None => "",
        };
        let incomplete = if self.incomplete.is_empty() {
            ""
        } else {
            " A report is incomplete."
        };
        words + partial + past + incomplete
    }

    /// The headline metrics with a better direction, but times, with their names.
    fn ranked(&self) -> Vec<(String, &Change)> {
        let changes = self.named_changes(&ColumnChoice::Headline);
        let is_ranked = |(_, change): &(String, &Change)| {
            change.metric.better != Better::Neither && change.metric.unit != MetricUnit::Ms
        };
        changes.into_iter().filter(is_ranked).collect()
    }

    /// The changes of these columns, with the names of their algorithms where there are several.
    pub(super) fn named_changes(&self, columns: &ColumnChoice) -> Vec<(String, &Change)> {
        let changes = self.algorithms.iter().flat_map(|algorithm| {
            let shown = algorithm.shown(columns).into_iter();
            shown.map(|(name, change)| (self.name(algorithm, &name), change))
        });
        changes.collect()
    }

    /// True if an algorithm was not compared.
    fn is_partial(&self) -> bool {
        !self.only_in_base.is_empty() || !self.left_out.is_empty()
    }

    /// True if all pairs have equal results.
    fn are_equal(&self) -> bool {
        let mut algorithms = self.algorithms.iter();
        algorithms.all(|own| own.equal_results == own.pairs)
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
            counted(most as u64, things)
        } else {
            format!("{fewest} to {most} {things}s")
        }
    }

    pub(super) fn tested_words(&self) -> String {
        format!("at {} over {}", self.method.level, self.pairs_words())
    }
}

/// So many metrics, with their verb.
fn counted_are(metrics: usize) -> String {
    match metrics {
        1 => "1 metric is".to_owned(),
        metrics => format!("{metrics} metrics are"),
    }
}

/// The changes of that judgement, the first of them with their values: the surest change, but more
/// missed obstacles before all others.
fn listed(changes: &[(String, &Change)], judgement: Judgement, limit: usize) -> Option<String> {
    let own = changes
        .iter()
        .filter(|(_, change)| change.judgement == judgement);
    let mut own: Vec<_> = own.collect();
    let is_worse = judgement == Judgement::Worse;
    let is_other = |change: &Change| !is_worse || change.metric.name != "missed";
    own.sort_by(|(_, a), (_, b)| {
        let surest = b.sureness().total_cmp(&a.sureness());
        is_other(a).cmp(&is_other(b)).then(surest)
    });
    let words = own.iter();
    let words = words.map(|(name, change)| format!("{name} {}", change.words()));
    let mut words: Vec<_> = words.collect();
    let more = words.len().saturating_sub(limit);
    words.truncate(limit);
    let listed = words.join(", ");
    match (words.is_empty(), more) {
        (true, _) => None,
        (false, 0) => Some(listed),
        (false, more) => Some(format!("{listed} and {more} more")),
    }
}
