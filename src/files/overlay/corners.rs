//! The corners of a calibration board, drawn on a pair.

use super::viridis;
use nalgebra::Point2;
use svl_core::stereo::StereoPair;

/// Both images side by side as interleaved RGB, with a cross on every corner: width, height,
/// pixels. A row of the board, `columns` corners, has one colour, from yellow to blue; the first
/// corner is red.
pub fn corners_drawn(
    pair: &StereoPair,
    corners: [&[Point2<f64>]; 2],
    columns: usize,
) -> (usize, usize, Vec<u8>) {
    let (width, height) = pair.size();
    let images = pair.left().rows().zip(pair.right().rows());
    let mut pixels: Vec<u8> = images
        .flat_map(|(left, right)| left.iter().chain(right))
        .flat_map(|&v| [v; 3])
        .collect();
    for (side, corners) in corners.into_iter().enumerate() {
        for (i, corner) in corners.iter().enumerate() {
            let part = i as f32 / corners.len() as f32;
            let row = (i / columns.max(1) * columns.max(1)) as f32 / corners.len() as f32;
            let color = if part == 0.0 {
                [230, 60, 40]
            } else {
                viridis(1.0 - 0.8 * row)
            };
            // The cast saturates, so that a corner far outside stays outside.
            let (x, y) = (corner.x.round() as isize, corner.y.round() as isize);
            for step in -ARM..=ARM {
                for (x, y) in [(x + step, y), (x, y + step)] {
                    if (0..width as isize).contains(&x) && (0..height as isize).contains(&y) {
                        let at = 3 * (y as usize * 2 * width + side * width + x as usize);
                        pixels[at..at + 3].copy_from_slice(&color);
                    }
                }
            }
        }
    }
    (2 * width, height, pixels)
}

/// Half of a cross's width, pixels.
const ARM: isize = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::Gray;

    #[test]
    fn crosses_are_where_the_corners_are() {
        let pair = StereoPair::new(
            Gray::filled(20, 10, 90).unwrap(),
            Gray::filled(20, 10, 80).unwrap(),
        )
        .unwrap();
        let outside = [Point2::new(5.2, 5.9), Point2::new(-30.0, 1e9)];
        let (width, height, pixels) =
            corners_drawn(&pair, [&outside, &[Point2::new(18.0, 2.0)]], 1);
        assert_eq!((width, height, pixels.len()), (40, 10, 3 * 400));
        let at = |x: usize, y: usize| &pixels[3 * (y * 40 + x)..][..3];
        assert_eq!(
            (at(5, 6), at(9, 6)),
            (&[230, 60, 40][..], &[230, 60, 40][..])
        );
        assert_eq!(
            (at(10, 6), at(38, 2), at(0, 2)),
            (&[90; 3][..], &[230, 60, 40][..], &[90; 3][..])
        );
    }
}
