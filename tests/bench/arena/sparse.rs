//! Cells scored by a sparse truth agree with the dense truth that it is drawn from: in the patterns
//! of a lidar and of KITTI, also where a scene's far, near or smooth surfaces have no points.

use crate::common::{datasets, step};
use svl::arena::{Arena, ArenaConfig};
use svl::depth::{GridSettings, grid};
use svl::matcher::{Algorithm, MatchContext, MatchOutput};
use svl::score::{CellJudgement, Judge, Verdict};
use svl::source::dataset::Scene;
use svl::stereo::{CellRule, Estimate, Frame, MapDensity, Plane, RectifiedPair, Truth, TruthKind};

/// True for a pixel (x, y) of a frame that has a point.
type HasPoint = Box<dyn Fn(usize, usize, &Dense) -> bool>;

/// A frame with dense truth.
struct Dense<'a> {
    frame: &'a Frame,
    truth: &'a Plane<f32>,
    /// 20th and 80th percentile of the truth, pixels.
    far_px: f32,
    near_px: f32,
}

impl<'a> Dense<'a> {
    fn new(frame: &'a Frame) -> Self {
        let truth = &frame.truth.as_ref().unwrap().disparity;
        let mut known: Vec<f32> = truth.pixels().filter(|d| d.is_finite()).collect();
        known.sort_by(f32::total_cmp);
        let [far_px, near_px] = [20, 80].map(|percent| known[percent * known.len() / 100]);
        Self {
            frame,
            truth,
            far_px,
            near_px,
        }
    }

    /// True if the image has nearly no contrast around a pixel, as sky, glass and lacquer have.
    fn is_smooth(&self, x: usize, y: usize) -> bool {
        let image = self.frame.pair.left();
        let (width, height) = image.size();
        let rows = y.saturating_sub(2)..(y + 3).min(height);
        let values = rows.flat_map(|y| {
            let columns = x.saturating_sub(2)..(x + 3).min(width);
            columns.map(move |x| image.get(x, y))
        });
        let (least, greatest) = values.fold((u8::MAX, 0), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        greatest - least < 12
    }
}

/// Rows and columns of a lidar that misses the upper third.
fn lidar(rows: usize, columns: usize) -> HasPoint {
    Box::new(move |x, y, dense| {
        let top = dense.truth.height() / 3;
        y >= top && (y - top).is_multiple_of(rows) && x.is_multiple_of(columns)
    })
}

/// The pixels in which KITTI's scene has points, scaled to the frame.
fn kitti(mask: Plane<f32>) -> HasPoint {
    Box::new(move |x, y, dense| {
        let ((width, height), (w, h)) = (dense.truth.size(), mask.size());
        mask.get(x * w / width, y * h / height).is_finite()
    })
}

/// Points of a pattern, but none on some surfaces of the scene.
fn but_none_on(points: HasPoint, surfaces: fn(usize, usize, &Dense) -> bool) -> HasPoint {
    Box::new(move |x, y, dense| points(x, y, dense) && !surfaces(x, y, dense))
}

fn is_far(x: usize, y: usize, dense: &Dense) -> bool {
    dense.truth.get(x, y) <= dense.far_px
}

fn is_near(x: usize, y: usize, dense: &Dense) -> bool {
    dense.truth.get(x, y) >= dense.near_px
}

fn is_smooth(x: usize, y: usize, dense: &Dense) -> bool {
    dense.is_smooth(x, y)
}

fn patterns() -> Vec<(&'static str, HasPoint)> {
    // A pattern like KITTI's: denser in the centre than below, with holes.
    let uneven = |share: fn(f64) -> f64| -> HasPoint {
        Box::new(move |x, y, dense| {
            let height = dense.truth.height();
            let mixed = (x * 7919 + y * 104_729) as u64 * 0x9E37_79B9_7F4A_7C15;
            let below = (height - y) as f64 / height as f64;
            y >= height / 3 && (mixed >> 40) as f64 / f64::from(1 << 24) < share(below)
        })
    };
    let mut patterns: Vec<(_, HasPoint)> = vec![
        ("lidar, 4th row, 2nd column", lidar(4, 2)),
        ("lidar, 8th row, 3rd column", lidar(8, 3)),
        ("the same, none on what is far", {
            but_none_on(lidar(8, 3), is_far)
        }),
        ("the same, none on what is near", {
            but_none_on(lidar(8, 3), is_near)
        }),
        ("the same, none on what is smooth", {
            but_none_on(lidar(8, 3), is_smooth)
        }),
        ("uneven", uneven(|below| below * below)),
        ("uneven, on most pixels", uneven(|below| 1.4 * below)),
        // Sweeps that overlap in every second band.
        ("all and thirds", {
            Box::new(|_, y, dense| {
                (8 * y / dense.truth.height()).is_multiple_of(2) || y.is_multiple_of(3)
            })
        }),
        ("every 16th row", Box::new(|_, y, _| y.is_multiple_of(16))),
        (
            "every 12th column",
            Box::new(|x, _, _| x.is_multiple_of(12)),
        ),
    ];
    if let Some(folder) = datasets() {
        let scene = Scene::find(&folder.join("kitti2012-000000_10"), "kitti").unwrap();
        let mask = scene.read(0).unwrap().truth.unwrap().disparity;
        let points = || kitti(mask.clone());
        patterns.extend([
            ("KITTI's", points()),
            (
                "KITTI's, none on what is far",
                but_none_on(points(), is_far),
            ),
            (
                "KITTI's, none on what is near",
                but_none_on(points(), is_near),
            ),
            (
                "KITTI's, none on what is smooth",
                but_none_on(points(), is_smooth),
            ),
        ]);
    }
    patterns
}

fn thinned(dense: &Dense, has_point: &HasPoint) -> Frame {
    let (width, height) = dense.truth.size();
    let kept = |x, y| {
        if has_point(x, y, dense) {
            dense.truth.get(x, y)
        } else {
            f32::INFINITY
        }
    };
    Frame {
        truth: Some(Truth {
            kind: TruthKind {
                density: MapDensity::Sparse,
                ..TruthKind::default()
            },
            ..Truth::exact(Plane::from_fn(width, height, kept).unwrap(), None)
        }),
        ..dense.frame.clone()
    }
}

fn estimate(algorithm: &Algorithm, frame: &Frame) -> Estimate {
    let judge = Judge::default();
    let context = MatchContext::for_frame(frame, judge.grid, judge.cells);
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
        times: None,
    }
}

