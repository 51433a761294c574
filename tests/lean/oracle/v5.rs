//! v5 as in its specification: plain loops over every pixel and disparity, sharing no code with the
//! matcher.

use svl_core::stereo::{Gray, StereoPair};

#[derive(Clone, Debug)]
pub(crate) struct V5 {
    pub(crate) max_disparity: usize,
    pub(crate) out: u8,
    pub(crate) p1: i32,
    pub(crate) p2: i32,
    pub(crate) edge: i32,
    pub(crate) unique: i32,
    pub(crate) jump: i32,
    pub(crate) slack: i64,
    pub(crate) rank: i64,
    pub(crate) allowance: f64,
}

/// Results of each step, in raster order.
pub(crate) struct Steps {
    pub(crate) size: (usize, usize),
    pub(crate) half: [Vec<u16>; 2],
    #[allow(dead_code, reason = "each test program uses its part of this module")]
    pub(crate) census: [Vec<u32>; 2],
    /// By row, column, disparity.
    pub(crate) costs: Vec<u8>,
    pub(crate) sums: Vec<u8>,
    /// Bins of 1/8 px, before the majority.
    pub(crate) disparity: Vec<i16>,
    pub(crate) consistent: Vec<bool>,
    pub(crate) first_seen: Vec<bool>,
    pub(crate) seen: Vec<bool>,
    pub(crate) filled: Vec<i16>,
    pub(crate) own: Vec<u8>,
}

/// Evidence on a cell: report, median and the six features.
pub(crate) type Evidence = [i64; 8];

impl Default for V5 {
    fn default() -> Self {
        Self {
            max_disparity: 80,
            out: 7,
            p1: 6,
            p2: 32,
            edge: 40,
            unique: 20,
            jump: 16,
            slack: 10,
            rank: 50,
            allowance: 0.25,
        }
    }
}

fn half(image: &Gray) -> Vec<u16> {
    let (width, height) = (image.width(), image.height());
    let across = |x: usize, y: usize| {
        let at = |x: usize| u16::from(image.get(x, y));
        let before = (2 * x).saturating_sub(1);
        at(before) + 3 * at(2 * x) + 3 * at(2 * x + 1) + at((2 * x + 2).min(width - 1))
    };
    let mut half = Vec::new();
    for y in 0..height / 2 {
        for x in 0..width / 2 {
            let t = |y: usize| across(x, y);
            let above = (2 * y).saturating_sub(1);
            let sum = t(above) + 3 * t(2 * y) + 3 * t(2 * y + 1) + t((2 * y + 2).min(height - 1));
            half.push((sum + 8) >> 4);
        }
    }
    half
}

/// A half image halved again, in its own units.
fn halved(half: &[u16], (width, height): (usize, usize)) -> Vec<u16> {
    let weigh = |at: &dyn Fn(usize) -> u32, i: usize, last: usize| {
        at((2 * i).saturating_sub(1))
            + 3 * at(2 * i)
            + 3 * at(2 * i + 1)
            + at((2 * i + 2).min(last))
    };
    let across = |x: usize, y: usize| weigh(&|x| half[y * width + x].into(), x, width - 1);
    let pixel = |i: usize| {
        let (x, y) = (i % (width / 2), i / (width / 2));
        ((weigh(&|y| across(x, y), y, height - 1) + 32) >> 6) as u16
    };
    (0..width / 2 * (height / 2)).map(pixel).collect()
}

fn census(half: &[u16], (w, h): (usize, usize)) -> Vec<u32> {
    let at = |x: i32, y: i32| {
        half[y.clamp(0, h as i32 - 1) as usize * w + x.clamp(0, w as i32 - 1) as usize]
    };
    let mut census = Vec::new();
    for y in 0..h as i32 {
        for x in 0..w as i32 {
            let mut bits = 0;
            for j in -2..=2 {
                for i in -2..=2 {
                    if (i, j) != (0, 0) {
                        bits = bits << 1 | u32::from(at(x + i, y + j) < at(x, y));
                    }
                }
            }
            census.push(bits);
        }
    }
    census
}

impl V5 {
    pub(crate) fn nd(&self) -> usize {
        self.max_disparity / 2 + 1
    }

    pub(crate) fn steps(&self, pair: &StereoPair) -> Steps {
        let size = (pair.left().width() / 2, pair.left().height() / 2);
        self.steps_of([half(pair.left()), half(pair.right())], size)
    }

