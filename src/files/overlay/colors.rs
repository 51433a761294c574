//! The colours of a run's algorithms: the same on every plot of every page and, but for sweeps, in
//! Rerun.

use std::collections::BTreeSet;

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
    [0x3d, 0x9b, 0xd4],
    [0x99, 0x5c, 0x50],
];

/// Colour of the references that look at no image.
pub const REFERENCE_COLOR: [u8; 3] = [0x80; 3];

/// The algorithms whose first setting always has the colour at its place here.
const FIXED: [&str; COLOR_COUNT] = ["v5", "sgm", "bm", "v3", "v1", "v2", "dp", "v4"];

/// Colour at that place; colours repeat after [`COLOR_COUNT`].
pub fn plot_color(place: usize) -> [u8; 3] {
    COLORS[place % COLORS.len()]
}

/// The kind of an algorithm, by its label.
pub fn kind_of_label(label: &str) -> &str {
    label.split(':').next().unwrap_or_default()
}

/// Colours of the algorithms with these labels, which do not depend on their order for those of
/// svl: others, and further settings, have the colours that are left.
pub fn algorithm_colors(labels: &[&str]) -> Vec<[u8; 3]> {
    let mut taken = BTreeSet::new();
    let fixed = |label: &&str| FIXED.iter().position(|name| *name == kind_of_label(label));
    let mut places: Vec<_> = labels
        .iter()
        .map(|label| fixed(label).filter(|place| taken.insert(*place)))
        .collect();
    let mut left = (0..COLOR_COUNT)
        .filter(|place| !taken.contains(place))
        .chain(0..);
    for place in places.iter_mut().filter(|place| place.is_none()) {
        *place = left.next();
    }
    let color = |place: &Option<usize>| plot_color(place.unwrap_or_default());
    places.iter().map(color).collect()
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
        let references = std::iter::once(REFERENCE_COLOR);
        for color in COLORS
            .into_iter()
            .chain(references)
            .chain(shades)
            .map(luminance)
        {
            for ground in [[0xff; 3], [0x14, 0x17, 0x1b]].map(luminance) {
                assert!(contrast(color, ground) >= 3.0);
            }
        }
        assert_eq!(plot_color(9), COLORS[1]);
        assert_eq!([0.0, 1.0].map(parameter_color), [COLORS[0], COLORS[1]]);
    }

    #[test]
    fn an_algorithm_has_one_colour_in_every_order() {
        assert_eq!(algorithm_colors(&["bm", "v5"]), [COLORS[2], COLORS[0]]);
        let settings = algorithm_colors(&["mine", "sgm", "sgm:p1=3", "v5"]);
        assert_eq!(settings, [COLORS[2], COLORS[1], COLORS[3], COLORS[0]]);
        let many: Vec<_> = (0..20).map(|i| format!("a{i}")).collect();
        let many: Vec<_> = many.iter().map(String::as_str).collect();
        assert_eq!(algorithm_colors(&many).len(), 20);
    }
}
