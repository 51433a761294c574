use super::matchers::ReadyMatcher;
use super::*;
use crate::sink::{CollectSink, Outbox};
use crate::source::Chain;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use svl_core::depth::{self, CellDecision, GridSettings};
use svl_core::matcher::{MatchContext, MatchOutput, Matcher};
use svl_core::stereo::{ExtraPlanes, Frame, Geometry, Gray, RectifiedPair, StereoPair};
use svl_core::timing::Stage;
use svl_score::judge::{Judge, Judged, MatchFailure};
use svl_score::manifest::Manifest;

/// That many frames, then an error.
struct Failing {
    left: u64,
    geometry: Geometry,
    listens: bool,
    heard: Vec<u64>,
    /// True if it is read from a pool, or from a thread that has one of its own.
    in_pool: bool,
}

impl Failing {
    fn new(left: u64) -> Self {
        Self {
            left,
            geometry: Geometry::Rectified(None),
            listens: false,
            heard: Vec::new(),
            in_pool: rayon::current_thread_index().is_some(),
        }
    }
}

impl Source for Failing {
    fn name(&self) -> String {
        "failing".into()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        self.left = self
            .left
            .checked_sub(1)
            .ok_or_else(|| Error::Invalid("source failed".into()))?;
        // Rayon must work in this thread, as it does for the arena, not in the pool of the caller,
        // whose only thread waits for this one.
        let in_pool = rayon::current_thread_index().is_some();
        assert!(in_pool || !self.in_pool, "rayon would use another pool");
        let image = Gray::filled(40, 20, self.left as u8)?;
        Ok(Some(Frame {
            sequence: self.left,
            ..Frame::new(StereoPair::new(image.clone(), image)?, self.geometry)
        }))
    }

    fn pairs(&self) -> Option<u64> {
        None
    }

    fn listens(&self) -> bool {
        self.listens
    }

    fn hear(&mut self, judged: &Judged) {
        assert_eq!(judged.frame.sequence, self.left, "before the next frame");
        self.heard.push(judged.frame.sequence);
    }
}

/// Calls of a sink, in order.
type Log = Arc<Mutex<Vec<String>>>;

/// Takes that many frames, then fails.
struct Full(usize, Log);

impl Full {
    fn note(&self, what: String) {
        self.1.lock().unwrap().push(what);
    }
}

impl Sink for Full {
    fn begin_pass(&mut self, _: &PassStart<'_>) -> Result<()> {
        self.note("begin".into());
        Ok(())
    }

    fn take(&mut self, judged: &Judged) -> Result<()> {
        assert_eq!(judged.estimates.len(), 1);
        if self.0 == 0 {
            return Err(Error::Invalid("sink failed".into()));
        }
        self.0 -= 1;
        self.note(judged.frame.sequence.to_string());
        Ok(())
    }

    fn end_pass(&mut self, end: &PassEnd<'_>) -> Result<()> {
        self.note(format!("end {}", end.error.unwrap_or("well")));
        Ok(())
    }
}

struct Until(u64);

impl Monitor for Until {
    fn go_on(&mut self, done: u64) -> bool {
        done < self.0
    }
}

/// The calls of the sink, and the end of the pass.
fn ran(source: &mut dyn Source, sink_takes: usize, last: u64) -> (String, Outcome, Result<()>) {
    ran_at(Pace::Asap, source, sink_takes, last)
}

fn ran_at(
    pace: Pace,
    source: &mut dyn Source,
    sink_takes: usize,
    last: u64,
) -> (String, Outcome, Result<()>) {
    let algorithms = ["v3:max_disparity=8".parse().unwrap()];
    let manifest = Manifest::new("test", &algorithms).unwrap();
    let judge = Judge::default();
    let start = PassStart::new(&manifest, None, &judge);
    let log = Log::default();
    let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(Full(sink_takes, Arc::clone(&log)))];
    let mut matchers = Matchers::new(&algorithms).unwrap();
    let until = &mut Until(last);
    let (outcome, ended) = run(source, &mut matchers, &start, pace, &mut sinks, until);
    (log.lock().unwrap().join(" "), outcome, ended)
}

fn pool(threads: usize) -> rayon::ThreadPool {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap()
}

const PACES: [Pace; 5] = [
    Pace::Asap,
    Pace::Measured { rounds: 1 },
    Pace::Jobs(1),
    Pace::Jobs(2),
    Pace::Jobs(7),
];

