//! Runs that resume with the results of an earlier part.

use super::*;
use crate::outputs::write_json;
use crate::report::{ResultLog, Row};
use crate::sink::{Outbox, TableSink};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use svl_core::matcher::{MatchContext, MatchOutput, Matcher};
use svl_core::stereo::{
    ExtraPlanes, Frame, Geometry, Gray, Plane, RectifiedPair, StereoPair, Truth,
};
use svl_data::manifest::Manifest;
use svl_data::score::Judge;

const SIZE: (usize, usize) = (160, 96);
const PAIRS: u64 = 3;
const ALGORITHMS: [&str; 3] = ["v1", "v2", "v3"];

/// Pairs that show a floor, whose disparities are the numbers of its rows.
struct Floors {
    next: u64,
    /// The truth has every N-th row; `None`: no truth.
    every: Option<usize>,
}

impl Source for Floors {
    fn name(&self) -> String {
        "floors".into()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        if self.next == PAIRS {
            return Ok(None);
        }
        let image = Gray::filled(SIZE.0, SIZE.1, self.next as u8)?;
        let pair = StereoPair::new(image.clone(), image)?;
        let truth = |every: usize| {
            let known = |_, y: usize| {
                if y.is_multiple_of(every) {
                    y as f32
                } else {
                    f32::INFINITY
                }
            };
            Plane::from_fn(SIZE.0, SIZE.1, known).map(|floor| Truth::exact(floor, None))
        };
        self.next += 1;
        Ok(Some(Frame {
            sequence: self.next,
            truth: self.every.map(truth).transpose()?,
            ..Frame::new(pair, Geometry::Rectified(None))
        }))
    }

    fn pairs(&self) -> Option<u64> {
        Some(PAIRS)
    }
}

/// Sees the floor, unless it fails, and counts its matchings.
struct SeesFloor {
    fails: bool,
    remembers: bool,
    matchings: Arc<AtomicU64>,
    forgotten: Arc<AtomicU64>,
}

impl Matcher for SeesFloor {
    fn compute(
        &mut self,
        pair: RectifiedPair<'_>,
        _: &MatchContext,
        output: &mut MatchOutput,
    ) -> Result<()> {
        if self.fails {
            return Err(Error::Invalid("too dark".into()));
        }
        self.matchings.fetch_add(1, Ordering::Relaxed);
        let (width, height) = pair.size();
        output.disparity.resize(width, height, ExtraPlanes::NONE)?;
        for (y, mut row) in output.disparity.rows_mut().enumerate() {
            (0..width).for_each(|x| row.accept(x, y as f32));
        }
        Ok(())
    }

    fn remembers(&self) -> bool {
        self.remembers
    }

    fn forget(&mut self) {
        self.forgotten.fetch_add(1, Ordering::Relaxed);
    }
}

/// A property of the last of three algorithms.
#[derive(Clone, Copy, PartialEq)]
enum Last {
    LikeOthers,
    Fails,
    Remembers,
}

/// The run through three algorithms into a folder; it resumes with what `earlier` holds. Returns
/// its rows and the number of matchings.
fn scored(
    folder: &Path,
    earlier: Option<&Path>,
    every: Option<usize>,
    last: Last,
) -> (Vec<Row>, u64) {
    let algorithms = ALGORITHMS.map(|name| name.parse().unwrap());
    let mut manifest = Manifest::new("floors", &algorithms).unwrap();
    let judge = Judge::default();
    let log = earlier.map(|earlier| ResultLog::read(earlier, &mut manifest, judge.grid).unwrap());
    std::fs::create_dir(folder).unwrap();
    write_json(&folder.join("manifest.json"), &manifest).unwrap();
    let rows = Outbox::default();
    let mut sinks: Vec<Box<dyn Sink>> =
        vec![Box::new(TableSink::in_folder(folder, &rows).unwrap())];
    let [matchings, forgotten] = [0, 0].map(|n| Arc::new(AtomicU64::new(n)));
    let mut matchers = Matchers::new(&algorithms).unwrap();
    for (i, entry) in matchers.0.iter_mut().enumerate() {
        entry.matcher = Box::new(SeesFloor {
            fails: last == Last::Fails && i == 2,
            remembers: last == Last::Remembers && i == 2,
            matchings: Arc::clone(&matchings),
            forgotten: Arc::clone(&forgotten),
        });
    }
    let start = RunStart {
        log: log.as_ref(),
        ..RunStart::new(&manifest, None, &judge)
    };
    let (_, ran) = run(
        &mut Floors { next: 0, every },
        &mut matchers,
        &start,
        Pace::Measured { rounds: 1 },
        &mut sinks,
        &mut Always,
    );
    ran.unwrap();
    crate::sink::finish(sinks).unwrap();
    // No algorithm remembers pairs of another run.
    assert_eq!(forgotten.load(Ordering::Relaxed), ALGORITHMS.len() as u64);
    (rows.take(), matchings.load(Ordering::Relaxed))
}

struct Always;

impl Monitor for Always {
    fn go_on(&mut self, _: u64) -> bool {
        true
    }
}

#[test]
fn pairs_are_not_matched_again_whatever_their_truth() {
    let folder = tempfile::tempdir().unwrap();
    let of_all = ALGORITHMS.len() as u64;
    for every in [1, 4] {
        let [first, second] =
            ["first", "second"].map(|n| folder.path().join(format!("{n}{every}")));
        scored(&first, None, Some(every), Last::LikeOthers);
        let (_, matchings) = scored(&second, Some(&first), Some(every), Last::LikeOthers);
        // One sets up the memory, one verifies the first result.
        assert_eq!(matchings, of_all * 2, "{every}");
        for table in ["rows.csv", "cells.csv"] {
            let [whole, resumed] =
                [&first, &second].map(|at| std::fs::read_to_string(at.join(table)).unwrap());
            assert_eq!(resumed, whole, "{table}, {every}");
        }
    }
}

#[test]
fn an_algorithm_that_failed_before_is_one_of_those_that_agree() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    let agreed = |rows: Vec<Row>| -> Vec<_> {
        let of_rows = rows.iter().map(|row| row.metrics.get("agreed"));
        of_rows.collect()
    };
    let (rows, _) = scored(&first, None, None, Last::Fails);
    assert_eq!(agreed(rows), [None; 2 * PAIRS as usize]);
    let (rows, _) = scored(&second, Some(&first), None, Last::LikeOthers);
    assert_eq!(agreed(rows), [Some(1.0); 3 * PAIRS as usize]);
}

#[test]
fn an_algorithm_that_remembers_matches_all_pairs_again() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    scored(&first, None, Some(1), Last::Remembers);
    let (_, matchings) = scored(&second, Some(&first), Some(1), Last::Remembers);
    // One of each sets up the memory; two match one pair, the last one all.
    assert_eq!(matchings, 3 + 2 + PAIRS);
}
