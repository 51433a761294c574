//! The setting of a swept algorithm to use, with a score from pairs that did not choose it.
//!
//! The best of many settings is the luckiest, too: its score on the pairs that chose it is too
//! good. So each half of the blocks of neighbouring pairs chooses, and the other half scores the
//! choice.

use super::best::SweepChoice;
use super::choice::better_first;
use super::prior_margin::merit_sample;
use super::summary::Results;
use crate::rows::records::Row;
use crate::rows::samples::{blocks, sample};
use std::collections::{BTreeMap, BTreeSet};
use svl_core::counted;
use svl_score::bootstrap::METHOD;
use svl_score::judge::{Better, Metric, TruthLevel};
use svl_score::manifest::AlgorithmRecord;

/// The scores that rank settings.
#[derive(Clone, Copy)]
struct Ranking {
    /// The metric with its direction.
    metric: &'static Metric,
    /// True for right minus wrong cells.
    is_merit: bool,
}

impl Ranking {
    fn score(self, rows: &[&Row]) -> Option<f64> {
        if self.is_merit {
            merit_sample(rows).total()
        } else {
            sample(self.metric, rows)?.total()
        }
    }

    /// The setting that is best on these rows.
    fn best<'a>(self, settings: &BTreeMap<&'a str, Vec<&Row>>) -> Option<&'a str> {
        let scored = settings
            .iter()
            .map(|(label, rows)| (*label, self.score(rows)));
        let scored = scored.filter(|(_, score)| score.is_some());
        let best = scored.min_by(|(_, a), (_, b)| better_first(self.metric, *a, *b));
        best.map(|(label, _)| label)
    }
}

impl Results {
    /// Finds the settings to use, of each kind of algorithm with several. `rows`: those that the
    /// results are of.
    pub(crate) fn choose_settings(&mut self, records: &[AlgorithmRecord], rows: &[Row]) {
        let first = match self.kind() {
            TruthLevel::Distances => Metric::find("right"),
            _ => self.first_metric(),
        };
        let Some(metric) = self.shown.sort.or(first) else {
            return;
        };
        let ranking = Ranking {
            metric,
            is_merit: self.shown.sort.is_none() && self.kind() == TruthLevel::Distances,
        };
        let candidates = self.candidate_labels();
        let (mut choices, mut unchosen) = (Vec::new(), Vec::new());
        let kinds = records.iter().map(|own| (&own.name, &own.filters));
        let mut seen = BTreeSet::new();
        let kinds = kinds.filter(|(name, filters)| seen.insert(format!("{name} {filters:?}")));
        for (name, filters) in kinds {
            let kin = records
                .iter()
                .filter(|own| own.name == *name && own.filters == *filters);
            let labels = kin.map(|own| own.label.as_str());
            let labels: Vec<_> = labels.filter(|label| candidates.contains(label)).collect();
            if labels.len() < 2 {
                continue;
            }
            let is_measured = |label: &&str| self.value(label, metric, None).is_some();
            let choice = if metric.better == Better::Neither {
                let why = "neither less nor more of it is better";
                Err(format!("{}, {why}", metric.name))
            } else if labels.iter().all(is_measured) {
                SweepChoice::new(name, &labels, rows, ranking)
            } else {
                Err(format!("{} is not measured", metric.name))
            };
            match choice {
                Ok(choice) => choices.push(choice),
                Err(why) => unchosen.push(format!("No setting of {name} is named: {why}.")),
            }
        }
        (self.choices, self.unchosen) = (choices, unchosen);
    }

    /// The choices in sentences; where the user asked for a metric, also why no setting
    /// is chosen.
    pub(crate) fn choice_words(&self) -> Vec<String> {
        let unchosen = self.unchosen.iter().filter(|_| self.shown.sort.is_some());
        let choices = self.choices.iter().map(SweepChoice::words);
        choices.chain(unchosen.cloned()).collect()
    }
}

impl SweepChoice {
    /// The choice among two settings or more.
    ///
    /// # Errors
    /// The reason why no setting is chosen.
    fn new<'a>(
        name: &str,
        labels: &[&'a str],
        rows: &'a [Row],
        ranking: Ranking,
    ) -> Result<Self, String> {
        let metric = ranking.metric;
        let no_values = || {
            format!(
                "{} has no values by pairs; sort by another metric",
                metric.name
            )
        };
        let rows_of = |label: &str| -> Vec<_> {
            let rows = rows.iter();
            let own = rows.filter(|row| row.algorithm == label && row.stress.is_none());
            own.collect()
        };
        let all = labels.iter().map(|label| (*label, rows_of(label)));
        let all: BTreeMap<_, Vec<&Row>> = all.collect();
        let blocks = all
            .values()
            .next()
            .map_or_else(Vec::new, |rows| blocks(rows));
        let is_equal = |own: &Vec<&Row>| own.len() == blocks.len();
        if blocks.last().map_or(0, |last| last + 1) < METHOD.fewest_blocks {
            return Err("too few pairs".to_owned());
        }
        if !all.values().all(is_equal) {
            return Err("a setting failed on pairs".to_owned());
        }
        let half = |side: usize| -> BTreeMap<_, Vec<&Row>> {
            let own_half = |(label, rows): (&&'a str, &Vec<&'a Row>)| {
                let own = rows
                    .iter()
                    .zip(&blocks)
                    .filter(|(_, block)| *block % 2 == side);
                (*label, own.map(|(row, _)| *row).collect())
            };
            all.iter().map(own_half).collect()
        };
        let halves = [half(0), half(1)];
        let best = |rows| ranking.best(rows).ok_or_else(no_values);
        let [even, odd] = [best(&halves[0])?, best(&halves[1])?];
        // Each half by the setting that the other one chose.
        let others = [&*halves[1][even], &*halves[0][odd]].concat();
        let setting = best(&all)?;
        let score = |rows: &[&Row]| ranking.score(rows).ok_or_else(no_values);
        Ok(Self {
            algorithm: name.to_owned(),
            settings: labels.len(),
            metric: (!ranking.is_merit).then_some(ranking.metric),
            setting: setting.to_owned(),
            own_score: score(&all[setting])?,
            halves: [even, odd].map(str::to_owned),
            score: score(&others)?,
        })
    }

