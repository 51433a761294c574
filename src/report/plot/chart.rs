//! Lines and points over two axes.

use super::key::PlotKey;
use super::ticks::{linear_ticks, log_ticks};
use super::{
    AXIS, AlgorithmColors, DrawError, PlotCanvas, Series, SeriesStyle, TEXT, TITLE, WIDTH, color,
    draw_title, labels, svg, text,
};
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use svl_core::Result;

/// A plot of series over common axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
}

/// One axis: its quantity with unit, its scale and its range.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    pub label: String,
    /// Logarithmic; values of 0 and below are then omitted.
    pub log: bool,
    /// Ends of the axis, instead of those of the data.
    pub range: Option<(f64, f64)>,
    /// Bounds that no value can lie outside of.
    pub bounds: Option<(f64, f64)>,
}

pub(super) const HEIGHT: u32 = 640;

impl Axis {
    /// A linear axis over what the data span.
    pub fn new(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            ..Self::default()
        }
    }

    /// A linear axis of percentages of a whole.
    pub fn share(label: impl Into<String>) -> Self {
        Self {
            bounds: Some((0.0, 100.0)),
            ..Self::new(label)
        }
    }

    /// True if it has a place for a value.
    fn shows(&self, value: f64) -> bool {
        value.is_finite() && (value > 0.0 || !self.log)
    }

    /// Ends of the axis for `values`, with a little room at both; never empty.
    fn span(&self, values: impl Iterator<Item = f64>) -> (f64, f64) {
        if let Some(range) = self.range {
            return range;
        }
        let shown = values.filter(|&v| self.shows(v));
        let (low, high) = shown.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
        match (low <= high, self.log) {
            (false, _) => (0.1, 1.0),
            // A logarithmic axis has room by a factor.
            (true, true) => (low / 1.25, high * 1.25),
            (true, false) => {
                // A scale that nearly begins at zero begins there.
                let room = if high > low {
                    0.04 * (high - low)
                } else {
                    0.5 * high.abs().max(2.0)
                };
                let begin = if low >= 0.0 && low <= 0.25 * high {
                    0.0
                } else {
                    low - room
                };
                let (least, most) = self.bounds.unwrap_or((begin, high + room));
                (begin.max(least), (high + room).min(most))
            }
        }
    }
}

impl Chart {
    /// The plot as an SVG document.
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the drawing library.
    pub fn svg(&self) -> Result<String> {
        self.svg_in(&AlgorithmColors::new([]))
    }

    /// [`Chart::svg`] with the algorithms' colours for series named after them.
    ///
    /// # Errors
    /// The errors of [`Chart::svg`].
    pub fn svg_in(&self, colors: &AlgorithmColors<'_>) -> Result<String> {
        self.svg_named(colors, &|series, _| series.name.clone())
    }

    /// [`Chart::svg_in`] where the tooltip of a point begins with the name that `name` returns.
    ///
    /// # Errors
    /// The errors of [`Chart::svg`].
    pub fn svg_named(
        &self,
        colors: &AlgorithmColors<'_>,
        name: &dyn Fn(&Series, (f64, f64)) -> String,
    ) -> Result<String> {
        let points = || self.series.iter().flat_map(|s| &s.points);
        let x = TickedAxis::new(&self.x, || points().map(|p| p.0));
        let y = TickedAxis::new(&self.y, || points().map(|p| p.1));
        let key = PlotKey::new(
            self.series
                .iter()
                .zip(self.colors(colors))
                .filter(|(series, _)| series.is_keyed())
                .map(|(series, color)| (series.name.as_str(), color)),
        );
        let svg = svg(HEIGHT + key.height as u32, &self.title, |canvas| {
            let colors = self.colors(colors);
            let drawing = Drawing {
                canvas,
                key: &key,
                colors,
            };
            self.draw(drawing, x, y)
        })?;
        Ok(self.with_tips(&svg, name))
    }

    /// True if the point has a place.
    pub(super) fn shows(&self, (x, y): &(f64, f64)) -> bool {
        self.x.shows(*x) && self.y.shows(*y)
    }

    /// A colour per series: that of its algorithm, else by its place. Named series without an
    /// algorithm share the first.
    fn colors(&self, colors: &AlgorithmColors<'_>) -> Vec<RGBColor> {
        let named = usize::from(self.series.iter().any(|s| s.form == SeriesStyle::Named));
        let mut others = (named..).map(color);
        let own = |series: &Series| match series.form {
            SeriesStyle::Caption | SeriesStyle::Label | SeriesStyle::Front => AXIS,
            form => colors.color(&series.name).unwrap_or_else(|| match form {
                SeriesStyle::Named => color(0),
                _ => others.next().unwrap_or(AXIS),
            }),
        };
        self.series.iter().map(own).collect()
    }

