//! The screen while labelling: the left image with the grid over it, and beside it the
//! checkpoint.

use super::tool::Labelling;
use crate::cli::shared::stepper::{ToolCanvas, picture};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use svl::counted;
use svl::score::Verdict;
use svl::stereo::Frame;

/// Draws it all. Returns where the image is.
pub(super) fn draw(tool: &Labelling, frame: &Frame, canvas: &mut ToolCanvas<'_, '_>) -> Rect {
    let lines = lines(tool, frame);
    let image = picture::draw_beside(&lines, frame.pair.left(), canvas);
    let buffer = canvas.screen.buffer_mut();
    let shape = tool.shape();
    for at in shape.iter() {
        let cell = picture::cell(shape, at, image);
        border(cell, at, buffer);
        texts(tool, at, cell, buffer);
    }
    outline(picture::cell(shape, tool.picked, image), buffer);
    image
}

/// A line left of a cell and one above it, but not around the image.
fn border(cell: Rect, (column, row): (usize, usize), buffer: &mut Buffer) {
    let style = Style::reset().fg(Color::Gray);
    let mut set = |x: u16, y: u16, line: &str| {
        if let Some(cell) = buffer.cell_mut((x, y)) {
            cell.set_symbol(line).set_style(style);
        }
    };
    if row > 0 {
        (cell.left()..cell.right()).for_each(|x| set(x, cell.y, "─"));
    }
    if column > 0 {
        (cell.top()..cell.bottom()).for_each(|y| set(cell.x, y, "│"));
    }
    if row > 0 && column > 0 {
        set(cell.x, cell.y, "┼");
    }
}

/// The cell that is picked, all around.
fn outline(cell: Rect, buffer: &mut Buffer) {
    let style = Style::reset()
        .fg(Color::Yellow)
        .add_modifier(Modifier::BOLD);
    let is_roomy = cell.width > 2 && cell.height > 2;
    for (at, line) in picture::border(cell) {
        // Text in a cell of few characters stays.
        if let Some(place) = buffer.cell_mut(at)
            && (is_roomy || place.symbol() == "│")
        {
            place.set_symbol(line).set_style(style);
        } else if let Some(place) = buffer.cell_mut(at) {
            place.set_style(Style::new().add_modifier(Modifier::REVERSED));
        }
    }
}

/// The label, and below it the report of the algorithm.
fn texts(tool: &Labelling, at: (usize, usize), cell: Rect, buffer: &mut Buffer) {
    let label = tool.draft.label(at.into()).map(String::from);
    let reported = tool.reported.as_ref().map(|reported| {
        let [mark, _] = mark(tool.verdict(at));
        reported.words(at) + mark
    });
    let bold = Style::reset().add_modifier(Modifier::BOLD).fg(Color::Green);
    let texts = label.map(|text| (text, bold)).into_iter();
    let texts = texts.chain(reported.map(|text| (text, Style::reset())));
    // Within the outline, where there is room for it.
    let inset = |side: u16| u16::from(side > 2);
    let (x, y) = (cell.x + inset(cell.width), cell.y + inset(cell.height));
    let bottom = cell.bottom().saturating_sub(inset(cell.height));
    let width = usize::from(cell.width.saturating_sub(2 * inset(cell.width)));
    for ((text, style), y) in texts.zip(y..bottom) {
        buffer.set_stringn(x, y, text, width, style);
    }
}

/// A result as a mark, as in the tables of `svl score`, and in a word.
fn mark(verdict: Option<Verdict>) -> [&'static str; 2] {
    match verdict {
        Some(Verdict::Right) => ["✓", "right"],
        Some(Verdict::Wrong) => ["✗", "wrong"],
        Some(Verdict::Unknown) => ["✗", "missing"],
        Some(Verdict::NoTruth) | None => ["", ""],
    }
}

/// The text beside the image.
fn lines(tool: &Labelling, frame: &Frame) -> Vec<String> {
    let [first, last] = tool.draft.frames(frame.sequence);
    let name = match tool.draft.name.as_str() {
        "" => "no name yet",
        name => name,
    };
    let (column, row) = tool.picked;
    let label = tool.draft.label([column, row]);
    let mut lines = vec![
        format!("checkpoint {}: {name}", tool.file.next_number()),
        format!("frames {first} to {last}"),
        format!("{} labelled", counted(tool.draft.cells.len(), "cell")),
        String::new(),
        format!("cell ({column}, {row})"),
        label.map_or("  not labelled".to_owned(), |label| {
            format!("  labelled {label}")
        }),
    ];
    if let Some(reported) = &tool.reported {
        let [_, word] = mark(tool.verdict(tool.picked));
        let words = reported.words(tool.picked);
        lines.push(format!("  {} {words} {word}", reported.label()));
    }
    let others = tool.others(frame);
    if !others.is_empty() {
        lines.push(String::new());
        lines.push("written for this frame:".to_owned());
        lines.extend(others.iter().map(|other| format!("  {other}")));
    }
    lines.push(String::new());
    let keys = [
        "arrows pick, 0.43 metres",
        "= words, f free, x clear",
        "[ ] frames, n name, w write",
    ];
    lines.extend(keys.map(str::to_owned));
    lines
}
