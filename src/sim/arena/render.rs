//! Ray casting: the sharp image of a camera with its geometry, and the truth between two cameras.

use super::scene::{ArenaScene, Hit};
use super::view::{Candidates, PinholeView};
use rayon::prelude::*;
use svl_core::stereo::{Plane, Rig, Truth, Visibility};

/// View of a pinhole camera at one instant, row-major.
pub(super) struct SharpImage {
    pub(super) width: usize,
    /// Light per pixel, 1 from a white surface that faces the lamps.
    pub(super) radiance: Vec<f32>,
    /// Hit of the ray through each pixel's centre; its `t` is the depth.
    pub(super) hits: Vec<Hit>,
}

/// Blur of a lens, as a wider footprint of the pixels.
pub(super) struct Lens {
    pub(super) focal_px: f32,
    pub(super) aperture_m: f32,
    pub(super) focus_m: f32,
}

impl Lens {
    /// Angle covered by a pixel at a depth, radians: one pixel and the circle of confusion.
    fn angle(&self, depth_m: f32) -> f32 {
        // A disc is as wide as a square of 0.87 times its diameter with the same variance.
        let disc_px = 0.87 * self.focal_px * self.aperture_m * (1.0 / depth_m - 1.0 / self.focus_m);
        (1.0 + disc_px * disc_px).sqrt() / self.focal_px
    }
}

/// Offsets of the samples in a pixel crossed by an edge: a rotated grid.
pub(super) const SAMPLES_PX: [(f32, f32); 4] = [
    (-0.125, -0.375),
    (0.375, -0.125),
    (0.125, 0.375),
    (-0.375, 0.125),
];

/// The rays of a camera.
struct SceneRays<'a> {
    scene: &'a ArenaScene,
    view: &'a PinholeView,
    lens: &'a Lens,
    candidates: Candidates,
}

impl SceneRays<'_> {
    /// The hit and the light of the ray at (x, y). `set`: the solids that it can hit.
    fn light(&self, x: f32, y: f32, set: u64) -> (Hit, f32) {
        let ray = self.view.ray(self.view.slope(x, y));
        let hit = self.scene.cast(&self.candidates, set, &ray);
        let angle = self.lens.angle(hit.t);
        (
            hit,
            self.scene.radiance(&self.view.origin, &ray, hit, angle),
        )
    }

    /// The light of a pixel that is crossed by an edge.
    fn mean_light(&self, x: usize, y: usize) -> f32 {
        let set = self.candidates.at(x, y);
        let sum: f32 = SAMPLES_PX
            .iter()
            .map(|(dx, dy)| self.light(x as f32 + dx, y as f32 + dy, set).1)
            .sum();
        sum / SAMPLES_PX.len() as f32
    }
}

impl SharpImage {
    /// Renders the image: one ray per pixel, four where surfaces meet. Defocus widens a pixel's
    /// footprint on its surface, so surfaces blur with distance but the outlines of near things do
    /// not.
    pub(super) fn take(
        scene: &ArenaScene,
        view: &PinholeView,
        lens: &Lens,
        size: (usize, usize),
    ) -> Self {
        let (width, height) = size;
        let rays = SceneRays {
            scene,
            view,
            lens,
            candidates: Candidates::new(view, &scene.objects.solids, size),
        };
        let nothing = Hit {
            t: f32::INFINITY,
            surface: 0,
        };
        let mut hits = vec![nothing; width * height];
        let mut radiance = vec![0.0; width * height];
        let rows = hits
            .par_chunks_exact_mut(width)
            .zip(radiance.par_chunks_exact_mut(width));
        rows.enumerate().for_each(|(y, (hits, radiance))| {
            for (x, (hit, value)) in hits.iter_mut().zip(radiance).enumerate() {
                let set = rays.candidates.at(x, y);
                (*hit, *value) = rays.light(x as f32, y as f32, set);
            }
        });
        radiance
            .par_chunks_exact_mut(width)
            .enumerate()
            .for_each(|(y, radiance)| {
                let row = |y: usize| &hits[y * width..][..width];
                let above = row(y.saturating_sub(1));
                let here = row(y);
                let below = row((y + 1).min(height - 1));
                for (x, value) in radiance.iter_mut().enumerate() {
                    let own = here[x].surface;
                    let around = [
                        here[x.saturating_sub(1)],
                        here[(x + 1).min(width - 1)],
                        above[x],
                        below[x],
                    ];
                    // Only there does one ray per pixel alias: inside a surface the texture is
                    // filtered.
                    if around.iter().any(|hit| hit.surface != own) {
                        *value = rays.mean_light(x, y);
                    }
                }
            });
        Self {
            width,
            radiance,
            hits,
        }
    }
}

