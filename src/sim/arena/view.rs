//! A pinhole camera at one instant: the rays of its pixels, and the solids that each can hit.

use super::solid::{Solid, Vec3};
use nalgebra::Matrix3;
use svl_core::stereo::{Pose, Rig};

/// A pinhole camera in the world.
pub(super) struct PinholeView {
    pub(super) origin: Vec3,
    /// Columns: right, down, forward.
    axes: Matrix3<f32>,
    pub(super) focal_px: f32,
    center_px: (f32, f32),
    skew: ImageSkew,
}

/// Misalignment of an image against the rectified one: rotated about its centre, then moved down.
#[derive(Clone, Copy)]
pub(super) struct ImageSkew {
    pub(super) sin_roll: f32,
    pub(super) row_offset_px: f32,
}

impl ImageSkew {
    pub(super) const NONE: Self = Self {
        sin_roll: 0.0,
        row_offset_px: 0.0,
    };
}

impl PinholeView {
    pub(super) fn new(pose: &Pose, rig: &Rig, skew: ImageSkew) -> Self {
        let (cx, cy) = rig.center_px();
        Self {
            origin: pose.translation.vector.cast(),
            axes: pose.rotation.to_rotation_matrix().matrix().cast(),
            focal_px: rig.focal_px() as f32,
            center_px: (cx as f32, cy as f32),
            skew,
        }
    }

    /// Direction of the pixel (`x`, `y`) in camera axes, scaled to depth 1.
    pub(super) fn slope(&self, x: f32, y: f32) -> (f32, f32) {
        let dx = x - self.center_px.0;
        let dy = y - self.center_px.1 - self.skew.row_offset_px;
        // Roll is a fraction of a degree: the cosine is one to a millionth.
        let sin = self.skew.sin_roll;
        (
            (dx + sin * dy) / self.focal_px,
            (dy - sin * dx) / self.focal_px,
        )
    }

    /// The ray of a slope in the world; its point at `t` has the depth `t`.
    pub(super) fn ray(&self, (x, y): (f32, f32)) -> Vec3 {
        self.axes.column(0) * x + self.axes.column(1) * y + self.axes.column(2)
    }

    /// The squared distance of a pixel from the centre, relative to the image's corner.
    pub(super) fn eccentricity(&self, x: usize, y: usize) -> f32 {
        let (cx, cy) = self.center_px;
        let (dx, dy) = (x as f32 - cx, y as f32 - cy);
        (dx * dx + dy * dy) / (cx * cx + cy * cy)
    }
}

/// For every tile of an image, the set of solids that its rays can hit, as bits.
pub(super) struct Candidates {
    pub(super) origin: Vec3,
    /// The camera in the coordinates of each solid.
    pub(super) from: Vec<Vec3>,
    columns: Vec<u64>,
    rows: Vec<u64>,
}

const TILE_PX: usize = 16;

impl Candidates {
    pub(super) fn new(
        view: &PinholeView,
        solids: &[Solid],
        (width, height): (usize, usize),
    ) -> Self {
        let corners: Vec<[Vec3; 8]> = (solids.iter())
            .map(|solid| {
                solid
                    .corners()
                    .map(|corner| view.axes.tr_mul(&(corner - view.origin)))
            })
            .collect();
        // Half a pixel for the samples within one, the rest for the skew.
        let reach = view.center_px.0.max(view.center_px.1);
        let margin = 1.0 + view.skew.row_offset_px.abs() + view.skew.sin_roll.abs() * reach;
        // A solid is outside if all its corners lie beyond one of the planes that bound the tile's
        // rays.
        let between = |axis: usize, center: f32, tile: usize| {
            let from = ((tile * TILE_PX) as f32 - center - margin) / view.focal_px;
            let to = (((tile + 1) * TILE_PX) as f32 - center + margin) / view.focal_px;
            corners.iter().enumerate().fold(0, |set, (i, corners)| {
                let before = corners.iter().all(|c| c[axis] < from * c.z);
                let beyond = corners.iter().all(|c| c[axis] > to * c.z);
                let behind = corners.iter().all(|c| c.z <= 0.0);
                if before || beyond || behind {
                    set
                } else {
                    set | 1 << i
                }
            })
        };
        Self {
            origin: view.origin,
            from: solids.iter().map(|s| s.seen(&view.origin)).collect(),
            // A tile has the solids common to its column and its row: perhaps a few more than its
            // rays hit, but found quickly.
            columns: (0..width.div_ceil(TILE_PX))
                .map(|tile| between(0, view.center_px.0, tile))
                .collect(),
            rows: (0..height.div_ceil(TILE_PX))
                .map(|tile| between(1, view.center_px.1, tile))
                .collect(),
        }
    }

    /// The set for the pixel (`x`, `y`).
    pub(super) fn at(&self, x: usize, y: usize) -> u64 {
        self.columns[x / TILE_PX] & self.rows[y / TILE_PX]
    }
}
