//! Disparities as colours.

use crate::stereo::DisparityMap;

/// The map as interleaved RGB in the colours of viridis, from dark blue at 0 to yellow at `max_px` and beyond; black where there is none.
///
/// Viridis grows evenly in lightness, so it also reads in grey and to colour-blind eyes.
pub fn preview(map: &DisparityMap, max_px: f32) -> Vec<u8> {
    let color = |d: f32| if d.is_finite() { viridis(d / max_px) } else { [0; 3] };
    map.disparity().pixels().flat_map(color).collect()
}

/// Viridis at `t` of 0..=1, straight between nine of its colours (S. van der Walt and N. Smith, matplotlib 1.5; the nine
/// as the R package viridisLite gives them).
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
    let below = (at as usize).min(steps - 1);
    let between = |i: usize| {
        let (a, b) = (f32::from(COLOURS[below][i]), f32::from(COLOURS[below + 1][i]));
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
        let light = |c: &[u8; 3]| 299 * u32::from(c[0]) + 587 * u32::from(c[1]) + 114 * u32::from(c[2]);
        assert!(ramp.is_sorted_by(|a, b| light(a) < light(b)));
    }

    #[test]
    fn nothing_is_black() {
        let mut map = DisparityMap::new(2, 1).unwrap();
        map.rows_mut().next().unwrap().accept(1, 99.0, 0);
        assert_eq!(preview(&map, 64.0), [[0; 3], viridis(1.0)].concat());
    }
}
