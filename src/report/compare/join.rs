//! Two reports, joined once: their algorithms, and of each the pairs or courses of both.

use super::scored_run::ScoredRun;
use crate::rows::held::{RowRef, RunKey};
use crate::subjects::drives::DriveRow;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use svl_core::{Error, Result, joined};
use svl_score::losses::Incomplete;
use svl_score::manifest::{AlgorithmRecord, Manifest};

/// The cure for algorithms that only one report has.
pub(super) const MAP: &str = "--map BASE=OTHER compares algorithms of other names";

/// Two reports, the pairs of the second in the order of the first.
pub struct Join<'a> {
    pub(super) runs: [&'a ScoredRun; 2],
    pub(super) is_driven: bool,
    pub(super) algorithms: Vec<JoinedAlgorithm<'a>>,
    /// Algorithms of the first report without a namesake or with several, each in words.
    pub(super) ambiguous: Vec<String>,
}

/// An algorithm of the first report with one of the second.
#[derive(Default)]
pub(super) struct JoinedAlgorithm<'a> {
    pub labels: [&'a str; 2],
    /// Rows of the pairs with equal pixels, those of a run beside each other.
    pub pairs: Vec<[RowRef<'a>; 2]>,
    /// The drives through equal courses.
    pub courses: Vec<[&'a DriveRow; 2]>,
    /// Number of pairs or courses of the first report.
    pub base_pairs: usize,
    /// Pairs or courses of either report without a partner.
    pub unmatched: usize,
    /// Number of pairs that the second read.
    pub read_pairs: usize,
    /// Pairs that the second failed on and of which the first has a result.
    pub newly_failed: usize,
    /// Pairs before which the two have different pairs.
    pub other_past: usize,
    /// Runs whose pairs both have completely, by the names of each: checkpoints are counted over
    /// whole runs.
    pub whole_runs: [Vec<RunKey<'a>>; 2],
}

/// Run, number and name of a pair, by the names and numbers of the first report.
type PairKey<'a> = (RunKey<'a>, u64, &'a str);
type PairRows<'a> = BTreeMap<PairKey<'a>, RowRef<'a>>;

impl<'a> Join<'a> {
    /// Joins the algorithms that `map` names, as `BASE=OTHER`, and of the others those of equal
    /// labels, and of those left the only ones of a kind, whatever their parameters; without a map,
    /// where each report has just one, these two.
    ///
    /// # Errors
    /// [`Incomplete`] when the reports have no algorithm or no pair in common;
    /// [`Error::Invalid`] for drives and pairs, and for a map of algorithms that they do not have.
    pub fn new(base: &'a ScoredRun, other: &'a ScoredRun, map: &[String]) -> Result<Self> {
        let runs = [base, other];
        let is_driven = !base.drives.is_empty();
        if is_driven == other.drives.is_empty() {
            return Err(Error::Invalid(format!(
                "{}: is of drives, and the other report is of pairs; compare two of a kind",
                runs[usize::from(!is_driven)].name.display()
            )));
        }
        let alignment = AlignedRuns::new(base, other);
        let mut labels = matched_labels(&base.manifest, &other.manifest, map)?;
        let ambiguous = add_namesakes([&base.manifest, &other.manifest], &mut labels);
        let algorithms = labels.into_iter().map(|labels| {
            if is_driven {
                JoinedAlgorithm::from_courses(runs, labels)
            } else {
                JoinedAlgorithm::from_pairs(runs, labels, &alignment)
            }
        });
        let join = Self {
            runs,
            is_driven,
            algorithms: algorithms.collect(),
            ambiguous,
        };
        let shown = || format!("{} and {}", base.name.display(), other.name.display());
        let has_any = |own: &JoinedAlgorithm<'_>| own.compared() > 0 || own.newly_failed > 0;
        if join.algorithms.is_empty() {
            let [ours, theirs] = runs.map(|run| run.labels().join(", "));
            return Err(Error::other(Incomplete(format!(
                "{}: no algorithm in common ({ours}; {theirs}); {MAP}",
                shown()
            ))));
        }
        if join.algorithms.iter().all(|own| own.base_pairs == 0) {
            let labels = join.algorithms.iter().map(|own| own.labels[0]);
            return Err(Error::other(Incomplete(format!(
                "{}: has no result of {}",
                base.name.display(),
                joined(labels)
            ))));
        }
        if !join.algorithms.iter().any(has_any) {
            let things = if is_driven { "course" } else { "pair" };
            return Err(Error::other(Incomplete(format!(
                "{}: no {things} in common: their {things}s differ, as those of other scenarios, \
                 seeds or arena versions do",
                shown()
            ))));
        }
        Ok(join)
    }

    /// True if the label of that report is compared.
    fn is_joined(&self, side: usize, label: &str) -> bool {
        self.algorithms.iter().any(|own| own.labels[side] == label)
    }

    /// The most tests of drives at once: three metrics of each algorithm decide.
    pub(super) fn tests(&self) -> usize {
        3 * self.algorithms.len()
    }

    /// Labels that only this report has, and that are not compared.
    pub(super) fn only_in(&self, side: usize) -> Vec<String> {
        let others = self.runs[1 - side].labels();
        let own = self.runs[side].labels().into_iter();
        let only = own.filter(|label| !others.contains(label) && !self.is_joined(side, label));
        only.map(str::to_owned).collect()
    }

    /// Labels of both reports that in one of them are not compared, as a map names the namesake.
    pub(super) fn left_out(&self) -> Vec<&str> {
        let [mut ours, theirs] = self.runs.map(ScoredRun::labels);
        let is_joined = |label| self.is_joined(0, label) && self.is_joined(1, label);
        ours.retain(|label| theirs.contains(label) && !is_joined(label));
        ours
    }
}

/// The algorithms that are compared, by their labels in the two reports.
fn matched_labels<'a>(
    base: &'a Manifest,
    other: &'a Manifest,
    map: &[String],
) -> Result<Vec<[&'a str; 2]>> {
    let (ours, theirs): (Vec<_>, Vec<_>) = (base.labels().collect(), other.labels().collect());
    let mut both = Vec::new();
    for text in map {
        // Either label may hold `=`.
        let splits = text.match_indices('=');
        let splits = splits.map(|(i, _)| (&text[..i], &text[i + 1..]));
        let find = |labels: &[&'a str], label| labels.iter().find(|own| **own == label).copied();
        let mut known = splits.filter_map(|(a, b)| Some([find(&ours, a)?, find(&theirs, b)?]));
        both.push(known.next().ok_or_else(|| {
            let (ours, theirs) = (ours.join(", "), theirs.join(", "));
            Error::Invalid(format!(
                "--map {text}: expected BASE=OTHER, an algorithm of the first report ({ours}) and \
                 one of the other ({theirs})"
            ))
        })?);
    }
    match (&ours[..], &theirs[..]) {
        // With one algorithm each, two different algorithms can be compared: v1 with v3.
        ([one], [another]) if both.is_empty() => both.push([one, another]),
        _ => {
            let is_free = |label: &&&str| both.iter().all(|pair| !pair.contains(label));
            let equal = ours.iter().filter(|label| theirs.contains(label));
            let equal = equal.filter(is_free);
            let equal: Vec<_> = equal.map(|label| [*label; 2]).collect();
            both.extend(equal);
        }
    }
    Ok(both)
}

/// Adds algorithms of other parameters: of each kind the one that is left in each report. Returns
/// those of the first report that have several namesakes, or are one of several, in words.
fn add_namesakes<'a>(manifests: [&'a Manifest; 2], both: &mut Vec<[&'a str; 2]>) -> Vec<String> {
    let left = |side: usize| {
        let records = manifests[side].algorithms.iter();
        // One that the user named is not of another name.
        let is_plain = |own: &&AlgorithmRecord| {
            let parameters = own.label.strip_prefix(own.name.as_str());
            parameters.is_some_and(|rest| rest.is_empty() || rest.starts_with(':'))
        };
        let is_left = |own: &&AlgorithmRecord| both.iter().all(|pair| pair[side] != own.label);
        records.filter(is_plain).filter(is_left).collect::<Vec<_>>()
    };
    let sides = [left(0), left(1)];
    let mut ambiguous = Vec::new();
    for own in &sides[0] {
        let [ours, theirs] = sides.each_ref().map(|side| {
            let kin = side.iter().filter(|other| other.name == own.name);
            kin.map(|other| other.label.as_str()).collect::<Vec<_>>()
        });
        match (&ours[..], &theirs[..]) {
            // A map names its namesake, which `left_out` tells.
            (_, []) if manifests[1].labels().any(|label| label == own.label) => {}
            (_, []) => ambiguous.push(format!(
                "{} was not compared: the second report has no {}",
                own.label, own.name
            )),
            ([one], [other]) => both.push([one, other]),
            _ => ambiguous.push(format!(
                "{} was not compared: of {} any may be it; {MAP}",
                own.label,
                theirs.join(", ")
            )),
        }
    }
    ambiguous
}

/// The second report's runs by the names, and its scenes by the numbers, that the first has them
/// under.
struct AlignedRuns<'a> {
    runs: BTreeMap<RunKey<'a>, RunKey<'a>>,
    scenes: HashMap<u64, u64>,
}

impl<'a> AlignedRuns<'a> {
    fn new(base: &'a ScoredRun, other: &'a ScoredRun) -> Self {
        Self {
            runs: aligned_runs(base, other),
            scenes: aligned_scenes(base, other),
        }
    }

    fn place(&self, run: RunKey<'a>, sequence: u64) -> (RunKey<'a>, u64) {
        let run = *self.runs.get(&run).unwrap_or(&run);
        // Scenes are in no recording and of no seed.
        let scene = self.scenes.get(&sequence).filter(|_| run == (None, None));
        (run, *scene.unwrap_or(&sequence))
    }
}

/// Each run is the one with the most pairs in common, of several that of its own name: a recording
/// may have another name, or be of a seed of the arena.
fn aligned_runs<'a>(base: &'a ScoredRun, other: &'a ScoredRun) -> BTreeMap<RunKey<'a>, RunKey<'a>> {
    let in_run = |row: &RowRef<'_>| !row.origin().is_scene();
    let pair = |row: RowRef<'a>| (row.sequence(), row.stamp_ns(), row.pair_hash());
    let by_pair = base.rows.iter().filter(in_run);
    let by_pair: HashMap<_, _> = by_pair
        .map(|row| (pair(row), row.origin().run_key()))
        .collect();
    let mut common: BTreeMap<RunKey<'_>, BTreeMap<RunKey<'_>, u64>> = BTreeMap::new();
    for row in other.rows.iter().filter(in_run) {
        let runs = common.entry(row.origin().run_key()).or_default();
        if let Some(run) = by_pair.get(&pair(row)) {
            *runs.entry(*run).or_default() += 1;
        }
    }
    let names = common.iter().map(|(own, runs)| {
        let best = runs.iter();
        let best = best.max_by_key(|(run, pairs)| (**pairs, *run == own));
        (*own, *best.map_or(own, |(run, _)| run))
    });
    let names: BTreeMap<_, _> = names.collect();
    // All keep their names if two would have the same.
    let is_unique = names.values().collect::<BTreeSet<_>>().len() == names.len();
    if is_unique { names } else { BTreeMap::new() }
}

