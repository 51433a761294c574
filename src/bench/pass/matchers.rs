//! The algorithms of a pass, each with its memory.

use std::collections::VecDeque;
use svl_core::depth::{self, CellDecision};
use svl_core::matcher::{Algorithm, MatchContext, MatchOutput, Matcher};
use svl_core::stereo::{DisparityMap, RectifiedPair, Rig};
use svl_core::timing::{Stage, StageTimes};
use svl_core::{Error, Result};
use svl_score::manifest::Manifest;
use svl_score::memory::{self, MemoryUse};
use svl_score::notice::Notice;
use svl_score::scenario::WITNESS;

/// The algorithms of a pass, ready to match.
#[derive(Default)]
pub struct Matchers(pub(super) Vec<ReadyMatcher>);

pub(super) struct ReadyMatcher {
    pub(super) label: String,
    pub(super) algorithm: Algorithm,
    pub(super) matcher: Box<dyn Matcher>,
    /// Others of the same algorithm, for other pairs at the same time.
    pub(super) copies: Vec<Self>,
    /// Number of pairs that it failed on, the last reason, and true if that was on the previous
    /// pair.
    failed_pairs: u64,
    failure: Option<String>,
    pub(super) is_failing: bool,
    /// Maps that the sinks no longer need.
    pub(super) spent: Vec<DisparityMap>,
    memory: Option<MemoryUse>,
    /// Absent where its parameters do not determine it.
    pub(super) max_disparity: Option<i32>,
    /// The lowest disparity that it searches.
    lowest_px: i32,
    /// True if it reports a map that others computed, which takes no time of matching.
    is_recorded: bool,
    /// True if the user was warned of the range.
    warned_of_range: bool,
    /// The size of images that it has memory for, once it was measured.
    pub(super) warm_for: Option<(usize, usize)>,
    /// Results of the next pairs, where it matches several at once.
    pub(super) ahead: VecDeque<Result<Vec<MatchOutput>>>,
}

impl ReadyMatcher {
    pub(super) fn new(algorithm: &Algorithm) -> Result<Self> {
        let label = algorithm.label().to_owned();
        let matcher = algorithm.build().map_err(|error| match error {
            Error::Usage(reason) => Error::Usage(format!("{label}: {reason}")),
            other => other,
        })?;
        Ok(Self {
            label,
            algorithm: algorithm.clone(),
            matcher,
            copies: Vec::new(),
            failed_pairs: 0,
            failure: None,
            is_failing: false,
            spent: Vec::new(),
            memory: None,
            max_disparity: algorithm.max_disparity(),
            lowest_px: algorithm.range().map_or(0, |range| *range.start()),
            is_recorded: algorithm.spec().is_recorded(),
            // Obstacles beyond the range are not missed behind a filter that says "too close".
            warned_of_range: !algorithm.filters().is_empty(),
            warm_for: None,
            ahead: VecDeque::new(),
        })
    }
}

impl Matchers {
    /// Builds the algorithms; each label may occur once, as it names rows and topics.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the algorithm that occurs twice or cannot be built.
    pub fn new(algorithms: &[Algorithm]) -> Result<Self> {
        for (i, algorithm) in algorithms.iter().enumerate() {
            let label = algorithm.label();
            if algorithms[..i].iter().any(|other| other.label() == label) {
                return Err(Error::Usage(format!(
                    "{label}: named twice; name each algorithm once"
                )));
            }
        }
        let entries = algorithms.iter().map(ReadyMatcher::new);
        entries.collect::<Result<_>>().map(Self)
    }

    /// Puts an algorithm in the place of the one with its label; the others keep their memory.
    ///
    /// # Errors
    /// The errors of [`Matchers::new`].
    pub fn replace(&mut self, algorithm: &Algorithm) -> Result<()> {
        let label = algorithm.label();
        if let Some(entry) = self.0.iter_mut().find(|entry| entry.label == label) {
            *entry = ReadyMatcher {
                warned_of_range: entry.warned_of_range,
                ..ReadyMatcher::new(algorithm)?
            };
        }
        Ok(())
    }