    fn draw(
        &self,
        drawing: Drawing<'_, '_>,
        x: TickedAxis,
        y: TickedAxis,
    ) -> std::result::Result<(), DrawError> {
        let Drawing {
            canvas,
            key,
            colors,
        } = drawing;
        let mut builder = ChartBuilder::on(canvas);
        draw_title(canvas, &self.title)?;
        let title = if self.title.is_empty() { 0 } else { TITLE };
        let mut chart = builder
            .margin(12)
            .margin_top(12 + title + key.height)
            .margin_right(36)
            .x_label_area_size(84)
            .y_label_area_size(110)
            .build_cartesian_2d(x, y)?;
        chart
            .configure_mesh()
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .label_style(text(TEXT - 4))
            .axis_desc_style(text(TEXT))
            .axis_style(AXIS.stroke_width(2))
            .set_all_tick_mark_size(8)
            .bold_line_style(AXIS.mix(0.25))
            // No minor grid lines: they would be invisible at the size of a page.
            .light_line_style(AXIS.mix(0.0))
            .draw()?;
        for (series, color) in self.series.iter().zip(colors) {
            self.draw_series(&mut chart, series, color)?;
        }
        let shown = |p: &&(f64, f64)| self.shows(p);
        let place = |p: &(f64, f64)| chart.backend_coord(p);
        let (across, down) = chart.plotting_area().get_pixel_range();
        let bounds = [across.start + 6, down.start, WIDTH as i32, down.end];
        labels::write(canvas, &self.series, bounds, |p| {
            Some(p).filter(shown).map(place)
        })?;
        key.draw(canvas, title)
    }

    fn draw_series(
        &self,
        chart: &mut ChartContext<'_, SVGBackend<'_>, Cartesian2d<TickedAxis, TickedAxis>>,
        series: &Series,
        color: RGBColor,
    ) -> std::result::Result<(), DrawError> {
        let points = || series.points.iter().copied().filter(|p| self.shows(p));
        match series.form {
            SeriesStyle::Line | SeriesStyle::Both | SeriesStyle::Joined => {
                // A value without a place interrupts the line: joining its neighbours would invent
                // data.
                for run in series.points.split(|p| !self.shows(p)) {
                    let run = run.iter().copied();
                    chart.draw_series(LineSeries::new(run, color.stroke_width(4)))?;
                }
            }
            SeriesStyle::Front => {
                let line = DashedLineSeries::new(points(), 12, 10, color.stroke_width(3));
                chart.draw_series(line)?;
            }
            _ => {}
        }
        if let Some(radius) = series.form.radius() {
            chart.draw_series(points().map(|p| Circle::new(p, radius, color.filled())))?;
        }
        Ok(())
    }
}

/// An axis with its ends and its ticks. Plotters has a type per kind of axis.
struct TickedAxis {
    low: f64,
    high: f64,
    log: bool,
    ticks: Vec<f64>,
}

impl TickedAxis {
    fn new<I: Iterator<Item = f64>>(axis: &Axis, values: impl Fn() -> I) -> Self {
        let (low, high) = axis.span(values());
        let is_whole = || {
            values()
                .filter(|&v| axis.shows(v))
                .all(|v| v.fract() == 0.0)
        };
        let ticks = if axis.log {
            log_ticks(low, high)
        } else {
            linear_ticks(low, high, is_whole())
        };
        Self {
            low,
            high,
            log: axis.log,
            ticks,
        }
    }
}

