//! The world for ray casting: floor, walls, obstacles and the laboratory around them.

use super::config::WorldConfig;
use super::objects::{Objects, WALLS};
use super::solid::{Solid, Vec3, nonzero};
use super::texture::{self, Footprint, Texture};
use super::view::Candidates;
use svl_core::stereo::Surface;

/// Geometry and textures of one run.
pub(super) struct ArenaScene {
    pub(super) objects: Objects,
    /// Start of each object's piece of the forest.
    pieces_m: Vec<f32>,
    /// Lower and upper corner of the laboratory in the plane.
    room: [[f32; 2]; 2],
    /// `None` if only the geometry is needed.
    pictures: Option<ScenePictures>,
}

/// Textures of the surfaces.
struct ScenePictures {
    forest: Texture,
    floor: Texture,
    lab: Texture,
}

/// Hit of a ray.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Hit {
    /// The ray's parameter.
    pub(super) t: f32,
    /// Index of the surface: equal for neighbouring pixels exactly if there is no edge between
    /// them.
    pub(super) surface: u16,
}

const FLOOR: u16 = u16::MAX;
/// Minus the axis and side of the room's wall.
const LAB: u16 = u16::MAX - 1;

impl Hit {
    /// The surface that a pixel with this hit shows.
    pub(super) fn shows(&self) -> Surface {
        match self.surface {
            FLOOR => Surface::Floor,
            lab if lab >= LAB - 3 => Surface::Room,
            solid if usize::from(solid >> 3) < WALLS => Surface::Wall,
            _ => Surface::Object,
        }
    }
}

impl ArenaScene {
    /// The geometry of `world` with the given objects.
    pub(super) fn new(world: &WorldConfig, objects: Objects) -> Self {
        let solids = &objects.solids;
        let mut end_m = 0.0;
        let piece = |(i, solid): (usize, &Solid)| {
            let girth_m = solid.girth_m();
            // Unrolled coordinates begin at minus half a side: at most a quarter of the girth below
            // 0.
            let begin_m = end_m + 0.25 * girth_m;
            // Only the inner side of the walls is seen, half of their girth.
            end_m += if i < WALLS { 0.5 } else { 1.0 } * girth_m;
            begin_m
        };
        let pieces_m = solids.iter().enumerate().map(piece).collect();
        let margin = world.room_margin_m as f32;
        Self {
            pieces_m,
            room: [
                [-margin; 2],
                [
                    world.width_m as f32 + margin,
                    world.length_m as f32 + margin,
                ],
            ],
            pictures: None,
            objects,
        }
    }

    /// Paints the textures of `world`, from which it was built.
    pub(super) fn paint(&mut self, world: &WorldConfig, seed: u64) {
        let solids = &self.objects.solids;
        let light = |x: f32, y: f32| {
            let near =
                |solid: &Solid| (1.0 - solid.distance(&Vec3::new(x, y, 0.0)) / 0.09).max(0.0);
            solids.iter().fold(1.0, |light, solid| {
                // Ambient occlusion: the floor is darker at the foot of things.
                light * (1.0 - 0.45 * near(solid) * near(solid))
            })
        };
        self.pictures = Some(ScenePictures {
            forest: texture::forest(seed, world.forest_contrast as f32),
            floor: texture::floor(seed, world, light),
            lab: texture::room(seed),
        });
    }

    /// True once painted.
    pub(super) fn is_painted(&self) -> bool {
        self.pictures.is_some()
    }

    /// The first hit of a ray from the camera. `set`: the candidate solids of the ray.
    pub(super) fn cast(&self, candidates: &Candidates, set: u64, direction: &Vec3) -> Hit {
        let mut hit = self.lab_or_floor(&candidates.origin, direction);
        for (i, (t, face)) in self.objects.enter(candidates, set, direction) {
            if t < hit.t {
                hit = Hit {
                    t,
                    surface: (i as u16) << 3 | u16::from(face),
                };
            }
        }
        hit
    }

