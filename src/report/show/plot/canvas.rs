//! A drawing in SVG, and the key of a plot.

use super::series::{TEXT, TITLE, WIDTH, text_width};
use quick_xml::escape::escape;
use std::fmt::Write;

/// A colour: red, green, blue.
pub(crate) type Color = [u8; 3];

/// A place: to the right, and down.
pub(crate) type Point = (i32, i32);

pub(crate) const BLACK: Color = [0; 3];

/// The side of a text that is at its place, and the shift that brings its middle or its top there.
pub(crate) type Anchor = (&'static str, &'static str);

pub(crate) const LEFT: Anchor = ("start", "0.5ex");
pub(crate) const RIGHT: Anchor = ("end", "0.5ex");
pub(crate) const MIDDLE: Anchor = ("middle", "0.5ex");
pub(crate) const TOP_LEFT: Anchor = ("start", "0.76em");
pub(crate) const BELOW: Anchor = ("middle", "0.76em");

/// A colour that fills, or that lines are drawn in.
#[derive(Clone, Copy)]
pub(crate) struct Paint {
    color: Color,
    opacity: f64,
    /// Width of lines; none fills.
    width: Option<u32>,
}

pub(crate) fn fill(color: Color, opacity: f64) -> Paint {
    Paint {
        color,
        opacity,
        width: None,
    }
}

pub(crate) fn line(color: Color, width: u32) -> Paint {
    Paint {
        width: Some(width),
        ..fill(color, 1.0)
    }
}

impl Paint {
    pub fn faint(self) -> Self {
        Self {
            opacity: 0.25,
            ..self
        }
    }

    /// True unless it is a line without a width.
    pub fn draws(self) -> bool {
        self.width != Some(0)
    }

    fn attributes(self) -> String {
        let color = hex(self.color);
        let (fill, stroke) = match self.width {
            None => (color.as_str(), "none"),
            Some(_) => ("none", color.as_str()),
        };
        let width = self.width.unwrap_or(1);
        let opacity = self.opacity;
        format!(
            "opacity=\"{opacity}\" fill=\"{fill}\" stroke=\"{stroke}\" stroke-width=\"{width}\""
        )
    }
}

pub(crate) fn hex([r, g, b]: Color) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

/// The elements so far.
#[derive(Default)]
pub(crate) struct Canvas(String);

impl Canvas {
    /// A canvas with a title in the middle of the top, unless it is empty.
    pub fn titled(title: &str) -> Self {
        let mut canvas = Self::default();
        if !title.is_empty() {
            canvas.text(title, (WIDTH as i32 / 2, 16), TEXT + 4, BELOW);
        }
        canvas
    }

    fn element(&mut self, element: &str, paint: Paint) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.0, "<{element} {}/>", paint.attributes());
    }

    /// Elements of a layer that a page may hide.
    pub fn layer(&mut self, name: &str, draw: impl FnOnce(&mut Self)) {
        let _ = writeln!(self.0, "<g data-layer=\"{}\">", escape(name));
        draw(self);
        self.0 += "</g>\n";
    }

    /// A rectangle between two corners.
    pub fn rectangle(&mut self, [(x, y), (right, bottom)]: [Point; 2], paint: Paint) {
        let (width, height) = (right - x, bottom - y);
        let place = format!("x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"");
        self.element(&format!("rect {place}"), paint);
    }

    /// A line through points; dashed with gaps.
    pub fn path(&mut self, points: impl IntoIterator<Item = Point>, paint: Paint, dashes: &str) {
        let points = points.into_iter().map(|(x, y)| format!("{x},{y}"));
        let points = points.collect::<Vec<_>>().join(" ");
        let dashes = match dashes {
            "" => String::new(),
            dashes => format!(" stroke-dasharray=\"{dashes}\""),
        };
        let shape = if paint.width.is_some() {
            "polyline"
        } else {
            "polygon"
        };
        self.element(&format!("{shape} points=\"{points}\"{dashes}"), paint);
    }

    /// A circle; `tip` is shown at the pointer, and read by screen readers.
    pub fn circle(&mut self, (x, y): Point, radius: u32, paint: Paint, tip: &str) {
        let (paint, tip) = (paint.attributes(), escape(tip));
        let circle = format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" {paint}");
        let _ = match &*tip {
            "" => writeln!(self.0, "{circle}/>"),
            tip => writeln!(self.0, "{circle}><title>{tip}</title></circle>"),
        };
    }

    pub fn text(&mut self, words: &str, at: Point, size: u32, anchor: Anchor) {
        self.turned_text(words, at, size, anchor, "");
    }

    /// A text that runs upwards.
    pub fn upward_text(&mut self, words: &str, (x, y): Point, size: u32) {
        let turn = format!(" transform=\"rotate(270, {x}, {y})\"");
        self.turned_text(words, (x, y), size, BELOW, &turn);
    }

    fn turned_text(&mut self, words: &str, (x, y): Point, size: u32, anchor: Anchor, turn: &str) {
        // The height of letters in place of that of lines.
        let size = f64::from(size) / 1.24;
        let (words, (side, shift)) = (escape(words), anchor);
        let _ = writeln!(
            self.0,
            "<text x=\"{x}\" y=\"{y}\" dy=\"{shift}\" text-anchor=\"{side}\" \
             font-family=\"sans-serif\" font-size=\"{size:.1}\" fill=\"#000000\"{turn}>\n\
             {words}\n</text>"
        );
    }

    /// The document. Sizes let the page decide; `viewBox` keeps the proportions.
    pub fn svg(self, height: i32) -> String {
        let elements = self.0;
        format!(
            "<svg class=\"plot\" role=\"img\" viewBox=\"0 0 {WIDTH} {height}\" \
             xmlns=\"http://www.w3.org/2000/svg\">\n{elements}</svg>\n"
        )
    }
}

/// Height of the title above a plot, or of the margin without one.
pub(crate) fn title_height(title: &str, margin: i32) -> i32 {
    if title.is_empty() { margin } else { TITLE }
}

/// Height of a line of the key.
const LINE: i32 = 44;
const SIZE: u32 = TEXT - 2;

/// The key of a plot: squares of colour with names, in lines above the drawing.
pub(crate) struct PlotKey<'a> {
    entries: Vec<(&'a str, Color, Point)>,
    /// Height of all lines; 0 without names.
    pub height: i32,
}

impl<'a> PlotKey<'a> {
    pub fn new(names: impl Iterator<Item = (&'a str, Color)>) -> Self {
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
    pub fn draw(&self, canvas: &mut Canvas, top: i32) {
        for (name, color, (x, y)) in &self.entries {
            let (x, y) = (*x, y + top);
            canvas.rectangle([(x, y), (x + 24, y + 24)], fill(*color, 1.0));
            canvas.text(name, (x + 34, y + 12), SIZE, LEFT);
        }
    }
}
