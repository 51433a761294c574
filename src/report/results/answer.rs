//! The answer of a report: a sentence at its head, and the meanings of marks below its table.

use super::best::{BEST, Best, Certainty, FAILED, FEW_PAIRS, SweepChoice, UNFIT, Unfit};
use super::choice::answer_metrics;
use super::summary::{AlgorithmSummary, Results};
use crate::rows::samples::grouped;
use crate::subjects::pieces::PieceRow;
use crate::subjects::references::EXACT;
use svl_core::{counted, joined};
use svl_score::bootstrap::METHOD;
use svl_score::judge::{AreaChoice, Metric, TruthLevel};

/// Limit of the algorithms whose faults are named.
const MAX_NAMED: usize = 3;
/// Limit of the algorithms whose estimated errors are told.
const MAX_ESTIMATES: usize = 2;

impl Unfit {
    /// The reason, before the algorithms that it is of.
    fn reason(self) -> String {
        match self {
            Self::Over(name, percent) => format!("over {percent} % {name}"),
            Self::Under(name, percent) => format!("under {percent} % {name}"),
            Self::Easy => "right in less than half of the most".to_owned(),
            Self::BehindPrior => "not told above the prior".to_owned(),
            Self::TooFewPairs => "too few pairs to tell".to_owned(),
            Self::Absent => "less than half of the pairs answered".to_owned(),
            Self::NotCompared => "not compared".to_owned(),
        }
    }
}

impl Results {
    /// The answer in a sentence, then the settings to use.
    pub fn answer(&self) -> Vec<String> {
        let head = self.head();
        let choices = self.choices.iter().map(SweepChoice::words);
        head.into_iter().chain(choices).collect()
    }

    /// Which algorithm is best, by how much, on how many pairs and cells; or why none is.
    fn head(&self) -> Option<String> {
        let extent = self.extent_words();
        let mut answered = self.algorithms.iter().filter(|a| a.pairs > 0);
        match (answered.next(), answered.next()) {
            (None, _) if self.basis.common.read > 0 => {
                let pairs = counted(self.basis.common.read, "pair");
                return Some(format!("No algorithm answered any of {pairs}."));
            }
            (None, _) => return None,
            (Some(own), None) => return self.lone_words(own),
            _ => {}
        }
        if self.is_area_empty() {
            let pairs = counted(self.basis.scope.pairs, "pair");
            return Some(format!(
                "No cell of this area is scored, so none is best; {pairs}."
            ));
        }
        if self.kind() == TruthLevel::Courses && self.best.is_empty() {
            return Some(format!(
                "None is called best: {}{}.",
                self.undecided_courses(),
                self.numbers()
            ));
        }
        let unfit = self.unfit.values();
        let mut answered = unfit.filter(|own| !matches!(own, Unfit::Absent | Unfit::NotCompared));
        // One that failed on all pairs changes no sentence.
        let is_few = answered.next() == Some(&Unfit::TooFewPairs)
            && answered.all(|own| *own == Unfit::TooFewPairs);
        let is_any_fit = self.algorithms.iter().any(|a| self.may_be_best(a));
        if is_few && !is_any_fit {
            let numbers = self.numbers();
            return Some(format!(
                "Too few pairs to tell which is best{numbers}; {extent}."
            ));
        }
        // Times are marked, and judge nothing.
        let best: Vec<_> = (self.best.iter())
            .filter(|best| best.metric.name != "time")
            .collect();
        if is_any_fit && self.has_own_pairs() {
            let (common, read) = (self.basis.common.common, self.basis.common.read);
            let numbers = self.numbers();
            return Some(format!(
                "Only {common} of {read} pairs are common to all, so none is best{numbers}; `svl \
                 compare` tests two on the pairs of both."
            ));
        }
        if best.is_empty() {
            return (!is_any_fit).then(|| {
                let why = self.unfit_words(self.ranked_algorithms());
                format!("None may be best: {why}; {extent}.")
            });
        }
        let names = |own: &[&Best]| {
            let by = own.iter().map(|best| self.best_words(best));
            format!("{} by {}", own[0].algorithm, joined(by))
        };
        let names = grouped(&best, |best| &best.algorithm, names).join("; ");
        Some(format!("Best: {names}; {extent}."))
    }

