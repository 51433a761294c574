//! The arena's floor: its covering, and the light that reaches it.

use super::pattern::Pattern;
use super::{Texture, fabric};
use crate::arena::config::{FloorPattern, WorldConfig};
use crate::arena::noise::{Dice, NoiseStream};
use rayon::prelude::*;

/// Linoleum: 2 m x 4 m with [`TEXEL_M`], of a longer arena 2 m x 8 m; a still larger arena's floor
/// repeats.
const WIDTH: usize = 1024;
const HEIGHT: usize = 2048;
const TEXEL_M: f32 = 0.002;

/// The patterned floors have twice the texel density: their detail is finer.
const PATTERN_DETAIL: usize = 2;

/// The floor of the run with that seed; `light` returns the fraction of light that reaches a point.
pub(crate) fn floor(
    seed: u64,
    world: &WorldConfig,
    light: impl Fn(f32, f32) -> f32 + Sync,
) -> Texture {
    let mut dice = Dice::new(seed, NoiseStream::Floor);
    let is_long = world.length_m as f32 > HEIGHT as f32 * TEXEL_M;
    let height = if is_long { 2 * HEIGHT } else { HEIGHT };
    let patterns = &world.floor_patterns;
    match patterns[(seed % patterns.len() as u64) as usize] {
        FloorPattern::Linoleum => linoleum(height, world.floor_contrast as f32, light, &mut dice),
        kind => patterned(height, &Pattern::new(kind, &mut dice), light),
    }
}

fn patterned(height: usize, pattern: &Pattern, light: impl Fn(f32, f32) -> f32) -> Texture {
    let (width, height) = (PATTERN_DETAIL * WIDTH, PATTERN_DETAIL * height);
    let texel_m = TEXEL_M / PATTERN_DETAIL as f32;
    let shade = Shade::new((width, height), texel_m, light);
    let albedo: Vec<f32> = (0..width * height)
        .into_par_iter()
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let tone = pattern.albedo(x as f32 * texel_m, y as f32 * texel_m);
            (tone * shade.at(x, y)).clamp(0.02, 0.95)
        })
        .collect();
    Texture::new(width, &albedo, texel_m)
}

/// Linoleum as in the thesis: grey, speckled, with scuffs, much weaker than the walls. `contrast`
/// is the standard deviation of the speckles' albedo.
fn linoleum(
    height: usize,
    contrast: f32,
    light: impl Fn(f32, f32) -> f32,
    dice: &mut Dice,
) -> Texture {
    let stains = fabric::clouds(WIDTH, height, 8, dice);
    let mut speckles: Vec<f32> = (0..WIDTH * height)
        .map(|_| dice.between(-1.7, 1.7))
        .collect();
    for _ in 0..260 {
        let mut x = dice.between(0.0, WIDTH as f32);
        let mut y = dice.between(0.0, height as f32);
        let (along, tone) = (dice.direction(), dice.between(-3.5, 2.5));
        for _ in 0..dice.between(10.0, 90.0) as usize {
            (x, y) = (x + along.0, y + along.1);
            let (column, row) = (x.max(0.0) as usize, y.max(0.0) as usize);
            // A scuff that leaves the picture does not continue on the other side.
            if column < WIDTH && row < height {
                speckles[row * WIDTH + column] += tone;
            }
        }
    }
    let shade = Shade::new((WIDTH, height), TEXEL_M, light);
    let albedo: Vec<f32> = (stains.iter().zip(&speckles).enumerate())
        .map(|(i, (stain, speckle))| {
            let tone = 0.42 + contrast * (0.7 * stain + speckle);
            (tone * shade.at(i % WIDTH, i / WIDTH)).clamp(0.02, 0.95)
        })
        .collect();
    Texture::new(WIDTH, &albedo, TEXEL_M)
}

/// Light on the floor, computed at every eighth texel.
struct Shade {
    columns: usize,
    light: Vec<f32>,
}

impl Shade {
    const STEP: usize = 8;

    fn new((width, height): (usize, usize), texel_m: f32, light: impl Fn(f32, f32) -> f32) -> Self {
        let columns = width / Self::STEP + 2;
        let rows = height / Self::STEP + 2;
        let step_m = Self::STEP as f32 * texel_m;
        let at = |i: usize| light((i % columns) as f32 * step_m, (i / columns) as f32 * step_m);
        Self {
            columns,
            light: (0..columns * rows).map(at).collect(),
        }
    }

    fn at(&self, x: usize, y: usize) -> f32 {
        // Bilinear between the eighth texels: light varies slowly and is expensive to compute.
        let fraction = |v: usize| (v % Self::STEP) as f32 / Self::STEP as f32;
        let first = y / Self::STEP * self.columns + x / Self::STEP;
        let row = |i: usize| self.light[i] + fraction(x) * (self.light[i + 1] - self.light[i]);
        row(first) + fraction(y) * (row(first + self.columns) - row(first))
    }
}
