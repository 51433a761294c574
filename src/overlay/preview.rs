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

/// Viridis at `t` of 0..=1 (S. van der Walt and N. Smith, matplotlib 1.5), as Matt Zucker's polynomial of degree 6,
/// within 2 of 255 of the table.
fn viridis(t: f32) -> Rgb<u8> {
    const COEFFICIENTS: [[f32; 7]; 3] = [
        [0.277_727_33, 0.105_093_04, -0.330_861_83, -4.634_230_5, 6.228_27, 4.776_385, -5.435_456],
        [0.005_407_344_5, 1.404_613_5, 0.214_847_56, -5.799_101, 14.179_933, -13.745_145, 4.645_852_6],
        [0.334_099_8, 1.384_590_2, 0.095_095_165, -19.332_44, 56.690_55, -65.353_035, 26.312_435],
    ];
    let t = t.clamp(0.0, 1.0);
    Rgb(COEFFICIENTS.map(|c| (255.0 * c.iter().rev().fold(0.0, |sum, c| sum * t + c)).round() as u8))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// matplotlib's table at 0, 64, 128, 191 and 255.
    #[test]
    fn the_ramp_is_viridis() {
        let table =
            [(0, [68, 1, 84]), (64, [59, 82, 139]), (128, [33, 145, 140]), (191, [94, 201, 98]), (255, [253, 231, 37])];
        for (index, expected) in table {
            let got = viridis(index as f32 / 255.0).0;
            let near = got.iter().zip(expected).all(|(&a, b)| a.abs_diff(b) <= 3);
            assert!(near, "{index}: {got:?}, expected {expected:?}");
        }
    }

    #[test]
    fn nothing_is_black() {
        let mut map = DisparityMap::new(2, 1).unwrap();
        map.rows_mut().next().unwrap().accept(1, 99.0, 0);
        let picture = preview(&map, 64.0);
        assert_eq!((*picture.get_pixel(0, 0), *picture.get_pixel(1, 0)), (Rgb([0; 3]), viridis(1.0)));
    }
}
