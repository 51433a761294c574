//! The results of a run that are kept: which pairs need not be matched again.

use super::store::StoredSeal;
use super::{BLOCK, ReportPlan};
use crate::rows::Row;
use std::collections::{BTreeMap, BTreeSet};
use svl_core::Result;

/// The results of a run that a report has, by algorithm and place of the pair in the run.
#[derive(Clone, Debug, Default)]
pub struct KeptResults {
    /// Per algorithm the seal of each place, as an index.
    by_label: BTreeMap<String, BTreeMap<u64, usize>>,
    seals: Vec<StoredSeal>,
}

impl KeptResults {
    /// The results of these seals that the plan asks for: of several of a pair those of the last
    /// session. `pairs`: number of pairs of the run, if they are known; beyond it nothing is kept.
    /// `pictured`: algorithms whose results count only with pictures.
    pub fn new(
        plan: &ReportPlan,
        seals: Vec<StoredSeal>,
        pairs: Option<u64>,
        pictured: &[&str],
    ) -> Self {
        let mut by_label: BTreeMap<String, BTreeMap<u64, usize>> = BTreeMap::new();
        for (i, stored) in seals.iter().enumerate() {
            let seal = &stored.seal;
            for own in &seal.algorithms {
                let lacks_pictures = !own.has_pictures && pictured.contains(&own.label.as_str());
                if lacks_pictures || plan.identity(&own.label) != Some(&own.identity) {
                    continue;
                }
                let places = by_label.entry(own.label.clone()).or_default();
                let is_there = |place: &u64| {
                    !own.without.contains(place) && pairs.is_none_or(|pairs| *place < pairs)
                };
                let sealed = seal.pairs.iter().map(|pair| pair.place);
                places.extend(sealed.filter(is_there).map(|place| (place, i)));
                if seal.drive.is_some() {
                    places.insert(0, i);
                }
            }
        }
        Self { by_label, seals }
    }

    /// The seals, in their order.
    pub fn seals(&self) -> &[StoredSeal] {
        &self.seals
    }

    /// The seal that has the result of an algorithm of the pair at `place`, as an index.
    pub fn seal(&self, label: &str, place: u64) -> Option<usize> {
        self.by_label.get(label)?.get(&place).copied()
    }

    /// The places of the pairs that an algorithm has results of, with the seals, as indices.
    pub fn places(&self, label: &str) -> Option<&BTreeMap<u64, usize>> {
        self.by_label.get(label)
    }

    /// The number of pairs that an algorithm has a result of.
    pub fn count(&self, label: &str) -> u64 {
        self.by_label
            .get(label)
            .map_or(0, |places| places.len() as u64)
    }

    /// The first pair that an algorithm has a result of: its place, and the seal.
    pub fn first(&self, label: &str) -> Option<(u64, &StoredSeal)> {
        let (place, seal) = self.by_label.get(label)?.first_key_value()?;
        Some((*place, &self.seals[*seal]))
    }

    /// The first row of an algorithm, with its place in the run.
    ///
    /// # Errors
    /// Those of reading the table.
    pub fn first_row(&self, label: &str) -> Option<Result<(u64, Row)>> {
        let (place, stored) = self.first(label)?;
        let mut pairs = stored.seal.pairs.iter();
        let sequence = pairs.find(|pair| pair.place == place)?.sequence;
        let rows = match stored.rows() {
            Ok(rows) => rows,
            Err(error) => return Some(Err(error)),
        };
        let mut rows = rows.into_iter();
        let row = rows.find(|row| row.algorithm == label && row.sequence == sequence)?;
        Some(Ok((place, row)))
    }

    /// Forgets all results of an algorithm.
    pub fn forget(&mut self, label: &str) {
        self.by_label.remove(label);
    }

