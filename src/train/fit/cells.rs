//! Fits a [`VerdictTable`] to samples: a logistic regression on steps ([`super::steps`]).
//!
//! The number of steps is chosen by cross-validation: whole groups are held out, never single
//! cells, as the cells of a run are similar to each other.

use super::CellSample;
use super::steps::{StepData, StepModel, StepSide, at, fewest};
use svl_core::depth::decision::{Feature, VerdictTable};

/// A fitted table, with its figures on the samples.
#[derive(Clone, Debug)]
pub struct CellFit {
    pub table: VerdictTable,
    /// Per sample, in order, the log odds in thousandths from a table fitted without the sample's
    /// fold; the least number if there is nothing to report.
    pub held_out: Vec<i64>,
    /// Per kind a table fitted without it; empty if there is only one.
    pub without_kind: Vec<VerdictTable>,
    /// Mean logistic loss of held-out samples by the number of steps, from 0 on.
    pub losses: Vec<f64>,
}

/// Largest number of steps in a table.
pub const MAX_STEPS: usize = 32;

/// Folds into which the groups are divided for the cross-validation.
pub const FOLDS: usize = 5;

/// Fits base and steps of a table to samples of those kinds with those weights; all else is that of
/// `like`. Samples with nothing to report are ignored.
///
/// The result depends only on the samples and their order.
///
/// `progress` is called after each of the [`FOLDS`], each of several kinds, and the final fit; if
/// it returns false, the result is `None`.
pub fn fit_cells(
    samples: &[CellSample],
    kinds: &[usize],
    weights: &[f64],
    like: &VerdictTable,
    progress: impl Fn() -> bool + Sync,
) -> Option<CellFit> {
    let features = samples
        .iter()
        .map(|sample| sample.evidence.unwrap_or_default().features);
    let right = samples.iter().map(|sample| sample.right).collect();
    let data = StepData::new(
        features.collect(),
        right,
        weights.to_vec(),
        Feature::ALL.map(side),
    );
    let reportable: Vec<_> = (0..samples.len())
        .filter(|&i| samples[i].is_reportable())
        .collect();
    let fold = |i: usize| samples[i].group % FOLDS;
    let folds = data.hold_out(&reportable, MAX_STEPS, FOLDS, &fold, &progress)?;
    let losses = data.losses(&folds, MAX_STEPS);
    let steps = fewest(&losses);
    let table = |model: &StepModel| {
        let (base, steps) = data.steps(model);
        VerdictTable {
            base,
            steps,
            time: None,
            ..like.clone()
        }
    };
    let mut held_out = vec![i64::MIN; samples.len()];
    for (path, test) in &folds.parts {
        let table = table(at(path, steps));
        for &i in test {
            held_out[i] = table.score(&samples[i].evidence.unwrap_or_default());
        }
    }
    let without_kind = match kinds.iter().max() {
        None | Some(0) => Vec::new(),
        Some(last) => {
            let kind = |i: usize| kinds[i];
            let kinds = data.hold_out(&reportable, steps, last + 1, &kind, &progress)?;
            let tables = kinds.parts.iter().map(|(path, _)| table(at(path, steps)));
            tables.collect()
        }
    };
    let path = data.path(&reportable, steps);
    progress().then(|| CellFit {
        table: table(at(&path, steps)),
        held_out,
        without_kind,
        losses,
    })
}

