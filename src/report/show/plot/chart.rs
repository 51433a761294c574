//! Lines and points over two axes.

use super::canvas::{BELOW, Canvas, Color, PlotKey, Point, RIGHT, fill, line, title_height};
use super::labels;
use super::series::{AXIS, AlgorithmColors, Series, SeriesStyle, TEXT, WIDTH};
use super::ticks::{linear_ticks, log_ticks};
use svl_files::overlay::plot_color;

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

const HEIGHT: u32 = 640;

impl Axis {
    /// A linear axis over what the data span.
    pub fn new(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            ..Self::default()
        }
    }

    /// A logarithmic axis over what the data span.
    pub fn log(label: &str) -> Self {
        Self {
            log: true,
            ..Self::new(label)
        }
    }

    /// A linear axis of percentages of a whole.
    pub fn share(label: impl Into<String>) -> Self {
        Self {
            bounds: Some((0.0, 100.0)),
            ..Self::new(label)
        }
    }

    /// With fixed ends.
    #[must_use]
    pub fn with_range(self, from: f64, to: f64) -> Self {
        let range = Some((from, to));
        Self { range, ..self }
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
    /// A chart without a title, of the series that have points.
    pub fn untitled(x: Axis, y: Axis, series: impl IntoIterator<Item = Series>) -> Self {
        let series = series.into_iter();
        Self {
            x,
            y,
            series: series.filter(|series| !series.points.is_empty()).collect(),
            ..Self::default()
        }
    }

    /// The chart, if it shows more than dots: of lines one with two points, else two points.
    pub fn if_any(self) -> Option<Self> {
        let is_joined = |own: &&Series| matches!(own.form, SeriesStyle::Line | SeriesStyle::Both);
        let points = |own: &Series| own.points.iter().filter(|point| self.shows(point)).count();
        let marks = self.series.iter().filter(|own| own.form.radius().is_some());
        let dots: usize = marks.filter(|own| !is_joined(own)).map(points).sum();
        let mut lines = self.series.iter().filter(is_joined);
        let is_any = dots > 1 || lines.any(|line| points(line) > 1);
        is_any.then_some(self)
    }

    /// The plot as an SVG document.
    pub fn svg(&self) -> String {
        self.svg_in(&AlgorithmColors::new([]))
    }

    /// [`Chart::svg`] with the algorithms' colours for series named after them.
    pub fn svg_in(&self, colors: &AlgorithmColors<'_>) -> String {
        self.svg_named(colors, &|series, _| series.name.clone())
    }

    /// [`Chart::svg_in`] where the tooltip of a point begins with the name that `name` returns.
    pub fn svg_named(
        &self,
        colors: &AlgorithmColors<'_>,
        name: &dyn Fn(&Series, (f64, f64)) -> String,
    ) -> String {
        let series = || self.series.iter().zip(self.colors(colors));
        let keyed = series().filter(|(series, _)| series.is_keyed());
        let key = PlotKey::new(keyed.map(|(series, color)| (series.name.as_str(), color)));
        let title = title_height(&self.title, 0);
        let height = HEIGHT as i32 + key.height;
        let (down, across) = (
            [height - 97, 12 + title + key.height],
            [122, WIDTH as i32 - 37],
        );
        let points = || self.series.iter().flat_map(|s| &s.points);
        let x = TickedAxis::new(&self.x, across, || points().map(|p| p.0));
        let y = TickedAxis::new(&self.y, down, || points().map(|p| p.1));
        let mut canvas = Canvas::titled(&self.title);
        self.draw_axes(&mut canvas, &x, &y);
        for (series, color) in series() {
            self.draw_series(&mut canvas, series, color, (&x, &y), name);
        }
        let bounds = [across[0] + 6, down[1], WIDTH as i32, down[0] + 1];
        labels::write(&mut canvas, &self.series, bounds, |p| {
            self.shows(p).then(|| (x.place(p.0), y.place(p.1)))
        });
        key.draw(&mut canvas, title);
        canvas.svg(height)
    }

    /// True if the point has a place.
    fn shows(&self, (x, y): &(f64, f64)) -> bool {
        self.x.shows(*x) && self.y.shows(*y)
    }

    /// A colour per series: that of its algorithm, else by its place. Named series without an
    /// algorithm share the first.
    fn colors(&self, colors: &AlgorithmColors<'_>) -> Vec<Color> {
        let named = usize::from(self.series.iter().any(|s| s.form == SeriesStyle::Named));
        let mut others = (named..).map(plot_color);
        let own = |series: &Series| match series.form {
            SeriesStyle::Caption | SeriesStyle::Label | SeriesStyle::Front => AXIS,
            form => colors.rgb(&series.name).unwrap_or_else(|| match form {
                SeriesStyle::Named => plot_color(0),
                _ => others.next().unwrap_or(AXIS),
            }),
        };
        self.series.iter().map(own).collect()
    }

    /// Axes with ticks and grid lines at their numbers.
    fn draw_axes(&self, canvas: &mut Canvas, x: &TickedAxis, y: &TickedAxis) {
        let ([left, right], [bottom, top]) = (x.ends, y.ends);
        let (grid, axis) = (line(AXIS, 1).faint(), line(AXIS, 2));
        canvas.upward_text(&self.y.label, (12, (top + bottom + 1) / 2), TEXT);
        canvas.text(
            &self.x.label,
            ((left + right + 1) / 2, bottom + 62),
            TEXT,
            BELOW,
        );
        canvas.path([(left - 1, top), (left - 1, bottom)], axis, "");
        canvas.path([(left, bottom + 1), (right, bottom + 1)], axis, "");
        for (tick, at) in x.ticks() {
            canvas.path([(at, bottom), (at, top)], grid, "");
            canvas.path([(at, bottom + 1), (at, bottom + 9)], axis, "");
            canvas.text(&tick, (at, bottom + 17), TEXT - 4, BELOW);
        }
        for (tick, at) in y.ticks() {
            canvas.path([(left, at), (right, at)], grid, "");
            canvas.path([(left - 9, at), (left - 1, at)], axis, "");
            canvas.text(&tick, (left - 16, at), TEXT - 4, RIGHT);
        }
    }

    fn draw_series(
        &self,
        canvas: &mut Canvas,
        series: &Series,
        color: Color,
        (x, y): (&TickedAxis, &TickedAxis),
        name: &dyn Fn(&Series, (f64, f64)) -> String,
    ) {
        let place = |p: &(f64, f64)| -> Point { (x.place(p.0), y.place(p.1)) };
        let (paint, dashes) = match series.form {
            SeriesStyle::Line | SeriesStyle::Both | SeriesStyle::Joined => (line(color, 4), ""),
            SeriesStyle::Front => (line(color, 3), "12 10"),
            _ => (line(color, 0), ""),
        };
        // A value without a place interrupts the line: joining its neighbours would invent data.
        let runs = series.points.split(|p| !self.shows(p));
        for run in runs.filter(|run| paint.draws() && run.len() > 1) {
            canvas.path(run.iter().map(place), paint, dashes);
        }
        let Some(radius) = series.form.radius() else {
            return;
        };
        for point in series.points.iter().filter(|p| self.shows(p)) {
            let values = [(&self.x, point.0), (&self.y, point.1)];
            let values = values.map(|(axis, v)| format!("{}: {}", axis.label, number(v)));
            let tip = format!("{}\n{}", name(series, *point), values.join("\n"));
            canvas.circle(place(point), radius, fill(color, 1.0), &tip);
        }
    }
}

