//! The two primitives, box and sphere, and their intersections with rays.

use super::config::{Ball, Block};

pub(super) type Vec3 = nalgebra::Vector3<f32>;

/// A convex solid for ray casting.
pub(super) enum Solid {
    Block(Slab),
    Ball { center: Vec3, radius: f32 },
}

/// A box, rotated about the vertical axis.
pub(super) struct Slab {
    /// Centre of the box.
    center: Vec3,
    half: Vec3,
    /// Direction of its length.
    along: (f32, f32),
}

/// A point of a solid's surface, in metres.
pub(super) struct SurfacePoint {
    pub(super) normal: Vec3,
    /// Coordinates on the unrolled surface, and their directions in the world.
    pub(super) u_m: f32,
    pub(super) v_m: f32,
    pub(super) u_axis: Vec3,
    pub(super) v_axis: Vec3,
}

/// A hit: the ray's parameter, and a code of the face that was hit.
pub(super) type FaceHit = (f32, u8);

impl Solid {
    pub(super) fn block(block: &Block) -> Self {
        let [length, breadth, height] = block.size_m;
        let [x, y] = block.at_m;
        let (sin, cos) = block.heading_deg.to_radians().sin_cos();
        Self::Block(Slab {
            center: Vec3::new(
                x as f32,
                y as f32,
                (block.above_floor_m + 0.5 * height) as f32,
            ),
            half: Vec3::new(
                0.5 * length as f32,
                0.5 * breadth as f32,
                0.5 * height as f32,
            ),
            along: (cos as f32, sin as f32),
        })
    }

    pub(super) fn ball(ball: &Ball) -> Self {
        let [x, y] = ball.at_m;
        Self::Ball {
            center: Vec3::new(x as f32, y as f32, ball.height_m as f32),
            radius: ball.radius_m as f32,
        }
    }

    /// A point in the solid's coordinates: relative to its centre, for a block along its sides.
    pub(super) fn seen(&self, point: &Vec3) -> Vec3 {
        match self {
            Self::Block(slab) => slab.to_local(&(point - slab.center)),
            Self::Ball { center, .. } => point - center,
        }
    }

    /// The entry of the ray `origin + t * direction`, t > 0, into the solid; `None` from inside it.
    /// `from`: the origin, [`Solid::seen`].
    pub(super) fn enter(&self, from: &Vec3, direction: &Vec3) -> Option<FaceHit> {
        match self {
            Self::Block(slab) => slab.enter(from, direction),
            Self::Ball { radius, .. } => {
                let (a, b) = (direction.norm_squared(), from.dot(direction));
                // The squared distance of the ray from the centre via its nearest point, which
                // avoids cancellation.
                let nearest = from - direction * (b / a);
                let room = radius * radius - nearest.norm_squared();
                if room <= 0.0 {
                    return None;
                }
                let t = -b / a - (room / a).sqrt();
                (t > 0.0).then_some((t, 0))
            }
        }
    }

    /// The surface at `point`, where a ray hit `face`.
    pub(super) fn surface(&self, point: &Vec3, face: u8) -> SurfacePoint {
        match self {
            Self::Block(slab) => slab.surface(point, face),
            Self::Ball { center, radius } => {
                let normal = (point - center) / *radius;
                // The texture is projected from six sides, through the centre.
                let (axis, u_axis, v_axis) = match normal.iamax() {
                    0 => (0, Vec3::y(), Vec3::z()),
                    1 => (1, Vec3::x(), Vec3::z()),
                    _ => (2, Vec3::x(), Vec3::y()),
                };
                let spread = radius / normal[axis].abs();
                let u_m = u_axis.dot(&normal) * spread;
                let v_m = radius + v_axis.dot(&normal) * spread;
                SurfacePoint {
                    normal,
                    u_m,
                    v_m,
                    u_axis,
                    v_axis,
                }
            }
        }
    }

    /// Length of its unrolled sides.
    pub(super) fn girth_m(&self) -> f32 {
        match self {
            Self::Block(slab) => 4.0 * (slab.half.x + slab.half.y),
            Self::Ball { radius, .. } => 2.0 * radius,
        }
    }

    /// Corners of a bounding box; for a block, its own.
    pub(super) fn corners(&self) -> [Vec3; 8] {
        let corner =
            |i: usize| Vec3::from_fn(|axis, _| if i >> axis & 1 == 0 { -1.0 } else { 1.0 });
        std::array::from_fn(|i| match self {
            Self::Block(slab) => slab.center + slab.to_world(&corner(i).component_mul(&slab.half)),
            Self::Ball { center, radius } => center + corner(i) * *radius,
        })
    }

