//! Oracle of semi-global matching, from its equations: slow, in integers with an infinity, sharing
//! no code with the matcher.

use svl_core::stereo::{DisparityMap, Gray, Reason, StereoPair};

#[derive(Clone, Debug)]
pub(crate) struct Sgm {
    pub(crate) min: i32,
    pub(crate) max: i32,
    pub(crate) p1: i32,
    pub(crate) p2: i32,
    pub(crate) edge: i32,
    pub(crate) uniqueness: i32,
    pub(crate) symmetry_tolerance: i32,
    pub(crate) median: bool,
}

/// Cost of a disparity that leads outside the right image.
const INFINITE: i32 = 1 << 20;

/// Costs by pixel and disparity.
type Volume = Vec<Vec<Vec<i32>>>;

impl Sgm {
    pub(crate) fn compute(&self, pair: &StereoPair) -> DisparityMap {
        let (width, height) = pair.size();
        let costs = self.costs(pair);
        let mut sums: Volume = vec![vec![vec![0; costs[0][0].len()]; width]; height];
        for direction in [
            (1, 0),
            (-1, 0),
            (0, 1),
            (0, -1),
            (1, 1),
            (-1, -1),
            (1, -1),
            (-1, 1),
        ] {
            self.add_paths(pair.left(), &costs, direction, &mut sums);
        }
        let admissible = |x: usize| {
            (self.min..=self.max).filter(move |d| (0..width as i32).contains(&(x as i32 - d)))
        };
        let sum = |x: usize, y: usize, d: i32| sums[y][x][(d - self.min) as usize];
        let best = |x: usize, y: usize| admissible(x).min_by_key(|&d| (sum(x, y, d), d));
        let raw = |x: usize, y: usize| {
            best(x, y).map_or(0, |d| {
                16 * d + self.fraction(&|d| sum(x, y, d), d, admissible(x))
            })
        };
        let raw: Vec<Vec<i32>> = (0..height)
            .map(|y| (0..width).map(|x| raw(x, y)).collect())
            .collect();
        // The left pixel x + d meets the right pixel x.
        let right = |x: i32, y: usize| {
            let meets = (self.min..=self.max).filter(|d| (0..width as i32).contains(&(x + d)));
            meets.min_by_key(|&d| (sum((x + d) as usize, y, d), d))
        };

        let mut map = DisparityMap::new(width, height).unwrap();
        for (y, mut row) in map.rows_mut().enumerate() {
            for x in 0..width {
                let disparity = if self.median {
                    median(&raw, x, y)
                } else {
                    raw[y][x]
                };
                let match_x = x as i32 - (disparity + 8).div_euclid(16);
                let consistent = self.symmetry_tolerance < 0
                    || (0..width as i32).contains(&match_x)
                        && right(match_x, y).is_some_and(|d| {
                            (16 * d - disparity).abs() <= 16 * self.symmetry_tolerance
                        });
                let rival = |best: i32| {
                    admissible(x)
                        .filter(|d| (d - best).abs() > 1)
                        .map(|d| sum(x, y, d))
                        .min()
                };
                let unique = |best: i32| {
                    rival(best).is_none_or(|rival| {
                        100 * rival >= sum(x, y, best) * (100 + self.uniqueness)
                    })
                };
                match best(x, y) {
                    None => row.reject(x, Reason::Border),
                    Some(best) if !unique(best) => row.reject(x, Reason::Ambiguous),
                    Some(_) if !consistent => row.reject(x, Reason::Inconsistent),
                    Some(_) => row.accept(x, disparity as f32 / 16.0),
                }
            }
        }
        map
    }

    fn costs(&self, pair: &StereoPair) -> Volume {
        let (width, height) = pair.size();
        let [left, right] = [pair.left(), pair.right()].map(census);
        let cost = |x: usize, y: usize, d: i32| match x as i32 - d {
            u if (0..width as i32).contains(&u) => left[y][x]
                .iter()
                .zip(&right[y][u as usize])
                .filter(|(a, b)| a != b)
                .count() as i32,
            _ => INFINITE,
        };
        let pixel = |x: usize, y: usize| (self.min..=self.max).map(|d| cost(x, y, d)).collect();
        (0..height)
            .map(|y| (0..width).map(|x| pixel(x, y)).collect())
            .collect()
    }

