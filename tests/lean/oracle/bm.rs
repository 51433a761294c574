//! Oracle of block matching and its optional checks: slow, sharing no code with the matcher.

use svl_core::stereo::{DisparityMap, Gray, Reason, StereoPair};

#[derive(Clone, Debug)]
pub(crate) struct Bm {
    pub(crate) min: i32,
    pub(crate) max: i32,
    pub(crate) log: bool,
    pub(crate) block_size: i32,
    pub(crate) texture_threshold: i32,
    pub(crate) uniqueness: i32,
    pub(crate) symmetry_tolerance: i32,
    pub(crate) speckle_size: usize,
    pub(crate) speckle_range: i32,
}

/// Disparity in 16ths of a pixel and SAD, or the reason why there is none.
type Pixel = Result<(i32, i32), Reason>;

impl Bm {
    pub(crate) fn compute(&self, pair: &StereoPair) -> DisparityMap {
        let (width, height) = pair.size();
        let [left, right] = [pair.left(), pair.right()]
            .map(|image| if self.log { log(image) } else { sobel(image) });
        let mut rows: Vec<Vec<Pixel>> = (0..height as i32)
            .map(|y| {
                (0..width as i32)
                    .map(|x| self.pixel(&left, &right, x, y))
                    .collect()
            })
            .collect();
        if self.symmetry_tolerance >= 0 {
            rows.iter_mut().for_each(|row| self.check(row));
        }
        if self.speckle_size > 0 {
            self.remove_speckles(&mut rows);
        }
        let mut map = DisparityMap::new(width, height).unwrap();
        for (mut out, row) in map.rows_mut().zip(rows) {
            for (x, pixel) in row.into_iter().enumerate() {
                match pixel {
                    Ok((d, _)) => out.accept(x, d as f32 / 16.0),
                    Err(reason) => out.reject(x, reason),
                }
            }
        }
        map
    }

    fn pixel(&self, left: &[Vec<i32>], right: &[Vec<i32>], x: i32, y: i32) -> Pixel {
        let (width, height, reach) = (left[0].len() as i32, left.len() as i32, self.block_size / 2);
        let inside =
            |x: i32| x - reach >= 0 && x + reach < width && y - reach >= 0 && y + reach < height;
        if !inside(x) || !inside(x - self.min) || !inside(x - self.max) {
            // Windows that leave at the right with min > 0 are not lost: the left window leaves
            // first there.
            return Err(Reason::Border);
        }
        let window = || (-reach..=reach).flat_map(|j| (-reach..=reach).map(move |i| (i, j)));
        let at = |image: &[Vec<i32>], x: i32, y: i32| image[y as usize][x as usize];
        if window()
            .map(|(i, j)| (at(left, x + i, y + j) - 31).abs())
            .sum::<i32>()
            < self.texture_threshold
        {
            return Err(Reason::Untextured);
        }
        let sad = |d: i32| -> i32 {
            window()
                .map(|(i, j)| (at(left, x + i, y + j) - at(right, x + i - d, y + j)).abs())
                .sum()
        };
        let best = (self.min..=self.max).min_by_key(|&d| (sad(d), -d)).unwrap();
        let least = sad(best);
        let limit = least + least * self.uniqueness / 100;
        if self.uniqueness > 0
            && (self.min..=self.max).any(|d| (d - best).abs() > 1 && sad(d) <= limit)
        {
            return Err(Reason::Ambiguous);
        }
        let fraction = if best == self.min || best == self.max {
            0
        } else {
            let (p, n) = (sad(best - 1), sad(best + 1));
            let curvature = p + n - 2 * least + (p - n).abs();
            if curvature == 0 {
                0
            } else {
                (p - n) * 256 / curvature
            }
        };
        Ok(((best * 256 + fraction + 15).div_euclid(16), least))
    }

