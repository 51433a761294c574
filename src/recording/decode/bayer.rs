//! Bilinear demosaicing of Bayer images.

use svl_core::stereo::{Gray, Rgb};

/// Colours of the pixels (0,0), (1,0), (0,1), (1,1): 0 red, 1 green, 2 blue.
pub(crate) type Tile = [usize; 4];

/// Demosaics bilinearly: a missing colour of a pixel is the rounded mean of its neighbours with
/// that colour, among the eight in the image. If no neighbour has it, in an image of one row or
/// column, it is the pixel's own value.
pub(crate) fn color(samples: &Gray, tile: Tile) -> Rgb {
    let (width, height) = samples.size();
    let colour = |x: usize, y: usize| tile[(y & 1) << 1 | (x & 1)];
    let mut rgb = Vec::with_capacity(width * height);
    for y in 0..height {
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        for x in 0..width {
            let own = u32::from(samples.get(x, y));
            let (mut sums, mut counts) = ([0; 3], [0; 3]);
            for v in rows.clone() {
                for u in x.saturating_sub(1)..(x + 2).min(width) {
                    sums[colour(u, v)] += u32::from(samples.get(u, v));
                    counts[colour(u, v)] += 1;
                }
            }
            // The pixel's own colour is measured, not averaged with its neighbours.
            (sums[colour(x, y)], counts[colour(x, y)]) = (own, 1);
            let mean = |c: usize| {
                (sums[c] + counts[c] / 2)
                    .checked_div(counts[c])
                    .unwrap_or(own)
            };
            rgb.push([0, 1, 2].map(|c| mean(c) as u8));
        }
    }
    Rgb::from_vec(width, height, rgb).expect("of the size of the samples")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coloured_plane_has_its_colour_everywhere() {
        let rgb = [200u8, 90, 30];
        for tile in [[0, 1, 1, 2], [2, 1, 1, 0], [1, 2, 0, 1], [1, 0, 2, 1]] {
            let mosaic = Gray::from_fn(7, 6, |x, y| rgb[tile[(y & 1) * 2 + (x & 1)]]).unwrap();
            let found = color(&mosaic, tile);
            assert!(found.pixels().all(|found| found == rgb), "{tile:?}");
        }
    }

    #[test]
    fn missing_colours_are_means_of_neighbours() {
        // One red pixel in the middle of black: half in the adjacent pixels, a quarter at the
        // corners.
        let tile = [0, 1, 1, 2];
        let mosaic = Gray::from_fn(5, 5, |x, y| if (x, y) == (2, 2) { 200 } else { 0 }).unwrap();
        let found = color(&mosaic, tile);
        let red = |value: u8| [value, 0, 0];
        assert_eq!(
            [(2, 2), (1, 2), (2, 3), (1, 1)].map(|(x, y)| found.get(x, y)),
            [200, 100, 100, 50].map(red)
        );
        assert_eq!(found.get(0, 0), [0; 3]);
        let one = color(&Gray::filled(1, 1, 7).unwrap(), tile);
        assert_eq!(one.get(0, 0), [7; 3]);
    }
}
