//! Losses of an algorithm under stress, from unperturbed pairs or drives to perturbed ones, that
//! are no chance.

use super::change::{Change, Judgement, changes};
use super::summary::{CheckpointSummary, ReportTables, Results};
use crate::rows::held::Rows;
use crate::rows::samples::{paired, runs, sample, totals};
use crate::show::table::model::Table;
use crate::subjects::drives::DriveRow;
use crate::subjects::stress::{
    Loss, MIN_SAME, NUMBERS, StressNumber, StressSummary, kinds, stress_table,
};
use std::collections::BTreeMap;
use svl_core::Result;
use svl_score::bootstrap::METHOD;
use svl_score::holm::MAX_P;
use svl_score::judge::{AreaChoice, Better, Measured, Metric, MetricUnit, signs};
use svl_sim::stress::Stress;

/// Fewest frames of a checkpoint that can be lost.
const MIN_FRAMES: u64 = METHOD.fewest_blocks as u64;

/// Larger than what rounding adds to a difference.
const EPSILON: f64 = 1e-9;

impl Results {
    /// The perturbed pairs or drives, per kind of perturbation the unperturbed ones as level 0.
    ///
    /// # Errors
    /// The error of a perturbation that svl does not know.
    pub(crate) fn stressed(&self, tables: &ReportTables) -> Result<Vec<StressSummary>> {
        let mut levels: Vec<(&str, Stress)> = Vec::new();
        for text in tables.rows.iter().filter_map(|row| row.stress()) {
            if levels.iter().all(|(known, _)| *known != text) {
                levels.push((text, text.parse()?));
            }
        }
        // A map that others computed has no perturbed pairs.
        let is_perturbed = |label: &str| {
            let mut perturbed = tables.rows.iter().filter(|row| row.stress().is_some());
            perturbed.any(|row| row.algorithm() == label)
        };
        let labels = self.algorithms.iter().map(|a| a.algorithm.as_str());
        let labels: Vec<_> = labels.filter(|label| is_perturbed(label)).collect();
        let mut summaries = Vec::new();
        for (i, (text, stress)) in levels.iter().enumerate() {
            let kind = stress.kind();
            let mut before = levels[..i].iter();
            let is_first = before.all(|(_, other)| other.kind().name != kind.name);
            let none = is_first.then_some((None, 0.0));
            for (text, level) in none.into_iter().chain([(Some(*text), stress.level())]) {
                let mut sums = Self::from_rows(&tables.rows, &tables.checkpoints, text);
                sums.add_drives(&tables.drives, text);
                let summary = |label: &&str| StressSummary {
                    kind: kind.name,
                    level,
                    ..self.stress_summary(&sums, tables, text, label)
                };
                summaries.extend(labels.iter().map(summary));
            }
        }
        Ok(summaries)
    }

    /// The results of an algorithm at the level of `sums`, against these unperturbed ones.
    fn stress_summary(
        &self,
        sums: &Self,
        tables: &ReportTables,
        text: Option<&str>,
        label: &str,
    ) -> StressSummary {
        let is_driven = !tables.drives.is_empty();
        let right = Metric::find("right").and_then(|right| self.value(label, right, None));
        let is_shown = |metric: &Metric| {
            let is_known = metric.against_truth == right.is_some()
                || ["passed", "phantoms"].contains(&metric.name);
            metric.is_of_drives() == is_driven && (is_driven || is_known)
        };
        let numbers = NUMBERS.iter().filter_map(|number| {
            let metric = Metric::find(number.name).filter(|metric| is_shown(metric))?;
            Some((number, metric))
        });
        let values = numbers.clone().filter_map(|(number, metric)| {
            let own = sums.measurement(label, metric, None, sums.basis.area)?;
            Some((number.name, number.value(metric, own)?))
        });
        let decide = numbers.clone().filter(|(number, _)| number.loss.is_some());
        let decide: Vec<_> = decide.map(|(_, metric)| metric).collect();
        let changes = match text {
            None => Vec::new(),
            Some(text) if is_driven => course_changes(&tables.drives, label, text, &decide),
            Some(text) => pair_changes(&tables.rows, label, text, &decide),
        };
        let losses = numbers.filter_map(|(number, metric)| {
            let change = changes.iter().find(|change| change.metric == metric)?;
            Some((change.judgement, loss_words(number, change)?))
        });
        let real = losses.filter(|(own, _)| *own == Judgement::Worse);
        let lost = lost_checkpoints(&self.checkpoints, &sums.checkpoints, label);
        let broken: Vec<_> = real.map(|(_, words)| words).chain(lost).collect();
        let is_few = |own: Judgement| own == Judgement::TooFew;
        let own = tables.drives.iter().filter(|row| row.algorithm == label);
        let courses = own.filter(|row| row.stress.as_deref() == text).count();
        let own = tables.rows.iter().filter(|row| row.algorithm() == label);
        let own: Vec<_> = own.filter(|row| row.stress() == text).collect();
        let cases = if is_driven {
            courses
        } else {
            runs(&own).blocks()
        };
        let untold = if text.is_none() || !broken.is_empty() {
            None
        } else if changes.is_empty() {
            Some("not measured")
        } else if cases < METHOD.fewest_blocks
            || changes.iter().any(|change| is_few(change.judgement))
        {
            Some(if is_driven {
                "too few courses to tell"
            } else {
                "too few pairs to tell"
            })
        } else {
            None
        };
        let own = sums.algorithms.iter().find(|a| a.algorithm == label);
        StressSummary {
            kind: "",
            level: 0.0,
            algorithm: label.to_owned(),
            pairs: own.map_or(0, |a| a.pairs),
            values: values.collect(),
            broken: (!broken.is_empty()).then(|| broken.join(", ")),
            untold,
        }
    }

