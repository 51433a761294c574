//! Several charts in one picture.

use super::WIDTH;
use super::chart::HEIGHT;

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
