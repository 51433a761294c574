//! A course from above, with the ways that algorithms took through it.

use super::canvas::{Canvas, TOP_LEFT, fill, line};
use super::series::{AXIS, AlgorithmColors, TEXT, WIDTH, text_width};

/// Content of a map. The course's `y` runs to the right. Points are metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CourseMap {
    pub title: String,
    /// Extent in x and in y.
    pub size_m: (f64, f64),
    pub goal_m: f64,
    /// Angle of the sectors.
    pub field_of_view_deg: f64,
    /// True if an algorithm that may be called best did not finish it.
    pub is_failed: bool,
    /// Closed outlines of the obstacles.
    pub outlines: Vec<Vec<[f64; 2]>>,
    pub ways: Vec<MapWay>,
}

/// A way through a course.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapWay {
    pub name: String,
    /// One more for each time that the robot was set back.
    pub stretches: Vec<Vec<[f64; 2]>>,
    pub collisions: Vec<[f64; 2]>,
    pub stuck: Vec<[f64; 2]>,
    /// The camera's field of view at the first collision.
    pub sector: Option<CameraSector>,
}

/// Place and direction of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSector {
    pub at: [f64; 2],
    /// atan2(y, x), radians.
    pub heading: f64,
}

const MARGIN: i32 = 12;
/// Half the size of a cross.
const CROSS: i32 = 9;
/// Radius of a sector, and the number of its corners on the arc.
const SECTOR_M: f64 = 0.7;
const ARC_POINTS: u32 = 12;

impl CourseMap {
    /// The map as an SVG element: obstacles in grey, ways in the colours of their algorithms, a
    /// cross for each collision, the camera's field of view at the first, a ring where the robot
    /// was stuck.
    pub fn svg(&self, colors: &AlgorithmColors<'_>) -> String {
        let scale = f64::from(WIDTH as i32 - 2 * MARGIN) / self.size_m.1;
        let top = TEXT as i32 + 2 * MARGIN;
        let bottom = top + (scale * self.size_m.0) as i32;
        let mut canvas = Canvas::default();
        canvas.text(&self.title, (MARGIN, MARGIN), TEXT, TOP_LEFT);
        self.draw(&mut canvas, colors, |[x, y]| {
            let across = MARGIN + (scale * y).round() as i32;
            (across, top + (scale * (self.size_m.0 - x)).round() as i32)
        });
        self.draw_key(&mut canvas, colors, bottom + MARGIN);
        canvas.svg(bottom + top)
    }

    /// The corners of a sector, those outside the room moved to its walls.
    fn sector(&self, CameraSector { at, heading }: &CameraSector) -> Vec<[f64; 2]> {
        let angle = self.field_of_view_deg.to_radians();
        let arc = (0..=ARC_POINTS).map(|i| {
            let (y, x) = (heading + angle * (f64::from(i) / f64::from(ARC_POINTS) - 0.5)).sin_cos();
            let x = (at[0] + SECTOR_M * x).clamp(0.0, self.size_m.0);
            [x, (at[1] + SECTOR_M * y).clamp(0.0, self.size_m.1)]
        });
        std::iter::once(*at).chain(arc).collect()
    }

    fn draw(
        &self,
        canvas: &mut Canvas,
        colors: &AlgorithmColors<'_>,
        place: impl Fn([f64; 2]) -> (i32, i32),
    ) {
        let places = |points: &[[f64; 2]]| points.iter().map(|p| place(*p)).collect::<Vec<_>>();
        let color = |way: &MapWay| colors.rgb(&way.name).unwrap_or(AXIS);
        for outline in &self.outlines {
            canvas.path(places(outline), fill(AXIS, 1.0), "");
        }
        let goal = [[0.0, self.goal_m], [self.size_m.0, self.goal_m]];
        canvas.path(places(&goal), line(AXIS, 2), "");
        for way in &self.ways {
            canvas.layer(&way.name, |canvas| {
                if let Some(sector) = &way.sector {
                    let corners = places(&self.sector(sector));
                    canvas.path(corners, fill(color(way), 1.0).faint(), "");
                }
                for stretch in &way.stretches {
                    canvas.path(places(stretch), line(color(way), 3), "");
                }
                for (x, y) in places(&way.collisions) {
                    for down in [CROSS, -CROSS] {
                        let ends = [(x - CROSS, y - down), (x + CROSS, y + down)];
                        canvas.path(ends, line(color(way), 5), "");
                    }
                }
                for at in places(&way.stuck) {
                    canvas.circle(at, CROSS as u32, line(color(way), 3), "");
                }
            });
        }
    }

    /// The names of the ways, with the numbers of their marks.
    fn draw_key(&self, canvas: &mut Canvas, colors: &AlgorithmColors<'_>, top: i32) {
        let (mut x, side) = (MARGIN, TEXT as i32 - 8);
        for way in &self.ways {
            let count = |sign: char, places: &[[f64; 2]]| match places.len() {
                0 => String::new(),
                n => format!(" {sign}{n}"),
            };
            let marks = count('×', &way.collisions) + &count('○', &way.stuck);
            let name = format!("{}{marks}", way.name);
            let color = colors.rgb(&way.name).unwrap_or(AXIS);
            let swatch = [(x, top + 6), (x + side, top + 6 + side)];
            canvas.rectangle(swatch, fill(color, 1.0));
            x += side + 8;
            canvas.text(&name, (x, top), TEXT, TOP_LEFT);
            x += text_width(&name, TEXT) + 2 * MARGIN;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sector_ends_at_the_walls() {
        let map = CourseMap {
            size_m: (2.0, 6.0),
            field_of_view_deg: 90.0,
            ..CourseMap::default()
        };
        // Ahead, along y, beside the right wall.
        let sector = map.sector(&CameraSector {
            at: [1.9, 3.0],
            heading: std::f64::consts::FRAC_PI_2,
        });
        assert_eq!((sector[0], sector.len()), ([1.9, 3.0], 14));
        assert!(sector.iter().all(|[x, y]| *x <= 2.0 && *y >= 3.0));
        assert!((sector[7][1] - 3.7).abs() < 1e-9, "{sector:?}");
    }
}