    /// A table per kind of perturbation: what breaks each algorithm first, and its numbers by
    /// level.
    pub fn stress_tables(&self) -> Vec<Table> {
        let kinds = kinds(&self.stress).into_iter();
        let mut tables: Vec<_> = kinds.map(|kind| stress_table(kind, &self.stress)).collect();
        if let Some(last) = tables.last_mut() {
            last.note(
                "breaks at",
                format!(
                    "the least level at which missed near obstacles rise by 5 points of the near \
                     ones, found ones fall by 10 points, wrong cells rise by 5 points, or right \
                     ones fall by a tenth, and the 95 % interval of the paired difference \
                     excludes 0; or at which a checkpoint of {MIN_FRAMES} frames or more does not \
                     pass in half of them any more. Without truth: at which same is below {:.0} %, \
                     and its interval, too. In drives: at which collisions, finished courses or \
                     near misses become worse by an exact sign test over the courses",
                    100.0 * MIN_SAME
                ),
            );
            let same = self.stress.iter().any(|s| s.values.contains_key("same"));
            let same = Metric::find("same").filter(|_| same);
            if let Some(note) = same.and_then(|same| same.note) {
                let (_, meaning) = note.text(self.shown.rule);
                last.note("same, changed, gone", meaning);
            }
        }
        tables
    }
}

