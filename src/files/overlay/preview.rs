//! Previews of disparity maps in the colours of viridis.

use super::picture::Picture;
use svl_core::stereo::{DisparityMap, MAX_SIDE, Plane};

/// The map as interleaved RGB in the colours of viridis, from dark blue at 0 to yellow at `max_px`
/// and beyond; black if invalid.
///
/// The lightness of viridis increases evenly, so it can also be read in grey and by the
/// colour-blind.
pub fn preview(map: &DisparityMap, max_px: f32) -> Vec<u8> {
    let color = |d: f32| {
        if d.is_finite() {
            viridis(d / max_px)
        } else {
            [0; 3]
        }
    };
    map.disparity().pixels().flat_map(color).collect()
}

/// Number of colours of [`disparities`] besides that of no disparity: the page's bytes are spent
/// only on visible steps.
const STEPS: u8 = 63;

/// The code of no disparity, black.
pub const NO_DISPARITY: u8 = 0;

/// Disparities in pixels coloured like [`preview`], in 63 steps.
pub fn disparities(plane: &Plane<f32>, max_px: f32) -> Picture {
    let step = |d: f32| {
        if d.is_finite() {
            // To the nearest step: `round` is a call.
            NO_DISPARITY + 1 + ((d / max_px).clamp(0.0, 1.0) * f32::from(STEPS - 1) + 0.5) as u8
        } else {
            NO_DISPARITY
        }
    };
    let colors = (0..STEPS).map(|i| viridis(f32::from(i) / f32::from(STEPS - 1)));
    Picture {
        codes: plane.map(step),
        palette: std::iter::once([0; 3]).chain(colors).collect(),
    }
}

/// Bins of a pixel in the histogram of [`ColorEnd`].
const BINS_PER_PX: f32 = 4.0;
const MAX_BIN: f32 = BINS_PER_PX * MAX_SIDE as f32;

/// The disparity at the end of the colours: the 99th percentile of the finite ones of some maps, to
/// a quarter of a pixel, but at least a pixel.
#[derive(Clone, Debug, Default)]
pub struct ColorEnd {
    histogram: Vec<u64>,
}

impl ColorEnd {
    pub fn add(&mut self, map: &Plane<f32>) {
        for row in map.rows() {
            for px in row.iter().filter(|px| px.is_finite()) {
                let bin = (px * BINS_PER_PX).min(MAX_BIN) as usize;
                if bin >= self.histogram.len() {
                    self.histogram.resize(bin + 1, 0);
                }
                self.histogram[bin] += 1;
            }
        }
    }

    /// `None` without a finite disparity.
    pub fn end_px(&self) -> Option<f32> {
        let rank = (self.histogram.iter().sum::<u64>() * 99).div_ceil(100);
        let mut below = 0;
        let bin = self.histogram.iter().position(|count| {
            below += count;
            rank > 0 && below >= rank
        });
        bin.map(|bin| (bin as f32 / BINS_PER_PX).max(1.0))
    }
}

/// [`ColorEnd::end_px`] of these maps.
pub fn color_end(maps: &[&Plane<f32>]) -> Option<f32> {
    let mut end = ColorEnd::default();
    maps.iter().for_each(|map| end.add(map));
    end.end_px()
}

/// Viridis at `t` of 0..=1, linear between nine of its colours (S. van der Walt and N. Smith,
/// matplotlib 1.5; the nine as in the R package viridisLite).
pub fn viridis(t: f32) -> [u8; 3] {
    const COLOURS: [[u8; 3]; 9] = [
        [0x44, 0x01, 0x54],
        [0x47, 0x2d, 0x7b],
        [0x3b, 0x52, 0x8b],
        [0x2c, 0x72, 0x8e],
        [0x21, 0x90, 0x8c],
        [0x27, 0xad, 0x81],
        [0x5d, 0xc8, 0x63],
        [0xaa, 0xdc, 0x32],
        [0xfd, 0xe7, 0x25],
    ];
    let steps = COLOURS.len() - 1;
    let at = t.clamp(0.0, 1.0) * steps as f32;
    // There is no colour above the yellow end: the last interval is used.
    let below = (at as usize).min(steps - 1);
    let between = |i: usize| {
        let a = f32::from(COLOURS[below][i]);
        let b = f32::from(COLOURS[below + 1][i]);
        (a + (at - below as f32) * (b - a)).round() as u8
    };
    [between(0), between(1), between(2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_grows_in_lightness_from_end_to_end() {
        let ramp: Vec<_> = (0..=64).map(|i| viridis(i as f32 / 64.0)).collect();
        assert_eq!((ramp[0], ramp[64]), ([68, 1, 84], [253, 231, 37]));
        let light =
            |c: &[u8; 3]| 299 * u32::from(c[0]) + 587 * u32::from(c[1]) + 114 * u32::from(c[2]);
        assert!(ramp.is_sorted_by(|a, b| light(a) < light(b)));
    }

    #[test]
    fn steps_are_the_ramp() {
        let plane = Plane::from_vec(5, 1, vec![f32::INFINITY, -1.0, 0.0, 32.0, 99.0]).unwrap();
        let Picture { codes, palette } = disparities(&plane, 64.0);
        assert_eq!(codes.row(0), [0, 1, 1, 32, 63]);
        assert_eq!(
            [0, 1, 32, 63].map(|code: usize| palette[code]),
            [[0; 3], viridis(0.0), viridis(0.5), viridis(1.0)]
        );
    }

    #[test]
    fn nothing_is_black() {
        let mut map = DisparityMap::new(2, 1).unwrap();
        map.rows_mut().next().unwrap().accept(1, 99.0);
        assert_eq!(preview(&map, 64.0), [[0; 3], viridis(1.0)].concat());
    }

    #[test]
    fn colours_end_at_the_99th_percentile() {
        let ramp = Plane::from_fn(100, 2, |x, _| x as f32).unwrap();
        let none = Plane::filled(9, 9, f32::INFINITY).unwrap();
        assert_eq!(color_end(&[&ramp, &none]), Some(98.0));
        assert_eq!((color_end(&[&none]), color_end(&[])), (None, None));
    }
}