    fn words(&self) -> String {
        let (words, metric) = match self.metric {
            Some(metric) => (metric.words, Some(metric)),
            None => ("right minus wrong", Metric::find("right")),
        };
        let show = |score: f64| metric.map_or_else(String::new, |metric| metric.show(score));
        let (settings, own) = (counted(self.settings, "setting"), show(self.own_score));
        let (setting, score, [even, odd]) = (&self.setting, show(self.score), &self.halves);
        let halves = if even == odd {
            let chosen = if even == setting { "it" } else { even.as_str() };
            format!("each half chooses {chosen}")
        } else {
            format!(
                "the halves choose differently: {even} and {odd}, each scored on the other half"
            )
        };
        let name = &self.algorithm;
        format!(
            "Of {settings} of {name}, use {setting}: {words} {score} on pairs that did not choose \
             ({halves}), {own} on all pairs, which chose it."
        )
    }
}

#[cfg(test)]
mod tests {
    use super::super::summary::{ReportTables, ResultParts, Shown};
    use super::*;
    use crate::subjects::speed::tests::row;
    use svl_score::judge::MetricValues;
    use svl_score::manifest::Manifest;

    /// 280 pairs in 20 blocks by 40 settings; `right`: cells of 100 that a setting has in a block.
    fn chosen(right: impl Fn(usize, usize) -> f64) -> (SweepChoice, String) {
        let (choices, words) = chosen_by(Shown::default(), right);
        (choices[0].clone(), words)
    }

    /// The same, by what is shown; each pair has a false near obstacle.
    fn chosen_by(shown: Shown, right: impl Fn(usize, usize) -> f64) -> (Vec<SweepChoice>, String) {
        let labels: Vec<_> = (0..40).map(|i| format!("bm:uniqueness={i}")).collect();
        let rows = labels.iter().enumerate().flat_map(|(setting, label)| {
            let right = &right;
            (0..280).map(move |sequence| {
                let right = right(setting, sequence as usize / 14);
                let cells = [("right", right), ("wrong", 0.0), ("unknown", 100.0 - right)];
                let mut metrics = MetricValues::from(cells);
                metrics.set("false", Some(1.0));
                // Nothing is near, so nothing can be missed.
                metrics.set("near", Some(0.0));
                metrics.set("missed", Some(0.0));
                Row {
                    sequence,
                    algorithm: label.clone(),
                    metrics,
                    ..row(1000, (64, 48), None)
                }
            })
        });
        let tables = ReportTables {
            rows: rows.collect(),
            ..ReportTables::default()
        };
        let algorithms: Vec<_> = labels.iter().map(|label| label.parse().unwrap()).collect();
        let manifest = Manifest::new("s", &algorithms).unwrap();
        let parts = ResultParts {
            manifest: Some(&manifest),
            ..ResultParts::default()
        };
        let results = Results::new(&tables, parts, shown).unwrap();
        let words = results.answer().join(" ");
        (results.choices, words)
    }

    #[test]
    fn settings_that_differ_by_luck_alone_score_as_all() {
        // Each block is as good for a setting as a die says: 50 in the mean.
        let mut random = fastrand::Rng::with_seed(5);
        let dice: Vec<f64> = (0..40 * 20)
            .map(|_| f64::from(random.u32(0..=100)))
            .collect();
        let (choice, words) = chosen(|setting, block| dice[20 * setting + block]);
        assert!(
            choice.own_score > 0.6 && (choice.score - 0.5).abs() < 0.08,
            "{choice:?}"
        );
        assert_ne!(choice.halves[0], choice.halves[1]);
        assert!(
            words.contains("the halves choose differently: bm:uniqueness="),
            "{words}"
        );
    }

    #[test]
    fn a_setting_that_is_better_is_chosen_by_all() {
        let (choice, words) = chosen(|setting, block| {
            let is_best = if setting == 7 { 20.0 } else { 0.0 };
            50.0 + is_best + (setting * block % 3) as f64
        });
        assert_eq!(choice.setting, "bm:uniqueness=7");
        let expected = "Of 40 settings of bm, use bm:uniqueness=7: right minus wrong 71.0 % on \
                        pairs that did not choose (each half chooses it), 71.0 % on all pairs, \
                        which chose it.";
        assert!(words.contains(expected), "{words}");
    }

    #[test]
    fn counts_of_both_halves_are_those_of_all() {
        let by = |name| {
            let shown = Shown {
                sort: Metric::find(name),
                ..Shown::default()
            };
            chosen_by(shown, |_, _| 50.0)
        };
        let (choices, words) = by("false");
        assert_eq!(
            [choices[0].score, choices[0].own_score],
            [280.0; 2],
            "{words}"
        );
        // The number of the truth's near obstacles chooses nothing.
        for (name, why) in [
            ("near", "near, neither less nor more of it is better"),
            ("rmse", "rmse is not measured"),
            ("missed", "missed is not measured"),
        ] {
            let (choices, words) = by(name);
            assert_eq!(choices.len(), 0);
            let sentence = format!("No setting of bm is named: {why}.");
            assert!(words.contains(&sentence), "{words}");
        }
    }
}
