//! Oracle of dp: slow, unoptimized, sharing no code with the matcher.

use svl_core::stereo::{DisparityMap, Gray, StereoPair};

#[derive(Clone, Debug)]
pub(crate) struct Dp {
    pub(crate) max: i32,
    pub(crate) occlusion: i64,
    pub(crate) reward: i64,
    pub(crate) slightly: usize,
    pub(crate) moderately: usize,
    pub(crate) highly: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Left,
    Up,
    Diag,
}

const INFINITE: i64 = 1 << 40;

/// Disparities by row and column.
type Map = Vec<Vec<i32>>;

impl Dp {
    pub(crate) fn compute(&self, pair: &StereoPair) -> DisparityMap {
        let (left, right) = (pair.left(), pair.right());
        let (width, height) = pair.size();
        let mut found: Map = (0..height)
            .map(|y| self.match_row(left.row(y), right.row(y)))
            .collect();

        for (y, x) in (1..height.max(1) - 1).flat_map(|y| (0..width).map(move |x| (y, x))) {
            if found[y - 1][x] == found[y + 1][x] {
                found[y][x] = found[y - 1][x];
            }
        }
        let steep = steep(left);
        for x in 0..width {
            let mut column: Vec<_> = (0..height).map(|y| found[y][x]).collect();
            let closed: Vec<_> = (0..height).map(|y| steep[y][x]).collect();
            self.spread(&mut column, &closed);
            column
                .into_iter()
                .enumerate()
                .for_each(|(y, d)| found[y][x] = d);
        }
        for (y, row) in found.iter_mut().enumerate() {
            let closed: Vec<_> = (0..width)
                .map(|x| bits(left.row(y), right.row(y), x).0)
                .collect();
            self.spread(row, &closed);
        }

        let mut map = DisparityMap::new(width, height).unwrap();
        for (mut row, found) in map.rows_mut().zip(found) {
            found
                .iter()
                .enumerate()
                .for_each(|(x, &d)| row.accept(x, d as f32));
        }
        map
    }

    fn match_row(&self, left: &[u8], right: &[u8]) -> Vec<i32> {
        let width = left.len() as i32;
        // By column, then disparity.
        let mut cells: Vec<Vec<(i64, Step)>> =
            vec![vec![(INFINITE, Step::Up); self.max as usize + 1]; left.len()];
        let cell = |cells: &[Vec<(i64, Step)>], x: i32, d: i32| match d {
            d if d < 0 || d > self.max => (INFINITE, Step::Left),
            d => cells[x as usize][d as usize],
        };
        cells[0][0] = (0, Step::Left);
        for x in 1..width {
            for d in (0..=x.min(self.max)).rev() {
                let mut candidates = vec![(cell(&cells, x - 1, d).0 - self.reward, Step::Left)];
                let (cost, step) = cell(&cells, x, d + 1);
                if bits(left, right, x as usize).0 && step != Step::Diag {
                    candidates.push((cost + self.occlusion, Step::Up));
                }
                let (cost, step) = cell(&cells, x - 1, d - 1);
                if bits(left, right, (x - d) as usize).1 && step != Step::Up {
                    candidates.push((cost + self.occlusion, Step::Diag));
                }
                // The first of equals.
                let (cost, step) = candidates
                    .into_iter()
                    .min_by_key(|(cost, _)| *cost)
                    .unwrap();
                cells[x as usize][d as usize] = (
                    cost + dissimilarity(left, right, x as usize, d as usize),
                    step,
                );
            }
        }

        let mut found = vec![0; left.len()];
        let mut x = width - 1;
        let mut d = (0..=x.min(self.max))
            .min_by_key(|&d| cell(&cells, x, d).0)
            .unwrap();
        while x > 0 {
            found[x as usize] = d;
            while cell(&cells, x, d).1 == Step::Up {
                d += 1;
            }
            let last = x;
            while cell(&cells, x, d).1 == Step::Diag {
                (x, d) = (x - 1, d - 1);
            }
            (x..last).for_each(|x| found[x as usize] = d);
            x -= 1;
        }
        found
    }

    /// Spreads reliable disparities along a column or row.
    fn spread(&self, line: &mut [i32], closed: &[bool]) {
        let reliability: Vec<usize> = (0..line.len())
            .map(|i| {
                let same = |&j: &usize| line[j] == line[i];
                (i..line.len()).take_while(same).count() + (0..i).rev().take_while(same).count()
            })
            .collect();
        let mut i = 0;
        while i < line.len() {
            let d = line[i];
            if reliability[i] < self.moderately || closed[i] || d == 0 {
                i += 1;
                continue;
            }
            let spreader = reliability[i];
            let stops = |line: &[i32], j: usize| {
                closed[j]
                    || line[j] < d && reliability[j] >= self.slightly
                    || line[j] == d + 1 && spreader < self.highly
            };
            for j in (0..i).rev() {
                if stops(line, j) {
                    break;
                }
                line[j] = d;
            }
            i += 1;
            while i < line.len() && !stops(line, i) {
                line[i] = d;
                i += 1;
            }
        }
    }
}

fn dissimilarity(left: &[u8], right: &[u8], x: usize, d: usize) -> i64 {
    let (last, u) = (right.len() - 1, x - d);
    if x == last {
        return 0;
    }
    let u = if u == last && last > 0 { last - 1 } else { u };
    let mean = |a: usize, b: usize| (i64::from(right[a]) + i64::from(right[b])) >> 1;
    let values = [
        i64::from(right[u]),
        mean(u, (u + 1).min(last)),
        mean(u.saturating_sub(1), u),
    ];
    let left = i64::from(left[x]);
    let (low, high) = (values.iter().min().unwrap(), values.iter().max().unwrap());
    0.max(left - high).max(low - left)
}

/// bit1 and bit2 of column `x`.
fn bits(left: &[u8], right: &[u8], x: usize) -> (bool, bool) {
    let width = left.len();
    let ranges = |values: &[u8]| values.iter().max().unwrap() - values.iter().min().unwrap() >= 5;
    if x + 3 >= width {
        (true, false)
    } else if x < 3 {
        (false, true)
    } else if x + 4 == width {
        (false, false)
    } else {
        (ranges(&left[x - 3..x]), ranges(&right[x + 1..x + 4]))
    }
}

/// bit4 by row and column.
fn steep(left: &Gray) -> Vec<Vec<bool>> {
    let (width, height) = left.size();
    let mut steep = vec![vec![false; width]; height];
    let mut mark = |x: usize| {
        let mut y = 1;
        while y + 1 < height {
            let around = [y - 1, y, y + 1].map(|y| left.get(x, y));
            if around.iter().max().unwrap() - around.iter().min().unwrap() >= 5 {
                (y - 1..=y + 1).for_each(|y| steep[y][x] = true);
                y += 1;
            }
            y += 1;
        }
    };
    (0..width).for_each(&mut mark);
    let lone = |row: &[bool], x: usize| x > 0 && x + 1 < width && !(row[x - 1] && row[x + 1]);
    steep
        .iter()
        .map(|row| (0..width).map(|x| row[x] && !lone(row, x)).collect())
        .collect()
}
