//! Error maps: disparity errors as colours.

use super::picture::Picture;
use svl_core::stereo::{Plane, Truth, Visibility};

/// Error maps of KITTI 2015 (M. Menze and A. Geiger, Object Scene Flow for Autonomous Vehicles,
/// CVPR 2015, development kit): upper end of each bin, and its colour, from blue, good, to red,
/// wrong. The outliers begin at 1.
pub const BINS: [(f32, [u8; 3]); 10] = [
    (1.0 / 16.0, [49, 54, 149]),
    (1.0 / 8.0, [69, 117, 180]),
    (1.0 / 4.0, [116, 173, 209]),
    (1.0 / 2.0, [171, 217, 233]),
    (1.0, [224, 243, 248]),
    (2.0, [254, 224, 144]),
    (4.0, [253, 174, 97]),
    (8.0, [244, 109, 67]),
    (16.0, [215, 48, 39]),
    (f32::INFINITY, [165, 0, 38]),
];

/// No estimate at a pixel with truth: grey, which no error has.
pub const SILENT: [u8; 3] = [0xa0, 0xa0, 0xa0];
/// Occluded in the right camera or not known to be visible: not scored.
pub const HIDDEN: [u8; 3] = [0x50, 0x50, 0x50];
/// No truth: not scored.
pub const UNKNOWN: [u8; 3] = [0, 0, 0];

/// The code of [`errors`] of a pixel without truth.
pub const NO_TRUTH: u8 = BINS.len() as u8 + 2;

/// The size of an error as defined by KITTI 2015: 1 at 3 px or at 5 % of the true disparity,
/// whichever is more.
pub fn error_size(disparity_px: f32, true_px: f32) -> f32 {
    let error = (disparity_px - true_px).abs();
    // `min` discards the NaN of no error at a truth of 0.
    (error / 3.0).min(20.0 * error / true_px.abs())
}

/// The index of the bin of [`BINS`] that contains an error of that size.
pub fn bin(error_size: f32) -> usize {
    // The ends of bins are powers of two from 1/16 on: their exponents are the numbers of bins.
    const BELOW_ONE: u32 = f32::MAX_EXP as u32 - 2;
    let exponent = (error_size / BINS[0].0).to_bits() >> (f32::MANTISSA_DIGITS - 1);
    (exponent.saturating_sub(BELOW_ONE) as usize).min(BINS.len() - 1)
}

/// The errors of disparities, a plane of the size of `truth`: blue to red if both cameras see the
/// pixel and its truth is known, grey if the algorithm has no disparity there; the darker greys are
/// not scored.
pub fn errors(disparities: &Plane<f32>, truth: &Truth) -> Picture {
    let neutrals = [SILENT, HIDDEN, UNKNOWN];
    let [silent, hidden, unknown] = [0, 1, 2].map(|i| (BINS.len() + i) as u8);
    let mut codes = truth.disparity.map(|_| unknown);
    for (y, truths) in truth.disparity.rows().enumerate() {
        let visible = truth.visibility.as_ref().map(|v| v.row(y));
        let visible = |x: usize| visible.is_none_or(|row| row[x] == Visibility::Visible);
        let pixels = disparities.row(y).iter().zip(truths).enumerate();
        let codes = codes.row_mut(y).iter_mut();
        for (code, (x, (&estimate, &true_px))) in codes.zip(pixels) {
            // The order matters: without truth nothing is scored, occluded or not.
            *code = if !true_px.is_finite() {
                unknown
            } else if !visible(x) {
                hidden
            } else if !estimate.is_finite() {
                silent
            } else {
                bin(error_size(estimate, true_px)) as u8
            };
        }
    }
    Picture {
        codes,
        palette: BINS
            .iter()
            .map(|(_, color)| *color)
            .chain(neutrals)
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use svl_core::stereo::{DisparityMap, Plane, Reason};

    #[test]
    fn sizes_are_kitti_s() {
        // 3 px of 20 are 15 %, of 120 they are 2.5 %.
        assert_eq!(
            [
                error_size(23.0, 20.0),
                error_size(117.0, 120.0),
                error_size(6.0, 0.0)
            ],
            [1.0, 0.5, 2.0]
        );
        assert_eq!(
            [0.0, 0.0625, 0.99, 1.0, 15.9, 16.0, f32::INFINITY].map(bin),
            [0, 1, 4, 5, 8, 9, 9]
        );
        for size in (0..4000).map(|i| i as f32 / 125.0) {
            let expected = BINS.iter().position(|(end, _)| size < *end);
            assert_eq!(bin(size), expected.unwrap());
        }
    }

    #[test]
    fn pixels_not_judged_show_no_error() {
        let mut map = DisparityMap::new(6, 1).unwrap();
        let mut row = map.rows_mut().next().unwrap();
        (0..6).for_each(|x| row.accept(x, 40.0));
        row.reject(1, Reason::Untextured);
        let truth =
            Plane::from_vec(6, 1, vec![40.0, 40.0, 10.0, f32::INFINITY, 10.0, 10.0]).unwrap();
        let mut visibility = Plane::filled(6, 1, Visibility::Visible).unwrap();
        visibility.set(2, 0, Visibility::Occluded);
        visibility.set(5, 0, Visibility::Unknown);
        let Picture { codes, palette } =
            errors(map.disparity(), &Truth::exact(truth, Some(visibility)));
        let colors: Vec<_> = codes
            .pixels()
            .map(|code| palette[usize::from(code)])
            .collect();
        assert_eq!(
            colors,
            [BINS[0].1, SILENT, HIDDEN, UNKNOWN, BINS[8].1, HIDDEN]
        );
    }
}
