//! The setting of a swept algorithm to use, with a score from pairs that did not choose it.
//!
//! The best of many settings is the luckiest, too: its score on the pairs that chose it is too
//! good. So each half of the blocks of neighbouring pairs chooses, and the other half scores the
//! choice.

use super::best::{BestSetting, RowsByAlgorithm, SweepChoice, Unfit};
use super::change::{Change, Judgement};
use super::choice::{MIN_AHEAD, better_first, merit_sample};
use super::summary::{AlgorithmSummary, Results};
use crate::rows::held::RowRef;
use crate::rows::samples::{paired, runs, sample};
use svl_core::counted;
use svl_core::matcher;
use svl_score::bootstrap::{METHOD, Sample};
use svl_score::judge::{Better, Metric, TruthLevel};
use svl_score::manifest::AlgorithmRecord;

/// Reason of a sweep without a choice.
const FEW_PAIRS: &str = "too few pairs to tell";

/// The settings that are compared, with their rows of the pairs that all of them have.
type SettingRows<'a> = Vec<(&'a str, Vec<RowRef<'a>>)>;

/// True if one algorithm differs from the other in its settings alone: both are of one program,
/// file or topic.
pub(crate) fn are_settings_of_one(a: &AlgorithmRecord, b: &AlgorithmRecord) -> bool {
    let spec = matcher::find(&a.name).ok();
    let is_setting = |key: &str| {
        let parameter = spec.and_then(|spec| spec.parameter(key));
        parameter.is_some_and(|own| own.range.is_setting())
    };
    let mut both = a.values.iter().zip(&b.values);
    let is_same = |((key, own), (_, other)): (&(String, String), &(String, String))| {
        is_setting(key) || own == other
    };
    a.name == b.name && a.filters == b.filters && both.all(is_same)
}

impl Results {
    /// Finds the settings to use, of each algorithm with several.
    pub(crate) fn choose_settings(
        &mut self,
        records: &[AlgorithmRecord],
        rows: &RowsByAlgorithm<'_>,
    ) {
        let is_merit = self.shown.sort.is_none() && self.kind() == TruthLevel::Distances;
        let metric = self.shown.sort.or_else(|| self.first_metric());
        let Some(metric) = metric.filter(|_| self.kind() != TruthLevel::Courses) else {
            return;
        };
        let mut kins: Vec<Vec<&AlgorithmRecord>> = Vec::new();
        for own in records {
            match kins.iter_mut().find(|kin| are_settings_of_one(kin[0], own)) {
                Some(kin) => kin.push(own),
                None => kins.push(vec![own]),
            }
        }
        let is_sweep =
            |kin: &&Vec<&AlgorithmRecord>| kin.iter().any(|own| own.values != kin[0].values);
        let choices = kins.iter().filter(is_sweep).map(|kin| {
            let mut choice = SweepChoice {
                algorithm: kin[0].name.clone(),
                settings: kin.len(),
                metric: (!is_merit).then_some(metric),
                setting: None,
                reason: None,
            };
            let labels: Vec<_> = kin.iter().map(|own| own.label.as_str()).collect();
            match self.best_setting(&labels, metric, is_merit, rows) {
                Ok(setting) => choice.setting = Some(setting),
                Err(reason) => choice.reason = Some(reason),
            }
            choice
        });
        self.choices = choices.collect();
    }

    /// The setting with the best estimate: it is of all pairs, so all choose.
    fn best_estimated(
        settings: Vec<&AlgorithmSummary>,
        metric: &'static Metric,
    ) -> Result<BestSetting, String> {
        let estimates = settings.iter();
        let estimates = estimates.filter_map(|a| Some((&a.algorithm, a.value(metric)?)));
        let mut estimates: Vec<_> = estimates.collect();
        estimates.sort_by(|(_, a), (_, b)| better_first(metric, Some(*a), Some(*b)));
        let why = || format!("no {}", metric.words);
        let (label, best) = estimates.first().ok_or_else(why)?;
        let alike = estimates
            .iter()
            .filter(|(_, own)| (own - best).abs() < MIN_AHEAD);
        Ok(BestSetting {
            label: (*label).clone(),
            own_score: *best,
            score: *best,
            alike: alike.count() - 1,
        })
    }

