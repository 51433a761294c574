//! The screen while labelling: the left image with the grid over it, and beside it the
//! checkpoint.

use super::Labelling;
use crate::cli::shared::stepper::{ToolCanvas, picture};
use ratatui::buffer::Buffer;
use ratatui::layout::{Margin, Rect};
use ratatui::style::{Color, Style};
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
    for at in cell.positions() {
        let is_top = row > 0 && at.y == cell.top();
        let line = match (is_top, column > 0 && at.x == cell.left()) {
            (true, true) => "┼",
            (true, false) => "─",
            (false, true) => "│",
            (false, false) => continue,
        };
        let style = Style::reset().fg(Color::Gray);
        buffer[at].set_symbol(line).set_style(style);
    }
}

/// The cell that is picked, all around.
fn outline(cell: Rect, buffer: &mut Buffer) {
    let is_roomy = cell.width > 2 && cell.height > 2;
    for (at, line) in picture::border(cell) {
        // Text in a cell of few characters stays.
        if is_roomy || buffer[at].symbol() == "│" {
            let style = Style::reset().fg(Color::Yellow).bold();
            buffer[at].set_symbol(&line).set_style(style);
        } else {
            buffer[at].set_style(Style::new().reversed());
        }
    }
}

/// The label, and below it the report of the algorithm.
fn texts(tool: &Labelling, at: (usize, usize), cell: Rect, buffer: &mut Buffer) {
    let label = tool.draft.label(at.into()).map(String::from);
    let label = label.map(|text| (text, Style::reset().fg(Color::Green).bold()));
    let reported = tool.reported.as_ref().map(|reported| {
        let [mark, _] = mark(tool.verdict(at));
        (reported.words(at) + mark, Style::reset())
    });
    // Within the outline, where there is room for it.
    let inset = |side: u16| u16::from(side > 2);
    let inner = cell.inner(Margin::new(inset(cell.width), inset(cell.height)));
    let rows = inner.top()..inner.bottom();
    for ((text, style), y) in label.into_iter().chain(reported).zip(rows) {
        buffer.set_stringn(inner.x, y, text, inner.width.into(), style);
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
    let label = label.map_or("not labelled".to_owned(), |label| {
        format!("labelled {label}")
    });
    let mut lines = vec![
        format!("checkpoint {}: {name}", tool.file.next_number()),
        format!("frames {first} to {last}"),
        format!("{} labelled", counted(tool.draft.cells.len(), "cell")),
        String::new(),
        format!("cell ({column}, {row})"),
        format!("  {label}"),
    ];
    if let Some(reported) = &tool.reported {
        let [_, word] = mark(tool.verdict(tool.picked));
        let words = reported.words(tool.picked);
        lines.push(format!("  {} {words} {word}", reported.label));
    }
    let others = tool.others(frame);
    if !others.is_empty() {
        lines.extend(["", "written for this frame:"].map(str::to_owned));
        lines.extend(others.iter().map(|other| format!("  {other}")));
    }
    let keys = [
        "",
        "arrows pick, 0.43 metres",
        "= words, f free, x clear",
        "[ ] frames, n name, w write",
    ];
    lines.extend(keys.map(str::to_owned));
    lines
}