/// True disparities of a camera with that rig.
pub(super) fn disparity(
    scene: &ArenaScene,
    view: &PinholeView,
    rig: &Rig,
    (width, height): (usize, usize),
) -> svl_core::Result<Plane<f32>> {
    let candidates = Candidates::new(view, &scene.objects.solids, (width, height));
    let focal_baseline = (rig.focal_px() * rig.baseline_m()) as f32;
    let mut disparity = vec![0.0; width * height];
    let rows = disparity.par_chunks_exact_mut(width).enumerate();
    rows.for_each(|(y, row)| {
        for (x, value) in row.iter_mut().enumerate() {
            let ray = view.ray(view.slope(x as f32, y as f32));
            *value = focal_baseline / scene.cast(&candidates, candidates.at(x, y), &ray).t;
        }
    });
    Plane::from_vec(width, height, disparity)
}

/// True disparity and visibility of the left image: `left` is its sharp image, `views` are the two
/// cameras as if rectified exactly.
///
/// A point is occluded if it falls outside the right image or a solid lies between it and the right
/// camera.
pub(super) fn truth(
    scene: &ArenaScene,
    left: &SharpImage,
    [left_view, right_view]: [&PinholeView; 2],
    rig: &Rig,
) -> svl_core::Result<Truth> {
    let width = left.width;
    let size = (width, left.hits.len() / width);
    let candidates = Candidates::new(right_view, &scene.objects.solids, size);
    let focal_baseline = (rig.focal_px() * rig.baseline_m()) as f32;
    let to_right = left_view.origin - right_view.origin;
    let mut disparity = vec![f32::INFINITY; left.hits.len()];
    let mut visibility = vec![Visibility::Unknown; left.hits.len()];
    let rows = disparity
        .par_chunks_exact_mut(width)
        .zip(visibility.par_chunks_exact_mut(width));
    rows.zip(left.hits.par_chunks_exact(width))
        .enumerate()
        .for_each(|(y, ((disparity, visibility), hits))| {
            for (x, hit) in hits.iter().enumerate() {
                // For the exact rig: neither lens blur nor the skew of the right image affects the
                // truth.
                disparity[x] = focal_baseline / hit.t;
                let right_x = x as f32 - disparity[x];
                let inside = right_x > -0.5 && right_x < width as f32 - 0.5;
                let hidden = || {
                    let ray = left_view.ray(left_view.slope(x as f32, y as f32)) * hit.t + to_right;
                    let set = candidates.at((right_x + 0.5) as usize, y);
                    scene.objects.hide(&candidates, set, &ray)
                };
                visibility[x] = if inside && !hidden() {
                    Visibility::Visible
                } else {
                    Visibility::Occluded
                };
            }
        });
    let surface = left.hits.iter().map(|hit| hit.shows()).collect();
    Ok(Truth {
        surface: Some(Plane::from_vec(size.0, size.1, surface)?),
        ..Truth::exact(
            Plane::from_vec(size.0, size.1, disparity)?,
            Some(Plane::from_vec(size.0, size.1, visibility)?),
        )
    })
}
