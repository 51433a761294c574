//! What part of what two turned cameras see becomes the rectified images.

use super::view::View;
use crate::error::{Error, Result};
use crate::stereo::MAX_SIDE;
use nalgebra::{Point2, Vector2};

/// Size and crop of rectified images.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Framing {
    /// Width and height; the cameras' own where it is not given.
    pub size: Option<(usize, usize)>,
    /// As OpenCV's `alpha`. 0: every pixel of both images was seen by its camera. 1: all that the
    /// cameras saw is in them, with black where nothing was seen. Numbers between are between.
    pub alpha: f64,
}

/// One pinhole for both images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pinhole {
    pub(super) size: (usize, usize),
    pub(super) focal_px: f64,
    pub(super) center_px: (f64, f64),
}

impl Framing {
    /// # Errors
    /// [`Error::Invalid`] for an `alpha` outside 0 ..= 1; [`Error::Dimensions`]; [`Error::Rig`]
    /// where no rectangle is seen by both cameras.
    pub(super) fn pinhole(&self, views: &[View; 2]) -> Result<Pinhole> {
        if !(0.0..=1.0).contains(&self.alpha) {
            return Err(Error::Invalid(format!(
                "alpha {}: 0 crops to what was seen, 1 shows all",
                self.alpha
            )));
        }
        let size = self.size.unwrap_or(views[0].size());
        for (width, height) in [size, views[0].size(), views[1].size()] {
            if ![width, height]
                .iter()
                .all(|side| (2..=MAX_SIDE).contains(side))
            {
                return Err(Error::Dimensions {
                    width,
                    height,
                    max: MAX_SIDE,
                });
            }
        }
        let (width, height) = size;
        let [left, right] = views.each_ref().map(seen);
        let (left, right) = (left?, right?);
        let within = left.within.intersection(&right.within);
        let around = left.around.union(&right.around);
        let extent = Vector2::new((width - 1) as f64, (height - 1) as f64);
        let empty = !(within.size().x > 0.0 && within.size().y > 0.0);
        // What is wholly seen exists only where both see it; showing all needs no such place.
        if empty && self.alpha < 1.0 {
            let cure =
                "are the cameras turned away from each other? alpha = 1 shows all that they see";
            return Err(Error::Rig(format!(
                "no rectangle of the rectified plane is seen by both cameras: {cure}"
            )));
        }
        let within = if empty { around } else { within };
        let closest = extent.component_div(&within.size()).max();
        let widest = extent.component_div(&around.size()).min();
        let blend = |near: f64, far: f64| near + self.alpha * (far - near);
        let focal_px = blend(closest, widest);
        let middle = within.middle().lerp(&around.middle(), self.alpha);
        let center = extent / 2.0 - middle * focal_px;
        Ok(Pinhole {
            size,
            focal_px,
            center_px: (center.x, center.y),
        })
    }
}

/// A rectangle of directions.
#[derive(Clone, Copy)]
struct Rectangle {
    least: Vector2<f64>,
    most: Vector2<f64>,
}

impl Rectangle {
    fn size(&self) -> Vector2<f64> {
        self.most - self.least
    }

    fn middle(&self) -> Vector2<f64> {
        (self.least + self.most) / 2.0
    }

    fn intersection(&self, other: &Self) -> Self {
        Self {
            least: self.least.sup(&other.least),
            most: self.most.inf(&other.most),
        }
    }

    fn union(&self, other: &Self) -> Self {
        Self {
            least: self.least.inf(&other.least),
            most: self.most.sup(&other.most),
        }
    }
}

/// What one camera sees.
struct Seen {
    /// A rectangle within its picture.
    within: Rectangle,
    /// The least rectangle around it.
    around: Rectangle,
}

/// Follows the border of the camera's picture, pixel by pixel.
fn seen(view: &View) -> Result<Seen> {
    let (width, height) = view.size();
    let (right, bottom) = ((width - 1) as f64, (height - 1) as f64);
    let column = |x: f64| (0..height).filter_map(move |y| view.direction(Point2::new(x, y as f64)));
    let row = |y: f64| (0..width).filter_map(move |x| view.direction(Point2::new(x as f64, y)));
    let sides = [
        column(0.0).collect(),
        row(0.0).collect(),
        column(right).collect(),
        row(bottom).collect(),
    ];
    if sides.iter().any(|side: &Vec<_>| side.is_empty()) {
        let why =
            "its lens model says nothing there, or the cameras are turned too far from each other";
        return Err(Error::Rig(format!(
            "a whole side of a camera's image cannot be rectified: {why}"
        )));
    }
    let [left, top, right, bottom] = &sides;
    let x = |side: &[Vector2<f64>], of: fn(f64, f64) -> f64| {
        side.iter().map(|d| d.x).reduce(of).unwrap_or(f64::NAN)
    };
    let y = |side: &[Vector2<f64>], of: fn(f64, f64) -> f64| {
        side.iter().map(|d| d.y).reduce(of).unwrap_or(f64::NAN)
    };
    let all = sides.concat();
    Ok(Seen {
        within: Rectangle {
            least: Vector2::new(x(left, f64::max), y(top, f64::max)),
            most: Vector2::new(x(right, f64::min), y(bottom, f64::min)),
        },
        around: Rectangle {
            least: Vector2::new(x(&all, f64::min), y(&all, f64::min)),
            most: Vector2::new(x(&all, f64::max), y(&all, f64::max)),
        },
    })
}
