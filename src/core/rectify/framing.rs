//! Size, focal length and centre of rectified images: the part of the cameras' images that they
//! show.

use super::rotated_camera::RotatedCamera;
use crate::error::{Error, Result};
use crate::stereo::{MAX_RADIUS, MAX_SIDE};
use nalgebra::{Point2, Vector2};
use std::f64::consts::FRAC_PI_3;

/// Size and crop of rectified images.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Framing {
    /// Width and height; `None` for those of the cameras.
    pub size: Option<(usize, usize)>,
    /// OpenCV's `alpha`. 0: only valid pixels, and at most 60° from the axis to each side. 1:
    /// all pixels of the cameras' images, with black borders, and at most 75°. Values between
    /// interpolate.
    pub alpha: f64,
}

/// The common pinhole of both rectified images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pinhole {
    pub(super) size: (usize, usize),
    pub(super) focal_px: f64,
    pub(super) center_px: (f64, f64),
}

impl Framing {
    /// # Errors
    /// [`Error::Invalid`] for an `alpha` outside 0 ..= 1; [`Error::Dimensions`]; [`Error::Rig`] if
    /// no rectangle is seen by both cameras.
    pub(super) fn pinhole(&self, views: &[RotatedCamera; 2]) -> Result<Pinhole> {
        if !(0.0..=1.0).contains(&self.alpha) {
            return Err(Error::Invalid(format!(
                "alpha {}: 0 crops to valid pixels, 1 shows all",
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
        let [left, right] = views.each_ref().map(visible_region);
        let (left, right) = (left?, right?);
        let within = left.within.intersection(&right.within);
        let within = within.intersection(&Rectangle::within_angle(MAX_ANGLE));
        let around = left.around.union(&right.around);
        let around = around.intersection(&Rectangle::within_angle(MAX_ANGLE_OF_ALL));
        let extent = Vector2::new((width - 1) as f64, (height - 1) as f64);
        let empty = !(within.size().x > 0.0 && within.size().y > 0.0);
        // A valid rectangle exists only in the common field of view; alpha = 1 does not need one.
        if empty && self.alpha < 1.0 {
            let cure = "do the cameras diverge? alpha = 1 shows all that they see";
            return Err(Error::Rig(format!(
                "no rectangle of the rectified plane is seen by both cameras: {cure}"
            )));
        }
        let within = if empty { around } else { within };
        // The larger ratio fills the image with valid pixels; the smaller one shows everything.
        let closest = extent.component_div(&within.size()).max();
        let widest = extent.component_div(&around.size()).min();
        let blend = |near: f64, far: f64| near + self.alpha * (far - near);
        // Interpolating focal lengths (not fields of view), as OpenCV does.
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

/// Largest angles between the axis and a side of a rectified image, radians, for `alpha` 0 and 1. A
/// plane shows an angle θ magnified by 1/cos² θ: 4 and 15 times as large as the centre.
pub(super) const MAX_ANGLE: f64 = FRAC_PI_3;
pub(super) const MAX_ANGLE_OF_ALL: f64 = 5.0 * FRAC_PI_3 / 4.0;

/// A rectangle in the rectified plane, as `(X/Z, Y/Z)`.
#[derive(Clone, Copy)]
struct Rectangle {
    least: Vector2<f64>,
    most: Vector2<f64>,
}

impl Rectangle {
    /// All that is at most that angle off the axis, horizontally and vertically.
    fn within_angle(angle: f64) -> Self {
        let corner = Vector2::repeat(angle.tan());
        Self {
            least: -corner,
            most: corner,
        }
    }

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

/// The part of the rectified plane that one camera sees.
struct VisibleRegion {
    /// A rectangle inside its image.
    within: Rectangle,
    /// The bounding rectangle of its image.
    around: Rectangle,
}

/// Follows the border of the camera's image, pixel by pixel.
///
/// # Errors
/// [`Error::Rig`] if a whole side has no direction in front of the rectified camera.
fn visible_region(view: &RotatedCamera) -> Result<VisibleRegion> {
    let (width, height) = view.size();
    let (right, bottom) = ((width - 1) as f64, (height - 1) as f64);
    let column = |x: f64| (0..height).filter_map(move |y| view.direction(Point2::new(x, y as f64)));
    let row = |y: f64| (0..width).filter_map(move |x| view.direction(Point2::new(x as f64, y)));
    let mut sides: [Vec<_>; 4] = [
        column(0.0).collect(),
        row(0.0).collect(),
        column(right).collect(),
        row(bottom).collect(),
    ];
    if view.sees_beyond_the_plane() {
        // A side at 90° from the axis or beyond: the plane has no end there.
        let ends = [-Vector2::x(), -Vector2::y(), Vector2::x(), Vector2::y()];
        for (side, end) in sides.iter_mut().zip(ends) {
            if side.is_empty() {
                side.push(end * MAX_RADIUS);
            }
        }
    }
    if sides.iter().any(Vec::is_empty) {
        let why = match view.fold_px() {
            Some(fold) => format!(
                "its distortion model folds {fold:.0} px from the principal point; calibrate with \
                 the board near the image's sides, or with another --model"
            ),
            None => "its distortion model is undefined there, or the cameras diverge too far; \
                     calibrate again"
                .to_owned(),
        };
        return Err(Error::Rig(format!(
            "a whole side of a camera's image cannot be rectified: {why}"
        )));
    }
    // Distorted borders are curved: the valid rectangle ends at the innermost point of each side.
    let [left, top, right, bottom] = &sides;
    let x = |side: &[Vector2<f64>], extreme: fn(f64, f64) -> f64| {
        side.iter().map(|d| d.x).reduce(extreme).unwrap_or(f64::NAN)
    };
    let y = |side: &[Vector2<f64>], extreme: fn(f64, f64) -> f64| {
        side.iter().map(|d| d.y).reduce(extreme).unwrap_or(f64::NAN)
    };
    let all = sides.concat();
    Ok(VisibleRegion {
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