/// An axis with its ends, as values and as places, and its ticks.
struct TickedAxis {
    span: [f64; 2],
    ends: [i32; 2],
    is_log: bool,
    ticks: Vec<f64>,
}

impl TickedAxis {
    fn new<I>(axis: &Axis, ends: [i32; 2], values: impl Fn() -> I) -> Self
    where
        I: Iterator<Item = f64>,
    {
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
            span: [low, high],
            ends,
            is_log: axis.log,
            ticks,
        }
    }

    fn place(&self, value: f64) -> i32 {
        let scaled = |v: f64| if self.is_log { v.ln() } else { v };
        let ([low, high], [from, to]) = (self.span.map(scaled), self.ends);
        let share = (scaled(value) - low) / (high - low);
        from + (share * f64::from(to - from)).round() as i32
    }

    /// Numbers and their places.
    fn ticks(&self) -> impl Iterator<Item = (String, i32)> {
        let ticks = self.ticks.iter();
        ticks.map(|tick| (number(*tick), self.place(*tick)))
    }
}

/// Charts as one picture on white, in two columns.
pub fn two_columns(charts: &[String]) -> String {
    let (width, height) = (WIDTH, HEIGHT);
    let rows = charts.len().div_ceil(2) as u32;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\">\n<rect width=\"100%\" \
         height=\"100%\" fill=\"#FFFFFF\"/>\n",
        2 * width,
        rows * height
    );
    for (chart, i) in charts.iter().zip(0..) {
        let (x, y) = (i % 2 * width, i / 2 * height);
        let place = format!("<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" ");
        svg.push_str(&chart.replacen("<svg ", &place, 1));
        svg.push('\n');
    }
    svg + "</svg>\n"
}

