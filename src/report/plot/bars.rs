//! Horizontal bars of several parts.

use super::chart::number;
use super::{AXIS, Canvas, Failure, TEXT, WIDTH, color, svg, text};
use crate::error::Result;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A bar for every category, made of parts that stand one after another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bars {
    pub title: String,
    /// What the length of a bar is, with its unit.
    pub label: String,
    /// Names of the parts.
    pub parts: Vec<String>,
    /// Name, and a length per part, 0 or more.
    pub bars: Vec<(String, Vec<f64>)>,
}

/// Height of a bar with its gap, of what stands above and below the bars, and room for the names.
const BAR: i32 = 52;
const HEAD: i32 = 116;
const FOOT: i32 = 88;
const NAMES: i32 = 300;
/// Room for a bar's sum behind it.
const SUM: i32 = 120;

impl Bars {
    /// The plot as an SVG document.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] with what the drawing library says.
    pub fn svg(&self) -> Result<String> {
        let height = HEAD + FOOT + BAR * self.bars.len() as i32;
        svg(height as u32, &self.title, |canvas| self.draw(canvas))
    }

    fn draw(&self, canvas: &Canvas) -> std::result::Result<(), Failure> {
        let sum = |parts: &[f64]| parts.iter().sum::<f64>();
        let longest = self.bars.iter().map(|(_, parts)| sum(parts)).fold(0.0, f64::max);
        let scale = if longest > 0.0 { f64::from(WIDTH as i32 - NAMES - SUM) / longest } else { 0.0 };
        let place = |v: f64| NAMES + (v * scale).round() as i32;
        let at = |h, v| text(TEXT - 2).pos(Pos::new(h, v));
        canvas.draw(&Text::new(
            self.title.clone(),
            (WIDTH as i32 / 2, 16),
            text(TEXT + 4).pos(Pos::new(HPos::Center, VPos::Top)),
        ))?;
        let mut x = NAMES;
        for (i, part) in self.parts.iter().enumerate().filter(|_| self.parts.len() > 1) {
            canvas.draw(&Rectangle::new([(x, 72), (x + 24, 96)], color(i).filled()))?;
            canvas.draw(&Text::new(part.clone(), (x + 36, 84), at(HPos::Left, VPos::Center)))?;
            x += 80 + 16 * part.chars().count() as i32;
        }
        for (i, (name, parts)) in self.bars.iter().enumerate() {
            let y = HEAD + BAR * i as i32;
            canvas.draw(&Text::new(name.clone(), (NAMES - 16, y + BAR / 2), at(HPos::Right, VPos::Center)))?;
            let mut from = 0.0;
            for (k, part) in parts.iter().enumerate() {
                let corners = [(place(from), y + 8), (place(from + part), y + BAR - 8)];
                canvas.draw(&Rectangle::new(corners, color(k).filled()))?;
                from += part;
            }
            let end = (place(sum(parts)) + 12, y + BAR / 2);
            canvas.draw(&Text::new(number(sum(parts)), end, at(HPos::Left, VPos::Center)))?;
        }
        let foot = HEAD + BAR * self.bars.len() as i32;
        canvas.draw(&PathElement::new([(NAMES, HEAD), (NAMES, foot)], AXIS))?;
        canvas.draw(&Text::new(self.label.clone(), (NAMES, foot + 24), at(HPos::Left, VPos::Top)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_rectangle_per_part_and_key() {
        let parts = vec!["matching".to_owned(), "checks".to_owned()];
        let bars = vec![("v1".to_owned(), vec![1.0, 0.5]), ("v3".to_owned(), vec![0.5, 0.25])];
        let svg = Bars { title: "times".into(), label: "ms".into(), parts, bars }.svg().unwrap();
        assert_eq!(svg.matches("<rect").count(), 2 + 4);
        assert!(svg.contains("\n1.5\n"), "{svg}");
    }

    #[test]
    fn no_bars_and_empty_bars() {
        Bars::default().svg().unwrap();
        Bars { bars: vec![("v1".into(), vec![0.0]), ("v2".into(), vec![])], ..Bars::default() }.svg().unwrap();
    }
}
