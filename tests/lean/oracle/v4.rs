//! Oracle of v4.

use super::{back_checked, refine, smooth, textured, write};
use svl_core::stereo::{DisparityMap, ExtraPlanes, Plane, Reason, StereoPair};

#[derive(Clone, Debug)]
pub(crate) struct V4 {
    pub(crate) min: i32,
    pub(crate) max: i32,
    pub(crate) smoothing_sigma: f64,
    pub(crate) hash_tolerance: i64,
    pub(crate) row_tolerance: i32,
    pub(crate) subpixel: bool,
    pub(crate) back_check: bool,
}

impl V4 {
    /// The algorithm as on the command line.
    pub(crate) fn text(&self) -> String {
        let Self {
            min,
            max,
            smoothing_sigma,
            hash_tolerance,
            row_tolerance,
            subpixel,
            back_check,
        } = self;
        format!(
            "v4:min_disparity={min},max_disparity={max},smoothing_sigma={smoothing_sigma},\
             hash_tolerance={hash_tolerance},row_tolerance={row_tolerance},subpixel={subpixel},\
             back_check={back_check}"
        )
    }

    pub(crate) fn compute(&self, pair: &StereoPair) -> DisparityMap {
        let (left, right) = (
            smooth(pair.left(), self.smoothing_sigma),
            smooth(pair.right(), self.smoothing_sigma),
        );
        let (width, height) = (pair.size().0 as i32, pair.size().1 as i32);
        let inside = |x: i32| x - 4 >= 0 && x + 4 < width;
        let window = |image: &Plane<u8>, x: i32, y: i32| -> Vec<i64> {
            (-4..=4)
                .map(|i| i64::from(image.get((x + i) as usize, y as usize)))
                .collect()
        };
        let distance =
            |a: Vec<i64>, b: Vec<i64>| a.iter().zip(b).map(|(a, b)| (a - b).pow(2)).sum::<i64>();
        let ssd = |x, y, u, v| distance(window(&left, x, y), window(&right, u, v));
        let weight = |d: i32| 25 + 4 * i64::from(d.abs());
        let has_texture = |x: i32, y: i32| textured(&left, x, y as usize, 0.4, 3.35);

        // By left pixel: cost of the cheapest claim so far, its disparity and the row it comes
        // from.
        let mut claims = vec![None::<(i64, i32, i32)>; (width * height) as usize];
        for (v, u) in (0..height)
            .flat_map(|v| (0..width).map(move |u| (v, u)))
            .filter(|&(_, u)| inside(u))
        {
            let sum: i64 = window(&right, u, v).iter().sum();
            let mut best = None;
            for y in (v - self.row_tolerance).max(0)..=(v + self.row_tolerance).min(height - 1) {
                for x in (u + self.min).max(0)..=(u + self.max).min(width - 1) {
                    let near = inside(x)
                        && (window(&left, x, y).iter().sum::<i64>() - sum).abs()
                            <= self.hash_tolerance
                        && has_texture(x, y);
                    if near {
                        let candidate = (ssd(x, y, u, v) * weight(x - u), (y - v).abs(), y, x - u);
                        best = Some(best.map_or(candidate, |best| candidate.min(best)));
                    }
                }
            }
            if let Some((cost, _, y, d)) = best {
                let claim = &mut claims[(y * width + u + d) as usize];
                if claim.is_none_or(|(cheapest, ..)| cost < cheapest) {
                    *claim = Some((cost, d, v));
                }
            }
        }

        let mut offsets = Plane::filled(width as usize, height as usize, 0i8).unwrap();
        let mut map =
            DisparityMap::with_planes(width as usize, height as usize, ExtraPlanes::ALL).unwrap();
        for (y, mut row) in (0..height).zip(map.rows_mut()) {
            for x in 0..width {
                let admissible: Vec<i32> = (self.min..=self.max)
                    .filter(|d| inside(x) && inside(x - d))
                    .collect();
                let claim = claims[(y * width + x) as usize];
                let mut reject = |reason, ssdpi| write(&mut row, x as usize, Err(reason), ssdpi);
                if admissible.is_empty() {
                    reject(Reason::Border, DisparityMap::NO_SSDPI);
                } else if !has_texture(x, y) {
                    reject(Reason::Untextured, DisparityMap::NO_SSDPI);
                } else if let Some((_, d, v)) = claim {
                    offsets.set(x as usize, y as usize, (v - y) as i8);
                    let ssdpi = ssd(x, y, x - d, v);
                    let others =
                        (1..=self.min.abs().max(self.max.abs())).flat_map(|o| [x - o, x + o]);
                    let own = |u: i32| distance(window(&left, x, y), window(&left, u, y));
                    if others.filter(|&u| inside(u)).any(|u| ssdpi >= own(u)) {
                        reject(Reason::SelfCheck, ssdpi as u32);
                        continue;
                    }
                    let refined = if self.subpixel {
                        refine(d, &admissible, |d| ssd(x, y, x - d, v))
                    } else {
                        d as f32
                    };
                    let checked = back_checked(refined, self.back_check);
                    write(&mut row, x as usize, Ok(checked), ssdpi as u32);
                } else {
                    reject(Reason::Unmatched, DisparityMap::NO_SSDPI);
                }
            }
        }
        *map.row_offset_mut().unwrap() = offsets;
        map
    }
}