/// A folder that got another scene numbers the later ones anew.
fn aligned_scenes(base: &ScoredRun, other: &ScoredRun) -> HashMap<u64, u64> {
    let scenes = base.rows.iter().filter(|row| row.origin().is_scene());
    let scenes = scenes.map(|row| ((row.name(), row.pair_hash()), row.sequence()));
    let scenes: HashMap<_, _> = scenes.collect();
    let behind = scenes.values().max().map_or(0, |last| last + 1);
    let number = |row: RowRef<'_>| scenes.get(&(row.name(), row.pair_hash())).copied();
    let others = other.rows.iter().filter(|row| row.origin().is_scene());
    let others = others.map(|row| {
        (
            row.sequence(),
            number(row).unwrap_or(behind + row.sequence()),
        )
    });
    others.collect()
}

impl<'a> JoinedAlgorithm<'a> {
    /// Number of pairs or courses of both.
    pub fn compared(&self) -> usize {
        self.pairs.len().max(self.courses.len())
    }

    /// The rows of the pairs in one of the reports.
    pub fn rows(&self, side: usize) -> Vec<RowRef<'a>> {
        self.pairs.iter().map(|pair| pair[side]).collect()
    }

    /// The pairs of equal number and pixels: another seed or version of the arena renders other
    /// pixels, and pairs of a parked robot have equal ones.
    fn from_pairs(
        [base, other]: [&'a ScoredRun; 2],
        labels: [&'a str; 2],
        alignment: &AlignedRuns<'a>,
    ) -> Self {
        let mut sides = [PairRows::new(), PairRows::new()];
        for row in base.rows.iter().filter(|row| row.algorithm() == labels[0]) {
            sides[0].insert((row.origin().run_key(), row.sequence(), row.name()), row);
        }
        for row in other.rows.iter().filter(|row| row.algorithm() == labels[1]) {
            let (run, number) = alignment.place(row.origin().run_key(), row.sequence());
            sides[1].insert((run, number, row.name()), row);
        }
        let [ours, theirs] = sides;
        let both = ours.iter().filter_map(|(key, a)| {
            let b = theirs.get(key).filter(|b| a.pair_hash() == b.pair_hash());
            b.map(|b| [*a, *b])
        });
        let pairs: Vec<_> = both.collect();
        let has_results: BTreeSet<_> = ours.keys().map(|key| (key.0, key.1)).collect();
        let failed = |side: usize| {
            let own = [base, other][side].failures.iter();
            let own = own.filter(move |row| row.algorithm == labels[side]);
            own.map(|row| ((row.seed, row.run.as_deref()), row.sequence))
        };
        let failures = failed(1).map(|(run, sequence)| alignment.place(run, sequence));
        let read_pairs = theirs.len() + failures.clone().count();
        let newly_failed = failures.clone().filter(|place| has_results.contains(place));
        let newly_failed = newly_failed.count();
        let whole_runs = whole_runs(&pairs, [&ours, &theirs]);
        let records = [base, other].into_iter().zip(labels);
        let mut records = records.filter_map(|(run, label)| run.record(label));
        let other_past = if records.any(|record| record.has_run_memory) {
            // A pair that one of the two failed on was read by both.
            let failed: BTreeSet<_> = failed(0).chain(failures).collect();
            let read_by_both = |rows: &PairRows<'a>| -> PairRows<'a> {
                let rows = rows.iter().map(|(key, row)| (*key, *row));
                rows.filter(|(key, _)| !failed.contains(&(key.0, key.1)))
                    .collect()
            };
            let pasts = equal_pasts(&read_by_both(&ours), &read_by_both(&theirs));
            pairs.len() - pasts
        } else {
            0
        };
        Self {
            labels,
            base_pairs: ours.len(),
            unmatched: ours.len() + theirs.len() - 2 * pairs.len(),
            read_pairs,
            newly_failed,
            other_past,
            whole_runs,
            pairs,
            ..Self::default()
        }
    }

    /// The courses of equal seed and obstacles.
    fn from_courses([base, other]: [&'a ScoredRun; 2], labels: [&'a str; 2]) -> Self {
        let drives = |run: &'a ScoredRun, label| {
            let own = run.drives.iter();
            let own = own.filter(|row| row.algorithm == label && row.stress.is_none());
            own.map(|row| (row.seed, row)).collect::<BTreeMap<_, _>>()
        };
        let (ours, theirs) = (drives(base, labels[0]), drives(other, labels[1]));
        let both = ours.iter();
        let both = both.filter(|(seed, _)| base.has_course_of(other, **seed));
        let courses: Vec<_> = both
            .filter_map(|(seed, row)| Some([*row, *theirs.get(seed)?]))
            .collect();
        Self {
            labels,
            base_pairs: ours.len(),
            unmatched: ours.len() + theirs.len() - 2 * courses.len(),
            courses,
            ..Self::default()
        }
    }
}

