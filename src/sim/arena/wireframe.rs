//! Wireframe of the arena for 3D viewers.

use super::config::WorldConfig;
use super::objects::Objects;
use super::path::Walk;
use super::solid::{Solid, Vec3};

/// A named object as line strips in the world, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct WireObject {
    pub name: String,
    pub strips: Vec<Vec<[f32; 3]>>,
}

/// Floor, walls, blocks, balls and the robot's path (`path`).
pub(super) fn wires(objects: &Objects, walk: &Walk, world: &WorldConfig) -> Vec<WireObject> {
    let (w, l) = (world.width_m as f32, world.length_m as f32);
    let border = [[0.0, 0.0], [w, 0.0], [w, l], [0.0, l], [0.0, 0.0]];
    let floor = WireObject {
        name: "floor".into(),
        strips: vec![border.map(|[x, y]| [x, y, 0.0]).to_vec()],
    };
    let steps = (walk.length_m() / 0.02).ceil() as usize;
    let way = (0..=steps).map(|i| {
        let at = walk.middle(walk.length_m() * i as f64 / steps as f64);
        [at.x as f32, at.y as f32, 0.0]
    });
    let path = WireObject {
        name: "path".into(),
        strips: vec![way.collect()],
    };
    let solids = objects.named().map(|(name, solid)| WireObject {
        name: name.into(),
        strips: outline(solid),
    });
    [floor].into_iter().chain(solids).chain([path]).collect()
}

fn outline(solid: &Solid) -> Vec<Vec<[f32; 3]>> {
    match solid {
        Solid::Block(_) => {
            let corners = solid.corners().map(|c| [c.x, c.y, c.z]);
            let strip = |order: &[usize]| order.iter().map(|&i| corners[i]).collect();
            vec![
                // Corners are numbered by the bits of x, y and z: one line around the bottom, up,
                // and around the top; three edges remain.
                strip(&[0, 1, 3, 2, 0, 4, 5, 7, 6, 4]),
                strip(&[1, 5]),
                strip(&[3, 7]),
                strip(&[2, 6]),
            ]
        }
        Solid::Ball { center, radius } => {
            let circle = |a: Vec3, b: Vec3| {
                let point = |i: u8| {
                    let (sin, cos) = (f32::from(i) * std::f32::consts::TAU / 24.0).sin_cos();
                    let p = center + (a * cos + b * sin) * *radius;
                    [p.x, p.y, p.z]
                };
                (0..=24).map(point).collect()
            };
            vec![
                circle(Vec3::x(), Vec3::y()),
                circle(Vec3::y(), Vec3::z()),
                circle(Vec3::z(), Vec3::x()),
            ]
        }
    }
}