    /// The reason why the only algorithm could not be best, in a sentence.
    fn lone_words(&self, own: &AlgorithmSummary) -> Option<String> {
        let why = match self.unfit.get(&own.algorithm)? {
            Unfit::TooFewPairs if !self.references.is_empty() => {
                format!("Too few pairs to tell {} from the prior", own.algorithm)
            }
            Unfit::NotCompared | Unfit::TooFewPairs => return None,
            _ => format!("It could not be best: {}", self.unfit_words([own])),
        };
        Some(format!("{why}; {}.", self.extent_words()))
    }

    /// Why no algorithm is best by its drives.
    fn undecided_courses(&self) -> String {
        let courses = self.drives.iter().map(|own| own.courses).max();
        let (courses, fewest) = (courses.unwrap_or_default(), METHOD.fewest_blocks);
        if (courses as usize) < fewest {
            format!("{courses} of at least {fewest} courses")
        } else {
            "no algorithm that finishes is told apart from all others".to_owned()
        }
    }

    /// The value of the best, and that of the next.
    fn best_words(&self, best: &Best) -> String {
        let metric = best.metric;
        let next = best.others.first().and_then(|next| {
            let value = self.value(&next.algorithm, metric, None)?;
            let mark = next.certainty.mark();
            let mark = if mark.is_empty() {
                String::new()
            } else {
                format!("{mark} ")
            };
            Some(format!("{mark}{} {}", next.algorithm, metric.show(value)))
        });
        let notes: Vec<_> = next.into_iter().chain(self.exact_words(metric)).collect();
        let notes = if notes.is_empty() {
            String::new()
        } else {
            format!(" ({})", notes.join("; "))
        };
        format!("{} {}{notes}", metric.name, metric.show(best.value))
    }

    /// The number of the exact distances, of a metric by which they need not be perfect.
    fn exact_words(&self, metric: &Metric) -> Option<String> {
        let is_near = ["missed", "found"].contains(&metric.name);
        let value = self.value(EXACT, metric, None).filter(|_| is_near)?;
        Some(format!("exact distances {}", metric.show(value)))
    }

    /// The numbers by which none is called best.
    fn numbers(&self) -> String {
        let Some(words) = self.merit_words() else {
            return String::new();
        };
        let numbers = self.ranked_algorithms().into_iter().filter_map(|a| {
            let value = match self.kind() {
                TruthLevel::Distances => Metric::find("right")?.show(self.merit(a)?),
                _ => {
                    let metric = self.first_metric()?;
                    metric.show(self.value(&a.algorithm, metric, None)?)
                }
            };
            Some(format!("{} {value}", a.algorithm))
        });
        let numbers: Vec<_> = numbers.take(MAX_NAMED).collect();
        if numbers.is_empty() {
            return String::new();
        }
        format!("; {words}: {}", numbers.join(", "))
    }