/// The runs, by the names of each report, of which both have no other pairs than these.
fn whole_runs<'a>(pairs: &[[RowRef<'a>; 2]], all: [&PairRows<'a>; 2]) -> [Vec<RunKey<'a>>; 2] {
    let names = |pair: &[RowRef<'a>; 2]| pair.map(|row| row.origin().run_key());
    let runs = pairs.chunk_by(|a, b| names(a) == names(b));
    let is_whole = |run: &&[[RowRef<'a>; 2]]| {
        let is_whole = |(side, all): (usize, &PairRows<'_>)| {
            let name = run[0][side].origin().run_key();
            let own = all.values().filter(|row| row.origin().run_key() == name);
            own.count() == run.len()
        };
        all.into_iter().enumerate().all(is_whole)
    };
    let whole: Vec<_> = runs.filter(is_whole).map(|run| names(&run[0])).collect();
    [0, 1].map(|side| whole.iter().map(|names| names[side]).collect())
}

/// The number of common pairs before which the two reports have equal pairs.
fn equal_pasts<'a>(ours: &PairRows<'a>, theirs: &PairRows<'a>) -> usize {
    let in_run = |rows: &PairRows<'a>, run: RunKey<'a>| -> Vec<_> {
        let own = rows.iter().filter(|(key, _)| key.0 == run);
        own.map(|(key, row)| (*key, *row)).collect()
    };
    let equal = |run: RunKey<'a>| {
        let both = in_run(ours, run).into_iter().zip(in_run(theirs, run));
        // Scenes of a data set are independent of each other.
        let equal = both
            .take_while(|((_, a), (_, b))| a.origin().is_scene() || a.pair_hash() == b.pair_hash());
        equal
            .filter(|((key, a), (other, b))| key == other && a.pair_hash() == b.pair_hash())
            .count()
    };
    let runs: BTreeSet<_> = ours.keys().map(|key| key.0).collect();
    runs.into_iter().map(equal).sum()
}