#[test]
fn every_frame_is_taken_in_order_until_the_same_end() {
    // From the only thread of a pool, and from outside of any.
    let in_pool = |work: &mut (dyn FnMut() + Send)| pool(1).install(work);
    let outside = |work: &mut (dyn FnMut() + Send)| work();
    let with = [&in_pool as &dyn Fn(&mut (dyn FnMut() + Send)), &outside];
    for (with, pace) in with
        .into_iter()
        .flat_map(|with| PACES.map(|pace| (with, pace)))
    {
        with(&mut || {
            let (log, _, ended) = ran_at(pace, &mut Failing::new(4), 100, 100);
            assert_eq!(log, "begin 3 2 1 0 end source failed");
            assert_eq!(ended.unwrap_err().to_string(), "source failed");
            let (log, _, ended) = ran_at(pace, &mut Failing::new(9), 3, 100);
            assert_eq!(log, "begin 8 7 6 end sink failed");
            assert_eq!(ended.unwrap_err().to_string(), "sink failed");
            let (log, outcome, ended) = ran_at(pace, &mut Failing::new(20), 100, 4);
            assert_eq!(log, "begin 19 18 17 16 end well");
            ended.unwrap();
            assert_eq!((outcome.frames, outcome.interrupted), (4, true));
            let why = |pairs| outcome.reached_end(pairs).unwrap_err().to_string();
            assert_eq!(why(Some(20)), "interrupted after 4 of 20 pairs");
            assert_eq!(why(None), "interrupted after 4 pairs");
            outcome.reached_end(Some(4)).unwrap();
        });
    }
}

#[test]
fn a_source_that_listens_hears_each_frame_before_the_next() {
    let mut source = Failing {
        listens: true,
        ..Failing::new(20)
    };
    // Through the wrappers of every pass of the command line.
    let wrapped: &mut dyn Source = &mut source;
    let mut wrapped = Chain::for_matching(Some(0))
        .over(Box::new(wrapped))
        .unwrap();
    ran(&mut *wrapped, 100, 3).2.unwrap();
    drop(wrapped);
    assert_eq!(source.heard, [19, 18, 17]);
}

#[test]
fn memory_is_set_up_once_for_a_size_in_all_runs() {
    let algorithms = ["v3:max_disparity=8", "v1:max_disparity=8"].map(|a| a.parse().unwrap());
    let manifest = Manifest::new("test", &algorithms).unwrap();
    let judge = Judge::default();
    let start = PassStart::new(&manifest, None, &judge);
    let mut matchers = Matchers::new(&algorithms).unwrap();
    let matchings = Arc::new(AtomicU64::new(0));
    matchers.0[0].matcher = Box::new(CountedMatcher(Arc::clone(&matchings)));
    let run = |matchers: &mut Matchers| {
        let (mut source, pace) = (Failing::new(9), Pace::Measured { rounds: 1 });
        let (_, ran) = run(&mut source, matchers, &start, pace, &mut [], &mut Until(2));
        ran.unwrap();
        matchings.swap(0, Ordering::Relaxed)
    };
    // Two pairs; the first pass matches one more.
    assert_eq!((run(&mut matchers), run(&mut matchers)), (3, 2));
    // One that replaces another has to be set up; none that was away meanwhile has.
    matchers.replace(&algorithms[1]).unwrap();
    let is_warm = |matchers: &Matchers| matchers.0.iter().all(|matcher| matcher.warm_for.is_some());
    assert!(!is_warm(&matchers));
    let counted = matchers.take(&[algorithms[0].label()]);
    assert_eq!(run(&mut matchers), 0);
    matchers.append(counted);
    assert!(is_warm(&matchers));
    assert_eq!(run(&mut matchers), 2);
}

/// Counts its matchings.
struct CountedMatcher(Arc<AtomicU64>);

impl Matcher for CountedMatcher {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        _: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        self.0.fetch_add(1, Ordering::Relaxed);
        let (width, height) = pair.size();
        output.disparity.resize(width, height, ExtraPlanes::NONE)
    }
}