    /// The steps for a map's images, halved again.
    #[allow(dead_code, reason = "each test program uses its part of this module")]
    pub(crate) fn quarter_steps(&self, steps: &Steps) -> Steps {
        let size = (steps.size.0 / 2, steps.size.1 / 2);
        self.steps_of(
            steps.half.each_ref().map(|half| halved(half, steps.size)),
            size,
        )
    }

    fn steps_of(&self, half: [Vec<u16>; 2], size: (usize, usize)) -> Steps {
        let nd = self.nd();
        let (w, h) = size;
        let census = [census(&half[0], size), census(&half[1], size)];
        let mut costs = vec![self.out; w * h * nd];
        for y in 0..h {
            for x in 0..w {
                for d in 0..nd.min(x + 1) {
                    let differing = census[0][y * w + x] ^ census[1][y * w + x - d];
                    costs[(y * w + x) * nd + d] = differing.count_ones() as u8;
                }
            }
        }
        let sums = self.sums(&costs, &half[0], size);
        let mut steps = Steps {
            size,
            half,
            census,
            costs,
            sums,
            disparity: Vec::new(),
            consistent: Vec::new(),
            first_seen: Vec::new(),
            seen: Vec::new(),
            filled: Vec::new(),
            own: Vec::new(),
        };
        self.winners(&mut steps);
        steps.seen = majority(&steps.first_seen, size);
        steps.filled = self.fill(&steps);
        steps
    }

