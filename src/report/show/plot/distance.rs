//! The thesis's figure 5.1: distance over disparity.

use super::chart::{Axis, Chart};
use super::series::{Series, SeriesStyle};

/// Curves of `(disparity_px, distance_cm)` and measurements of `(distance_cm, disparity_px)`, each
/// under its name, over what was measured. Curves go as far as they are given, and no farther than
/// the measurements' plot.
pub fn distance_chart(
    curves: Vec<(String, Vec<(f64, f64)>)>,
    measured: Vec<(String, Vec<(f64, f64)>)>,
) -> Chart {
    let largest = |coordinate: fn(&(f64, f64)) -> f64| {
        let measured = measured.iter().flat_map(|(_, pairs)| pairs);
        measured.map(coordinate).fold(0.0, f64::max)
    };
    let (most_cm, most_px) = (
        round_up(1.15 * largest(|p| p.0)),
        round_up(1.1 * largest(|p| p.1)),
    );
    let inside = |p: &(f64, f64)| (0.0..=most_px).contains(&p.0) && (0.0..=most_cm).contains(&p.1);
    let line = |(name, points): (String, Vec<_>)| {
        Series::new(&name, SeriesStyle::Line, points.into_iter().filter(inside))
    };
    let points = |(name, pairs): &(String, Vec<(f64, f64)>)| {
        let points = pairs.iter().map(|(cm, px)| (*px, *cm));
        Series::new(name, SeriesStyle::Points, points)
    };
    let mut lines: Vec<_> = curves.into_iter().map(line).collect();
    let points = measured.iter().map(points);
    // The pinhole's curve, the last, above the points that it is compared with.
    let last = lines.pop();
    Chart {
        title: "Distance at disparity".into(),
        x: Axis::new("disparity, px").with_range(0.0, most_px),
        y: Axis::new("distance, cm").with_range(0.0, most_cm),
        series: lines.into_iter().chain(points).chain(last).collect(),
    }
}

/// To the next multiple of ten, and from 1000 on of a hundred.
fn round_up(value: f64) -> f64 {
    let step = if value < 1000.0 { 10.0 } else { 100.0 };
    (value / step).ceil().max(1.0) * step
}
