//! Register of the pairs that a command has read, each once: it finds copies, and pairs that
//! learned files were fitted to.

use crate::source::frames::{Source, wraps};
use parking_lot::Mutex;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;
use svl_core::matcher::Algorithm;
use svl_core::stereo::{FittedTo, Frame, PairId};
use svl_core::{Error, Result, counted};
use svl_score::losses::Losses;
use svl_score::notice::Notice;

/// Stamps from this on are of a clock (1973), not counted from the first pair: recordings share
/// them only if they show the same moments.
const MIN_CLOCK_NS: u64 = 100_000_000_000_000_000;

/// The pairs of the runs of a command. Clones share it.
#[derive(Clone, Default)]
pub struct PairRegister(Arc<Mutex<RegisteredPairs>>);

#[derive(Default)]
struct RegisteredPairs {
    /// Each with the scenario and seed of the simulation that it is of.
    runs: Vec<(String, Option<String>)>,
    /// The run that each pair belongs to.
    owners: HashMap<PairId, usize>,
    by_stamps: HashMap<[u64; 2], Vec<usize>>,
    /// The first run with these pixels, whatever their stamps.
    by_pixels: HashMap<u128, usize>,
    /// Runs that share stamps or pixels with an earlier one, which the user was warned of.
    same_moments: BTreeSet<usize>,
    /// Pairs of a run that belong to an earlier one.
    copies: BTreeMap<[usize; 2], u64>,
    learned: Vec<LearnedNumbers>,
}

/// The runs that the learned numbers of an algorithm were fitted to; the user is warned of each
/// algorithm once.
struct LearnedNumbers {
    label: String,
    fitted: Vec<FittedTo>,
    is_reported: bool,
}

impl PairRegister {
    /// An empty one, which warns of pairs that these algorithms were fitted to.
    ///
    /// # Errors
    /// The errors of [`Algorithm::fitted`].
    pub fn new(algorithms: &[Algorithm]) -> Result<Self> {
        let learned = algorithms.iter().map(|algorithm| {
            Ok(LearnedNumbers {
                label: algorithm.label().to_owned(),
                fitted: algorithm.fitted()?,
                is_reported: false,
            })
        });
        let pairs = RegisteredPairs {
            learned: learned.collect::<Result<_>>()?,
            ..RegisteredPairs::default()
        };
        Ok(Self(Arc::new(Mutex::new(pairs))))
    }

    /// Refuses recordings that share pairs: they would be trained on and tested on.
    ///
    /// # Errors
    /// [`Error::Usage`] with the two recordings.
    pub fn refuse_copies(&self) -> Result<()> {
        let pairs = self.0.lock();
        let Some(([run, owner], n)) = pairs.copies.first_key_value() else {
            return Ok(());
        };
        Err(Error::Usage(format!(
            "{}: has {} of {}: name each recording once, for training or for the test",
            pairs.runs[*run].0,
            counted(*n, "pair"),
            pairs.runs[*owner].0
        )))
    }

    /// The runs that are fitted to, of all in the order in which they were registered, with their
    /// pairs.
    pub fn fitted(&self, is_fitted: impl Fn(usize) -> bool) -> FittedTo {
        let pairs = self.0.lock();
        let runs = pairs.runs.iter().enumerate();
        let runs = runs.filter(|(run, _)| is_fitted(*run));
        let runs = runs.map(|(_, (name, _))| name.clone()).collect();
        let ids = pairs.owners.iter().filter(|(_, run)| is_fitted(**run));
        FittedTo::new(runs, ids.map(|(id, _)| *id))
    }

    fn begin(&self, run: (String, Option<String>)) -> usize {
        let mut pairs = self.0.lock();
        pairs.runs.push(run);
        pairs.runs.len() - 1
    }

    fn name(&self, run: usize) -> String {
        self.0.lock().runs[run].0.clone()
    }
}