    fn lab_or_floor(&self, origin: &Vec3, direction: &Vec3) -> Hit {
        let floor = if direction.z < 0.0 {
            -origin.z / direction.z
        } else {
            f32::INFINITY
        };
        let wall = |axis: usize| {
            let towards = nonzero(direction[axis]);
            let side = usize::from(towards > 0.0);
            let t = (self.room[side][axis] - origin[axis]) / towards;
            Hit {
                t,
                surface: LAB - (2 * axis + side) as u16,
            }
        };
        let nearer = |a: Hit, b: Hit| if b.t < a.t { b } else { a };
        nearer(
            nearer(
                Hit {
                    t: floor,
                    surface: FLOOR,
                },
                wall(0),
            ),
            wall(1),
        )
    }

    /// Light from a hit, 1 from a white surface that faces the lamps. `pixel`: angle covered by a
    /// pixel, radians, with the lens's blur.
    pub(super) fn radiance(&self, origin: &Vec3, direction: &Vec3, hit: Hit, pixel: f32) -> f32 {
        // A scene without textures is never rendered.
        let Some(pictures) = &self.pictures else {
            return 0.0;
        };
        let point = origin + direction * hit.t;
        let minor_m = hit.t * pixel;
        match hit.surface {
            FLOOR => {
                let at = footprint(
                    (point.x, point.y),
                    (Vec3::x(), Vec3::y()),
                    &Vec3::z(),
                    direction,
                    minor_m,
                );
                0.9 * pictures.floor.albedo(&at)
            }
            lab if lab >= LAB - 3 => {
                let wall = LAB - lab;
                let (along, normal) = if wall < 2 {
                    (Vec3::y(), Vec3::x())
                } else {
                    (Vec3::x(), Vec3::y())
                };
                // The four walls are unrolled 10 m apart.
                let u_m = along.dot(&point) + 10.0 * f32::from(wall);
                0.8 * pictures.lab.albedo(&footprint(
                    (u_m, point.z),
                    (along, Vec3::z()),
                    &normal,
                    direction,
                    minor_m,
                ))
            }
            solid => {
                let index = usize::from(solid >> 3);
                let surface = self.objects.solids[index].surface(&point, (solid & 7) as u8);
                let u_m = surface.u_m + self.pieces_m[index];
                let axes = (surface.u_axis, surface.v_axis);
                let at = footprint(
                    (u_m, surface.v_m),
                    axes,
                    &surface.normal,
                    direction,
                    minor_m,
                );
                pictures.forest.albedo(&at) * lamps(&surface.normal) * sky(point.z)
            }
        }
    }
}

/// The light of the ceiling's lamps on a surface: mostly from above, a little more from one side.
fn lamps(normal: &Vec3) -> f32 {
    0.68 + 0.40 * normal.z + 0.14 * normal.x - 0.10 * normal.y
}

/// Fraction of light that reaches a wall at a height above the floor.
fn sky(z: f32) -> f32 {
    let shade = (1.0 - z / 0.06).max(0.0);
    1.0 - 0.3 * shade * shade
}

fn footprint(
    (u_m, v_m): (f32, f32),
    axes: (Vec3, Vec3),
    normal: &Vec3,
    direction: &Vec3,
    minor_m: f32,
) -> Footprint {
    let facing = normal.dot(direction);
    let length = direction.norm();
    let stretch = (length / facing.abs().max(1.0e-3)).max(1.0);
    // Along the surface, away from the camera; its length is that of the direction's tangential
    // part.
    let away = direction - normal * facing;
    let scale = 0.5 * minor_m * stretch / away.norm().max(1.0e-6);
    Footprint {
        u_m,
        v_m,
        minor_m,
        reach_m: (axes.0.dot(&away) * scale, axes.1.dot(&away) * scale),
        stretch,
    }
}