/// The changes of metrics from the unperturbed pairs of an algorithm to the perturbed ones.
fn pair_changes(rows: &Rows, label: &str, text: &str, metrics: &[&'static Metric]) -> Vec<Change> {
    let own = |stress| {
        let own = rows.iter().filter(|row| row.algorithm() == label);
        own.filter(|row| row.stress() == stress).collect::<Vec<_>>()
    };
    let [before, now] = paired(&own(None), &own(Some(text)));
    let mut all = changes(&before, &now, metrics.iter().copied());
    let same = metrics.iter().find(|metric| metric.name == "same");
    all.extend(same.and_then(|same| {
        let own = totals(&now).measured(same, AreaChoice::default())?;
        let value = same.value_of(own)?;
        let interval = sample(same, &now)?.interval(&runs(&now));
        // All cells are the same before; the difference that counts is that from the limit.
        let interval = interval.map(|(low, high)| (low - MIN_SAME, high - MIN_SAME));
        Some(Change {
            cases: Some([own.cases; 2]),
            ..Change::new(same, [1.0, value], value - 1.0, interval)
        })
    }));
    all
}

/// The changes of metrics from the unperturbed drives of an algorithm to the perturbed ones.
fn course_changes(
    drives: &[DriveRow],
    label: &str,
    text: &str,
    metrics: &[&'static Metric],
) -> Vec<Change> {
    let own = drives.iter().filter(|row| row.algorithm == label);
    let plain = own.clone().filter(|row| row.stress.is_none());
    let plain: BTreeMap<_, _> = plain.map(|row| (row.seed, row)).collect();
    let own = own.filter(|row| row.stress.as_deref() == Some(text));
    let courses = own.filter_map(|row| Some([*plain.get(&row.seed)?, row]));
    let courses: Vec<_> = courses.collect();
    let changes = metrics.iter();
    let changes = changes.map(|metric| Change::from_drives(metric, &courses, 1));
    changes.filter_map(std::result::Result::ok).collect()
}

/// The checkpoints of an algorithm that passed in half of their frames and do not any more, in
/// words. The frames that fail now besides are no chance by the sign test.
fn lost_checkpoints(
    before: &[CheckpointSummary],
    now: &[CheckpointSummary],
    label: &str,
) -> Option<String> {
    let passes = |own: &CheckpointSummary| 2 * own.passed >= own.frames;
    let failed = |own: &CheckpointSummary| (own.frames - own.passed) as usize;
    let is_lost = |own: &&CheckpointSummary| {
        let mut now = now.iter().filter(|now| now.algorithm == label);
        let now = now.find(|now| now.checkpoint == own.checkpoint && now.frames >= MIN_FRAMES);
        now.is_some_and(|now| {
            let more = failed(now).saturating_sub(failed(own));
            passes(own) && !passes(now) && signs::p_value([more, 0]) <= MAX_P
        })
    };
    let own = before.iter().filter(|own| own.algorithm == label);
    let own = own.filter(|own| own.frames >= MIN_FRAMES).filter(is_lost);
    let lost: Vec<_> = own.map(|own| own.checkpoint.to_string()).collect();
    let noun = if lost.len() == 1 {
        "checkpoint"
    } else {
        "checkpoints"
    };
    (!lost.is_empty()).then(|| format!("{noun} {}", lost.join(", ")))
}

/// The change in words if it is a loss, by chance or not.
fn loss_words(number: &StressNumber, change: &Change) -> Option<String> {
    let [a, b] = change.cases?;
    let value = |value, cases| number.value(change.metric, Measured { value, cases });
    let (before, now) = (value(change.base, a)?, value(change.other, b)?);
    let loss = match change.metric.better {
        Better::More => before - now,
        _ => now - before,
    };
    let least = match number.loss.as_ref()? {
        Loss::By(least) => *least,
        Loss::Part(least) => least * before,
    };
    let words = match number.unit {
        MetricUnit::Share => format!("{:.0} → {:.0} %", 100.0 * before, 100.0 * now),
        _ => format!("{before:.1} → {now:.1} per 100 m"),
    };
    (loss > least - EPSILON).then(|| format!("{} {words}", number.words))
}

#[cfg(test)]
mod tests {
    use super::super::summary::{ResultParts, Shown};
    use super::*;
    use crate::rows::held::Row;
    use crate::rows::records::CheckpointRow;
    use crate::show::table::model::TableCell;
    use crate::show::words::NONE;
    use crate::subjects::drives::tests::drive;
    use crate::subjects::speed::tests::row;
    use svl_score::judge::MetricValues;

    /// The numbers of a pair: name and value.
    type Counts<'a> = &'a [(&'a str, f64)];

    /// 80 pairs, unperturbed and at `jpeg=10`. Every other one has one right cell less.
    fn pairs(pairs: u64, [plain, perturbed]: [Counts<'_>; 2]) -> Rows {
        let row = |(sequence, counts, stress): (u64, Counts<'_>, Option<&str>)| {
            let mut metrics = MetricValues::default();
            for (name, value) in counts {
                let less = u64::from(*name == "right") * (sequence % 2);
                metrics.set(name, Some(value - less as f64));
            }
            Row {
                sequence,
                metrics,
                stress: stress.map(str::to_owned),
                ..row(1000, (64, 48), None)
            }
        };
        let levels = [(plain, None), (perturbed, Some("jpeg=10"))];
        let rows = levels.into_iter();
        let rows = rows.flat_map(|(own, stress)| (0..pairs).map(move |i| (i, own, stress)));
        rows.map(row).collect()
    }

    fn results(tables: &ReportTables) -> Results {
        Results::new(tables, ResultParts::default(), Shown::default()).unwrap()
    }

    /// The summary of the perturbed pairs, and the words of the table.
    fn at_level(tables: &ReportTables) -> (StressSummary, String) {
        let results = results(tables);
        let table = results.stress_tables().remove(0);
        let TableCell::Text(breaks) = table.rows[0][1].clone() else {
            panic!("{table:?}");
        };
        (results.stress[1].clone(), breaks)
    }

    fn breaks(rows: Rows) -> String {
        let tables = ReportTables {
            rows,
            ..ReportTables::default()
        };
        at_level(&tables).1
    }

    const NAMES: [&str; 6] = ["right", "wrong", "unknown", "missed", "found", "near"];

    /// The numbers of a pair: right, wrong and unknown cells, missed and found obstacles, all.
    fn numbers(values: [f64; 6]) -> [(&'static str, f64); 6] {
        std::array::from_fn(|i| (NAMES[i], values[i]))
    }

    fn plain() -> [(&'static str, f64); 6] {
        numbers([61.0, 16.0, 24.0, 2.0, 40.0, 50.0])
    }

    /// The same with other numbers.
    fn changed(changes: Counts<'_>) -> Vec<(&'static str, f64)> {
        let changed = |(name, value)| {
            let own = changes.iter().find(|(own, _)| *own == name);
            (name, own.map_or(value, |(_, value)| *value))
        };
        plain().into_iter().map(changed).collect()
    }

    #[test]
    fn all_that_is_lost_is_named_in_its_order() {
        let broken = |values| breaks(pairs(80, [&plain(), &numbers(values)]));
        let words = "10: missed near 4 → 10 %, found near 80 → 70 %, wrong 16 → 22 %, \
                     right 60 → 52 %";
        assert_eq!(broken([53.0, 22.0, 26.0, 5.0, 35.0, 50.0]), words);
        // A blind algorithm misses nothing.
        let blind = broken([1.0, 0.0, 100.0, 0.0, 0.0, 50.0]);
        assert_eq!(blind, "10: found near 80 → 0 %, right 60 → 0 %");
        assert_eq!(broken([56.0, 20.0, 25.0, 4.0, 36.0, 50.0]), NONE);
        assert_eq!(broken(plain().map(|(_, value)| value)), NONE);
    }

    #[test]
    fn few_pairs_and_no_cells_tell_nothing() {
        let worse = changed(&[("wrong", 40.0), ("right", 30.0)]);
        for perturbed in [&worse[..], &plain()] {
            let found = breaks(pairs(20, [&plain(), perturbed]));
            assert_eq!(found, "too few pairs to tell");
        }
        let nothing = [("right", 0.0), ("wrong", 0.0), ("unknown", 0.0)];
        assert_eq!(breaks(pairs(80, [&nothing; 2])), "not measured");
    }

    #[test]
    fn without_truth_the_unperturbed_answer_is_kept() {
        let known = [("known", 0.9)];
        let kept = |same: f64| {
            let kept = [("same", same), ("changed", 100.0 - same), ("gone", 0.0)];
            let own = [&known[..], &kept].concat();
            let tables = ReportTables {
                rows: pairs(80, [&known, &own]),
                ..ReportTables::default()
            };
            at_level(&tables)
        };
        let (summary, breaks) = kept(89.0);
        assert_eq!(breaks, "10: same 100 → 89 %");
        let shares = ["same", "changed", "gone"].map(|name| summary.values.get(name).copied());
        assert_eq!(shares, [0.89, 0.11, 0.0].map(Some));
        assert_eq!([91.0, 100.0].map(|same| kept(same).1), [NONE; 2]);
    }

    #[test]
    fn a_checkpoint_is_lost_with_eight_frames_and_six_failures() {
        let lost = |frames, before, now| {
            let row = |(passed, stress): (u64, Option<&str>)| CheckpointRow {
                scenario: String::new(),
                seed: None,
                checkpoint: 3,
                name: "wall".into(),
                algorithm: "v3".into(),
                frames,
                passed,
                share: None,
                best_sequence: None,
                best_passed: None,
                worst_sequence: None,
                worst_passed: None,
                run: None,
                stress: stress.map(str::to_owned),
            };
            let tables = ReportTables {
                rows: pairs(80, [&plain(), &plain()]),
                checkpoints: [(before, None), (now, Some("jpeg=10"))].map(row).into(),
                ..ReportTables::default()
            };
            at_level(&tables).1
        };
        assert_eq!(lost(8, 8, 2), "10: checkpoint 3");
        for (frames, before, now) in [(7, 7, 0), (8, 4, 3), (20, 20, 10), (20, 9, 0)] {
            assert_eq!(lost(frames, before, now), NONE, "{frames} {before} {now}");
        }
    }

    #[test]
    fn drives_break_by_their_courses() {
        let broken = |courses: u64, change: fn(&mut DriveRow)| {
            let level = |stress: Option<&str>| {
                let mut rows: Vec<_> = (0..courses).map(|seed| drive(seed, "v3")).collect();
                for row in &mut rows {
                    row.stress = stress.map(str::to_owned);
                    if stress.is_some() {
                        change(row);
                        row.track_hash.clear();
                    }
                }
                rows
            };
            let tables = ReportTables {
                // The cells of two paths are not comparable.
                rows: pairs(80, [&plain(), &changed(&[("right", 1.0)])]),
                drives: [level(None), level(Some("jpeg=10"))].concat(),
                ..ReportTables::default()
            };
            at_level(&tables).1
        };
        let hit = |row: &mut DriveRow| (row.finished, row.collisions) = (false, 1);
        let words = "10: collisions 0.0 → 16.7 per 100 m, finished 100 → 0 %";
        assert_eq!(broken(8, hit), words);
        assert_eq!(broken(5, hit), "too few courses to tell");
        assert_eq!(broken(1, |_| ()), "too few courses to tell");
        let near = |row: &mut DriveRow| row.near_misses = 2;
        assert_eq!(broken(8, near), "10: near misses 0.0 → 33.3 per 100 m");
        // A robot that stands hits nothing, and finishes nothing.
        let stands = |row: &mut DriveRow| {
            (row.finished, row.arrived) = (false, false);
            (row.driven_m, row.route_m) = (0.0, 0.0);
        };
        assert_eq!(broken(8, stands), "10: finished 100 → 0 %");
        assert_eq!(broken(8, |_| ()), NONE);
    }
}