#[test]
fn failures_reach_the_sinks_and_the_manifest() {
    struct Fails;
    impl Matcher for Fails {
        fn compute(
            &mut self,
            _: RectifiedPair<'_>,
            _: &MatchContext,
            _: &mut MatchOutput,
        ) -> Result<()> {
            Err(Error::Invalid("too dark".into()))
        }
    }
    struct Kept(Vec<(u64, MatchFailure)>, Outbox<Vec<(u64, MatchFailure)>>);
    impl Sink for Kept {
        fn take(&mut self, judged: &Judged) -> Result<()> {
            let sequence = judged.frame.sequence;
            let failures = judged.failures.iter();
            self.0.extend(failures.map(|f| (sequence, f.clone())));
            Ok(())
        }

        fn finish(self: Box<Self>) -> Result<()> {
            self.1.put(self.0);
            Ok(())
        }
    }
    let algorithms = ["v3:max_disparity=8".parse().unwrap()];
    let mut manifest = Manifest::new("test", &algorithms).unwrap();
    let judge = Judge::default();
    let mut matchers = Matchers::new(&algorithms).unwrap();
    matchers.0[0].matcher = Box::new(Fails);
    let kept = Outbox::default();
    let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(Kept(Vec::new(), kept.clone()))];
    let start = PassStart::new(&manifest, None, &judge);
    let (mut source, pace) = (Failing::new(9), Pace::Asap);
    let ran = run(
        &mut source,
        &mut matchers,
        &start,
        pace,
        &mut sinks,
        &mut Until(2),
    );
    assert_eq!(ran.0.failures[algorithms[0].label()], 2);
    crate::sink::finish(sinks).unwrap();
    let failure = MatchFailure {
        algorithm: algorithms[0].label().to_owned(),
        reason: "too dark".to_owned(),
    };
    assert_eq!(kept.take(), [(8, failure.clone()), (7, failure)]);
    matchers.complete(&mut manifest);
    let record = &manifest.algorithms[0];
    assert_eq!(record.failed_pairs, 2);
    assert_eq!(record.failure.as_deref(), Some("too dark"));
}

#[test]
fn the_time_of_a_pair_holds_the_decision_of_its_cells() {
    for decision in [CellDecision::Median, CellDecision::Safe] {
        // The matcher's own time is that of matching alone.
        let mut entry = ReadyMatcher::new(&"blind".parse().unwrap()).unwrap();
        let grid = GridSettings {
            decision,
            ..GridSettings::default()
        };
        let context = MatchContext {
            grid,
            ..MatchContext::default()
        };
        let image = Gray::filled(40, 20, 7).unwrap();
        let pair = StereoPair::new(image.clone(), image).unwrap();
        let pair = RectifiedPair::assume(&pair);
        let output = entry.compute(pair, &context).unwrap();
        let is_timed = !output.clock.times().get(Stage::Checks).is_zero();
        assert_eq!(is_timed, decision != CellDecision::Median, "{decision:?}");
        let map = output.disparity.disparity();
        let decided = depth::cells(map, pair.left(), grid, context.cells, None);
        assert_eq!(output.decided, is_timed.then_some(decided));
        assert!(output.grid.is_none(), "it is not the algorithm's own");
    }
}

/// Answers the announced pairs by their numbers, and fails on the second.
struct Several(VecDeque<usize>);

impl Matcher for Several {
    fn batch(&self) -> usize {
        3
    }

    fn announce(&mut self, pairs: &[(RectifiedPair<'_>, MatchContext<'_>)]) {
        self.0 = (0..pairs.len()).collect();
    }

    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        _: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        let (width, height) = pair.size();
        let number = self.0.pop_front().expect("announced");
        let map = &mut output.disparity;
        map.resize(width, height, ExtraPlanes::NONE)?;
        map.rows_mut()
            .for_each(|mut row| row.accept(0, number as f32));
        match number {
            1 => Err(Error::Invalid("too dark".into())),
            _ => Ok(()),
        }
    }
}

/// The hashes of all results at a pace, as text, and the end. `change`: of the matchers.
fn results_at(
    pace: Pace,
    algorithms: &[&str],
    change: impl Fn(&mut Matchers),
) -> (Vec<String>, Matchers, Result<()>) {
    let algorithms: Vec<_> = algorithms.iter().map(|own| own.parse().unwrap()).collect();
    let manifest = Manifest::new("test", &algorithms).unwrap();
    let judge = Judge::default();
    let mut matchers = Matchers::new(&algorithms).unwrap();
    change(&mut matchers);
    let look = move |judged: &Judged| {
        let words = judged.estimates.iter().map(|scored| {
            let estimate = &scored.estimate;
            assert_eq!(estimate.times.is_none(), matches!(pace, Pace::Jobs(_)));
            format!("{} {:x}", estimate.algorithm, scored.hash)
        });
        let failures = judged.failures.iter().map(|failure| failure.reason.clone());
        let words: Vec<_> = words.chain(failures).collect();
        format!("{} {}", judged.frame.sequence, words.join(" "))
    };
    let sink = CollectSink::new(look);
    let results = sink.outbox();
    let mut sinks: Vec<Box<dyn Sink>> = vec![Box::new(sink)];
    let start = PassStart::new(&manifest, None, &judge);
    let (mut source, until) = (Failing::new(30), &mut Until(29));
    let (_, ended) = run(&mut source, &mut matchers, &start, pace, &mut sinks, until);
    crate::sink::finish(sinks).unwrap();
    (results.take(), matchers, ended)
}