    /// Distance in the plane of the point `at_m` from the part of the solid lower than `height_m`,
    /// negative inside; infinite if there is no such part.
    pub(super) fn distance_below(&self, [x, y]: [f64; 2], height_m: f64) -> f64 {
        match self {
            Self::Block(slab) if f64::from(slab.center.z - slab.half.z) >= height_m => {
                f64::INFINITY
            }
            Self::Block(slab) => {
                let [x, y] = [x - f64::from(slab.center.x), y - f64::from(slab.center.y)];
                let (c, s) = (f64::from(slab.along.0), f64::from(slab.along.1));
                let beyond = [
                    (c * x + s * y).abs() - f64::from(slab.half.x),
                    (c * y - s * x).abs() - f64::from(slab.half.y),
                ];
                let outside = beyond[0].max(0.0).hypot(beyond[1].max(0.0));
                outside + beyond[0].max(beyond[1]).min(0.0)
            }
            Self::Ball { center, .. } => {
                let Some(radius) = self.radius_below(height_m) else {
                    return f64::INFINITY;
                };
                (x - f64::from(center.x)).hypot(y - f64::from(center.y)) - radius
            }
        }
    }

    /// Largest radius of a ball's part lower than `height_m`.
    fn radius_below(&self, height_m: f64) -> Option<f64> {
        let Self::Ball { center, radius } = self else {
            return None;
        };
        let (above, radius) = (f64::from(center.z) - height_m, f64::from(*radius));
        match above {
            above if above <= 0.0 => Some(radius),
            above if above < radius => Some((radius * radius - above * above).sqrt()),
            _ => None,
        }
    }

    /// Closed outline in the plane of the part lower than `height_m`.
    pub(super) fn outline_below(&self, height_m: f64) -> Option<Vec<[f64; 2]>> {
        match self {
            Self::Block(slab) if f64::from(slab.center.z - slab.half.z) >= height_m => None,
            Self::Block(_) => {
                let corners = self.corners();
                let corner = |i: usize| [f64::from(corners[i].x), f64::from(corners[i].y)];
                Some([0, 1, 3, 2, 0].map(corner).to_vec())
            }
            Self::Ball { center, .. } => {
                let radius = self.radius_below(height_m)?;
                let point = |i: i32| {
                    let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 24.0).sin_cos();
                    let center = [f64::from(center.x), f64::from(center.y)];
                    [center[0] + radius * cos, center[1] + radius * sin]
                };
                Some((0..=24).map(point).collect())
            }
        }
    }

    /// Distance of a point from its surface, 0 inside.
    pub(super) fn distance(&self, point: &Vec3) -> f32 {
        match self {
            Self::Block(slab) => {
                let outside = slab.to_local(&(point - slab.center)).abs() - slab.half;
                outside.map(|v| v.max(0.0)).norm()
            }
            Self::Ball { center, radius } => ((point - center).norm() - radius).max(0.0),
        }
    }
}

/// A component of a direction, safe to divide by: a ray along an axis is tilted imperceptibly.
pub(super) fn nonzero(component: f32) -> f32 {
    if component.abs() < 1.0e-30 {
        1.0e-30
    } else {
        component
    }
}

impl Slab {
    fn to_local(&self, v: &Vec3) -> Vec3 {
        let (c, s) = self.along;
        Vec3::new(c * v.x + s * v.y, c * v.y - s * v.x, v.z)
    }

    fn to_world(&self, v: &Vec3) -> Vec3 {
        let (c, s) = self.along;
        Vec3::new(c * v.x - s * v.y, s * v.x + c * v.y, v.z)
    }

    /// By slabs (Kay and Kajiya, SIGGRAPH 1986). The face is twice the axis, plus one on its
    /// positive side.
    fn enter(&self, from: &Vec3, direction: &Vec3) -> Option<FaceHit> {
        let towards = self.to_local(direction);
        let (mut enter, mut leave, mut face) = (0.0, f32::INFINITY, u8::MAX);
        for axis in 0..3 {
            let inverse = 1.0 / nonzero(towards[axis]);
            let middle = -from[axis] * inverse;
            let reach = self.half[axis] * inverse.abs();
            let (near, far) = (middle - reach, middle + reach);
            // The ray is inside the box between its last entry and its first exit.
            if near > enter {
                enter = near;
                face = 2 * axis as u8 + u8::from(inverse < 0.0);
            }
            if far < leave {
                leave = far;
            }
        }
        (enter < leave && face != u8::MAX).then_some((enter, face))
    }

    fn surface(&self, point: &Vec3, face: u8) -> SurfacePoint {
        let local = self.to_local(&(point - self.center));
        let sign = if face & 1 == 1 { 1.0 } else { -1.0 };
        let up = local.z + self.half.z;
        // The sides are unrolled one after the other, top and bottom follow.
        let quarter = self.half.x + self.half.y;
        let turn = if sign > 0.0 { 0.0 } else { 2.0 * quarter };
        let (normal, u_axis, v_axis, u_m, v_m) = match face / 2 {
            0 => (
                Vec3::x() * sign,
                Vec3::y() * sign,
                Vec3::z(),
                turn + quarter + sign * local.y,
                up,
            ),
            1 => (
                Vec3::y() * sign,
                Vec3::x() * -sign,
                Vec3::z(),
                turn - sign * local.x,
                up,
            ),
            _ => (
                Vec3::z() * sign,
                Vec3::x(),
                Vec3::y(),
                4.0 * quarter + local.x,
                local.y,
            ),
        };
        let world = |v: Vec3| self.to_world(&v);
        SurfacePoint {
            normal: world(normal),
            u_m,
            v_m,
            u_axis: world(u_axis),
            v_axis: world(v_axis),
        }
    }
}