impl RegisteredPairs {
    /// Warns once of a run that shares stamps or pixels of pairs which are no copies. Stamps of
    /// simulations are alike in all, so that only those of one seed are of the same moments.
    fn warn_of_same_moments(&mut self, run: usize, id: PairId) {
        let others = self.by_stamps.entry(id.stamps_ns).or_default();
        if others.last() != Some(&run) {
            others.push(run);
        }
        for &other in others.iter().filter(|other| **other != run) {
            let [(name, simulated), (first, first_simulated)] =
                [&self.runs[run], &self.runs[other]];
            let is_same = match simulated {
                Some(_) => simulated == first_simulated,
                None => id.stamps_ns[0] >= MIN_CLOCK_NS,
            };
            if is_same && self.same_moments.insert(run) {
                tracing::warn!(
                    "{name}: has pairs with the stamps of pairs of {first}, but other pixels: what \
                     both recordings show counts twice"
                );
            }
        }
        let other = *self.by_pixels.entry(id.pixels).or_insert(run);
        if other != run && self.same_moments.insert(run) {
            let [(name, _), (first, _)] = [&self.runs[run], &self.runs[other]];
            tracing::warn!(
                "{name}: has pairs with the pixels of pairs of {first}, but other stamps: if one \
                 was recorded from the other, they count twice"
            );
        }
    }

    /// Warns once of each algorithm that was fitted to the frame.
    fn warn_of_training(&mut self, run: usize, frame: &Frame) {
        let (run, simulated) = &self.runs[run];
        let names = [simulated.as_deref(), frame.name.as_deref()];
        let names = names.into_iter().flatten();
        let id = frame.id();
        for learned in self
            .learned
            .iter_mut()
            .filter(|learned| !learned.is_reported)
        {
            if learned
                .fitted
                .iter()
                .any(|fitted| fitted.has(id, names.clone()))
            {
                learned.is_reported = true;
                let scene = frame.name.as_deref().unwrap_or(run);
                let text = format!(
                    "was fitted to pairs of {scene}: scores on what it was fitted to say little of \
                     other recordings"
                );
                Notice::new([&*learned.label], text).warn();
            }
        }
    }
}

/// A run to register.
pub struct Registration {
    pub register: PairRegister,
    pub name: String,
    /// Scenario and seed of the simulation that it is of.
    pub simulated: Option<String>,
}

/// A source without the pairs that the register has already.
pub struct RegisteredSource<'a> {
    source: Box<dyn Source + 'a>,
    register: PairRegister,
    run: usize,
    copies: BTreeMap<usize, u64>,
}

impl<'a> RegisteredSource<'a> {
    pub fn new(source: Box<dyn Source + 'a>, run: Registration) -> Self {
        Self {
            run: run.register.begin((run.name, run.simulated)),
            source,
            register: run.register,
            copies: BTreeMap::new(),
        }
    }

    /// Registers a pair; false if it is a copy.
    fn is_new(&mut self, frame: &Frame) -> bool {
        let id = frame.id();
        let mut pairs = self.register.0.lock();
        let pairs = &mut *pairs;
        // In one recording, stamps that were never set are equal, and so are the pictures of a
        // camera at rest.
        let owner = *pairs.owners.entry(id).or_insert(self.run);
        if owner != self.run {
            *self.copies.entry(owner).or_default() += 1;
            *pairs.copies.entry([self.run, owner]).or_default() += 1;
            return false;
        }
        pairs.warn_of_same_moments(self.run, id);
        pairs.warn_of_training(self.run, frame);
        true
    }
}

impl Source for RegisteredSource<'_> {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        while let Some(frame) = self.source.next()? {
            if self.is_new(&frame) {
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }

    fn finish(&mut self, taken: u64) -> Losses {
        let copies: u64 = self.copies.values().sum();
        let mut losses = self.source.finish(taken + copies);
        for (owner, n) in std::mem::take(&mut self.copies) {
            *losses.copies.entry(self.register.name(owner)).or_default() += n;
        }
        losses
    }
}