    fn best_setting(
        &self,
        labels: &[&str],
        metric: &'static Metric,
        is_merit: bool,
        rows: &RowsByAlgorithm<'_>,
    ) -> Result<BestSetting, String> {
        if metric.better == Better::Neither {
            return Err(format!("{} has no better direction", metric.name));
        }
        let own = self.algorithms.iter();
        let own = own.filter(|a| labels.contains(&&*a.algorithm));
        if metric.estimated().is_some() {
            return Self::best_estimated(own.collect(), metric);
        }
        // Right minus wrong cells choose none of easy cells alone, whatever other algorithms are.
        let is_easy = |a: &AlgorithmSummary| self.unfit.get(&a.algorithm) == Some(&Unfit::Easy);
        let is_fit = |a: &&AlgorithmSummary| self.may_be_best(a) || is_merit && is_easy(a);
        let fit = own.clone().filter(is_fit);
        let fit = fit.filter_map(|a| rows.get_key_value(a.algorithm.as_str()));
        let mut settings: SettingRows<'_> = fit.map(|(label, own)| (*label, own.clone())).collect();
        let Some((_, mut common)) = settings.first().cloned() else {
            let is_few =
                |a: &AlgorithmSummary| self.unfit.get(&a.algorithm) == Some(&Unfit::TooFewPairs);
            let is_any = own.clone().next().is_some();
            return Err(match self.unfit_words(own.clone()) {
                _ if is_any && own.clone().all(is_few) => FEW_PAIRS.to_owned(),
                why if why.is_empty() => "no pair was answered".to_owned(),
                why => why,
            });
        };
        for (_, own) in &settings {
            [common, _] = paired(&common, own);
        }
        for (_, own) in &mut settings {
            [_, *own] = paired(&common, own);
        }
        let runs = runs(&common);
        let blocks = runs.block_numbers();
        if runs.blocks() < METHOD.fewest_blocks {
            return Err(FEW_PAIRS.to_owned());
        }
        let measure = |rows: &[RowRef<'_>]| {
            let merit = is_merit.then(|| merit_sample(rows, self.basis.area));
            merit.or_else(|| sample(metric, rows))
        };
        let score = |rows: &[RowRef<'_>]| measure(rows).as_ref().and_then(Sample::total);
        let best = |settings: &SettingRows<'_>| {
            let scored = settings.iter().enumerate();
            let scored = scored.filter_map(|(i, (_, rows))| Some((i, score(rows)?)));
            let best = scored.min_by(|(_, a), (_, b)| better_first(metric, Some(*a), Some(*b)));
            best.ok_or_else(|| format!("{} is not measured by pairs", metric.name))
        };
        let half = |side: usize| -> SettingRows<'_> {
            let mut half = settings.clone();
            for (_, rows) in &mut half {
                let mut blocks = blocks.iter();
                rows.retain(|_| blocks.next().is_some_and(|block| block % 2 == side));
            }
            half
        };
        let halves = [half(0), half(1)];
        let [even, odd] = [best(&halves[0])?.0, best(&halves[1])?.0];
        let unseen = [&*halves[1][even].1, &*halves[0][odd].1].concat();
        let (place, own_score) = best(&settings)?;
        let is_alike = |rows: &[RowRef<'_>]| {
            let (a, b) = measure(&settings[place].1).zip(measure(rows))?;
            let values = [a.total()?, b.total()?];
            let change = Change::from_samples(metric, values, [&a, &b], &runs);
            (change.judgement != Judgement::Worse).then_some(())
        };
        let alike = settings.iter().filter_map(|(_, rows)| is_alike(rows));
        Ok(BestSetting {
            label: settings[place].0.to_owned(),
            own_score,
            score: score(&unseen).unwrap_or(own_score),
            // It is one of them.
            alike: alike.count().saturating_sub(1),
        })
    }
}

