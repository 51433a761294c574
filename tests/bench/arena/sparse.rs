//! Cells scored by a sparse truth agree with the dense truth that it is drawn from, in the patterns
//! of a lidar, a laser scan and KITTI.

use crate::common::datasets;
use svl::arena::{Arena, ArenaConfig};
use svl::depth::{GridSettings, grid};
use svl::matcher::{Algorithm, MatchContext, MatchOutput};
use svl::score::{CellJudgement, Judge, Verdict};
use svl::source::dataset::Scene;
use svl::stereo::{Estimate, Frame, Plane, RectifiedPair, Truth, TruthDensity, TruthKind};
use svl::timing::StageTimes;

/// True for a known pixel (x, y) of an image of a size.
type Known = Box<dyn Fn(usize, usize, (usize, usize)) -> bool>;

/// Lines of a lidar that misses the upper third.
fn lidar(rows: usize, columns: usize) -> Known {
    Box::new(move |x, y, (_, height)| {
        y >= height / 3 && (y - height / 3).is_multiple_of(rows) && x.is_multiple_of(columns)
    })
}

/// Rows of the whole image.
fn rows(every: usize) -> Known {
    Box::new(move |_, y, _| y.is_multiple_of(every))
}

fn patterns() -> Vec<(&'static str, Known)> {
    // As in KITTI: denser in the centre than below, with holes.
    let uneven = |share: fn(f64) -> f64| -> Known {
        Box::new(move |x, y, (_, height)| {
            let mixed = (x * 7919 + y * 104_729) as u64 * 0x9E37_79B9_7F4A_7C15;
            let below = (height - y) as f64 / height as f64;
            y >= height / 3 && (mixed >> 40) as f64 / f64::from(1 << 24) < share(below)
        })
    };
    let mut patterns: Vec<(_, Known)> = vec![
        ("lidar, every 4th row, 2nd column", lidar(4, 2)),
        ("lidar, every 6th row, 3rd column", lidar(6, 3)),
        ("lidar, every 8th row, 3rd column", lidar(8, 3)),
        ("laser scan in the middle row", {
            Box::new(|_, y, (_, height)| y == height / 2)
        }),
        ("uneven", uneven(|below| below * below)),
        ("uneven, on most pixels", uneven(|below| 1.4 * below)),
        // As where sweeps overlap in every second band.
        ("all and thirds, on most pixels", {
            Box::new(|_, y, (_, height)| (8 * y / height).is_multiple_of(2) || y.is_multiple_of(3))
        }),
        ("every 8th row of all", rows(8)),
        ("every 16th row of all", rows(16)),
        ("every 20th row of all", rows(20)),
        ("every 25th row of all", rows(25)),
        (
            "every 20th column",
            Box::new(|x, _, _| x.is_multiple_of(20)),
        ),
    ];
    if let Some(folder) = datasets() {
        let scene = Scene::find(&folder.join("kitti2012-000000_10"), "kitti").unwrap();
        let mask = scene.read(0).unwrap().truth.unwrap().disparity;
        let known = move |x: usize, y: usize, (width, height): (usize, usize)| {
            let (w, h) = mask.size();
            mask.get(x * w / width, y * h / height).is_finite()
        };
        patterns.push(("KITTI's own", Box::new(known)));
    }
    patterns
}

fn thinned(frame: &Frame, known: &Known) -> Frame {
    let truth = &frame.truth.as_ref().unwrap().disparity;
    let (width, height) = truth.size();
    let kept = |x, y| {
        if known(x, y, truth.size()) {
            truth.get(x, y)
        } else {
            f32::INFINITY
        }
    };
    Frame {
        truth: Some(Truth {
            kind: TruthKind {
                density: TruthDensity::Sparse,
                ..TruthKind::default()
            },
            ..Truth::exact(Plane::from_fn(width, height, kept).unwrap(), None)
        }),
        ..frame.clone()
    }
}

fn estimate(algorithm: &Algorithm, frame: &Frame) -> Estimate {
    let judge = Judge::default();
    let context = MatchContext::of(frame, judge.grid, judge.cells);
    let mut output = MatchOutput::new().unwrap();
    let mut matcher = algorithm.build().unwrap();
    matcher
        .compute(RectifiedPair::assume(&frame.pair), &context, &mut output)
        .unwrap();
    let own_grid = output.grid.is_some();
    let map = output.disparity.disparity();
    Estimate {
        algorithm: String::new(),
        grid: output
            .grid
            .unwrap_or_else(|| grid(map, GridSettings::default(), frame.rig())),
        disparity: output.disparity,
        own_grid,
        unfiltered: None,
        range_px: None,
        times: StageTimes::default(),
    }
}

