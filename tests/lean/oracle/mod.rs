//! Oracles of the thesis's matchers: slow, unoptimized, sharing no code with them.

pub(crate) mod bm;
pub(crate) mod dp;
pub(crate) mod gaps;
pub(crate) mod scenes;
pub(crate) mod sgm;
pub(crate) mod symmetric;
pub(crate) mod v4;
pub(crate) mod v5;

use svl_core::stereo::{DisparityMap, ExtraPlanes, Gray, Reason, RowMut, StereoPair};

#[derive(Clone, Debug)]
pub(crate) struct V3 {
    pub(crate) min: i32,
    pub(crate) max: i32,
    pub(crate) smoothing_sigma: f64,
    pub(crate) texture_sigma: f64,
    pub(crate) texture_delta: f64,
    pub(crate) subpixel: bool,
    pub(crate) back_check: bool,
}

impl V3 {
    pub(crate) fn compute(&self, pair: &StereoPair) -> DisparityMap {
        by_pixel(pair, self.smoothing_sigma, |left, right, x, y| {
            self.pixel(left, right, x, y)
        })
    }

    fn pixel(&self, left: &Gray, right: &Gray, x: i32, y: usize) -> Pixel {
        let inside = |x: i32| x - 4 >= 0 && x + 4 < left.width() as i32;
        let at = |image: &Gray, x: i32| i64::from(image.get(x as usize, y));
        let ssd = |other: &Gray, u: i32| {
            (-4..=4)
                .map(|i| (at(left, x + i) - at(other, u + i)).pow(2))
                .sum::<i64>()
        };

        let admissible: Vec<i32> = (self.min..=self.max)
            .filter(|d| inside(x) && inside(x - d))
            .collect();
        if admissible.is_empty() {
            return Err((Reason::Border, DisparityMap::NO_SSDPI));
        }
        if !textured(left, x, y, self.texture_sigma, self.texture_delta) {
            return Err((Reason::Untextured, DisparityMap::NO_SSDPI));
        }
        let cost = |d: i32| ssd(right, x - d) * (25 + 4 * i64::from(d.abs()));
        let winner = admissible
            .iter()
            .copied()
            .min_by_key(|&d| (cost(d), d))
            .unwrap();
        let ssdpi = ssd(right, x - winner);
        let farthest = self.min.abs().max(self.max.abs());
        let reference = (1..=farthest)
            .flat_map(|o| [x - o, x + o])
            .filter(|&u| inside(u))
            .map(|u| ssd(left, u))
            .min();
        if reference.is_some_and(|reference| ssdpi >= reference) {
            return Err((Reason::SelfCheck, ssdpi as u32));
        }
        let refined = if self.subpixel {
            refine(winner, &admissible, |d| ssd(right, x - d))
        } else {
            winner as f32
        };
        Ok((back_checked(refined, self.back_check), ssdpi as u32))
    }
}

/// A disparity or the reason why there is none, and the SSDPI.
type Pixel = Result<(f32, u32), (Reason, u32)>;

/// The map of the results of `pixel` on the two smoothed images at every position.
fn by_pixel(
    pair: &StereoPair,
    sigma: f64,
    pixel: impl Fn(&Gray, &Gray, i32, usize) -> Pixel,
) -> DisparityMap {
    let (left, right) = (smooth(pair.left(), sigma), smooth(pair.right(), sigma));
    let (width, height) = pair.size();
    let mut map = DisparityMap::with_planes(width, height, ExtraPlanes::SSDPI).unwrap();
    for (y, mut row) in map.rows_mut().enumerate() {
        for x in 0..width {
            match pixel(&left, &right, x as i32, y) {
                Ok((disparity, ssdpi)) => write(&mut row, x, Ok(disparity), ssdpi),
                Err((reason, ssdpi)) => write(&mut row, x, Err(reason), ssdpi),
            }
        }
    }
    map
}

/// A negative disparity becomes zero if the matcher checks for points behind the cameras.
fn back_checked(disparity: f32, back_check: bool) -> f32 {
    if back_check {
        disparity.max(0.0)
    } else {
        disparity
    }
}

/// Writes a pixel with its SSDPI.
fn write(row: &mut RowMut<'_>, x: usize, disparity: Result<f32, Reason>, ssdpi: u32) {
    match disparity {
        Ok(disparity) => row.accept(x, disparity),
        Err(reason) => row.reject(x, reason),
    }
    row.set_ssdpi(x, ssdpi);
}

/// The minimum of the parabola through the SSDs of the winner and its neighbours.
fn refine(winner: i32, admissible: &[i32], ssd: impl Fn(i32) -> i64) -> f32 {
    let [p, m, n] =
        [winner - 1, winner, winner + 1].map(|d| admissible.contains(&d).then(|| ssd(d)));
    match (p, m, n) {
        (Some(p), Some(m), Some(n)) if m <= p && m <= n && (m, m) != (p, n) => {
            winner as f32 + (p - n) as f32 / (2 * (p + n - 2 * m)) as f32
        }
        _ => winner as f32,
    }
}

/// The texture filter of v3 and v4.
fn textured(left: &Gray, x: i32, y: usize, s: f64, delta: f64) -> bool {
    let gaussian =
        |s: f64, t: f64| (-t * t / (2.0 * s * s)).exp() / s / (2.0 * std::f64::consts::PI).sqrt();
    let response = |a: f64, b: f64| -> i64 {
        (-12..=11)
            .map(|t| {
                let g = gaussian(a, f64::from(t)) - gaussian(b, f64::from(t));
                let weight = (65536.0 * g + 0.5).floor() as i64;
                weight * i64::from(left.get((x + t).clamp(0, left.width() as i32 - 1) as usize, y))
            })
            .sum::<i64>()
            .abs()
    };
    response(s, s + delta) >= response(s + delta, s + 2.0 * delta)
}

fn smooth(image: &Gray, sigma: f64) -> Gray {
    if sigma == 0.0 {
        return image.clone();
    }
    let radius = (3.0 * sigma).ceil() as i32;
    let gaussian = |k: i32| (-f64::from(k * k) / (2.0 * sigma * sigma)).exp();
    let sum: f64 = (-radius..=radius).map(gaussian).sum();
    let mut weights: Vec<(i32, i64)> = (-radius..=radius)
        .map(|k| (k, (65536.0 * gaussian(k) / sum + 0.5).floor() as i64))
        .collect();
    let others: i64 = weights
        .iter()
        .filter(|(k, _)| *k != 0)
        .map(|(_, w)| w)
        .sum();
    weights[radius as usize].1 = 65536 - others;
    let last = image.height() as i32 - 1;
    Gray::from_fn(image.width(), image.height(), |x, y| {
        let row = |k: i32| (y as i32 + k).clamp(0, last) as usize;
        let sum: i64 = weights
            .iter()
            .map(|&(k, w)| w * i64::from(image.get(x, row(k))))
            .sum();
        ((sum + 32768) >> 16) as u8
    })
    .unwrap()
}
