//! Distributions, one below the other.

use super::chart::number;
use super::ticks::log_ticks;
use super::{
    AXIS, AlgorithmColors, DrawError, PlotCanvas, TEXT, TITLE, WIDTH, draw_title, svg, text,
    text_width,
};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use svl_core::Result;
use svl_core::statistics::nearest_rank;

/// A histogram for every algorithm of a run, in its colour, over one common logarithmic axis, with
/// median, percentiles and maximum.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Strips {
    pub title: String,
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
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the drawing library.
    pub fn svg(&self, colors: &AlgorithmColors<'_>) -> Result<String> {
        let head = KEY + if self.title.is_empty() { 12 } else { TITLE };
        let height = head + STRIP * self.strips.len() as i32 + FOOT;
        svg(height as u32, &self.title, |canvas| {
            draw_title(canvas, &self.title)?;
            let mut x = 4;
            for (k, (name, ..)) in MARKS.iter().enumerate() {
                mark(canvas, k, (x, head - KEY + 32))?;
                canvas.draw(&Text::new(
                    *name,
                    (x + 14, head - KEY + 12),
                    beside(HPos::Left),
                ))?;
                x += 52 + text_width(name, SIZE);
            }
            self.draw(canvas, colors, head)
        })
    }

    fn draw(
        &self,
        canvas: &PlotCanvas,
        colors: &AlgorithmColors<'_>,
        head: i32,
    ) -> std::result::Result<(), DrawError> {
        let names = self
            .strips
            .iter()
            .map(|(name, _)| text_width(name, SIZE) + 16)
            .max()
            .unwrap_or(0)
            .min(NAMES);
        let values = || {
            self.strips
                .iter()
                .flat_map(|(_, values)| values)
                .copied()
                .filter(|v| *v > 0.0)
        };
        let low = values().fold(f64::INFINITY, f64::min) / 1.15;
        let high = values().fold(0.0, f64::max) * 1.15;
        // Without positive values any range will do.
        let (low, high) = if low < high { (low, high) } else { (0.1, 1.0) };
        let scale = f64::from(WIDTH as i32 - RIGHT - names) / (high / low).ln();
        let place = |v: f64| names + ((v / low).ln() * scale).round() as i32;
        let foot = head + STRIP * self.strips.len() as i32;

        for tick in log_ticks(low, high) {
            let x = place(tick);
            canvas.draw(&PathElement::new(
                [(x, head), (x, foot + 8)],
                AXIS.mix(0.25),
            ))?;
            let below = text(SIZE - 2).pos(Pos::new(HPos::Center, VPos::Top));
            canvas.draw(&Text::new(number(tick), (x, foot + 14), below))?;
        }
        for (i, (name, values)) in self.strips.iter().enumerate() {
            let color = colors.color(name).unwrap_or(AXIS);
            let base = head + STRIP * (i as i32 + 1) - 4;
            canvas.draw(&Text::new(
                name.clone(),
                (names - 16, base - STRIP / 2 + 4),
                beside(HPos::Right),
            ))?;
            canvas.draw(&PathElement::new(
                [(names, base), (WIDTH as i32 - RIGHT, base)],
                AXIS.mix(0.5),
            ))?;
            let mut sorted: Vec<f64> = values.iter().copied().filter(|v| *v > 0.0).collect();
            sorted.sort_by(f64::total_cmp);
            // All bins have one width on the page, so this is the histogram of the log of time.
            let bins = sorted.chunk_by(|a, b| place(*a) / BIN == place(*b) / BIN);
            // Each strip is scaled to its fullest bin: a spread distribution would otherwise
            // vanish.
            let fullest = bins.clone().map(<[_]>::len).max().unwrap_or(1);
            for bin in bins {
                let x = place(bin[0]) / BIN * BIN;
                let height =
                    (f64::from(STRIP - 10) * bin.len() as f64 / fullest as f64).ceil() as i32;
                canvas.draw(&Rectangle::new(
                    [(x, base - height), (x + BIN, base)],
                    color.mix(0.6).filled(),
                ))?;
            }
            for (k, (_, share, _)) in MARKS.iter().enumerate() {
                if let Some(value) = nearest_rank(&sorted, *share) {
                    mark(canvas, k, (place(value), base))?;
                }
            }
        }
        let middle = text(TEXT).pos(Pos::new(HPos::Center, VPos::Top));
        canvas.draw(&Text::new(
            self.label.clone(),
            ((names + WIDTH as i32 - RIGHT) / 2, foot + 56),
            middle,
        ))
    }
}

/// Draws mark `k` of [`MARKS`] with its foot at that place.
fn mark(
    canvas: &PlotCanvas,
    k: usize,
    (x, base): (i32, i32),
) -> std::result::Result<(), DrawError> {
    canvas.draw(&Rectangle::new(
        [(x - 3, base - MARKS[k].2), (x + 3, base)],
        BLACK.filled(),
    ))
}

fn beside<'a>(h: HPos) -> TextStyle<'a> {
    text(SIZE).pos(Pos::new(h, VPos::Center))
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
            title: "t".into(),
            label: "ms".into(),
            strips,
        }
        .svg(&AlgorithmColors::new([]))
        .unwrap();
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
        Strips::default().svg(&AlgorithmColors::new([])).unwrap();
        Strips {
            strips: vec![("a".into(), vec![]), ("b".into(), vec![3.0])],
            ..Strips::default()
        }
        .svg(&AlgorithmColors::new([]))
        .unwrap();
    }
}