fn judged(frame: Frame, estimate: Estimate) -> Vec<CellJudgement> {
    let judged = Judge::default().judge(frame, vec![estimate]);
    judged.estimates[0].cells.clone().unwrap()
}

#[derive(Clone, Copy, Default)]
struct Tally {
    scored: usize,
    known: usize,
    right: usize,
    /// Scored right, wrong, but differently by the dense truth.
    falsely: [usize; 2],
}

impl Tally {
    fn add(&mut self, dense: &CellJudgement, sparse: &CellJudgement) {
        let is_known = sparse.verdict != Verdict::Unknown;
        self.scored += 1;
        self.known += usize::from(is_known);
        self.right += usize::from(dense.verdict == Verdict::Right);
        if dense.verdict != sparse.verdict {
            self.falsely[usize::from(sparse.verdict == Verdict::Wrong)] += 1;
        }
    }

    /// Agreement over all cells, and over the known ones, %.
    fn agreement(&self) -> [f64; 2] {
        let off = self.falsely.iter().sum::<usize>() as f64;
        [self.scored, self.known].map(|of| 100.0 * (1.0 - off / of as f64))
    }
}

/// The algorithms' cells scored by sparse truths agree with those by the dense truth of the frames.
fn agree(frames: &[Frame], algorithms: [&str; 4]) {
    println!("| truth | algorithm | cells | known | right | agreement, % | of known cells, % |");
    println!("|---|---|---:|---:|---:|---:|---:|");
    let patterns = patterns();
    for name in algorithms {
        let algorithm: Algorithm = name.parse().unwrap();
        let mut tallies = vec![Tally::default(); patterns.len()];
        for frame in frames {
            let estimate = estimate(&algorithm, frame);
            let dense = judged(frame.clone(), estimate.clone());
            for ((_, known), tally) in patterns.iter().zip(&mut tallies) {
                let sparse = judged(thinned(frame, known), estimate.clone());
                let both = dense.iter().zip(&sparse);
                both.filter(|(dense, sparse)| {
                    let has_dense = dense.points.is_none() && dense.true_px.is_some();
                    has_dense && sparse.verdict != Verdict::NoTruth
                })
                .for_each(|(dense, sparse)| tally.add(dense, sparse));
            }
        }
        for ((pattern, _), tally) in patterns.iter().zip(tallies) {
            let [all, known] = tally.agreement();
            let Tally {
                scored,
                known: of,
                right,
                ..
            } = tally;
            let counts = format!("{scored} | {of} | {right} | {all:.1} | {known:.1}");
            println!("| {pattern} | {name} | {counts} |");
            let least = if pattern.ends_with("pixels") {
                98.0
            } else {
                96.0
            };
            assert!(all >= least && scored >= frames.len(), "{name}, {pattern}");
        }
    }
}

#[test]
fn sparse_truth_scores_the_arena_s_cells_as_dense_truth_does() {
    let arena = Arena::new(&ArenaConfig::default(), 1).unwrap();
    let frames: Vec<_> = (0..280)
        .step_by(11)
        .map(|i| arena.frame(i).unwrap())
        .collect();
    agree(&frames, ["v3", "v5", "bm", "sgm"]);
}

#[test]
fn sparse_truth_scores_real_scenes_cells_as_dense_truth_does() {
    let Some(folder) = datasets() else {
        return;
    };
    let scenes = "barn1 bull cones eth3d-playground_1l middlebury2006/Art middlebury2006/Baby1 \
                  middlebury2006/Books middlebury2006/Cloth3 middlebury2006/Reindeer \
                  middlebury2006/Wood1 middlebury2014q/Adirondack middlebury2014q/ArtL \
                  middlebury2014q/Motorcycle middlebury2014q/Piano middlebury2014q/PianoL \
                  middlebury2014q/Playroom teddy tsukuba venus";
    let read = |name| {
        Scene::find(&folder.join(name), name)
            .unwrap()
            .read(0)
            .unwrap()
    };
    let frames: Vec<_> = scenes.split_whitespace().map(read).collect();
    let algorithms = [
        "v3:max_disparity=80",
        "v5",
        "bm:max_disparity=80",
        "sgm:max_disparity=80",
    ];
    agree(&frames, algorithms);
}
