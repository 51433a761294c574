//! A course from above, with the ways that algorithms took through it.

use super::{AXIS, AlgorithmColors, DrawError, PlotCanvas, TEXT, WIDTH, svg, text, text_width};
use plotters::prelude::*;
use svl_core::Result;

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
    ///
    /// # Errors
    /// [`svl_core::Error::Invalid`] with the error of the plotting library.
    pub fn svg(&self, colors: &AlgorithmColors<'_>) -> Result<String> {
        let scale = f64::from(WIDTH as i32 - 2 * MARGIN) / self.size_m.1;
        let bottom = self.top() + (scale * self.size_m.0) as i32;
        let height = bottom + TEXT as i32 + 2 * MARGIN;
        svg(height as u32, &self.title, |canvas| {
            self.draw(canvas, colors, (scale, bottom))
        })
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

    fn top(&self) -> i32 {
        TEXT as i32 + 2 * MARGIN
    }

    fn draw(
        &self,
        canvas: &PlotCanvas,
        colors: &AlgorithmColors<'_>,
        (scale, bottom): (f64, i32),
    ) -> std::result::Result<(), DrawError> {
        let place = |[x, y]: [f64; 2]| {
            let across = MARGIN + (scale * y).round() as i32;
            (
                across,
                self.top() + (scale * (self.size_m.0 - x)).round() as i32,
            )
        };
        let places = |points: &[[f64; 2]]| points.iter().map(|p| place(*p)).collect::<Vec<_>>();
        canvas.draw(&Text::new(self.title.clone(), (MARGIN, MARGIN), text(TEXT)))?;
        for outline in &self.outlines {
            canvas.draw(&Polygon::new(places(outline), AXIS.filled()))?;
        }
        for way in &self.ways {
            if let Some(sector) = &way.sector {
                let color = colors.color(&way.name).unwrap_or(AXIS);
                let corners = places(&self.sector(sector));
                canvas.draw(&Polygon::new(corners, color.mix(0.25).filled()))?;
            }
        }
        let goal = [[0.0, self.goal_m], [self.size_m.0, self.goal_m]];
        canvas.draw(&PathElement::new(places(&goal), AXIS.stroke_width(2)))?;
        let mut key = MARGIN;
        for way in &self.ways {
            let color = colors.color(&way.name).unwrap_or(AXIS);
            for stretch in &way.stretches {
                canvas.draw(&PathElement::new(places(stretch), color.stroke_width(3)))?;
            }
            for at in &way.collisions {
                let (x, y) = place(*at);
                for down in [CROSS, -CROSS] {
                    let line = vec![(x - CROSS, y - down), (x + CROSS, y + down)];
                    canvas.draw(&PathElement::new(line, color.stroke_width(5)))?;
                }
            }
            for at in &way.stuck {
                canvas.draw(&Circle::new(place(*at), CROSS, color.stroke_width(3)))?;
            }
            let count = |sign: char, places: &[[f64; 2]]| match places.len() {
                0 => String::new(),
                n => format!(" {sign}{n}"),
            };
            let marks = count('×', &way.collisions) + &count('○', &way.stuck);
            let name = format!("{}{marks}", way.name);
            let (top, side) = (bottom + MARGIN, TEXT as i32 - 8);
            let swatch = [(key, top + 6), (key + side, top + 6 + side)];
            canvas.draw(&Rectangle::new(swatch, color.filled()))?;
            key += side + 8;
            canvas.draw(&Text::new(name.clone(), (key, top), text(TEXT)))?;
            key += text_width(&name, TEXT) + 2 * MARGIN;
        }
        Ok(())
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
