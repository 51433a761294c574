//! Cautions for the reader of a run's numbers.

use super::summary::Results;
use crate::show::words::ms;
use crate::subjects::references::PRIOR;
use crate::subjects::witness::EstimateRow;
use svl_core::counted;
use svl_core::doubt::Doubt;
use svl_score::judge::Metric;
use svl_score::notice::grouped;

impl Results {
    /// Losses and cautions, each with its cure where there is one; those of one kind together.
    pub fn cautions(&self) -> Vec<String> {
        let incomplete = self.ending.incomplete.iter();
        let incomplete = incomplete.map(|why| format!("incomplete: {why}"));
        let note = self.ending.note().map(|note| format!("not scored: {note}"));
        let doubts = self.ending.missing.doubts.iter().map(Doubt::to_string);
        // A warning tells the others.
        let doubts = doubts.filter(|doubt| !self.warnings.iter().any(|own| own.contains(doubt)));
        let failed = self.failed.iter().map(|f| {
            let pairs = if f.on_every_pair {
                "every pair".to_owned()
            } else {
                counted(f.pairs, "pair")
            };
            format!("{} failed on {pairs}: {}", f.algorithm, f.reason)
        });
        let profile = self.basis.slow_profile.clone();
        let parts = incomplete.chain(doubts).chain(note).chain(failed);
        let parts = parts.chain(self.empty_area()).chain(self.nothing_near());
        let parts = parts.chain(self.still_words()).chain(profile);
        let estimates = self.shown_estimates().into_iter();
        let parts = parts.chain(estimates.filter_map(EstimateRow::caution));
        let parts = parts.chain(self.mixed_times()).chain(self.slow_drivers());
        grouped(parts.chain(self.outliers()))
    }

    /// Caution where the prior tests nothing.
    fn still_words(&self) -> Option<String> {
        let right = Metric::find("right").filter(|_| self.is_still())?;
        let value = right.show(self.value(PRIOR, right, None)?);
        Some(format!(
            "the scene hardly changes: cell averages of other seeds or blocks (prior) have {value} \
             right cells"
        ))
    }

    /// Caution about obstacles where nothing is near.
    fn nothing_near(&self) -> Option<String> {
        let (near_m, _) = self.shown.rule.obstacle_and_clear_m();
        self.most_near().filter(|near| *near == 0.0).map(|_| {
            format!(
                "in the truth nothing is nearer than {near_m} m, so no obstacle can be missed or \
                 found; --near M sets what is near"
            )
        })
    }

    /// Caution about times of several sessions.
    fn mixed_times(&self) -> Option<String> {
        let is_mixed = self.basis.is_measured && !self.has_comparable_times();
        is_mixed.then(|| {
            "times are of several sessions, so those of different algorithms are not compared; \
             `svl score` with --times matches again what is needed"
                .to_owned()
        })
    }

    /// Cautions about algorithms that are too slow for the rate of the pairs, and steer as if they
    /// were not.
    fn slow_drivers(&self) -> Vec<String> {
        // The times of other builds are not those of svl.
        let drives = self.drives.iter();
        let drives = drives.filter(|_| self.basis.slow_profile.is_none());
        let words = drives.filter_map(|drive| {
            let mut algorithms = self.algorithms.iter();
            let own = algorithms.find(|a| a.algorithm == drive.algorithm)?;
            let (p50_ms, period_ms) = (own.p50_ms?, drive.period_ms?);
            (drive.latency_ms.is_none() && p50_ms > period_ms).then(|| {
                let (name, own, period) = (&drive.algorithm, ms(p50_ms), ms(period_ms));
                format!(
                    "{name} takes {own} ms per pair and steers as if it took {period}, the time \
                     from pair to pair; [drive] latency_ms sets what it takes on the robot"
                )
            })
        });
        words.collect()
    }

    /// True if the machine disturbed times.
    pub(crate) fn is_disturbed(&self) -> bool {
        self.algorithms.iter().any(|a| a.outliers > Some(0))
    }

    /// Caution about times that the machine disturbed.
    fn outliers(&self) -> Option<String> {
        // Otherwise svl's own reading and writing causes them, or the times are not used.
        let counts = self.basis.is_measured && self.basis.slow_profile.is_none();
        (counts && self.is_disturbed()).then(|| {
            "the machine was busy, so times are uncertain; use an idle one, or --repeat 5, for \
             better ones"
                .to_owned()
        })
    }
}
