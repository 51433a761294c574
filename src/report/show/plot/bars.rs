//! Horizontal bars of several parts.

use super::canvas::{Canvas, Color, LEFT, PlotKey, RIGHT, fill, line, title_height};
use super::series::{AXIS, TEXT, WIDTH, text_width};
use svl_files::overlay::viridis;

/// A bar for every category, made of parts one after another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bars {
    pub title: String,
    /// Quantity that the length of a bar is, with its unit.
    pub label: String,
    /// Names of the parts. One that no bar has is not in the key; others keep their colours.
    pub parts: Vec<String>,
    /// Name, and a length per part, 0 or more.
    pub bars: Vec<(String, Vec<f64>)>,
}

/// Height of a bar with its gap, and of the axis below the bars.
const BAR: i32 = 52;
const FOOT: i32 = 72;
/// Most room for the names.
const NAMES: i32 = 400;
/// Room for a bar's sum behind it.
const SUM: i32 = 110;
const SIZE: u32 = TEXT - 2;

impl Bars {
    /// The plot as an SVG document.
    pub fn svg(&self) -> String {
        self.drawn(|sum| sum)
    }

    /// [`Bars::svg`] with every bar as long as the plot is wide, to show the fractions of the
    /// parts. The sums are printed behind them.
    pub fn shares_svg(&self) -> String {
        self.drawn(|_| 1.0)
    }

    /// `length` of a bar, of its sum.
    fn drawn(&self, length: impl Fn(f64) -> f64) -> String {
        let is_shown = |i: usize| self.bars.iter().any(|(_, parts)| parts[i] > 0.0);
        let parts = self.parts.iter().enumerate().filter(|(i, _)| is_shown(*i));
        let parts = parts.map(|(i, part)| (part.as_str(), self.color(i)));
        let key = PlotKey::new(parts.filter(|_| self.parts.len() > 1));
        let title = title_height(&self.title, 12);
        let head = key.height + title;
        let foot = head + BAR * self.bars.len() as i32;
        let mut canvas = Canvas::titled(&self.title);
        key.draw(&mut canvas, title);
        self.draw(&mut canvas, head, length);
        let names = self.names();
        canvas.path([(names, head), (names, foot)], line(AXIS, 1), "");
        canvas.text(&self.label, (names, foot + 36), SIZE, LEFT);
        canvas.svg(foot + FOOT)
    }

    /// Colour of a part, different from those of algorithms.
    fn color(&self, part: usize) -> Color {
        let last = self.parts.len().saturating_sub(1).max(1);
        viridis(0.2 + 0.75 * part as f32 / last as f32)
    }

    /// Room for the names.
    fn names(&self) -> i32 {
        let names = self.bars.iter();
        let names = names.map(|(name, _)| text_width(name, SIZE) + 16);
        names.max().unwrap_or(0).min(NAMES)
    }

    fn draw(&self, canvas: &mut Canvas, head: i32, length: impl Fn(f64) -> f64) {
        let names = self.names();
        let sum = |parts: &[f64]| parts.iter().sum::<f64>();
        let lengths = self.bars.iter().map(|(_, parts)| length(sum(parts)));
        let longest = lengths.fold(f64::MIN_POSITIVE, f64::max);
        let scale = f64::from(WIDTH as i32 - names - SUM) / longest;
        // Counts have no decimals.
        let mut values = self.bars.iter().flat_map(|(_, parts)| parts);
        let digits = if values.all(|v| v.fract() == 0.0) {
            0
        } else {
            2
        };
        for (i, (name, parts)) in self.bars.iter().enumerate() {
            let y = head + BAR * i as i32;
            canvas.text(name, (names - 16, y + BAR / 2), SIZE, RIGHT);
            let total = sum(parts);
            // Stretched so that the whole bar gets `length`; its parts keep their proportions.
            let unit = length(total) * scale / total.max(f64::MIN_POSITIVE);
            // Ends are rounded, not lengths: neighbouring parts meet without gaps.
            let place = |v: f64| names + (v * unit).round() as i32;
            let mut from = 0.0;
            for (k, part) in parts.iter().enumerate() {
                let corners = [(place(from), y + 8), (place(from + part), y + BAR - 8)];
                canvas.rectangle(corners, fill(self.color(k), 1.0));
                from += part;
            }
            let behind = (place(total) + 12, y + BAR / 2);
            canvas.text(&format!("{total:.digits$}"), behind, SIZE, LEFT);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_rectangle_per_part_and_key() {
        let parts = ["smoothing", "matching", "checks"].map(str::to_owned);
        let bars = vec![
            ("v1".to_owned(), vec![0.0, 1.0, 0.5]),
            ("v3".to_owned(), vec![0.0, 0.5, 0.25]),
        ];
        let bars = Bars {
            title: "times".into(),
            label: "ms".into(),
            parts: parts.into(),
            bars,
        };
        let svg = bars.svg();
        // A part that no bar has is not in the key, and leaves the others their colours.
        let rects = |part: usize| {
            let color = super::super::canvas::hex(bars.color(part));
            svg.matches(&format!("fill=\"{color}\"")).count()
        };
        assert_eq!((rects(1), rects(2)), (3, 3), "{svg}");
        assert!(svg.contains("\n1.50\n"), "{svg}");
    }

    #[test]
    fn shares_are_as_long_as_the_plot() {
        let bars = vec![
            ("v1".to_owned(), vec![1.0, 3.0]),
            ("v3".to_owned(), vec![0.5, 0.0]),
        ];
        let svg = Bars {
            bars,
            ..Bars::default()
        }
        .shares_svg();
        let ends = |svg: &str| svg.matches("x=\"862\"").count();
        // Both sums are printed behind bars that end at 850.
        assert_eq!((ends(&svg), svg.contains("\n0.50\n")), (2, true), "{svg}");
    }

    #[test]
    fn no_bars_and_empty_bars_are_drawn() {
        Bars::default().svg();
        Bars {
            bars: vec![("v1".into(), vec![0.0]), ("v2".into(), vec![])],
            ..Bars::default()
        }
        .svg();
    }
}
