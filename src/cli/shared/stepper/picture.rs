//! A grey image in characters: two pixels of shades in each, or one by a character as dark.

use super::Key::{self, Press};
use super::ToolCanvas;
use ratatui::buffer::Buffer;
use ratatui::crossterm::event::KeyCode::{Down, Left, Right, Up};
use ratatui::layout::{Position, Rect, Size};
use ratatui::style::{Color, Style};
use ratatui::widgets::{Block, BorderType, Paragraph, Widget, Wrap};
use svl::stereo::{Gray, GridShape};

/// From dark to light.
const RAMP: [char; 10] = [' ', '.', ':', '-', '=', '+', '*', '#', '%', '@'];

/// Width of the text beside an image, characters.
const PANEL: u16 = 28;

/// The largest size, in characters about twice as high as wide, in which an image of `width` x
/// `height` pixels keeps its proportions within `room`.
pub(crate) fn fitting((width, height): (usize, usize), room: Size) -> Size {
    let (width, height) = (width.max(1) as f64, height.max(1) as f64);
    let (columns, rows) = (f64::from(room.width), f64::from(room.height));
    let scale = (columns / width).min(2.0 * rows / height);
    let fit = |side: f64, most: u16| (side.round() as u16).clamp(most.min(1), most);
    Size::new(
        fit(width * scale, room.width),
        fit(height * scale / 2.0, room.height),
    )
}

/// Draws an image, and lines of text to its right; returns the place of the image.
pub(crate) fn draw_beside(lines: &[String], image: &Gray, canvas: &mut ToolCanvas<'_, '_>) -> Rect {
    let area = canvas.area;
    let room = Size::new(area.width.saturating_sub(PANEL), area.height);
    let place = Rect::from((area.as_position(), fitting(image.size(), room)));
    draw(image, place, canvas.shades, canvas.screen.buffer_mut());
    let left = place.right() + 1;
    let panel = Rect::new(left, area.y, area.right().saturating_sub(left), area.height);
    let words = Paragraph::new(lines.join("\n")).wrap(Wrap { trim: false });
    canvas.screen.render_widget(words, panel);
    place
}

/// Draws the whole image into `area`; without shades by characters.
pub(crate) fn draw(image: &Gray, area: Rect, shades: bool, buffer: &mut Buffer) {
    let area = area.intersection(buffer.area);
    let rows = area.height * if shades { 2 } else { 1 };
    let mean = |column: u16, row: u16| mean(image, (column, area.width), (row, rows));
    for y in 0..area.height {
        for x in 0..area.width {
            let cell = &mut buffer[(area.x + x, area.y + y)];
            if shades {
                let (top, bottom) = (mean(x, 2 * y), mean(x, 2 * y + 1));
                cell.set_char('▀')
                    .set_style(Style::new().fg(shade(top)).bg(shade(bottom)));
            } else {
                cell.set_char(RAMP[usize::from(mean(x, y)) * RAMP.len() / 256]);
            }
        }
    }
}

/// The cell of a grid on an image at `image` that a place on the screen is in.
pub(crate) fn cell_at(shape: GridShape, image: Rect, (x, y): (u16, u16)) -> Option<(usize, usize)> {
    shape
        .iter()
        .find(|&at| cell(shape, at, image).contains(Position::new(x, y)))
}

/// The part of an image at `image` that a cell of a grid covers.
pub(crate) fn cell(shape: GridShape, at: (usize, usize), image: Rect) -> Rect {
    let (x, y) = shape.pixels(at, (image.width.into(), image.height.into()));
    let (column, row) = (image.x + x.start as u16, image.y + y.start as u16);
    Rect::new(column, row, x.len() as u16, y.len() as u16)
}

/// The cell of a grid beside another one, in the direction of an arrow.
pub(crate) fn beside(
    GridShape { columns, rows }: GridShape,
    (column, row): (usize, usize),
    arrow: Key,
) -> (usize, usize) {
    match arrow {
        Press(Left) => (column.saturating_sub(1), row),
        Press(Right) => ((column + 1).min(columns - 1), row),
        Press(Up) => (column, row.saturating_sub(1)),
        Press(Down) => (column, (row + 1).min(rows - 1)),
        _ => (column, row),
    }
}

/// The places along the border of a part of the screen, each with its line.
pub(crate) fn border(part: Rect) -> impl Iterator<Item = (Position, String)> {
    let mut drawn = Buffer::empty(part);
    let block = Block::bordered().border_type(BorderType::Thick);
    block.render(part, &mut drawn);
    let places = part.positions();
    let lines = places.map(move |at| (at, drawn[at].symbol().to_owned()));
    lines.filter(|(_, line)| line != " ")
}

/// One of the 24 greys that every terminal of 256 colours has.
fn shade(grey: u8) -> Color {
    Color::Indexed(232 + (u16::from(grey) * 24 / 256) as u8)
}

/// Mean of the pixels that fall into part `column` of `columns`, and `row` of `rows`.
fn mean(image: &Gray, (column, columns): (u16, u16), (row, rows): (u16, u16)) -> u8 {
    let range = |part: u16, parts: u16, side: usize| {
        let [from, to] = [part, part + 1].map(|end| usize::from(end) * side / usize::from(parts));
        from..to.max(from + 1)
    };
    let x = range(column, columns, image.width());
    let rows = range(row, rows, image.height()).map(|y| &image.row(y)[x.clone()]);
    let (sum, count) = rows.flatten().fold((0, 0), |(sum, count), pixel| {
        (sum + usize::from(*pixel), count + 1)
    });
    (sum / count) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_keeps_its_proportions() {
        assert_eq!(fitting((320, 240), Size::new(80, 20)), Size::new(53, 20));
        assert_eq!(fitting((1242, 375), Size::new(53, 20)), Size::new(53, 8));
        assert_eq!(fitting((1, 16_384), Size::new(80, 20)), Size::new(1, 20));
        assert_eq!(fitting((320, 240), Size::new(0, 0)), Size::new(0, 0));
    }

    #[test]
    fn characters_are_as_light_as_their_pixels() {
        let image = Gray::from_fn(8, 4, |x, _| if x < 4 { 0 } else { 255 }).unwrap();
        let mut buffer = Buffer::empty(Rect::new(0, 0, 4, 1));
        draw(&image, buffer.area, false, &mut buffer);
        assert_eq!(buffer, Buffer::with_lines(["  @@"]));
        draw(&image, buffer.area, true, &mut buffer);
        let colors: Vec<_> = buffer.content().iter().map(|cell| cell.fg).collect();
        assert_eq!(colors, [232, 232, 255, 255].map(Color::Indexed));
    }

    #[test]
    fn every_place_of_the_image_is_in_one_cell() {
        let shape = GridShape::default();
        let image = Rect::new(3, 1, 53, 20);
        assert_eq!(cell_at(shape, image, (3, 1)), Some((0, 0)));
        assert_eq!(cell_at(shape, image, (55, 20)), Some((4, 2)));
        assert_eq!(cell_at(shape, image, (56, 20)), None);
        assert_eq!(cell_at(shape, image, (2, 1)), None);
        let cells = shape
            .iter()
            .map(|at| cell(shape, at, image).area())
            .sum::<u32>();
        assert_eq!(cells, image.area());
    }
}
