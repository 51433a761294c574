//! The thesis's picture of a depth grid (figures 5.8d and 7.3, table 5.1): squares on the left
//! image.
//!
//! Every known cell has a centred green square whose size is the nearness of the cell's median
//! ([`overlay::Nearness`]). A yellow square shows the 20th percentile and a violet one the 80th in
//! the same way: the closer the three, the smaller the spread of the depth. A grey dot means
//! unknown. The thesis has both in red, which is here the colour of what is wrong.

use crate::scale::Scale;
use rerun::{Boxes2D, LineStrips2D, Points2D, Radius, Rgba32};
use svl_core::stereo::{DepthGrid, GridShape};
use svl_files::overlay::{self, Rect};

const GREEN: Rgba32 = Rgba32::from_rgb(23, 195, 163);
const GREY: Rgba32 = Rgba32::from_rgb(195, 201, 208);
const YELLOW: Rgba32 = Rgba32::from_rgb(255, 221, 50);
const VIOLET: Rgba32 = Rgba32::from_rgb(186, 85, 255);
pub(crate) const WHITE: Rgba32 = Rgba32::from_unmultiplied_rgba(255, 255, 255, 110);

/// The shapes on the left image for one depth grid.
pub(crate) struct Overlay {
    /// The green squares.
    pub medians: Boxes2D,
    /// The grey dots.
    pub unknown: Points2D,
    /// The borders of the cells.
    pub lines: LineStrips2D,
    /// The yellow and violet squares, drawn over the green ones: a separate entity.
    pub percentiles: Boxes2D,
    /// The distances of the known cells, or their disparities without a rig, as text.
    pub distances: Points2D,
}

/// Limits of the overlays side by side and of their columns whose labels do not overlap.
const MAX_LABELLED: usize = 4;
const MAX_LABELLED_COLUMNS: usize = 6;

impl Overlay {
    /// Overlay of `grid` on an image of `size` pixels, with distances as text unless there are too
    /// many `views` or columns for that.
    pub(crate) fn new(grid: &DepthGrid, size: (usize, usize), scale: &Scale, views: usize) -> Self {
        let mut medians = Vec::new();
        let mut percentiles = Vec::new();
        let mut unknown = Vec::new();
        for mark in overlay::marks(grid, size, scale.nearness) {
            match mark.squares {
                Some(squares) => {
                    medians.push((squares.median, GREEN));
                    percentiles.extend([(squares.p20, YELLOW), (squares.p80, VIOLET)]);
                }
                None => unknown.push(point(mark.cell.center())),
            }
        }
        let mut distances = Vec::new();
        // Below the middle of the squares: Rerun writes below a point, and the view ends soon.
        let below = |place| {
            let (x, y) = grid.shape().pixels(place, size);
            [
                x.start.midpoint(x.end) as f32,
                (2 * y.start + 3 * y.end) as f32 / 5.0,
            ]
        };
        for (place, cell) in grid.iter() {
            let Some(depth) = cell.depth else {
                if let Some(near) = cell.near {
                    distances.push((below(place), format!("near {:.0} %", 100.0 * near)));
                }
                continue;
            };
            // An object that is too close is nearer than its depth.
            let mut label = match (depth.distance_m, cell.too_close) {
                (Some(distance_m), false) => format!("{distance_m:.2} m"),
                (Some(distance_m), true) => format!("< {distance_m:.2} m"),
                (None, false) if depth.is_far() => "far".to_owned(),
                (None, false) => format!("{:.1} px", depth.median_px),
                (None, true) => format!("> {:.1} px", depth.median_px),
            };
            // Rerun shows the first line of a label.
            if let Some(probability) = cell.probability {
                label.push_str(&format!(" {:.0} %", 100.0 * probability));
            }
            distances.push((below(place), label));
        }
        // In image pixels, so that a small view gets thin lines and a large one bold ones.
        let unit = size.0 as f32 / 320.0;
        Self {
            medians: boxes(&medians, 1.4 * unit).with_draw_order(31.0),
            unknown: Points2D::new(unknown)
                .with_colors([GREY])
                .with_radii([3.5 * unit]),
            lines: LineStrips2D::new(lines(grid.shape(), size))
                .with_colors([WHITE])
                .with_radii([Radius::new_ui_points(0.5)]),
            percentiles: boxes(&percentiles, 0.6 * unit).with_draw_order(32.0),
            distances: Points2D::new(distances.iter().map(|(at, _)| *at))
                .with_labels(distances.into_iter().map(|(_, label)| label))
                .with_show_labels(
                    views <= MAX_LABELLED && grid.shape().columns <= MAX_LABELLED_COLUMNS,
                )
                // The colour of the labels.
                .with_colors([Rgba32::WHITE])
                .with_radii([Radius::new_ui_points(0.0)])
                .with_draw_order(33.0),
        }
    }
}

fn boxes(squares: &[(Rect, Rgba32)], radius: f32) -> Boxes2D {
    let centers = squares.iter().map(|(rect, _)| point(rect.center()));
    let half_sizes = squares
        .iter()
        .map(|(rect, _)| point((rect.width / 2.0, rect.height / 2.0)));
    Boxes2D::from_centers_and_half_sizes(centers, half_sizes)
        .with_colors(squares.iter().map(|s| s.1))
        .with_radii([radius])
}

fn point((x, y): (f64, f64)) -> [f32; 2] {
    [x as f32, y as f32]
}

/// Borders between the cells and around them.
pub(crate) fn lines(shape: GridShape, (width, height): (usize, usize)) -> Vec<[[f32; 2]; 2]> {
    let (right, bottom) = (width as f32, height as f32);
    let vertical = (0..=shape.columns)
        .map(|i| (i * width / shape.columns) as f32)
        .map(|x| [[x, 0.0], [x, bottom]]);
    let horizontal = (0..=shape.rows)
        .map(|i| (i * height / shape.rows) as f32)
        .map(|y| [[0.0, y], [right, y]]);
    vertical.chain(horizontal).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_enclose_every_cell() {
        let lines = lines(
            GridShape {
                columns: 5,
                rows: 3,
            },
            (320, 240),
        );
        assert_eq!(lines.len(), 6 + 4);
        assert!(
            lines.contains(&[[320.0, 0.0], [320.0, 240.0]])
                && lines.contains(&[[0.0, 80.0], [320.0, 80.0]])
        );
    }
}
