//! Plots as SVG: what reports and the thesis's figures are drawn with.
//!
//! A page that holds them styles them: axes and texts take the page's colours through the class
//! `plot`.

mod bars;
mod chart;
mod columns;
mod distance;
mod labels;
mod map;
mod strips;

pub use bars::Bars;
pub use chart::{Axis, Chart};
pub use columns::two_columns;
pub use distance::distance_chart;
pub use map::{CourseMap, MapWay};
pub use strips::Strips;

use plotters::prelude::*;
use plotters::style::FontFamily;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use svl_core::{Error, Result};

/// Ticks of a logarithmic axis from `low` to `high`: at the powers of ten where it spans
/// many, else at their 1, 2 and 5, in a narrow range at more digits.
fn log_ticks(low: f64, high: f64) -> Vec<f64> {
    let decades = || low.log10().floor() as i32..=high.log10().ceil() as i32;
    let within = |digits: &[f64]| -> Vec<f64> {
        let ticks = decades().flat_map(|d| digits.iter().map(move |digit| digit * 10f64.powi(d)));
        ticks.filter(|t| (low..=high).contains(t)).collect()
    };
    if decades().count() > 4 {
        return within(&[1.0]);
    }
    // The halves and tenths: 1.0, 1.1, …
    let tenths: Vec<_> = (10..100).map(|i| f64::from(i) / 10.0).collect();
    let finer = [
        &[1.0, 2.0, 5.0][..],
        &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0],
        &[
            1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0,
        ],
    ];
    let enough = |ticks: &Vec<f64>| ticks.len() >= 3;
    let found = finer.into_iter().map(within).find(enough);
    found.unwrap_or_else(|| {
        let ticks = within(&tenths);
        let every = ticks.len().div_ceil(8).max(1);
        ticks.into_iter().step_by(every).collect()
    })
}

/// Points under one name. What is not finite is omitted and interrupts a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    pub name: String,
    pub form: SeriesStyle,
    pub points: Vec<(f64, f64)>,
}

/// Style of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SeriesStyle {
    Line,
    Points,
    /// Points joined by lines.
    Both,
    /// Points with the series' name beside each, which then stands in no key; all such series have
    /// one colour.
    Named,
    /// The name alone beside each point: the caption of another series, in place of a key.
    Caption,
    /// As a caption, where there is room: the label of a point of another series.
    Label,
}

/// Width of every plot in the SVG's own units, which are whole; a page scales it, to between a
/// third and two thirds of a pixel each: on a phone and on paper the texts are still texts.
const WIDTH: u32 = 960;

/// Text size in the same units.
const TEXT: u32 = 30;

/// Grid and axes; the page's style replaces it.
const AXIS: RGBColor = RGBColor(0x80, 0x80, 0x80);

/// Colours that remain apart for the colour-blind (Okabe and Ito, "Color Universal Design", 2008),
/// without the yellow that white paper swallows.
const COLORS: [RGBColor; 7] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x80, 0x80, 0x80),
];

/// Colour of the `i`-th series; they repeat after seven.
fn color(i: usize) -> RGBColor {
    COLORS[i % COLORS.len()]
}

fn text<'a>(size: u32) -> TextStyle<'a> {
    (FontFamily::SansSerif, size).into_font().color(&BLACK)
}

/// Approximate width of a text in sans-serif fonts; the browser picks the font.
fn text_width(text: &str, size: u32) -> i32 {
    (0.56 * f64::from(size) * text.chars().count() as f64).ceil() as i32
}

/// A title in the middle of the top, as charts have it.
fn draw_title(canvas: &PlotCanvas, title: &str) -> std::result::Result<(), DrawError> {
    let style = text(TEXT + 4).pos(Pos::new(HPos::Center, VPos::Top));
    canvas.draw(&Text::new(title, (WIDTH as i32 / 2, 16), style))
}

/// Draws on an empty canvas of `height` and returns the SVG.
fn svg(
    height: u32,
    title: &str,
    draw: impl FnOnce(&PlotCanvas) -> std::result::Result<(), DrawError>,
) -> Result<String> {
    let mut svg = String::new();
    let canvas = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
    let drawn = draw(&canvas).and_then(|()| canvas.present());
    // The canvas borrows the text that it draws into.
    drop(canvas);
    drawn.map_err(|e| Error::Invalid(format!("plot '{title}': {e}")))?;
    // Sizes in percent let the page decide; `viewBox` keeps the proportions.
    Ok(svg.replacen(
        &format!("width=\"{WIDTH}\" height=\"{height}\""),
        "class=\"plot\" role=\"img\"",
        1,
    ))
}

type PlotCanvas<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type DrawError = DrawingAreaErrorKind<<SVGBackend<'static> as DrawingBackend>::ErrorType>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithmic_axes_have_some_ticks_and_not_many() {
        assert_eq!(log_ticks(0.3, 12.0), [0.5, 1.0, 2.0, 5.0, 10.0]);
        assert_eq!(
            log_ticks(0.5, 20_000.0),
            [1.0, 10.0, 100.0, 1000.0, 10_000.0]
        );
        assert_eq!(log_ticks(1.3, 4.5), [1.5, 2.0, 3.0, 4.0]);
        assert_eq!(log_ticks(1.33, 1.72), [1.4, 1.5, 1.6, 1.7]);
        assert_eq!(log_ticks(0.72, 1.125), [0.8, 0.9, 1.0]);
    }
}