    fn sums(&self, costs: &[u8], half: &[u16], (w, h): (usize, usize)) -> Vec<u8> {
        let nd = self.nd();
        let mut sums = vec![0; costs.len()];
        for (step_x, step_y) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
            let mut paths = vec![0_i32; costs.len()];
            let order = |n: usize, step: i32| -> Vec<usize> {
                if step < 0 {
                    (0..n).rev().collect()
                } else {
                    (0..n).collect()
                }
            };
            for y in order(h, step_y) {
                for x in order(w, step_x) {
                    let (px, py) = (x as i32 - step_x, y as i32 - step_y);
                    let inside = (0..w as i32).contains(&px) && (0..h as i32).contains(&py);
                    let here = y * w + x;
                    let before = py as usize * w + px as usize;
                    for d in 0..nd {
                        let cost = i32::from(costs[here * nd + d]);
                        paths[here * nd + d] = if inside {
                            let line = &paths[before * nd..][..nd];
                            let least = *line.iter().min().unwrap();
                            let step = i32::from(half[here]) - i32::from(half[before]);
                            let large = self.p2 * self.edge / self.edge.max(step.abs());
                            let mut best = line[d].min(least + self.p1.max(large));
                            if d > 0 {
                                best = best.min(line[d - 1] + self.p1);
                            }
                            if d + 1 < nd {
                                best = best.min(line[d + 1] + self.p1);
                            }
                            cost + best - least
                        } else {
                            cost
                        };
                    }
                }
            }
            for (sum, path) in sums.iter_mut().zip(&paths) {
                *sum += *path as u8;
            }
        }
        sums
    }

    fn winners(&self, steps: &mut Steps) {
        let (nd, (w, h)) = (self.nd(), steps.size);
        for y in 0..h {
            let sum = |x: usize, d: usize| i32::from(steps.sums[(y * w + x) * nd + d]);
            let right = |xr: usize| {
                let within = (0..nd).filter(|d| xr + d < w);
                within.min_by_key(|&d| (sum(xr + d, d), d)).unwrap()
            };
            for x in 0..w {
                let b = (0..nd).min_by_key(|&d| (sum(x, d), d)).unwrap();
                let best = sum(x, b);
                let others = (0..nd).filter(|d| d.abs_diff(b) > 1).map(|d| sum(x, d));
                let second = others.min().unwrap_or(1_000_000);
                let consistent = x >= b && right(x - b) == b;
                let unique =
                    i64::from(self.unique) * i64::from(second - best) >= i64::from(best + 8);
                let q = if b == 0 || b == nd - 1 {
                    0
                } else {
                    let (lo, hi) = (sum(x, b - 1), sum(x, b + 1));
                    match lo.max(hi) - best {
                        0 => 0,
                        den => (16 * (lo - hi) + den).div_euclid(2 * den),
                    }
                };
                steps.disparity.push((16 * b as i32 + q) as i16);
                steps.consistent.push(consistent);
                steps.first_seen.push(consistent && unique);
                steps.own.push(steps.costs[(y * w + x) * nd + b]);
            }
        }
    }

    fn fill(&self, steps: &Steps) -> Vec<i16> {
        let (w, h) = steps.size;
        let mut rows: Vec<Option<Vec<i16>>> = Vec::new();
        for y in 0..h {
            let known: Vec<(usize, i16)> = (0..w)
                .filter(|x| steps.seen[y * w + x])
                .map(|x| (x, steps.disparity[y * w + x]))
                .collect();
            let value = |x: usize| {
                let before = known.iter().rev().find(|(at, _)| *at <= x);
                let after = known.iter().find(|(at, _)| *at >= x);
                match (before, after) {
                    (Some((_, u)), Some((_, v))) => {
                        if i32::from(u - v).abs() > self.jump {
                            *u.min(v)
                        } else {
                            (u + v) >> 1
                        }
                    }
                    (Some((_, value)), None) | (None, Some((_, value))) => *value,
                    (None, None) => unreachable!(),
                }
            };
            rows.push((!known.is_empty()).then(|| (0..w).map(value).collect()));
        }
        let nearest = |y: usize| {
            let had = (0..h).filter(|&other| rows[other].is_some());
            had.min_by_key(|other| (other.abs_diff(y), *other))
        };
        let row = |y: usize| match nearest(y) {
            Some(other) => rows[other].clone().unwrap(),
            None => vec![-1; w],
        };
        (0..h).flat_map(row).collect()
    }

    /// The least and the greatest true bin for which each bin is right, within a tolerance in
    /// pixels.
    pub(crate) fn tolerance_px(&self, tolerance: f64) -> Vec<(i32, i32)> {
        let k = (((tolerance - self.allowance) * 8.0 + 0.5).floor() as i32).max(0);
        (0..16 * self.nd() as i32).map(|v| (v - k, v + k)).collect()
    }

    /// The bins of [`Self::tolerance_px`], within 20 % or 0.10 m; at infinity within a pixel.
    pub(crate) fn tolerance_m(&self, fb: f64, doffs: f64) -> Vec<(i32, i32)> {
        let bin = |a: f64| ((a.min(10_000.0) - doffs) * 8.0 + 0.5).floor() as i32;
        let infinity = (-doffs * 8.0 + 0.5).floor() as i32;
        let k = (((1.0 - self.allowance) * 8.0 + 0.5).floor() as i32).max(0);
        let interval = |v: i32| {
            if f64::from(v) / 8.0 + doffs <= 0.0 {
                return (-k, infinity + k);
            }
            let d = (f64::from(v) / 8.0 + doffs).max(0.001);
            let z = fb / d;
            let a = ((1.0 - 0.2) * d).min(fb / (z + 0.1)) + self.allowance;
            let far = if z > 0.101 {
                fb / (z - 0.1).max(0.001)
            } else {
                10_000.0
            };
            let c = ((1.0 + 0.2) * d).max(far) - self.allowance;
            (bin(a).min(v), bin(c).max(v))
        };
        (0..16 * self.nd() as i32).map(interval).collect()
    }

    /// The evidence behind each cell's report.
    pub(crate) fn evidence(
        &self,
        steps: &Steps,
        tolerance: &[(i32, i32)],
        (columns, rows): (usize, usize),
    ) -> Vec<Evidence> {
        let ((w, h), n) = (steps.size, tolerance.len() as i64);
        let mut evidence = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                let xs = column * w / columns..(column + 1) * w / columns;
                let ys = row * h / rows..(row + 1) * h / rows;
                let pixels: Vec<usize> = ys
                    .flat_map(|y| xs.clone().map(move |x| y * w + x))
                    .collect();
                evidence.push(self.cell(steps, tolerance, &pixels, n));
            }
        }
        evidence
    }

    fn cell(&self, steps: &Steps, tolerance: &[(i32, i32)], pixels: &[usize], n: i64) -> Evidence {
        let w = steps.size.0;
        let total = pixels.len() as i64;
        let below = |b: i64, only_seen: bool| {
            let counted = pixels
                .iter()
                .filter(|&&p| i64::from(steps.filled[p]) < b && (!only_seen || steps.seen[p]));
            counted.count() as i64
        };
        let all: Vec<i64> = (0..=n).map(|b| below(b, false)).collect();
        let seen: Vec<i64> = (0..=n).map(|b| below(b, true)).collect();
        let ends = |v: i64| {
            let (lo, hi) = tolerance[v as usize];
            (
                i64::from(lo).clamp(0, n) as usize,
                i64::from(hi + 1).clamp(0, n) as usize,
            )
        };
        let safe = |v: i64| {
            let (l, r) = ends(v);
            let near = (100 - self.rank) * total - 100 * (total - all[r]);
            (self.rank * total - 100 * all[l]).min(near)
        };
        let held = |v: i64| {
            let (l, r) = ends(v);
            seen[r] - seen[l]
        };
        let score = |v: i64| 4 * safe(v) + 100 * held(v);
        let median = (0..n)
            .find(|&v| 100 * all[v as usize + 1] >= self.rank * total)
            .unwrap();
        let best = (0..n).map(score).max().unwrap();
        let good = (0..n).filter(|&v| 10 * (best - score(v)) <= 4 * self.slack * total);
        let report = good.min_by_key(|&v| ((v - median).abs(), -v)).unwrap();
        let (lo, hi) = tolerance[report as usize];
        let half = |p: usize| i64::from(steps.half[0][p]);
        let step = |p: usize| {
            if p.is_multiple_of(w) {
                0
            } else {
                (half(p) - half(p - 1)).abs()
            }
        };
        let sum = |value: &dyn Fn(usize) -> i64| pixels.iter().map(|&p| value(p)).sum::<i64>();
        [
            report,
            median,
            (10 * safe(report)).div_euclid(total),
            1000 * held(report) / total,
            1000 * seen[n as usize] / total,
            1000 * (report - median).abs() / i64::from(hi - lo + 1),
            100 * sum(&|p| i64::from(steps.own[p])) / total,
            25 * sum(&step) / total,
        ]
    }
}