/// More margin, support, seen pixels, votes and a wider tolerance never make a report less
/// probable, nor do a greater shift and cost make it more so. So a fit contains less that holds
/// only for its samples.
fn side(feature: Feature) -> StepSide {
    match feature {
        Feature::Margin
        | Feature::Support
        | Feature::Seen
        | Feature::Span
        | Feature::Voted
        | Feature::Agreed => StepSide::Rises,
        Feature::Shift | Feature::Cost => StepSide::Falls,
        Feature::Texture => StepSide::Either,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth::decision::Steps;
    use svl_core::matcher::V5Model;
    use svl_core::stereo::CellEvidence;

    fn like() -> VerdictTable {
        V5Model::built_in().median
    }

    /// Cells decided by margin and cost, with that many groups.
    fn samples(count: usize, groups: usize) -> Vec<CellSample> {
        let mut random = fastrand::Rng::with_seed(7);
        let sample = |i: usize| {
            let mut features = [0; CellEvidence::FEATURES];
            features.fill_with(|| random.i64(0..1000));
            let odds = -1.0 + 3.0 * f64::from(features[Feature::Margin as usize] > 400)
                - 2.0 * f64::from(features[Feature::Cost as usize] > 700);
            CellSample {
                group: i % groups,
                evidence: Some(CellEvidence {
                    report: 40,
                    target: 40,
                    features,
                    plain: 0,
                }),
                right: random.f64() < 1.0 / (1.0 + (-odds).exp()),
                known: false,
            }
        };
        (0..count).map(sample).collect()
    }

    #[test]
    fn known_steps_are_found() {
        let samples = samples(20_000, 10);
        let kinds: Vec<_> = (0..samples.len()).map(|i| i % 3).collect();
        let fit = fit_cells(&samples, &kinds, &vec![1.0; samples.len()], &like(), || {
            true
        })
        .unwrap();
        let score_at = |feature: Feature, value: i64| {
            let steps: &Steps = &fit.table.steps[feature as usize];
            steps.score(value)
        };
        let difference = score_at(Feature::Margin, 600) - score_at(Feature::Margin, 200);
        assert!((2700..3300).contains(&difference), "{:?}", fit.table);
        let difference = score_at(Feature::Cost, 900) - score_at(Feature::Cost, 500);
        assert!((-2300..-1700).contains(&difference), "{:?}", fit.table);
        // A feature without influence has almost no steps.
        assert!(score_at(Feature::Shift, 999).abs() < 200, "{:?}", fit.table);
        assert!(fit.losses[2] < 0.9 * fit.losses[0]);
        // Kinds that do not differ are predicted by each other.
        let [run, kind] = losses_of_the_last_kind(&fit, &samples, &kinds);
        assert!((kind / run - 1.0).abs() < 0.01, "{run} {kind}");
        // One whose cells contradict the others' is not.
        let mut opposed = samples.clone();
        let own = opposed
            .iter_mut()
            .zip(&kinds)
            .filter(|(_, kind)| **kind == 2);
        own.for_each(|(sample, _)| sample.right = !sample.right);
        let fit = fit_cells(&opposed, &kinds, &vec![1.0; samples.len()], &like(), || {
            true
        })
        .unwrap();
        let [run, kind] = losses_of_the_last_kind(&fit, &opposed, &kinds);
        assert!(kind > 1.1 * run, "{run} {kind}");
    }

    /// Log loss of the cells of the last kind, with its runs held out and with the kind held out.
    fn losses_of_the_last_kind(fit: &CellFit, samples: &[CellSample], kinds: &[usize]) -> [f64; 2] {
        let without = |i: usize| fit.without_kind[2].score(&samples[i].evidence.unwrap());
        let scores: [&dyn Fn(usize) -> i64; 2] = [&|i| fit.held_out[i], &without];
        scores.map(|score| {
            let of_kind = (0..samples.len()).filter(|&i| kinds[i] == 2);
            let losses = of_kind.map(|i| {
                let sign = if samples[i].right { -1000.0 } else { 1000.0 };
                (score(i) as f64 / sign).exp().ln_1p()
            });
            losses.sum()
        })
    }

    #[test]
    fn it_is_repeatable_and_can_be_ended() {
        let samples = samples(2000, 3);
        let weights = vec![1.0; samples.len()];
        let one_kind = vec![0; samples.len()];
        let fit = || fit_cells(&samples, &one_kind, &weights, &like(), || true).unwrap();
        assert!(fit().without_kind.is_empty());
        let (one, two) = (fit(), fit());
        assert_eq!((one.table, one.held_out), (two.table, two.held_out));
        assert!(fit_cells(&samples, &one_kind, &weights, &like(), || false).is_none());
    }
}
