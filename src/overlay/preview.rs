//! Disparities as colours.

use crate::stereo::DisparityMap;
use image::{Rgb, RgbImage};

/// The map in the colours of viridis, from dark blue at 0 to yellow at `max_px` and beyond; black where there is none.
///
/// Viridis grows evenly in lightness, so it also reads in grey and to colour-blind eyes.
pub fn preview(map: &DisparityMap, max_px: f32) -> RgbImage {
    let (width, height) = map.size();
    // A plane's sides are at most `MAX_SIDE`, which fits.
    RgbImage::from_fn(width as u32, height as u32, |x, y| match map.at(x as usize, y as usize) {
        Ok(disparity) => viridis(disparity / max_px),
        Err(_) => Rgb([0; 3]),
    })
}

/// Viridis at `t` of 0..=1, straight between nine of its colours (S. van der Walt and N. Smith, matplotlib 1.5; the nine
/// as the R package viridisLite gives them).
fn viridis(t: f32) -> Rgb<u8> {
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
    let below = (at as usize).min(steps - 1);
    let between = |i: usize| {
        let (a, b) = (f32::from(COLOURS[below][i]), f32::from(COLOURS[below + 1][i]));
        (a + (at - below as f32) * (b - a)).round() as u8
    };
    Rgb([between(0), between(1), between(2)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_grows_in_lightness_from_end_to_end() {
        let ramp: Vec<_> = (0..=64).map(|i| viridis(i as f32 / 64.0).0).collect();
        assert_eq!((ramp[0], ramp[64]), ([68, 1, 84], [253, 231, 37]));
        let light = |c: &[u8; 3]| 299 * u32::from(c[0]) + 587 * u32::from(c[1]) + 114 * u32::from(c[2]);
        assert!(ramp.is_sorted_by(|a, b| light(a) < light(b)));
    }

    #[test]
    fn nothing_is_black() {
        let mut map = DisparityMap::new(2, 1).unwrap();
        map.rows_mut().next().unwrap().accept(1, 99.0, 0);
        let picture = preview(&map, 64.0);
        assert_eq!((*picture.get_pixel(0, 0), *picture.get_pixel(1, 0)), (Rgb([0; 3]), viridis(1.0)));
    }
}