impl SweepChoice {
    /// The choice in a sentence.
    pub(crate) fn words(&self) -> String {
        let (settings, name) = (counted(self.settings, "setting"), &self.algorithm);
        let Some(own) = &self.setting else {
            let reason = self.reason.as_deref().unwrap_or_default();
            return format!("Of {settings} of {name} none is chosen: {reason}.");
        };
        let words = self
            .metric
            .map_or("right minus wrong", |metric| metric.words);
        let metric = self.metric.or_else(|| Metric::find("right"));
        let show = |score: f64| metric.map_or_else(String::new, |metric| metric.show(score));
        let alike = match own.alike {
            0 => String::new(),
            1 => "; another is not told apart from it".to_owned(),
            alike => format!("; {alike} others are not told apart from it"),
        };
        let unseen = if metric.is_some_and(|metric| metric.estimated().is_some()) {
            String::new()
        } else {
            format!(", {} on pairs that did not choose", show(own.score))
        };
        format!(
            "Of {settings} of {name}, use {}: {words} {}{unseen}{alike}.",
            own.label,
            show(own.own_score),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::super::summary::{ReportTables, ResultParts, Shown};
    use super::*;
    use crate::rows::held::Row;
    use crate::subjects::speed::tests::row;
    use svl_score::judge::MetricValues;
    use svl_score::manifest::Manifest;

    /// 280 pairs in 20 blocks by 40 settings; `right`: cells of 100 that a setting has in a block.
    fn chosen(right: impl Fn(usize, usize) -> f64) -> (SweepChoice, String) {
        let (choices, words) = chosen_by(Shown::default(), settings(), right);
        (choices[0].clone(), words)
    }

    fn settings() -> Vec<String> {
        (0..40).map(|i| format!("bm:uniqueness={i}")).collect()
    }

    /// The same among these, by what is shown; each pair has a false near obstacle.
    fn chosen_by(
        shown: Shown,
        labels: Vec<String>,
        right: impl Fn(usize, usize) -> f64,
    ) -> (Vec<SweepChoice>, String) {
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
        let words = results.choices[0].words();
        (results.choices, words)
    }

    #[test]
    fn settings_that_differ_by_luck_alone_score_as_all() {
        // Each block is as good for a setting as a die says: 50 in the mean.
        let mut random = fastrand::Rng::with_seed(5);
        let dice = (0..40 * 20).map(|_| f64::from(random.u32(0..=100)));
        let dice: Vec<_> = dice.collect();
        let (choice, words) = chosen(|setting, block| dice[20 * setting + block]);
        let own = choice.setting.unwrap();
        let is_luck = own.own_score > 0.6 && (own.score - 0.5).abs() < 0.08;
        assert!(is_luck, "{own:?}");
        assert!(own.alike > 10, "{words}");
    }

    #[test]
    fn a_setting_that_is_better_is_chosen_by_all() {
        let (_, words) = chosen(|setting, block| {
            let is_best = if setting == 7 { 20.0 } else { 0.0 };
            50.0 + is_best + (setting * block % 3) as f64
        });
        let expected = "Of 40 settings of bm, use bm:uniqueness=7: right minus wrong 71.0 %, 71.0 \
                        % on pairs that did not choose.";
        assert_eq!(words, expected);
    }

    #[test]
    fn no_setting_is_named_that_may_not_be_best() {
        let (choice, words) = chosen(|_, _| 5.0);
        let why = "none is chosen: under 10 % right (bm:uniqueness=0 5.0 ";
        assert!(
            words.starts_with(&format!("Of 40 settings of bm {why}")),
            "{words}"
        );
        assert_eq!(choice.setting, None);
        let shown = Shown {
            sort: Metric::find("near"),
            ..Shown::default()
        };
        let (_, words) = chosen_by(shown, settings(), |_, _| 50.0);
        let why = "none is chosen: near has no better direction";
        assert!(words.contains(why), "{words}");
    }

    #[test]
    fn another_algorithm_changes_no_choice_among_settings() {
        let right = |setting: usize, _: usize| [30.0, 40.0, 95.0][setting.saturating_sub(38)];
        let (alone, _) = chosen(right);
        let labels = settings().into_iter().chain(["sgm".to_owned()]).collect();
        let (beside, _) = chosen_by(Shown::default(), labels, right);
        assert_eq!(alone.setting.as_ref().unwrap().label, "bm:uniqueness=39");
        assert_eq!(beside, [alone]);
    }

    #[test]
    fn programs_and_topics_are_no_settings_of_each_other() {
        let texts = "a=exec:command=a b=exec:command=b bm:uniqueness=3 bm".split(' ');
        let algorithms: Vec<_> = texts.map(|text| text.parse().unwrap()).collect();
        let records = Manifest::new("s", &algorithms).unwrap().algorithms;
        assert!(!are_settings_of_one(&records[0], &records[1]));
        assert!(are_settings_of_one(&records[2], &records[3]));
    }
}
