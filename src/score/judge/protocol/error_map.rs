//! Errors in the colours of KITTI 2015's error maps (`errorImage` of its development kit).

use super::ProtocolImage;
use super::kitti::{KittiMaps, stored};
use svl_core::stereo::{Plane, Visibility};
use svl_files::overlay::errors::{BINS, bin, error_size};

const NO_TRUTH: [u8; 3] = [0; 3];
const NO_ESTIMATE: [u8; 3] = [128; 3];

/// Each pixel on its own.
pub(super) fn plain(image: &ProtocolImage) -> Plane<[u8; 3]> {
    let mut rgb = image.truth.map(|_| NO_TRUTH);
    each(image, |x, y, truth, dimmed| {
        let d = image.estimate.get(x, y);
        rgb.set(
            x,
            y,
            dimmed(if d.is_finite() {
                colour(truth, d)
            } else {
                NO_ESTIMATE
            }),
        );
    });
    rgb
}

/// The map as drawn by the kit: the densified map, each pixel except on the image's border covers
/// its eight neighbours, later ones over earlier ones.
pub(super) fn kitti(image: &ProtocolImage) -> Plane<[u8; 3]> {
    let dense = KittiMaps::new(image).dense;
    let mut rgb = image.truth.map(|_| NO_TRUTH);
    let (width, height) = rgb.size();
    each(image, |x, y, truth, dimmed| {
        // The kit leaves a border of one pixel unpainted.
        if (1..width.saturating_sub(1)).contains(&x) && (1..height.saturating_sub(1)).contains(&y) {
            let colour = dimmed(colour(truth, stored(dense.get(x, y))));
            (y - 1..=y + 1).for_each(|y| rgb.row_mut(y)[x - 1..=x + 1].fill(colour));
        }
    });
    rgb
}

/// Calls `paint` for the pixels with truth in raster order, with a function that halves the colours
/// of those outside the mask.
fn each(image: &ProtocolImage, mut paint: impl FnMut(usize, usize, f32, fn([u8; 3]) -> [u8; 3])) {
    for (y, row) in image.truth.rows().enumerate() {
        for (x, &truth) in row
            .iter()
            .enumerate()
            .filter(|(_, truth)| truth.is_finite())
        {
            let seen = image
                .mask
                .is_none_or(|mask| mask.get(x, y) == Visibility::Visible);
            paint(
                x,
                y,
                truth,
                if seen {
                    |rgb| rgb
                } else {
                    |rgb| rgb.map(|c| c / 2)
                },
            );
        }
    }
}

fn colour(truth: f32, d: f32) -> [u8; 3] {
    BINS[bin(error_size(d, truth))].1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_begin_where_the_last_ends() {
        // At a truth of 60 the two thresholds coincide: 3 px.
        let colours = [0.0, 0.1875, 0.375, 0.75, 1.5, 3.0, 6.0, 12.0, 24.0, 48.0]
            .map(|error| colour(60.0, 60.0 + error));
        assert_eq!(colours, BINS.map(|(_, colour)| colour));
        assert_eq!(colour(60.0, 62.999), BINS[4].1);
        // Far off in pixels, but not relative to the truth: the smaller counts.
        assert_eq!(colour(600.0, 606.0), BINS[2].1);
        assert_eq!((colour(0.0, 0.0), colour(0.0, 3.0)), (BINS[0].1, BINS[5].1));
    }

    fn image<'a>(
        estimate: &'a Plane<f32>,
        truth: &'a Plane<f32>,
        mask: Option<&'a Plane<Visibility>>,
    ) -> ProtocolImage<'a> {
        ProtocolImage {
            estimate,
            truth,
            mask,
            foreground: None,
            max_disparity: None,
        }
    }

    #[test]
    fn pixels_that_cannot_be_coloured_are_black_or_grey_and_masked_ones_dimmed() {
        let inf = f32::INFINITY;
        let truth = Plane::from_vec(4, 1, vec![inf, 9.0, 9.0, 9.0]).unwrap();
        let estimate = Plane::from_vec(4, 1, vec![9.0, inf, 9.0, 9.0]).unwrap();
        let codes = Plane::from_vec(4, 1, vec![255u8, 255, 255, 128]).unwrap();
        let mask = codes.map(Visibility::from_code);
        let rgb = plain(&image(&estimate, &truth, Some(&mask)));
        assert_eq!(rgb.row(0), [NO_TRUTH, NO_ESTIMATE, BINS[0].1, [24, 27, 74]]);
    }

    #[test]
    fn kitti_fills_holes_and_draws_nine_pixels_for_one() {
        let inf = f32::INFINITY;
        let at = |x: usize, y: usize, d: f32| {
            Plane::from_fn(6, 3, |u, v| if (u, v) == (x, y) { d } else { inf }).unwrap()
        };
        let rgb = kitti(&image(&at(0, 0, 60.0), &at(2, 1, 60.0), None));
        for (x, y) in (0..3).flat_map(|y| (0..6).map(move |x| (x, y))) {
            assert_eq!(
                rgb.get(x, y),
                if (1..=3).contains(&x) {
                    BINS[0].1
                } else {
                    NO_TRUTH
                },
                "({x}, {y})"
            );
        }
        let border = kitti(&image(&at(0, 0, 60.0), &at(0, 1, 60.0), None));
        assert!(border.pixels().all(|rgb| rgb == NO_TRUTH));
    }
}
