//! The colours of a run's algorithms: the same on every plot of a page and, but for sweeps, in
//! Rerun.

/// Algorithms after which the colours repeat.
pub const COLOR_COUNT: usize = 8;

/// Colours that remain apart for the colour-blind (after Okabe and Ito, "Color Universal Design",
/// 2008), with a contrast of 3 on white paper and on a dark ground.
const COLORS: [[u8; 3]; COLOR_COUNT] = [
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0xc2, 0x8a, 0x00],
    [0x8a, 0x6f, 0xd8],
    [0x80, 0x80, 0x80],
    [0x3d, 0x9b, 0xd4],
];

/// Colour of the algorithm at that position of its run, in the order of the manifest; colours
/// repeat after [`COLOR_COUNT`].
pub fn algorithm_color(place: usize) -> [u8; 3] {
    COLORS[place % COLORS.len()]
}

/// Colours of the values of a parameter, from the least to the greatest.
const SHADES: [[u8; 3]; 4] = [COLORS[0], COLORS[5], COLORS[3], COLORS[1]];

/// Colour of a parameter's value at that place between the least, 0, and the greatest, 1.
pub fn parameter_color(place: f64) -> [u8; 3] {
    let scaled = place.clamp(0.0, 1.0) * (SHADES.len() - 1) as f64;
    let first = (scaled as usize).min(SHADES.len() - 2);
    let share = scaled - first as f64;
    let mixed = |i: usize| {
        let [a, b] = [SHADES[first][i], SHADES[first + 1][i]].map(f64::from);
        (a + share * (b - a)).round() as u8
    };
    [0, 1, 2].map(mixed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance (WCAG 2).
    fn luminance(color: [u8; 3]) -> f64 {
        let linear = |c: u8| match f64::from(c) / 255.0 {
            c if c <= 0.04045 => c / 12.92,
            c => ((c + 0.055) / 1.055).powf(2.4),
        };
        let [r, g, b] = color.map(linear);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    #[test]
    fn colours_are_seen_on_light_and_on_dark_grounds() {
        let contrast = |a: f64, b: f64| (a.max(b) + 0.05) / (a.min(b) + 0.05);
        let shades = (0..=30).map(|i| parameter_color(f64::from(i) / 30.0));
        for color in COLORS.into_iter().chain(shades).map(luminance) {
            for ground in [[0xff; 3], [0x14, 0x17, 0x1b]].map(luminance) {
                assert!(contrast(color, ground) >= 3.0);
            }
        }
        assert_eq!(algorithm_color(9), COLORS[1]);
        assert_eq!([0.0, 1.0].map(parameter_color), [COLORS[0], COLORS[1]]);
    }
}
