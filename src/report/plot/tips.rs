//! Tooltips of points, shown by browsers at the pointer and read by screen readers.

use super::Series;
use super::chart::{Chart, number};
use quick_xml::escape::escape;

impl Chart {
    /// The plot with a title in each of its circles, which are those of its points in their order.
    pub(super) fn with_tips(
        &self,
        svg: &str,
        name: &dyn Fn(&Series, (f64, f64)) -> String,
    ) -> String {
        let drawn = self.series.iter().filter(|s| s.form.radius().is_some());
        let points = drawn.flat_map(|s| s.points.iter().map(move |p| (s, *p)));
        let mut points = points.filter(|(_, p)| self.shows(p));
        let mut parts = svg.split("<circle ");
        let mut text = parts.next().unwrap_or_default().to_owned();
        for part in parts {
            let tip = points.next().map(|(series, (x, y))| {
                let values = [(&self.x, x), (&self.y, y)];
                let values = values.map(|(axis, v)| format!("{}: {}", axis.label, number(v)));
                format!("{}\n{}", name(series, (x, y)), values.join("\n"))
            });
            let tip = tip.unwrap_or_default();
            let circle = part.replacen(
                "/>",
                &format!("><title>{}</title></circle>", escape(tip)),
                1,
            );
            text += "<circle ";
            text += &circle;
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use crate::plot::{AlgorithmColors, Axis, Chart, Series, SeriesStyle};

    #[test]
    fn each_point_has_its_name_and_both_values() {
        let series = |name: &str, form, points| Series {
            name: name.to_owned(),
            form,
            points,
        };
        let chart = Chart {
            x: Axis {
                log: true,
                ..Axis::new("ms")
            },
            y: Axis::share("wrong, %"),
            series: vec![
                series("", SeriesStyle::Front, vec![(1.0, 2.0), (2.0, 1.0)]),
                series("v5", SeriesStyle::Disc(12), vec![(1.0, 2.0)]),
                // The first has no place on a logarithmic axis.
                series("<sgm>", SeriesStyle::Both, vec![(0.0, 3.0), (2.0, 1.0)]),
            ],
            ..Chart::default()
        };
        let tips = |svg: &str| {
            let tips = svg.split("<title>").skip(1);
            let tips = tips.map(|tip| tip.split_once("</title></circle>").unwrap().0.to_owned());
            tips.collect::<Vec<_>>()
        };
        let svg = chart.svg().unwrap();
        let expected = ["v5\nms: 1\nwrong, %: 2", "&lt;sgm&gt;\nms: 2\nwrong, %: 1"];
        assert_eq!(tips(&svg), expected);
        let svg = chart.svg_named(&AlgorithmColors::new([]), &|_, (x, _)| format!("at {x}"));
        assert!(tips(&svg.unwrap())[1].starts_with("at 2\n"));
    }
}
