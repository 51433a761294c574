//! Stixels on the left image.

use super::preview::viridis;
use svl_core::depth::Stixels;
use svl_core::stereo::Gray;

/// The image as interleaved RGB with its stixels: objects in the colours of viridis, from dark blue
/// at 0 px to yellow at the nearest of them, with a black line above each; the ground in grey.
pub fn stixels(left: &Gray, stixels: &Stixels) -> Vec<u8> {
    let width = left.width();
    let objects = stixels.stixels.iter().filter(|stixel| !stixel.is_ground);
    let max_px = objects.fold(1.0, |most, stixel| stixel.disparity_px.max(most));
    let mut rgb: Vec<u8> = left.pixels().flat_map(|v| [v / 2; 3]).collect();
    for stixel in &stixels.stixels {
        let [r, g, b] = if stixel.is_ground {
            [200; 3]
        } else {
            viridis(stixel.disparity_px / max_px)
        };
        for y in stixel.rows.clone() {
            let is_top = y == stixel.rows.start && !stixel.is_ground;
            let row =
                &mut rgb[3 * (y * width + stixel.columns.start)..][..3 * stixel.columns.len()];
            for pixel in row.as_chunks_mut::<3>().0 {
                *pixel = match is_top {
                    true => [0; 3],
                    // Half of it is the image.
                    false => [(pixel[0], r), (pixel[1], g), (pixel[2], b)].map(|(v, c)| v + c / 2),
                };
            }
        }
    }
    rgb
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::depth::Stixel;

    #[test]
    fn objects_are_coloured_below_a_line_and_the_ground_is_grey() {
        let left = Gray::filled(4, 4, 100).unwrap();
        let stixel = |rows, is_ground| Stixel {
            columns: 1..3,
            rows,
            is_ground,
            disparity_px: 20.0,
            slope: 0.0,
            support: 1.0,
        };
        let found = Stixels {
            stixels: vec![stixel(3..4, true), stixel(1..3, false)],
            ground: None,
        };
        let rgb = stixels(&left, &found);
        let at = |x: usize, y: usize| &rgb[3 * (4 * y + x)..][..3];
        assert_eq!([at(0, 0), at(0, 2), at(3, 3)], [[50; 3]; 3]);
        assert_eq!((at(1, 1), at(2, 3)), (&[0; 3][..], &[150; 3][..]));
        let yellow = viridis(1.0).map(|c| 50 + c / 2);
        assert_eq!(at(2, 2), yellow);
    }
}
