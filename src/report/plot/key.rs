//! The key of a plot: squares of colour with names, in lines above the drawing.

use super::{DrawError, PlotCanvas, TEXT, WIDTH, text, text_width};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Height of a line.
const LINE: i32 = 44;
const SIZE: u32 = TEXT - 2;

/// Names with their colours and places.
pub(super) struct PlotKey<'a> {
    entries: Vec<(&'a str, RGBColor, (i32, i32))>,
    /// Height of all lines; 0 without names.
    pub height: i32,
}

impl<'a> PlotKey<'a> {
    pub fn new(names: impl Iterator<Item = (&'a str, RGBColor)>) -> Self {
        let (mut x, mut y, mut entries) = (0, 0, Vec::new());
        for (name, color) in names {
            let width = 34 + text_width(name, SIZE);
            // A name wider than the plot stays alone on its line.
            if x > 0 && x + width > WIDTH as i32 {
                (x, y) = (0, y + LINE);
            }
            entries.push((name, color, (x, y)));
            x += width + 28;
        }
        let height = if entries.is_empty() { 0 } else { y + LINE };
        Self { entries, height }
    }

    /// Draws it below `top`.
    pub fn draw(&self, canvas: &PlotCanvas, top: i32) -> Result<(), DrawError> {
        for (name, color, (x, y)) in &self.entries {
            let (x, y) = (*x, y + top);
            let square = [(x, y), (x + 24, y + 24)];
            canvas.draw(&Rectangle::new(square, color.filled()))?;
            let style = text(SIZE).pos(Pos::new(HPos::Left, VPos::Center));
            canvas.draw(&Text::new((*name).to_owned(), (x + 34, y + 12), style))?;
        }
        Ok(())
    }
}