fn judged(frame: Frame, estimate: Estimate) -> Vec<CellJudgement> {
    let judged = Judge::default().judge(frame, vec![estimate]);
    judged.estimates[0].cells.clone().unwrap()
}

/// The verdict by dense truth, with the tolerance of sparse truth: only the cell's truth differs.
fn verdict(dense: &CellJudgement, reported_px: Option<f32>, rule: CellRule) -> Verdict {
    let true_px = dense.true_px.unwrap();
    match (rule.proportional_at(true_px), reported_px) {
        (CellRule::Disparity { tolerance_px }, Some(px)) => {
            if (f64::from(px) - true_px).abs() <= tolerance_px {
                Verdict::Right
            } else {
                Verdict::Wrong
            }
        }
        _ => dense.verdict,
    }
}

/// Cells with dense truth, those of them that a pattern scores, the known ones among these, and
/// those with the verdict by dense truth among these.
#[derive(Clone, Copy, Default)]
struct Tally {
    cells: usize,
    scored: usize,
    known: usize,
    alike: usize,
}

impl Tally {
    fn add(&mut self, verdict: Verdict, sparse: &CellJudgement) {
        self.cells += 1;
        self.scored += usize::from(sparse.verdict != Verdict::NoTruth);
        if matches!(sparse.verdict, Verdict::Right | Verdict::Wrong) {
            self.known += 1;
            self.alike += usize::from(sparse.verdict == verdict);
        }
    }

    /// The fraction of the known cells with the verdict by dense truth, %.
    fn agreement(&self) -> f64 {
        100.0 * self.alike as f64 / self.known as f64
    }
}

/// The scores of an algorithm's cells, by pattern.
fn tallies(frames: &[Frame], algorithm: &str, patterns: &[(&str, HasPoint)]) -> Vec<Tally> {
    let algorithm: Algorithm = algorithm.parse().unwrap();
    let mut tallies = vec![Tally::default(); patterns.len()];
    for frame in frames {
        let estimate = estimate(&algorithm, frame);
        let rule = CellRule::default().for_rig(frame.rig().is_some());
        let by_dense = judged(frame.clone(), estimate.clone());
        let dense = Dense::new(frame);
        for ((_, has_point), tally) in patterns.iter().zip(&mut tallies) {
            let by_points = judged(thinned(&dense, has_point), estimate.clone());
            let cells = by_dense.iter().zip(&by_points).zip(estimate.grid.iter());
            for ((dense, sparse), (_, cell)) in cells {
                if dense.points.is_none() && dense.true_px.is_some() {
                    let reported_px = cell.depth.map(|depth| depth.median_px);
                    tally.add(verdict(dense, reported_px, rule), sparse);
                }
            }
        }
    }
    tallies
}

/// The algorithms' cells scored by sparse truths agree with those by the dense truth of the frames.
fn agree(frames: &[Frame], algorithms: [&str; 4]) {
    // All patterns in `.ci/nightly`, a lidar's, an uneven one and KITTI's otherwise.
    let patterns: Vec<_> = patterns().into_iter().step_by(step(1)).collect();
    let by_algorithm = algorithms.map(|name| tallies(frames, name, &patterns));
    println!("| points | scored cells | {} |", algorithms.join(" | "));
    println!("|---|---:|---:|---:|---:|---:|");
    for (i, (pattern, _)) in patterns.iter().enumerate() {
        let by_pattern = by_algorithm.each_ref().map(|tallies| tallies[i]);
        let Tally { cells, scored, .. } = by_pattern[0];
        let agreements = by_pattern.map(|tally| tally.agreement());
        let shown = agreements
            .map(|percent| format!("{percent:.1}"))
            .join(" | ");
        println!("| {pattern} | {scored} of {cells} | {shown} |");
        // The same cells for all algorithms.
        assert!(
            by_pattern.iter().all(|tally| tally.scored == scored),
            "{pattern}"
        );
        assert!(scored >= frames.len(), "{pattern}: {scored} cells");
        let is_alike = |percent: &f64| *percent >= 95.0;
        assert!(agreements.iter().all(is_alike), "{pattern}: {agreements:?}");
    }
}

#[test]
fn sparse_truth_scores_the_arena_s_cells_as_dense_truth_does() {
    let arena = Arena::new(&ArenaConfig::default(), 1).unwrap();
    let frames: Vec<_> = (0..280)
        .step_by(step(11))
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