fn majority(seen: &[bool], (w, h): (usize, usize)) -> Vec<bool> {
    let at = |x: i32, y: i32| {
        seen[y.clamp(0, h as i32 - 1) as usize * w + x.clamp(0, w as i32 - 1) as usize]
    };
    let stays = |i: usize| {
        let (x, y) = ((i % w) as i32, (i / w) as i32);
        let around = (-1..=1).flat_map(|j| (-1..=1).map(move |i| (i, j)));
        seen[i] && around.filter(|(i, j)| at(x + i, y + j)).count() >= 5
    };
    (0..w * h).map(stays).collect()
}

/// Base and steps of a table: per feature, pairs of a value and the score above it.
pub(crate) type Table = (i64, [&'static [(i64, i64)]; 6]);

pub(crate) const MEDIAN: Table = (
    -131,
    [
        &[
            (26, 226),
            (49, 829),
            (67, 1678),
            (83, 2336),
            (98, 2648),
            (127, 2897),
            (157, 3564),
            (239, 4278),
        ],
        &[(84, 321), (215, 451), (528, 758)],
        &[(314, 610), (364, 743), (509, 947), (640, 997)],
        &[(315, -630)],
        &[
            (313, -59),
            (325, -434),
            (359, -510),
            (372, -578),
            (412, -747),
        ],
        &[(181, -669), (326, -727)],
    ],
);

pub(crate) const NEAR: Table = (
    -1066,
    [
        &[
            (10, 128),
            (28, 525),
            (44, 1142),
            (57, 1486),
            (87, 1562),
            (100, 1925),
            (153, 2438),
            (171, 2993),
            (194, 3295),
            (221, 3569),
            (240, 4390),
        ],
        &[
            (108, 66),
            (177, 571),
            (207, 763),
            (236, 1029),
            (264, 1178),
            (592, 1419),
        ],
        &[(493, 282), (578, 507), (597, 753)],
        &[(150, -75), (358, -773)],
        &[(404, -131), (414, -275), (445, -561), (460, -703)],
        &[(563, 154)],
    ],
);

pub(crate) fn score((base, features): Table, evidence: &Evidence) -> i64 {
    let part = |(steps, value): (&&[(i64, i64)], &i64)| {
        let reached = steps.iter().rev().find(|(above, _)| value > above);
        reached.map_or(0, |(_, score)| *score)
    };
    base + features.iter().zip(&evidence[2..]).map(part).sum::<i64>()
}