    /// Forgets the results of blocks in which those of these algorithms are of several sessions.
    pub fn forget_mixed_blocks(&mut self, labels: &[&str]) {
        let mut sessions: BTreeMap<u64, BTreeSet<Option<String>>> = BTreeMap::new();
        for label in labels {
            for (block, session) in self.block_sessions(label) {
                let session = session.map(str::to_owned);
                sessions.entry(block).or_default().insert(session);
            }
        }
        let is_mixed = |own: &BTreeSet<Option<String>>| own.len() > 1 || own.contains(&None);
        sessions.retain(|_, own| is_mixed(own));
        for places in self.by_label.values_mut() {
            places.retain(|place, _| !sessions.contains_key(&(place / BLOCK)));
        }
    }

    /// Forgets the results of sessions.
    pub fn forget_sessions(&mut self, is_forgotten: impl Fn(&str) -> bool) {
        for places in self.by_label.values_mut() {
            places.retain(|_, i| !is_forgotten(&self.seals[*i].seal.session));
        }
    }

    /// Forgets the pairs that an algorithm failed on.
    ///
    /// # Errors
    /// Those of reading the table of the failures.
    pub fn forget_failures(&mut self, label: &str) -> Result<()> {
        let Some(places) = self.by_label.get_mut(label) else {
            return Ok(());
        };
        for (i, stored) in self.seals.iter().enumerate() {
            for row in stored.failures()? {
                let mut pairs = stored.seal.pairs.iter();
                let pair = pairs.find(|pair| pair.sequence == row.sequence);
                if let Some(pair) = pair.filter(|_| row.algorithm == label)
                    && places.get(&pair.place) == Some(&i)
                {
                    places.remove(&pair.place);
                }
            }
        }
        Ok(())
    }

    /// Forgets the seals with pairs that are others now, and returns them; `inputs`: the input hash
    /// of each pair.
    pub fn forget_other_inputs(&mut self, inputs: &[String]) -> Vec<StoredSeal> {
        let is_other = |stored: &StoredSeal| {
            let mut pairs = stored.seal.pairs.iter();
            pairs.any(|pair| inputs.get(pair.place as usize) != Some(&pair.input_hash))
        };
        let seals = self.seals.iter().enumerate();
        let others: BTreeSet<usize> = seals
            .filter(|(_, stored)| is_other(stored))
            .map(|(i, _)| i)
            .collect();
        for places in self.by_label.values_mut() {
            places.retain(|_, i| !others.contains(i));
        }
        others.into_iter().map(|i| self.seals[i].clone()).collect()
    }

    /// The sessions whose results of an algorithm are kept.
    pub fn sessions(&self, label: &str) -> BTreeSet<&str> {
        let places = self.by_label.get(label);
        let seals = places.iter().flat_map(|places| places.values());
        seals
            .map(|i| self.seals[*i].seal.session.as_str())
            .collect()
    }

    /// The blocks with the session of their results of an algorithm; none of a block that has
    /// results of several.
    pub fn block_sessions(&self, label: &str) -> BTreeMap<u64, Option<&str>> {
        let mut blocks: BTreeMap<u64, Option<&str>> = BTreeMap::new();
        for (place, i) in self.by_label.get(label).into_iter().flatten() {
            let session = self.seals[*i].seal.session.as_str();
            let block_session = blocks.entry(place / BLOCK).or_insert(Some(session));
            if *block_session != Some(session) {
                *block_session = None;
            }
        }
        blocks
    }

    /// The seals that no result is taken of. `true`: the plan has all results of their algorithms
    /// from others, so that they are superseded. `pairs`: the number of pairs of the run.
    pub fn unused(&self, pairs: u64) -> Vec<(&StoredSeal, bool)> {
        let used: BTreeSet<_> = self
            .by_label
            .values()
            .flat_map(|places| places.values().copied())
            .collect();
        let is_superseded = |stored: &StoredSeal| {
            let mut algorithms = stored.seal.algorithms.iter();
            algorithms.all(|own| self.count(&own.label) == pairs)
        };
        let seals = self.seals.iter().enumerate();
        let unused = seals.filter(|(i, _)| !used.contains(i));
        unused
            .map(|(_, stored)| (stored, is_superseded(stored)))
            .collect()
    }
}
