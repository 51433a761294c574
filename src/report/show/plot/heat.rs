//! A heat map: a number over the values of two parameters.

use super::canvas::{Anchor, BLACK, Canvas, Color, MIDDLE, RIGHT, fill, line};
use super::series::{TEXT, TITLE, WIDTH, text_width};
use serde::Serialize;

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
    pub fn svg(&self) -> String {
        let names = self.rows.iter().map(|(name, _)| name).chain([&self.down]);
        let names = names.map(|name| text_width(name, SIZE)).max();
        let names = names.unwrap_or(0).min(MAX_NAMES) + 24;
        let width = (WIDTH as i32 - names - GAP) / self.columns.len().max(1) as i32;
        // Many columns have small texts.
        let cells = self.rows.iter();
        let cells = cells.flat_map(|(_, cells)| cells.iter().flatten());
        let texts = cells.map(|cell| &cell.text).chain(&self.columns);
        let widest = texts.map(|text| text_width(text, SIZE)).max().unwrap_or(0) + 8;
        let size = (SIZE as i32 * width.min(widest) / widest) as u32;
        let mut canvas = Canvas::titled(&self.title);
        let mut write = |words: &str, x: i32, row: i32, size: u32, anchor: Anchor| {
            canvas.text(words, (x, TITLE + ROW * row + ROW / 2), size, anchor);
        };
        let left = |column: usize| names + width * column as i32;
        let middle = (names + left(self.columns.len())) / 2;
        write(&self.across, middle, 0, SIZE, MIDDLE);
        write(&self.down, names - 16, 1, SIZE, RIGHT);
        for (column, value) in self.columns.iter().enumerate() {
            write(value, left(column) + width / 2, 1, size, MIDDLE);
        }
        for ((value, cells), row) in self.rows.iter().zip(2..) {
            let top = TITLE + ROW * row;
            canvas.text(value, (names - 16, top + ROW / 2), SIZE, RIGHT);
            let cells = cells.iter().enumerate();
            for (x, cell) in cells.filter_map(|(i, cell)| Some((left(i), cell.as_ref()?))) {
                let corners = [(x, top), (x + width - GAP, top + ROW - GAP)];
                canvas.rectangle(corners, fill(cell_color(cell.place), 1.0));
                if cell.is_best {
                    canvas.rectangle(corners, line(BLACK, 3));
                }
                let place = (x + (width - GAP) / 2, top + (ROW - GAP) / 2);
                canvas.text(&cell.text, place, size, MIDDLE);
            }
        }
        canvas.svg(TITLE + ROW * (2 + self.rows.len() as i32) + GAP)
    }
}

/// The colour of a cell, as the page mixes it.
fn cell_color(place: f64) -> Color {
    let mixed = |color: [f64; 3], share: f64, base: [f64; 3]| {
        [0, 1, 2].map(|i| share * color[i] + (1.0 - share) * base[i])
    };
    let (right, wrong) = ([59.0, 130.0, 196.0], [217.0, 84.0, 30.0]);
    let base = mixed(wrong, 0.45 * (1.0 - place), [255.0; 3]);
    mixed(right, 0.7 * place, base).map(|v| v.round() as u8)
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
        let svg = grid.svg();
        let frames = svg.matches("fill=\"none\"").count();
        assert_eq!((svg.matches("<rect ").count(), frames), (4, 1), "{svg}");
        for place in [0.0, 0.5, 1.0] {
            let color = super::super::canvas::hex(cell_color(place));
            assert!(svg.contains(&format!("fill=\"{color}\"")), "{svg}");
        }
        assert!(svg.contains("\np1\n") && svg.contains("\n0.5\n"), "{svg}");
        // Many columns fit.
        let columns: Vec<_> = (0..100).map(|i| i.to_string()).collect();
        HeatGrid { columns, ..grid }.svg();
        HeatGrid::default().svg();
    }
}
