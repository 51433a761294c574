//! Distributions, one below the other.

use super::canvas::{BELOW, BLACK, Canvas, LEFT, RIGHT as END, fill, line};
use super::chart::number;
use super::series::{AXIS, AlgorithmColors, TEXT, WIDTH, text_width};
use super::ticks::log_ticks;
use svl_core::statistics::nearest_rank;

/// A histogram for every algorithm of a run, in its colour, over one common logarithmic axis, with
/// median, percentiles and maximum.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Strips {
    /// The quantity that is measured, with its unit.
    pub label: String,
    /// Name and values; values that are not positive are not drawn.
    pub strips: Vec<(String, Vec<f64>)>,
}

/// Height of a strip, of the key, and of the axis below the strips.
const STRIP: i32 = 60;
const KEY: i32 = 44;
const FOOT: i32 = 104;
/// Most room for the names, and the room to the right.
const NAMES: i32 = 400;
const RIGHT: i32 = 36;
/// Width of a bin.
const BIN: i32 = 6;
const SIZE: u32 = TEXT - 2;

/// Marks of each distribution, above the percentiles: name, fraction, height of the mark.
const MARKS: [(&str, f64, i32); 4] = [
    ("p50", 0.50, 48),
    ("p95", 0.95, 32),
    ("p99", 0.99, 20),
    ("max", 1.0, 10),
];

impl Strips {
    /// The plot as an SVG document.
    pub fn svg(&self, colors: &AlgorithmColors<'_>) -> String {
        let head = KEY + 12;
        let foot = head + STRIP * self.strips.len() as i32;
        let mut canvas = Canvas::default();
        let mut x = 4;
        for (k, (name, ..)) in MARKS.iter().enumerate() {
            mark(&mut canvas, k, (x, head - KEY + 32));
            canvas.text(name, (x + 14, head - KEY + 12), SIZE, LEFT);
            x += 52 + text_width(name, SIZE);
        }
        let names = self.strips.iter();
        let names = names.map(|(name, _)| text_width(name, SIZE) + 16);
        let names = names.max().unwrap_or(0).min(NAMES);
        let values = || self.strips.iter().flat_map(|(_, values)| values);
        let positive = || values().copied().filter(|v| *v > 0.0);
        let low = positive().fold(f64::INFINITY, f64::min) / 1.15;
        let high = positive().fold(0.0, f64::max) * 1.15;
        // Without positive values any range will do.
        let (low, high) = if low < high { (low, high) } else { (0.1, 1.0) };
        let scale = f64::from(WIDTH as i32 - RIGHT - names) / (high / low).ln();
        let place = |v: f64| names + ((v / low).ln() * scale).round() as i32;
        for tick in log_ticks(low, high) {
            let x = place(tick);
            canvas.path([(x, head), (x, foot + 8)], line(AXIS, 1).faint(), "");
            canvas.text(&number(tick), (x, foot + 14), SIZE - 2, BELOW);
        }
        for (i, (name, values)) in self.strips.iter().enumerate() {
            let base = head + STRIP * (i as i32 + 1) - 4;
            canvas.text(name, (names - 16, base - STRIP / 2 + 4), SIZE, END);
            let ground = [(names, base), (WIDTH as i32 - RIGHT, base)];
            canvas.path(ground, line(AXIS, 1).faint(), "");
            let color = colors.rgb(name).unwrap_or(AXIS);
            draw_strip(&mut canvas, values, color, base, place);
        }
        let middle = (names + WIDTH as i32 - RIGHT) / 2;
        canvas.text(&self.label, (middle, foot + 56), TEXT, BELOW);
        canvas.svg(foot + FOOT)
    }
}

fn draw_strip(
    canvas: &mut Canvas,
    values: &[f64],
    color: [u8; 3],
    base: i32,
    place: impl Fn(f64) -> i32,
) {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| *v > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    // All bins have one width on the page, so this is the histogram of the log of time.
    let bins = sorted.chunk_by(|a, b| place(*a) / BIN == place(*b) / BIN);
    // Each strip is scaled to its fullest bin: a spread distribution would otherwise vanish.
    let fullest = bins.clone().map(<[_]>::len).max().unwrap_or(1) as f64;
    for bin in bins {
        let x = place(bin[0]) / BIN * BIN;
        let height = (f64::from(STRIP - 10) * bin.len() as f64 / fullest).ceil() as i32;
        canvas.rectangle([(x, base - height), (x + BIN, base)], fill(color, 0.6));
    }
    for (k, (_, share, _)) in MARKS.iter().enumerate() {
        if let Some(value) = nearest_rank(&sorted, *share) {
            mark(canvas, k, (place(value), base));
        }
    }
}

/// Draws mark `k` of [`MARKS`] with its foot at that place.
fn mark(canvas: &mut Canvas, k: usize, (x, base): (i32, i32)) {
    let corners = [(x - 3, base - MARKS[k].2), (x + 3, base)];
    canvas.rectangle(corners, fill(BLACK, 1.0));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_counts_and_the_marks_are_ranks() {
        let strips = vec![
            ("v3".to_owned(), (1..=100).map(f64::from).collect()),
            ("bm".to_owned(), vec![0.0, 10.0]),
        ];
        let svg = Strips {
            label: "ms".into(),
            strips,
        }
        .svg(&AlgorithmColors::new([]));
        assert!(svg.contains("\nv3\n") && svg.contains("\nms\n"));
        let rectangles = svg.split("<rect").skip(1);
        let marks = rectangles
            .filter(|line| line.contains("fill=\"#000000\""))
            .count();
        // Four for the key, four per strip.
        assert_eq!(marks, 12);
    }

    #[test]
    fn nothing_and_one_value_are_drawn() {
        Strips::default().svg(&AlgorithmColors::new([]));
        Strips {
            strips: vec![("a".into(), vec![]), ("b".into(), vec![3.0])],
            ..Strips::default()
        }
        .svg(&AlgorithmColors::new([]));
    }
}