impl Ranged for TickedAxis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let scaled = |v: f64| if self.log { v.ln() } else { v };
        let share = (scaled(*value) - scaled(self.low)) / (scaled(self.high) - scaled(self.low));
        from + (share * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for TickedAxis {
    fn format_ext(&self, value: &f64) -> String {
        number(*value)
    }
}

/// Canvas, key and colours of a chart.
struct Drawing<'a, 'b> {
    canvas: &'a PlotCanvas<'b>,
    key: &'a PlotKey<'a>,
    /// Colours of the series.
    colors: Vec<RGBColor>,
}

/// A tick's number, no longer than it must be.
pub(super) fn number(value: f64) -> String {
    let text = match value.abs() {
        v if v >= 100.0 => format!("{value:.0}"),
        v if v >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.4}"),
    };
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    // A tick just below zero rounds to -0.
    if text == "-0" {
        "0".into()
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        let series = Series {
            name: "v3 <&>".into(),
            form: SeriesStyle::Both,
            points,
        };
        Chart {
            title: "t".into(),
            x: Axis::new("x"),
            y: Axis::new("y"),
            series: vec![series],
        }
    }

    #[test]
    fn finite_points_are_drawn_and_texts_escaped() {
        let mut chart = chart(vec![
            (0.0, 1.0),
            (1.0, f64::NAN),
            (2.0, 3.0),
            (3.0, 4.0),
            (4.0, -1.0),
        ]);
        let circles = |chart: &Chart| chart.svg().unwrap().matches("<circle").count();
        assert_eq!(circles(&chart), 4);
        chart.y.log = true;
        assert_eq!(circles(&chart), 3);
        let svg = chart.svg().unwrap();
        assert!(svg.contains("v3 &lt;&amp;&gt;"), "{svg}");
        assert!(
            svg.starts_with("<svg class=\"plot\" role=\"img\" viewBox=\"0 0 960 684\""),
            "{svg}"
        );
    }

    #[test]
    fn names_stand_beside_points_and_in_no_key() {
        let series = |name: &str, form, x| Series {
            name: name.into(),
            form,
            points: vec![(x, 1.0), (x, f64::NAN)],
        };
        let series = vec![
            series("bm", SeriesStyle::Named, 1.0),
            series("sgm", SeriesStyle::Named, 1.0),
            series("0.4", SeriesStyle::Label, 2.0),
        ];
        let svg = Chart {
            series,
            ..Chart::default()
        }
        .svg()
        .unwrap();
        assert_eq!(
            ["<circle", "\nbm\n", "\nsgm\n", "\n0.4\n"].map(|t| svg.matches(t).count()),
            [2, 1, 1, 1]
        );
        // No frame of a key.
        assert!(!svg.contains("opacity=\"0.8\""), "{svg}");
    }

    #[test]
    fn shares_end_at_a_whole() {
        assert_eq!(Axis::share("%").span([100.0].into_iter()), (50.0, 100.0));
        assert_eq!(Axis::share("%").span([99.0, 90.0].into_iter()).1, 99.36);
    }

    #[test]
    fn counts_begin_at_zero_and_have_whole_ticks() {
        for values in [[0.0, 0.0], [0.0, 3.0]] {
            let axis = TickedAxis::new(&Axis::new("count"), || values.into_iter());
            assert_eq!(axis.low, 0.0);
            assert!(axis.ticks.len() > 1 && axis.ticks.iter().all(|t| t.fract() == 0.0));
        }
    }

    #[test]
    fn a_key_is_above_the_points() {
        let svg = chart(vec![(0.0, 1.0), (1.0, 2.0)]).svg().unwrap();
        let top = |text: &str| {
            let y = svg
                .split(text)
                .nth(1)?
                .split("y=\"")
                .nth(1)?
                .split('"')
                .next()?;
            y.parse::<i32>().ok()
        };
        // The square of the key, then the circles.
        let square = top("<rect x=\"0\"").unwrap_or_else(|| panic!("{svg}"));
        let circles = svg.split("cy=\"").skip(1);
        let highest = circles
            .filter_map(|c| c.split('"').next()?.parse::<i32>().ok())
            .min();
        assert!(highest > Some(square + 24), "{svg}");
    }

    #[test]
    fn a_value_without_room_is_left_out() {
        let label = |i: i32| Series {
            name: format!("value {i}"),
            form: SeriesStyle::Label,
            points: vec![(1.0, 1.0)],
        };
        let svg = Chart {
            series: (0..60).map(label).collect(),
            ..Chart::default()
        }
        .svg()
        .unwrap();
        assert!((2..9).contains(&svg.matches("\nvalue ").count()), "{svg}");
    }

    #[test]
    fn nothing_one_point_and_equal_points_have_axes() {
        for points in [
            vec![],
            vec![(1.0, 0.0)],
            vec![(2.0, 5.0), (2.0, 5.0)],
            vec![(f64::INFINITY, 1.0)],
        ] {
            for log in [false, true] {
                let mut chart = chart(points.clone());
                (chart.x.log, chart.y.log) = (log, log);
                chart.svg().unwrap();
            }
        }
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(
            [0.0, -0.0, 0.25, 3.5, 12.0, 1500.0, 0.00001].map(number),
            ["0", "0", "0.25", "3.5", "12", "1500", "0"]
        );
    }
}