    /// L(p, d) = C(p, d) + min(L(p', d), L(p', d ± 1) + P1, min L(p') + P2) − min L(p'), where p'
    /// is the pixel before p. A path begins where there is none, or none that has a disparity.
    fn add_paths(&self, image: &Gray, costs: &Volume, (dx, dy): (i32, i32), sums: &mut Volume) {
        let (width, height) = (image.width() as i32, image.height() as i32);
        let mut paths = costs.clone();
        for j in 0..height {
            for i in 0..width {
                let (x, y) = (
                    if dx < 0 { width - 1 - i } else { i },
                    if dy < 0 { height - 1 - j } else { j },
                );
                let (before_x, before_y) = (x - dx, y - dy);
                let (x, y) = (x as usize, y as usize);
                if (0..width).contains(&before_x) && (0..height).contains(&before_y) {
                    let (before_x, before_y) = (before_x as usize, before_y as usize);
                    let before = paths[before_y][before_x].clone();
                    let least = *before.iter().min().unwrap();
                    let difference =
                        i32::from(image.get(x, y).abs_diff(image.get(before_x, before_y)));
                    let large = self.p1.max(self.p2 * self.edge / self.edge.max(difference));
                    for (d, path) in paths[y][x]
                        .iter_mut()
                        .enumerate()
                        .filter(|_| least < INFINITE)
                    {
                        let near = |d: usize| before.get(d).map_or(INFINITE, |cost| cost + self.p1);
                        let step = near(d + 1).min(if d > 0 { near(d - 1) } else { INFINITE });
                        *path =
                            (*path + before[d].min(step).min(least + large) - least).min(INFINITE);
                    }
                }
                sums[y][x]
                    .iter_mut()
                    .zip(&paths[y][x])
                    .for_each(|(sum, path)| *sum += path);
            }
        }
    }

    /// In 16ths, half away from zero; none beside a disparity that is not admissible.
    fn fraction(
        &self,
        sum: &dyn Fn(i32) -> i32,
        best: i32,
        admissible: impl Iterator<Item = i32>,
    ) -> i32 {
        let admissible: Vec<i32> = admissible.collect();
        if !admissible.contains(&(best - 1)) || !admissible.contains(&(best + 1)) {
            return 0;
        }
        let (lower, higher) = (sum(best - 1), sum(best + 1));
        let rise = 2 * (lower.max(higher) - sum(best));
        if rise == 0 {
            0
        } else {
            (16.0 * f64::from(lower - higher) / f64::from(rise)).round() as i32
        }
    }
}

fn census(image: &Gray) -> Vec<Vec<Vec<bool>>> {
    let (width, height) = (image.width() as i32, image.height() as i32);
    let at = |x: i32, y: i32| {
        image.get(
            x.clamp(0, width - 1) as usize,
            y.clamp(0, height - 1) as usize,
        )
    };
    let pixel = |x: i32, y: i32| {
        (-3..=3)
            .flat_map(|j| (-4..=4).map(move |i| (i, j)))
            .map(|(i, j)| at(x + i, y + j) < at(x, y))
            .collect()
    };
    (0..height)
        .map(|y| (0..width).map(|x| pixel(x, y)).collect())
        .collect()
}

fn median(raw: &[Vec<i32>], x: usize, y: usize) -> i32 {
    let near = |i: usize, k: usize, len: usize| (i + k).saturating_sub(1).min(len - 1);
    let mut around: Vec<i32> = (0..9)
        .map(|k| raw[near(y, k / 3, raw.len())][near(x, k % 3, raw[0].len())])
        .collect();
    around.sort_unstable();
    around[4]
}