    fn check(&self, row: &mut [Pixel]) {
        let width = row.len() as i32;
        let mut claims: Vec<Option<(i32, i32)>> = vec![None; row.len()];
        for x in 0..width {
            if let Ok((d, sad)) = row[x as usize] {
                let u = x - (d + 8).div_euclid(16);
                if (0..width).contains(&u)
                    && claims[u as usize].is_none_or(|(_, least)| sad < least)
                {
                    claims[u as usize] = Some((d, sad));
                }
            }
        }
        for x in 0..width {
            let Ok((d, _)) = row[x as usize] else {
                continue;
            };
            let denied = |u: i32| {
                (0..width).contains(&u)
                    && claims[u as usize]
                        .is_some_and(|(other, _)| (other - d).abs() > 16 * self.symmetry_tolerance)
            };
            if denied(x - d.div_euclid(16)) && denied(x - (d + 15).div_euclid(16)) {
                row[x as usize] = Err(Reason::Inconsistent);
            }
        }
    }

    fn remove_speckles(&self, rows: &mut [Vec<Pixel>]) {
        let (width, height) = (rows[0].len(), rows.len());
        let mut seen = vec![vec![false; width]; height];
        for start in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let mut island = vec![start];
            let mut next = 0;
            while next < island.len() {
                let (x, y) = island[next];
                next += 1;
                let Ok((d, _)) = rows[y][x] else { continue };
                let near = [
                    (x.wrapping_sub(1), y),
                    (x + 1, y),
                    (x, y.wrapping_sub(1)),
                    (x, y + 1),
                ];
                for (x, y) in near.into_iter().filter(|&(x, y)| x < width && y < height) {
                    let joins = rows[y][x]
                        .is_ok_and(|(other, _)| (other - d).abs() <= 16 * self.speckle_range);
                    if joins && !seen[y][x] && !island.contains(&(x, y)) {
                        island.push((x, y));
                    }
                }
            }
            if !seen[start.1][start.0] && rows[start.1][start.0].is_ok() {
                let small = island.len() <= self.speckle_size;
                for (x, y) in island {
                    seen[y][x] = true;
                    if small {
                        rows[y][x] = Err(Reason::Inconsistent);
                    }
                }
            }
        }
    }
}

fn filtered(
    image: &Gray,
    response: impl Fn(i32, i32) -> i32,
    blank: impl Fn(i32, i32) -> bool,
) -> Vec<Vec<i32>> {
    let at = |x: i32, y: i32| {
        if blank(x, y) {
            31
        } else {
            response(x, y).clamp(-31, 31) + 31
        }
    };
    (0..image.height() as i32)
        .map(|y| (0..image.width() as i32).map(|x| at(x, y)).collect())
        .collect()
}

fn sobel(image: &Gray) -> Vec<Vec<i32>> {
    let (width, height) = (image.width() as i32, image.height() as i32);
    let step = |x: i32, y: i32| {
        let y = if y < 0 {
            1
        } else if y == height {
            height - 2
        } else {
            y
        } as usize;
        i32::from(image.get(x as usize + 1, y)) - i32::from(image.get(x as usize - 1, y))
    };
    let blank = |x: i32, y: i32| x == 0 || x == width - 1 || (height % 2 == 1 && y == height - 1);
    filtered(
        image,
        |x, y| step(x, y - 1) + 2 * step(x, y) + step(x, y + 1),
        blank,
    )
}

fn log(image: &Gray) -> Vec<Vec<i32>> {
    const KERNEL: [[i32; 5]; 5] = [
        [0, 0, 1, 0, 0],
        [0, 1, 2, 1, 0],
        [1, 2, -16, 2, 1],
        [0, 1, 2, 1, 0],
        [0, 0, 1, 0, 0],
    ];
    let (width, height) = (image.width() as i32, image.height() as i32);
    let at = |x: i32, y: i32| i32::from(image.get(x as usize, y.clamp(0, height - 1) as usize));
    let sum = |x: i32, y: i32| -> i32 {
        (0..25)
            .map(|k| KERNEL[k as usize / 5][k as usize % 5] * at(x + k % 5 - 2, y + k / 5 - 2))
            .sum()
    };
    filtered(
        image,
        |x, y| -sum(x, y).div_euclid(2),
        |x, _| x < 2 || x >= width - 2,
    )
}