#[test]
fn jobs_have_the_results_of_one_thread() {
    let algorithms = ["v3", "v5", "sgm", "bm"].map(|name| format!("{name}:max_disparity=8"));
    let algorithms = algorithms.each_ref().map(String::as_str);
    for algorithms in [&algorithms[..], &algorithms[..1]] {
        let all = PACES.map(|pace| results_at(pace, algorithms, |_| ()));
        assert_eq!(all[0].0.len(), 29);
        for (results, matchers, ended) in all {
            ended.unwrap();
            assert_eq!(results, results_at(PACES[0], algorithms, |_| ()).0);
            let labels: Vec<_> = matchers.0.iter().map(|own| own.label.as_str()).collect();
            assert_eq!(labels, algorithms);
            let copies: Vec<_> = matchers.0.iter().map(|own| own.copies.len()).collect();
            assert!(copies.iter().sum::<usize>() < 7, "{copies:?}");
        }
    }
}

/// Notes how many of them match at the same time, and panics on a pair.
struct Crowded {
    now: Arc<AtomicU64>,
    most: Arc<AtomicU64>,
    dies_on: Option<u64>,
}

impl Matcher for Crowded {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        context: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        assert_eq!(rayon::current_num_threads(), 1, "one thread");
        assert!(self.dies_on != Some(context.sequence), "out of luck");
        let now = self.now.fetch_add(1, Ordering::SeqCst) + 1;
        self.most.fetch_max(now, Ordering::SeqCst);
        std::thread::yield_now();
        self.now.fetch_sub(1, Ordering::SeqCst);
        let (width, height) = pair.size();
        output.disparity.resize(width, height, ExtraPlanes::NONE)
    }
}

/// Puts a crowded matcher in the place of each, the second of which dies on a pair.
fn crowded(matchers: &mut Matchers, most: &Arc<AtomicU64>, dies_on: Option<u64>) {
    let now = Arc::default();
    for (i, entry) in matchers.0.iter_mut().enumerate() {
        entry.matcher = Box::new(Crowded {
            now: Arc::clone(&now),
            most: Arc::clone(most),
            dies_on: dies_on.filter(|_| i == 1),
        });
    }
}

#[test]
fn programs_match_in_turn() {
    let most = Arc::default();
    let programs = [
        "a=exec:command=true",
        "b=exec:command=true",
        "c=exec:command=true",
    ];
    let change = |matchers: &mut Matchers| crowded(matchers, &most, None);
    let (results, matchers, ended) = results_at(Pace::Jobs(7), &programs, change);
    ended.unwrap();
    assert_eq!((results.len(), most.load(Ordering::SeqCst)), (29, 1));
    assert!(matchers.0.iter().all(|own| own.copies.is_empty()));
}

#[test]
fn a_job_that_dies_is_named_and_what_is_whole_is_kept() {
    // Programs have no copies, and match in turn.
    let algorithms = ["a=exec:command=true", "b=exec:command=true"];
    let change = |matchers: &mut Matchers| crowded(matchers, &Arc::default(), Some(17));
    for jobs in [1, 2, 7] {
        let (results, _, ended) = results_at(Pace::Jobs(jobs), &algorithms, change);
        assert_eq!(
            ended.unwrap_err().to_string(),
            "b died on pair 17; a bug, please report it"
        );
        let sequences: Vec<_> = results.iter().map(|own| &own[..2]).collect();
        let whole: Vec<_> = (18..30).rev().map(|i| i.to_string()).collect();
        assert_eq!(sequences, whole);
    }
}

#[test]
fn each_pair_has_its_own_outputs() {
    let mut entry = ReadyMatcher::new(&"v3".parse().unwrap()).unwrap();
    entry.matcher = Box::new(Several(VecDeque::new()));
    let image = Gray::filled(4, 2, 0).unwrap();
    let pair = StereoPair::new(image.clone(), image).unwrap();
    let pair = (RectifiedPair::assume(&pair), MatchContext::default());
    entry.match_ahead(&[pair; 3], 2);
    let firsts = entry.ahead.iter().map(|outputs| match outputs {
        Ok(outputs) => {
            let maps = outputs.iter().map(|output| output.disparity.at(0, 0));
            maps.map(|disparity| format!("{disparity:?}")).collect()
        }
        Err(error) => vec![error.to_string()],
    });
    let firsts: Vec<Vec<_>> = firsts.collect();
    let expected = [vec!["Ok(0.0)"; 2], vec!["too dark"], vec!["Ok(2.0)"; 2]];
    assert_eq!(firsts, expected);
}

#[test]
fn raw_pairs_are_not_matched() {
    let mut source = Failing {
        geometry: Geometry::Raw,
        ..Failing::new(20)
    };
    let error = ran(&mut source, 100, 3).2.unwrap_err().to_string();
    assert!(error.contains("--calib"), "{error}");
}
