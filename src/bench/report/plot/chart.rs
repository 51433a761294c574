//! Lines and points over two axes.

use super::{
    AXIS, DrawError, PlotCanvas, Series, SeriesStyle, TEXT, WIDTH, color, labels, log_ticks, svg,
    text,
};
use plotters::coord::combinators::BindKeyPoints;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
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

/// One axis: what it shows, with its unit, and how.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    pub label: String,
    /// Logarithmic; values of 0 and below are then omitted.
    pub log: bool,
    /// From where to where, instead of what the data span.
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

    /// From where to where, for `values`, with a little room at both ends; never empty.
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
                    0.5 * high.abs().max(1.0)
                };
                let begin = if low >= 0.0 && low < 0.25 * high {
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
    /// [`svl_core::Error::Invalid`] with what the drawing library says.
    pub fn svg(&self) -> Result<String> {
        let points = || self.series.iter().flat_map(|s| &s.points);
        let (x0, x1) = self.x.span(points().map(|p| p.0));
        let (y0, y1) = self.y.span(points().map(|p| p.1));
        let log = |low: f64, high: f64| {
            let axis = (low..high).log_scale();
            axis.with_key_points(log_ticks(low, high))
        };
        svg(HEIGHT, &self.title, |canvas| {
            // Plotters has a type per kind of axis, so each combination is its own call.
            match (self.x.log, self.y.log) {
                (false, false) => self.draw(canvas, x0..x1, y0..y1),
                (true, false) => self.draw(canvas, log(x0, x1), y0..y1),
                (false, true) => self.draw(canvas, x0..x1, log(y0, y1)),
                (true, true) => self.draw(canvas, log(x0, x1), log(y0, y1)),
            }
        })
    }

    fn draw<X, Y>(&self, canvas: &PlotCanvas, x: X, y: Y) -> std::result::Result<(), DrawError>
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        let mut builder = ChartBuilder::on(canvas);
        if !self.title.is_empty() {
            builder.caption(&self.title, text(TEXT + 4));
        }
        let mut chart = builder
            .margin(12)
            .margin_right(36)
            .x_label_area_size(84)
            .y_label_area_size(110)
            .build_cartesian_2d(x, y)?;
        let number = |v: &f64| number(*v);
        chart
            .configure_mesh()
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .x_labels(8)
            .y_labels(8)
            .label_style(text(TEXT - 4))
            .axis_desc_style(text(TEXT))
            .axis_style(AXIS.stroke_width(2))
            .set_all_tick_mark_size(8)
            .bold_line_style(AXIS.mix(0.25))
            // No minor grid lines: they would be invisible at the size of a page.
            .light_line_style(AXIS.mix(0.0))
            .x_label_formatter(&number)
            .y_label_formatter(&number)
            .draw()?;
        let shown = |p: &&(f64, f64)| self.x.shows(p.0) && self.y.shows(p.1);
        let keyed = |s: &&Series| {
            !s.name.is_empty()
                && matches!(
                    s.form,
                    SeriesStyle::Line | SeriesStyle::Points | SeriesStyle::Both
                )
        };
        // Named series share the first colour, so the others begin at the second.
        let named = usize::from(self.series.iter().any(|s| s.form == SeriesStyle::Named));
        let mut colors = (named..).map(color);
        for series in self
            .series
            .iter()
            .filter(|s| !matches!(s.form, SeriesStyle::Caption | SeriesStyle::Label))
        {
            let color = if series.form == SeriesStyle::Named {
                color(0)
            } else {
                colors.next().unwrap_or(AXIS)
            };
            let symbol = series.form != SeriesStyle::Line;
            if matches!(series.form, SeriesStyle::Line | SeriesStyle::Both) {
                // A value without a place interrupts the line: joining its neighbours would invent
                // data.
                for run in series.points.split(|p| !shown(&p)) {
                    chart
                        .draw_series(LineSeries::new(run.iter().copied(), color.stroke_width(4)))?;
                }
            }
            let marks = series.points.iter().filter(shown).filter(|_| symbol);
            let marks = chart.draw_series(marks.map(|&p| Circle::new(p, 8, color.filled())))?;
            if keyed(&series) {
                marks.label(&series.name).legend(move |(x, y)| {
                    let size = if symbol { 10 } else { 3 };
                    Rectangle::new([(x, y - size), (x + 28, y + size)], color.filled())
                });
            }
        }
        let place = |p: &(f64, f64)| chart.backend_coord(p);
        let (across, down) = chart.plotting_area().get_pixel_range();
        let bounds = [across.start, down.start, WIDTH as i32, down.end];
        labels::write(canvas, &self.series, bounds, |p| {
            Some(p).filter(shown).map(place)
        })?;
        if self.series.iter().any(|s| keyed(&s)) {
            let drawn = self
                .series
                .iter()
                .flat_map(|s| &s.points)
                .filter(shown)
                .map(place);
            let corner = emptiest(&drawn.collect::<Vec<_>>());
            chart
                .configure_series_labels()
                .position(corner)
                .legend_area_size(48)
                .label_font(text(TEXT - 4))
                .border_style(AXIS.mix(0.4))
                .background_style(WHITE.mix(0.8))
                .draw()?;
        }
        Ok(())
    }
}

/// The corner of the plot with the fewest points, where the key hides least.
fn emptiest(points: &[(i32, i32)]) -> SeriesLabelPosition {
    use SeriesLabelPosition::{LowerLeft, LowerRight, UpperLeft, UpperRight};
    let (x, y) = (WIDTH as i32 / 2, HEIGHT as i32 / 2);
    let in_corner = |right: bool, lower: bool| {
        points
            .iter()
            .filter(|p| (p.0 > x) == right && (p.1 > y) == lower)
            .count()
    };
    let corners = [
        (true, false, UpperRight),
        (false, false, UpperLeft),
        (true, true, LowerRight),
        (false, true, LowerLeft),
    ];
    let corner = corners
        .into_iter()
        .min_by_key(|&(right, lower, _)| in_corner(right, lower));
    corner.map_or(UpperRight, |(.., position)| position)
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
    fn draws_what_has_a_place_and_escapes_texts() {
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
            svg.starts_with("<svg class=\"plot\" role=\"img\" viewBox=\"0 0 960 640\""),
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
