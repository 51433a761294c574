//! A run of a report with the units of its algorithms.

use super::facts::RunFacts;
use super::plan::{BLOCK, ReportPlan, ReportRun};
use super::store::{StoredSession, Units};
use super::unit::StoredUnit;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use svl_core::Result;
use svl_core::doubt::Doubt;
use svl_score::manifest::InputRecord;
use svl_score::notice::Notice;
use svl_score::plausibility::MeasuredScales;

/// A run of a report with the units that the report lists.
#[derive(Default)]
pub struct RunUnits {
    pub run: ReportRun,
    /// Facts of the run; if it was never read to its end, its pairs are those that units are of.
    pub facts: RunFacts,
    /// Per algorithm its units, by block.
    units: BTreeMap<String, BTreeMap<u64, StoredUnit>>,
}

impl RunUnits {
    /// Reads the units of a run. `damaged` gets the file of each one that cannot be used.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`].
    pub fn read(
        folder: &Units,
        plan: &ReportPlan,
        run: &ReportRun,
        sessions: &[StoredSession],
        damaged: impl FnMut(PathBuf),
    ) -> Result<Self> {
        let facts = match folder.facts(run)? {
            Some(facts) => facts,
            None => RunFacts {
                pairs: folder.pairs_of_units(run)?,
                ..RunFacts::default()
            },
        };
        Self::with_facts(folder, plan, run, sessions, facts, damaged)
    }

    /// [`RunUnits::read`] for a run with these facts.
    ///
    /// # Errors
    /// The errors of [`RunUnits::read`].
    pub fn with_facts(
        folder: &Units,
        plan: &ReportPlan,
        run: &ReportRun,
        sessions: &[StoredSession],
        facts: RunFacts,
        mut damaged: impl FnMut(PathBuf),
    ) -> Result<Self> {
        let mut found = Self {
            run: run.clone(),
            facts,
            units: BTreeMap::new(),
        };
        let pictured = plan.pictured();
        for algorithm in plan.algorithms_of(run) {
            // Perturbed pairs are not shown.
            let is_pictured = run.stress.is_none() && pictured.contains(&algorithm.label);
            for block in 0..found.blocks(plan) {
                let name = algorithm.unit_name(block, &found.facts.pairs);
                let path = folder.unit_path(run, &name);
                let unit = match StoredUnit::read(&path, &run.digest) {
                    Ok(Some(unit)) => unit,
                    Ok(None) => continue,
                    Err(_) => {
                        damaged(path);
                        continue;
                    }
                };
                let mut all = sessions.iter();
                let has_session = all.any(|own| own.manifest.run_id == unit.session);
                if has_session && (unit.has_pictures || !is_pictured) {
                    let own = found.units.entry(algorithm.label.to_owned()).or_default();
                    own.insert(block, unit);
                }
            }
        }
        Ok(found)
    }

    /// The units of an algorithm, by block.
    pub fn units(&self, label: &str) -> impl Iterator<Item = (u64, &StoredUnit)> {
        let units = self.units.get(label).into_iter().flatten();
        units.map(|(block, unit)| (*block, unit))
    }

    /// All units.
    pub fn all(&self) -> impl Iterator<Item = &StoredUnit> {
        self.units.values().flat_map(BTreeMap::values)
    }

    /// The unit of an algorithm in a block.
    pub fn unit(&self, label: &str, block: u64) -> Option<&StoredUnit> {
        self.units.get(label)?.get(&block)
    }

    /// Leaves out the units that are not kept.
    pub fn retain(&mut self, mut is_kept: impl FnMut(&str, u64, &StoredUnit) -> bool) {
        for (label, units) in &mut self.units {
            units.retain(|block, unit| is_kept(label, *block, unit));
        }
    }

    /// Leaves out the units of blocks in which those of the algorithms are of several sessions, or
    /// not all there.
    pub fn retain_equal_blocks(&mut self, plan: &ReportPlan) {
        let algorithms = plan.algorithms_of(&self.run).len();
        let mut sessions: BTreeMap<u64, (usize, BTreeSet<String>)> = BTreeMap::new();
        for (block, unit) in self.units.values().flatten() {
            let (count, own) = sessions.entry(*block).or_default();
            *count += 1;
            own.insert(unit.session.clone());
        }
        let is_equal = |block| {
            let (count, own): &(usize, BTreeSet<String>) = &sessions[&block];
            *count == algorithms && own.len() == 1
        };
        self.retain(|_, block, _| is_equal(block));
    }

    /// The number of blocks, as far as they are known.
    pub fn blocks(&self, plan: &ReportPlan) -> u64 {
        match plan.is_driven() {
            true => 1,
            false => (self.facts.pairs.len() as u64).div_ceil(BLOCK),
        }
    }

    /// The recording that it reads, if it is one; of perturbed pairs that is told once.
    pub fn record(&self) -> Option<InputRecord> {
        let is_told = self.run.stress.is_none();
        self.facts.record.clone().filter(|_| is_told)
    }

    /// True if all its pairs were read.
    pub fn is_read(&self) -> bool {
        self.facts.losses.is_some()
    }

    /// True if all its pairs were read, and these algorithms have all units.
    pub fn has_all(&self, plan: &ReportPlan, mut labels: impl Iterator<Item = String>) -> bool {
        let blocks = self.blocks(plan);
        (plan.is_driven() || self.is_read())
            && labels.all(|label| self.units(&label).count() as u64 == blocks)
    }

    /// True if all its pairs were read, and every algorithm has a result of each or failed on it.
    pub fn is_whole(&self, plan: &ReportPlan) -> bool {
        let algorithms = plan.algorithms_of(&self.run).into_iter();
        self.has_all(plan, algorithms.map(|own| own.label.to_owned()))
    }

    /// The doubts that its warnings tell, and those about its truth or its maps.
    pub fn doubts(&self) -> Vec<Doubt> {
        let mut scales = MeasuredScales::default();
        for (label, units) in &self.units {
            // That of the first block with enough pixels.
            if let Some((origin, scale)) = units.values().find_map(|unit| unit.scale.clone()) {
                scales.origin = origin;
                scales.algorithms.insert(label.clone(), scale);
            }
        }
        // Perturbed pairs have the truth of the others.
        let measured = self.run.stress.is_none().then(|| scales.doubts());
        let told = self.facts.warnings.iter();
        let told = told.filter_map(|warning| warning.doubt.clone());
        let all = told.chain(measured.into_iter().flatten());
        all.map(|doubt| Doubt {
            run: self.run.run.clone(),
            ..doubt
        })
        .collect()
    }

    /// The warnings of the run and of the algorithms of the plan, added to others.
    pub fn add_warnings(&self, plan: &ReportPlan, warnings: &mut Vec<Notice>) {
        let algorithms = plan.algorithms_of(&self.run);
        let labels = || algorithms.iter().map(|own| (&*own.digest, own.label));
        let known = self.facts.warnings.iter();
        let known = known.filter_map(|warning| warning.renamed(labels()));
        known.for_each(|warning| warning.add_to(warnings));
    }
}
