//! A heat map: a number over the values of two parameters.

use super::{DrawError, PlotCanvas, TEXT, TITLE, WIDTH, draw_title, svg, text, text_width};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use serde::Serialize;
use svl_core::Result;

/// Cells by the values of two parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct HeatGrid {
    pub title: String,
    /// The parameters.
    pub down: String,
    pub across: String,
    pub columns: Vec<String>,
    /// Value and cells; a cell is absent where no algorithm has these values.
    pub rows: Vec<(String, Vec<Option<HeatCell>>)>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeatCell {
    /// Label of the algorithm.
    pub label: String,
    pub text: String,
    /// 0 for the worst, 1 for the best.
    pub place: f64,
    pub is_best: bool,
}

/// Height of a row.
const ROW: i32 = 56;
/// Room between cells.
const GAP: i32 = 4;
/// Most room for the values of the rows.
const MAX_NAMES: i32 = 300;
const SIZE: u32 = TEXT - 2;

impl HeatGrid {
    /// The plot as an SVG document.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the drawing library.
    pub fn svg(&self) -> Result<String> {
        let height = TITLE + ROW * (2 + self.rows.len() as i32) + GAP;
        svg(height as u32, &self.title, |canvas| {
            draw_title(canvas, &self.title)?;
            self.draw(canvas)
        })
    }

    fn draw(&self, canvas: &PlotCanvas) -> std::result::Result<(), DrawError> {
        let names = self.rows.iter().map(|(name, _)| name).chain([&self.down]);
        let names = names.map(|name| text_width(name, SIZE)).max();
        let names = names.unwrap_or(0).min(MAX_NAMES) + 24;
        let width = (WIDTH as i32 - names - GAP) / self.columns.len().max(1) as i32;
        // Many columns have small texts.
        let texts = self
            .rows
            .iter()
            .flat_map(|(_, cells)| cells.iter().flatten());
        let texts = texts.map(|cell| &cell.text).chain(&self.columns);
        let widest = texts.map(|text| text_width(text, SIZE)).max().unwrap_or(0) + 8;
        let size = (SIZE as i32 * width.min(widest) / widest) as u32;
        let write = |words: &str, (x, y): (i32, i32), h: HPos, size: u32| {
            let style = text(size).pos(Pos::new(h, VPos::Center));
            canvas.draw(&Text::new(words.to_owned(), (x, y), style))
        };
        let middle = names + width * self.columns.len() as i32 / 2;
        write(&self.across, (middle, TITLE + ROW / 2), HPos::Center, SIZE)?;
        let head = TITLE + ROW;
        write(&self.down, (names - 16, head + ROW / 2), HPos::Right, SIZE)?;
        let left = |column: usize| names + width * column as i32;
        for (column, value) in self.columns.iter().enumerate() {
            let place = (left(column) + width / 2, head + ROW / 2);
            write(value, place, HPos::Center, size)?;
        }
        for (row, (value, cells)) in self.rows.iter().enumerate() {
            let top = head + ROW * (row as i32 + 1);
            write(value, (names - 16, top + ROW / 2), HPos::Right, SIZE)?;
            for (column, cell) in cells.iter().enumerate() {
                let Some(cell) = cell else { continue };
                let x = left(column);
                let corners = [(x, top), (x + width - GAP, top + ROW - GAP)];
                let color = cell_color(cell.place);
                canvas.draw(&Rectangle::new(corners, color.filled()))?;
                if cell.is_best {
                    canvas.draw(&Rectangle::new(corners, BLACK.stroke_width(3)))?;
                }
                let place = (x + (width - GAP) / 2, top + (ROW - GAP) / 2);
                write(&cell.text, place, HPos::Center, size)?;
            }
        }
        Ok(())
    }
}

/// The colour of a cell, as the page mixes it.
fn cell_color(place: f64) -> RGBColor {
    let mixed = |color: [f64; 3], share: f64, base: [f64; 3]| {
        [0, 1, 2].map(|i| share * color[i] + (1.0 - share) * base[i])
    };
    let (right, wrong) = ([59.0, 130.0, 196.0], [217.0, 84.0, 30.0]);
    let base = mixed(wrong, 0.45 * (1.0 - place), [255.0; 3]);
    let [r, g, b] = mixed(right, 0.7 * place, base).map(|v| v.round() as u8);
    RGBColor(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_for_each_algorithm_and_the_best_is_framed() {
        let cell = |label: &str, place, is_best| {
            Some(HeatCell {
                label: label.into(),
                text: format!("{place:.1}"),
                place,
                is_best,
            })
        };
        let grid = HeatGrid {
            title: "t".into(),
            down: "p1".into(),
            across: "p2".into(),
            columns: vec!["5".into(), "20".into()],
            rows: vec![
                (
                    "1".into(),
                    vec![cell("a", 0.0, false), cell("b", 1.0, true)],
                ),
                ("2".into(), vec![None, cell("c", 0.5, false)]),
            ],
        };
        let svg = grid.svg().unwrap();
        let frames = svg.matches("fill=\"none\"").count();
        assert_eq!((svg.matches("<rect ").count(), frames), (4, 1), "{svg}");
        for place in [0.0, 0.5, 1.0] {
            let RGBColor(r, g, b) = cell_color(place);
            assert!(
                svg.contains(&format!("fill=\"#{r:02X}{g:02X}{b:02X}\"")),
                "{svg}"
            );
        }
        assert!(svg.contains("\np1\n") && svg.contains("\n0.5\n"), "{svg}");
        // Many columns fit.
        let columns: Vec<_> = (0..100).map(|i| i.to_string()).collect();
        HeatGrid { columns, ..grid }.svg().unwrap();
        HeatGrid::default().svg().unwrap();
    }
}