    /// Splits off those from the `first` on, which keep their state.
    #[must_use]
    pub fn split_off(&mut self, first: usize) -> Self {
        Self(self.0.split_off(first.min(self.0.len())))
    }

    /// Splits off those with these labels.
    #[must_use]
    pub fn take(&mut self, labels: &[&str]) -> Self {
        let is_named = |entry: &mut ReadyMatcher| labels.contains(&entry.label.as_str());
        Self(self.0.extract_if(.., is_named).collect())
    }

    /// Appends others.
    pub fn append(&mut self, mut others: Self) {
        self.0.append(&mut others.0);
    }

    /// The same without the warnings of ranges that end before obstacles do: where algorithms
    /// change, or a model is being fitted.
    #[must_use]
    pub fn without_warnings(mut self) -> Self {
        for entry in &mut self.0 {
            entry.warned_of_range = true;
        }
        self
    }

    /// Labels of the algorithms whose results depend on all earlier pairs of a pass.
    pub fn with_run_memory(&self) -> impl Iterator<Item = &str> {
        let entries = self.0.iter();
        let entries = entries.filter(|entry| entry.matcher.has_run_memory());
        entries.map(|entry| entry.label.as_str())
    }

    /// Completes the manifest with the memory of each algorithm, known after a measured pass whose
    /// program counts it, with the pairs that each failed on, and with whether it depends on
    /// earlier ones.
    pub fn complete(&self, manifest: &mut Manifest) {
        for record in &mut manifest.algorithms {
            if let Some(entry) = self.0.iter().find(|entry| entry.label == record.label) {
                record.has_run_memory = entry.matcher.has_run_memory();
                record.program = entry.matcher.program();
                let process = record.program.as_ref().and_then(|p| p.memory_bytes);
                record.memory_bytes = process.or(entry.memory.map(|memory| memory.peak));
                record.warnings().for_each(|warning| warning.warn());
                if let Some(remark) = entry.matcher.remark() {
                    Notice::new([&*entry.label], remark).warn();
                }
                record.failed_pairs = entry.failed_pairs;
                record.failure.clone_from(&entry.failure);
            }
        }
    }

    /// The lowest disparity that all search.
    pub(super) fn lowest_px(&self) -> i32 {
        let shown = self.0.iter().filter(|entry| entry.label != WITNESS);
        let lowest = shown.map(|entry| entry.lowest_px);
        lowest.max().unwrap_or(0)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The matchers at these places, which ascend.
    pub(super) fn at(&mut self, places: &[usize]) -> Vec<&mut ReadyMatcher> {
        let entries = self.0.iter_mut().enumerate();
        let entries = entries.filter(|(place, _)| places.contains(place));
        entries.map(|(_, entry)| entry).collect()
    }

    /// Keeps the maps of estimates for later frames.
    pub(super) fn take_back(&mut self, spent: Spent) {
        for (label, map) in spent {
            if let Some(entry) = self.0.iter_mut().find(|entry| entry.label == label) {
                entry.spent.push(map);
            }
        }
    }
}

/// Maps that the sinks no longer need, with the labels of their algorithms.
pub(super) type Spent = Vec<(String, DisparityMap)>;

impl ReadyMatcher {
    /// Matches a pair. A decision of cells other than the median is part of the measured time; the
    /// median costs nothing beside a matcher.
    pub(super) fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        context: &MatchContext,
    ) -> Result<MatchOutput> {
        let mut output = match self.spent.pop() {
            Some(map) => MatchOutput::with_memory(map),
            None => MatchOutput::new()?,
        };
        output.begin();
        self.matcher.compute(pair, context, &mut output)?;
        if output.grid.is_none() && context.grid.decision != CellDecision::Median {
            let (map, rig) = (output.disparity.disparity(), context.rig.as_ref());
            let grid = depth::cells(map, pair.left(), context.grid, context.cells, rig);
            output.decided = Some(grid);
            output.clock.lap(Stage::Checks);
        }
        // Cells are scored by their place: another shape would compare the wrong ones.
        match &output.grid {
            Some(grid) if grid.shape() != context.grid.shape() => Err(Error::Invalid(
                "its depth grid does not have the shape of the run's".into(),
            )),
            _ => Ok(output),
        }
    }