    /// Why these algorithms may not be best, in words: each reason once.
    pub(crate) fn unfit_words<'a>(
        &self,
        algorithms: impl IntoIterator<Item = &'a AlgorithmSummary>,
    ) -> String {
        let unfit = algorithms.into_iter();
        let unfit = unfit.filter_map(|a| Some((*self.unfit.get(&a.algorithm)?, a)));
        let words = |own: &[&(Unfit, &AlgorithmSummary)]| {
            let labels = own.iter().map(|(unfit, a)| self.limited_words(*unfit, a));
            let more = own.len().saturating_sub(MAX_NAMED);
            let more = (more > 0).then(|| format!("{more} more"));
            let labels = labels.take(MAX_NAMED).chain(more).collect::<Vec<_>>();
            format!("{} ({})", own[0].0.reason(), labels.join(", "))
        };
        let unfit: Vec<_> = unfit.collect();
        grouped(&unfit.iter().collect::<Vec<_>>(), |own| own.0, words).join(", ")
    }

    /// The label of an algorithm, and its number that is beyond a limit.
    fn limited_words(&self, unfit: Unfit, a: &AlgorithmSummary) -> String {
        let name = match unfit {
            Unfit::Over(name, _) | Unfit::Under(name, _) => name,
            Unfit::Easy => "right",
            _ => return a.algorithm.clone(),
        };
        let value = Metric::find(name).and_then(|metric| {
            let own = a.totals.measured(metric, self.deciding_area())?;
            Some(metric.show(metric.value_of(own)?))
        });
        format!("{} {}", a.algorithm, value.unwrap_or_default())
    }

    /// The pairs and the cells of the numbers.
    fn extent_words(&self) -> String {
        let common = &self.basis.common;
        let pairs = if self.has_own_pairs() {
            return format!("each one's own of {}", counted(common.read, "pair"));
        } else if self.basis.own.is_empty() {
            counted(self.basis.scope.pairs, "pair")
        } else {
            format!("{} of {} pairs, which all have", common.common, common.read)
        };
        let cells = self
            .most_cells(self.basis.area)
            .filter(|_| self.has_areas());
        let area = match self.basis.area {
            AreaChoice::Obstacle if !self.includes_floor() => "obstacle cell",
            AreaChoice::Floor => "floor cell",
            _ => "cell",
        };
        let cells = cells.map(|cells| format!(", {}", counted(cells, area)));
        format!("{pairs}{}", cells.unwrap_or_default())
    }

    /// The meanings of the marks, the order, and times that look apart and are not: footnotes.
    pub fn legend(&self) -> Vec<String> {
        let shown = self.shown.columns.metrics(self.kind());
        let marked = self.best.iter().filter(|best| shown.contains(&best.metric));
        let marks = marked.clone().flat_map(|best| &best.others);
        let marks = marks.map(|other| other.certainty.mark());
        let answers = answer_metrics(self.kind());
        let has_marks = shown.iter().any(|own| answers.contains(own)) && !self.has_one_algorithm();
        let unfit = self.unfit.values().filter(|_| has_marks);
        let unfit = unfit.map(|own| own.mark());
        let seen: Vec<_> = marks.chain(unfit).collect();
        let untold = Certainty::NotToldApart.mark();
        let meanings = [
            (untold, "not told apart from it".to_owned()),
            (FEW_PAIRS, "too few pairs to tell".to_owned()),
            (UNFIT, self.broken_words()),
        ];
        let meanings = meanings.into_iter().filter(|(own, _)| seen.contains(own));
        let marks = meanings.map(|(own, words)| format!("{own} {words}"));
        let best = (marked.clone().count() > 0).then(|| format!("{BEST} best"));
        let failed = self.basis.common.partial.iter().map(|(label, pairs)| {
            let read = self.basis.common.read;
            format!(
                "{FAILED} {label} failed on {} of {read} pairs",
                read - pairs
            )
        });
        let failed = failed.filter(|_| self.kind() != TruthLevel::Courses);
        let marks: Vec<_> = best.into_iter().chain(marks).chain(failed).collect();
        let marks = (!marks.is_empty()).then(|| format!("{}.", marks.join("; ")));
        let order = self.shown.sort.and_then(|_| self.order_words());
        let order = order.map(|words| format!("The algorithms are {words}."));
        let parts = marks.into_iter().chain(self.own_pairs_words());
        let parts = parts.chain(order).chain(self.estimate_words());
        let parts = parts.chain(self.piece_words());
        parts.chain(self.phantom_words()).collect()
    }

    /// The reaches of the narrowest test piece of the first algorithms that have one.
    fn piece_words(&self) -> Vec<String> {
        let ranked = self.ranked_algorithms().into_iter();
        let rows = ranked.filter_map(|a| {
            let mut own = self
                .pieces
                .iter()
                .filter(|row| row.algorithm == a.algorithm);
            let first = own.clone().next();
            own.find(|row| row.reach_m > Some(0.0)).or(first)
        });
        rows.take(MAX_ESTIMATES).map(PieceRow::words).collect()
    }

    /// The estimated errors of the first algorithms, and of one that has none.
    fn estimate_words(&self) -> Vec<String> {
        let mut rows = self.shown_estimates();
        let absent = rows.iter().position(|row| row.absent.is_some());
        if let Some(place) = absent.filter(|place| *place >= MAX_ESTIMATES) {
            rows.swap(MAX_ESTIMATES - 1, place);
        }
        let words = rows.iter().take(MAX_ESTIMATES).map(|row| row.words());
        let more = rows.len().saturating_sub(MAX_ESTIMATES);
        let more = (more > 0).then(|| format!("estimates.csv has {more} more."));
        words.chain(more).collect()
    }

    /// The phantoms of the algorithms that have some, and of how much.
    fn phantom_words(&self) -> Vec<String> {
        let words = |a: &AlgorithmSummary| {
            let all = |name| a.totals.measured(Metric::find(name)?, AreaChoice::All);
            let (pairs, cells) = (all("phantom_pairs")?, all("phantoms")?);
            let count = |name| all(name).map_or(0.0, |own| own.value);
            let apart = [
                (
                    "phantoms_of_v5",
                    "that the truth or v5 reports, too, so perhaps it moved away",
                ),
                (
                    "phantoms_of_body",
                    "in cells that always report the same: its own body?",
                ),
            ];
            let apart = apart.map(|(name, why)| (count(name), why)).into_iter();
            let apart = apart.filter(|(count, _)| *count > 0.0);
            let apart: String = apart
                .map(|(n, why)| format!("; {n} not counted {why}"))
                .collect();
            let with = (pairs.value * pairs.cases.items as f64).round();
            Some(format!(
                "{}: phantoms in {with} of {}, in {:.1} % of {:.1} m and {:.2} % of {} reports on \
                 the way{apart}.",
                a.algorithm,
                counted(pairs.cases.items, "pair"),
                100.0 * all("phantom_way").map_or(0.0, |own| own.value),
                count("way_m"),
                100.0 * cells.value,
                cells.cases.cells.unwrap_or_default(),
            ))
        };
        let ranked = self.ranked_algorithms().into_iter();
        ranked.filter_map(words).take(MAX_ESTIMATES).collect()
    }

    /// The limits that algorithms break, and the cells that they are of.
    fn broken_words(&self) -> String {
        let own = self.ranked_algorithms().into_iter();
        let own = own.filter(|a| {
            let unfit = self.unfit.get(&a.algorithm);
            unfit.is_some_and(|own| own.mark() == UNFIT)
        });
        let area = self.deciding_area();
        let is_other = self.has_areas() && area != self.basis.area;
        let cells = if is_other {
            format!(", by {area} cells")
        } else {
            String::new()
        };
        format!("may not be best{cells}: {}", self.unfit_words(own))
    }

    /// True if the numbers are of each algorithm's own pairs, as too few are common.
    pub(crate) fn has_own_pairs(&self) -> bool {
        let common = &self.basis.common;
        let is_any = !self.has_one_algorithm() && self.drives.is_empty();
        is_any && !common.is_shown() && !common.partial.is_empty()
    }

    /// The sentence that says so.
    fn own_pairs_words(&self) -> Option<String> {
        let (common, read) = (self.basis.common.common, self.basis.common.read);
        self.has_own_pairs().then(|| {
            format!(
                "Numbers are of each one's own pairs: {common} of {read} are common to all that \
                 answered half of them."
            )
        })
    }
}