/// A tick's number, no longer than it must be.
pub(crate) fn number(value: f64) -> String {
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

    fn series(name: &str, form: SeriesStyle, points: &[(f64, f64)]) -> Series {
        Series {
            name: name.into(),
            form,
            points: points.to_vec(),
        }
    }

    fn chart_of(series: Vec<Series>) -> Chart {
        Chart {
            series,
            ..Chart::default()
        }
    }

    fn chart(points: &[(f64, f64)]) -> Chart {
        chart_of(vec![series("v3 <&>", SeriesStyle::Both, points)])
    }

    #[test]
    fn finite_points_are_drawn_and_texts_escaped() {
        let finite = [(0.0, 1.0), (2.0, 3.0), (3.0, 4.0), (4.0, -1.0)];
        let mut chart = chart(&[&finite[..], &[(1.0, f64::NAN)]].concat());
        let circles = |chart: &Chart| chart.svg().matches("<circle").count();
        assert_eq!(circles(&chart), 4);
        chart.y.log = true;
        assert_eq!(circles(&chart), 3);
        let svg = chart.svg();
        assert!(svg.contains("v3 &lt;&amp;&gt;"), "{svg}");
        let begin = "<svg class=\"plot\" role=\"img\" viewBox=\"0 0 960 684\"";
        assert!(svg.starts_with(begin), "{svg}");
    }

    #[test]
    fn names_stand_beside_points_and_in_no_key() {
        let points = |x| [(x, 1.0), (x, f64::NAN)];
        let all = vec![
            series("bm", SeriesStyle::Named, &points(1.0)),
            series("sgm", SeriesStyle::Named, &points(1.0)),
            series("0.4", SeriesStyle::Label, &points(2.0)),
        ];
        let svg = chart_of(all).svg();
        let texts = ["<circle", "\nbm\n", "\nsgm\n", "\n0.4\n"];
        assert_eq!(texts.map(|t| svg.matches(t).count()), [2, 1, 1, 1]);
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
            let axis = TickedAxis::new(&Axis::new("count"), [0, 1], || values.into_iter());
            assert_eq!(axis.span[0], 0.0);
            assert!(axis.ticks.len() > 1 && axis.ticks.iter().all(|t| t.fract() == 0.0));
        }
    }

    #[test]
    fn a_key_is_above_the_points() {
        let svg = chart(&[(0.0, 1.0), (1.0, 2.0)]).svg();
        // The numbers of all attributes of a name.
        let numbers = |svg: &str, begin: &str| {
            let texts = svg.split(begin).skip(1);
            let numbers = texts.filter_map(|text| text.split('"').next()?.parse::<i32>().ok());
            numbers.collect::<Vec<_>>()
        };
        // The square of the key, then the circles.
        let (_, square) = svg.split_once("<rect x=\"0\"").unwrap();
        let square = numbers(square, "y=\"")[0];
        let highest = numbers(&svg, "cy=\"").into_iter().min();
        assert!(highest > Some(square + 24), "{svg}");
    }

    #[test]
    fn a_value_without_room_is_left_out() {
        let label = |i| series(&format!("value {i}"), SeriesStyle::Label, &[(1.0, 1.0)]);
        let svg = chart_of((0..60).map(label).collect()).svg();
        assert!((2..9).contains(&svg.matches("\nvalue ").count()), "{svg}");
    }

    #[test]
    fn nothing_one_point_and_equal_points_have_axes() {
        let some = [(1.0, 0.0), (2.0, 5.0), (2.0, 5.0), (f64::INFINITY, 1.0)];
        for places in [0..0, 0..1, 1..3, 3..4] {
            for log in [false, true] {
                let mut chart = chart(&some[places.clone()]);
                (chart.x.log, chart.y.log) = (log, log);
                chart.svg();
            }
        }
    }

    #[test]
    fn a_chart_of_dots_alone_is_not_drawn() {
        let one = |form| series("v3", form, &[(1.0, 1.0), (f64::NAN, 1.0)]);
        let is_drawn = |series: &[Series]| chart_of(series.to_vec()).if_any().is_some();
        let (both, disc) = (one(SeriesStyle::Both), one(SeriesStyle::Disc(9)));
        let diagonal = series("", SeriesStyle::Front, &[(0.0, 0.0), (1.0, 1.0)]);
        assert!(!is_drawn(&[both.clone(), both, diagonal]));
        assert!(!is_drawn(std::slice::from_ref(&disc)));
        assert!(is_drawn(&[disc.clone(), disc]));
        assert!(chart(&[(0.0, 1.0), (2.0, 3.0)]).if_any().is_some());
    }

    #[test]
    fn numbers_are_short() {
        let short = [0.0, -0.0, 0.25, 3.5, 12.0, 1500.0, 0.00001].map(number);
        assert_eq!(short, ["0", "0", "0.25", "3.5", "12", "1500", "0"]);
    }

    #[test]
    fn each_point_has_its_name_and_both_values() {
        let mut chart = chart_of(vec![
            series("", SeriesStyle::Front, &[(1.0, 2.0), (2.0, 1.0)]),
            series("v5", SeriesStyle::Disc(12), &[(1.0, 2.0)]),
            // The first has no place on a logarithmic axis.
            series("<sgm>", SeriesStyle::Both, &[(0.0, 3.0), (2.0, 1.0)]),
        ]);
        (chart.x, chart.y) = (Axis::new("ms"), Axis::share("wrong, %"));
        chart.x.log = true;
        let tips = |svg: &str| {
            let tips = svg.split("<title>").skip(1);
            let tips = tips.map(|tip| tip.split_once("</title></circle>").unwrap().0.to_owned());
            tips.collect::<Vec<_>>()
        };
        let svg = chart.svg();
        let expected = ["v5\nms: 1\nwrong, %: 2", "&lt;sgm&gt;\nms: 2\nwrong, %: 1"];
        assert_eq!(tips(&svg), expected);
        let svg = chart.svg_named(&AlgorithmColors::new([]), &|_, (x, _)| format!("at {x}"));
        assert!(tips(&svg)[1].starts_with("at 2\n"));
    }
}