    /// Matches pairs, several at once, `rounds` times.
    pub(super) fn match_ahead(
        &mut self,
        pairs: &[(RectifiedPair<'_>, MatchContext<'_>)],
        rounds: usize,
    ) {
        let mut ahead: Vec<_> = pairs.iter().map(|_| Ok(Vec::new())).collect();
        for _ in 0..rounds {
            if pairs.len() > 1 {
                self.matcher.announce(pairs);
            }
            for ((pair, context), outputs) in pairs.iter().zip(&mut ahead) {
                // Also after a failure: the program has an answer for each pair.
                add(outputs, self.compute(*pair, context));
            }
        }
        self.ahead.extend(ahead);
    }

    /// The nearest distance that it sees, if obstacles are nearer; each time but the first none.
    pub(super) fn short_range(
        &mut self,
        (size, cells): ((usize, usize), usize),
        rig: &Rig,
        obstacle_m: f64,
    ) -> Option<f64> {
        let px = self.matcher.range_px(size, cells).or(self.max_disparity)?;
        let nearest_m = rig.depth_m(f64::from(px))?;
        let is_short = nearest_m >= obstacle_m;
        let is_first = is_short && !std::mem::replace(&mut self.warned_of_range, true);
        is_first.then_some(nearest_m)
    }

    /// The times of an output, if it was matched.
    pub(super) fn times(&self, output: &MatchOutput) -> Option<StageTimes> {
        (!self.is_recorded).then(|| output.clock.times())
    }

    /// A pass begins.
    pub(super) fn begin_pass(&mut self) {
        // Pairs of a pass that was interrupted.
        self.ahead.clear();
        self.matcher.reset();
    }

    /// Notes that it failed on a pair; returns `true` unless it failed for the same reason on the
    /// pair before.
    pub(super) fn failed(&mut self, reason: &str) -> bool {
        self.failed_pairs += 1;
        let is_news = !(self.is_failing && self.failure.as_deref() == Some(reason));
        self.is_failing = true;
        self.failure = Some(reason.to_owned());
        is_news
    }

    /// Sets up its memory for that pair, and learns how much that is.
    pub(super) fn warm_up(&mut self, pair: RectifiedPair<'_>, context: &MatchContext) {
        if self.is_recorded {
            return;
        }
        self.spent.clear();
        let used = memory::used_by(|| {
            // An error comes again when the pair is matched, and is reported then.
            if let Ok(output) = self.compute(pair, context) {
                self.spent.push(output.disparity);
            }
        });
        let before = self.memory.unwrap_or_default();
        self.memory = used.map(|used| MemoryUse {
            peak: before
                .peak
                .max(used.peak.saturating_add_signed(before.kept)),
            kept: before.kept + used.kept,
        });
    }

    /// The output whose time is the median, by nearest rank, of outputs for one pair.
    pub(super) fn median(&mut self, mut outputs: Vec<MatchOutput>) -> Result<MatchOutput> {
        if let [first, others @ ..] = &outputs[..]
            && !others.is_empty()
        {
            let hash = first.disparity.hash();
            if others.iter().any(|other| other.disparity.hash() != hash) {
                return Err(Error::Invalid(
                    "its result differs when the pair is matched again".into(),
                ));
            }
        }
        outputs.sort_by_key(|output| output.clock.times().total());
        let middle = outputs.swap_remove((outputs.len() - 1) / 2);
        let others = outputs.into_iter().map(|output| output.disparity);
        self.spent.extend(others);
        Ok(middle)
    }
}

/// Adds an output to those of earlier rounds, until the first error.
pub(super) fn add(outputs: &mut Result<Vec<MatchOutput>>, output: Result<MatchOutput>) {
    if let Ok(before) = outputs {
        match output {
            Ok(output) => before.push(output),
            Err(error) => *outputs = Err(error),
        }
    }
}

/// The output of an algorithm for a frame.
pub(super) struct Matched {
    pub(super) algorithm: String,
    pub(super) output: MatchOutput,
    pub(super) range_px: Option<f64>,
    pub(super) times: Option<StageTimes>,
}
