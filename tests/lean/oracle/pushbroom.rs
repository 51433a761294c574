//! Oracle of pushbroom stereo for one pair: slow, sharing no code with the matcher.

use svl_core::stereo::{DisparityMap, Gray, Reason, StereoPair};

#[derive(Clone, Debug)]
pub(crate) struct Pushbroom {
    pub(crate) disparity: i32,
    pub(crate) block_size: i32,
    pub(crate) interest: i32,
    pub(crate) threshold: i32,
    pub(crate) invariance: i32,
}

impl Pushbroom {
    pub(crate) fn compute(&self, pair: &StereoPair) -> DisparityMap {
        let (width, height) = pair.size();
        let mut map = DisparityMap::new(width, height).unwrap();
        let side = self.block_size as usize;
        let corners = |size: usize| (0..size as i32).step_by(side);
        let blocks: Vec<Vec<Reason>> = corners(height)
            .map(|y| corners(width).map(|x| self.block(pair, x, y)).collect())
            .collect();
        for (y, mut row) in map.rows_mut().enumerate() {
            for x in 0..width {
                match blocks[y / side][x / side] {
                    Reason::Valid => row.accept(x, self.disparity as f32),
                    reason => row.reject(x, reason),
                }
            }
        }
        map
    }

    fn block(&self, pair: &StereoPair, x: i32, y: i32) -> Reason {
        let (left, right) = (pair.left(), pair.right());
        let side = self.block_size;
        let inside = |x: i32, y: i32| {
            let (width, height) = (left.width() as i32, left.height() as i32);
            x >= 0 && y >= 0 && x + side <= width && y + side <= height
        };
        let u = x - self.disparity;
        if !inside(x, y) || !inside(u, y) {
            return Reason::Border;
        }
        let sum = |image: &Gray, x: i32, y: i32| -> i32 {
            let pixels = (0..side).flat_map(|j| (0..side).map(move |i| (i, j)));
            pixels.map(|(i, j)| laplacian(image, x + i, y + j)).sum()
        };
        // Per cent of the sum of Laplacians; nothing matches without texture.
        let matches_at = |u: i32, v: i32, percent: i32| {
            let pixels = (0..side).flat_map(|j| (0..side).map(move |i| (i, j)));
            let differences =
                pixels.map(|(i, j)| (at(left, x + i, y + j) - at(right, u + i, v + j)).abs());
            100 * differences.sum::<i32>() < percent * (sum(left, x, y) + sum(right, u, v))
        };
        let least = self.interest * side * side;
        if sum(left, x, y) < least || sum(right, u, y) < least {
            return Reason::Untextured;
        }
        if !matches_at(u, y, self.threshold) {
            return Reason::Unmatched;
        }
        let near_infinity = [-8, -6, -4, -2, 0, 2, 4, 6, 8]
            .into_iter()
            .flat_map(|dy| (-3..=3).map(move |dx| (dx, dy)));
        let repeats = near_infinity
            .filter(|(dx, dy)| inside(x + dx, y + dy))
            .any(|(dx, dy)| matches_at(x + dx, y + dy, self.invariance));
        if repeats {
            Reason::Ambiguous
        } else {
            Reason::Valid
        }
    }
}

fn at(image: &Gray, x: i32, y: i32) -> i32 {
    image.get(x as usize, y as usize).into()
}

fn laplacian(image: &Gray, x: i32, y: i32) -> i32 {
    let (right, bottom) = (image.width() as i32 - 1, image.height() as i32 - 1);
    if x == 0 || y == 0 || x == right || y == bottom {
        return 0;
    }
    let neighbours = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
    let sum: i32 = neighbours.map(|(x, y)| at(image, x, y)).iter().sum();
    (4 * at(image, x, y) - sum).abs().min(255)
}
