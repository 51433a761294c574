//! Textures of the surfaces: albedo pictures with mip-maps, sampled by footprint.

mod fabric;
mod floor;
mod forest;
mod pattern;
mod room;

pub(super) use fabric::clouds;
pub(super) use floor::floor;
pub(super) use forest::forest;
pub(super) use room::room;

use rayon::prelude::*;

/// A picture of albedos that repeats in both directions, with all its halvings (Williams, SIGGRAPH
/// 1983).
pub(super) struct Texture {
    levels: Vec<Level>,
    texel_m: f32,
}

/// A picture in blocks of 8 x 8 texels, each a cache line: a footprint touches few of them. The
/// last levels are smaller than a block and leave the rest of it empty.
struct Level {
    width: usize,
    height: usize,
    texels: Vec<u8>,
}

/// Logarithm of a block's side, in texels.
const BLOCK_BITS: usize = 3;
const BLOCK: usize = 1 << BLOCK_BITS;

/// Area of a surface covered by a pixel, in metres of the texture's own axes.
pub(super) struct Footprint {
    pub(super) u_m: f32,
    pub(super) v_m: f32,
    /// Extent across the view direction.
    pub(super) minor_m: f32,
    /// Half of the extent along the view direction, as a vector of (u, v).
    pub(super) reach_m: (f32, f32),
    /// Extent along the view direction as a multiple of `minor_m`, 1 or more.
    pub(super) stretch: f32,
}

/// Most samples along the longer side of a footprint; longer ones are blurred.
const TAPS: i32 = 4;

impl Texture {
    /// From rows of albedos 0..=1, bottom row first. Both sides must be powers of two.
    fn new(width: usize, albedo: &[f32], texel_m: f32) -> Self {
        let height = albedo.len() / width;
        debug_assert!(width.is_power_of_two() && height.is_power_of_two());
        let texel = |x: usize, y: usize| (albedo[y * width + x] * 255.0 + 0.5) as u8;
        let mut levels = vec![Level::new((width, height), texel)];
        while let Some(half) = levels.last().and_then(Level::half) {
            levels.push(half);
        }
        Self { levels, texel_m }
    }

    /// Mean albedo over a footprint, 0..=1.
    pub(super) fn albedo(&self, at: &Footprint) -> f32 {
        let taps = (at.stretch as i32).clamp(1, TAPS);
        let per_tap = at.minor_m * (at.stretch / taps as f32).max(1.0);
        let level = octave(per_tap / self.texel_m).clamp(0.0, (self.levels.len() - 1) as f32);
        let (mut sum, step, per_m) = (0.0, 2.0 / taps as f32, 1.0 / self.texel_m);
        // Whole periods of both sides are added to keep the casts below positive, so that they
        // round down.
        let lift = (4 * self.levels[0].width.max(self.levels[0].height)) as f32;
        for tap in 0..taps {
            let along = (tap as f32 + 0.5) * step - 1.0;
            let (u, v) = (at.u_m + along * at.reach_m.0, at.v_m + along * at.reach_m.1);
            sum += self.trilinear(u * per_m + lift, v * per_m + lift, level);
        }
        sum / (255 * taps) as f32
    }

    fn trilinear(&self, u: f32, v: f32, level: f32) -> f32 {
        let fine = level as usize;
        let blend = level - fine as f32;
        let scale = 1.0 / (1u32 << fine) as f32;
        let a = self.levels[fine].bilinear(u * scale, v * scale);
        match self.levels.get(fine + 1) {
            // A smaller fraction of the second level is not worth its four look-ups.
            Some(coarse) if blend > 0.02 => {
                a + blend * (coarse.bilinear(u * scale * 0.5, v * scale * 0.5) - a)
            }
            _ => a,
        }
    }
}

impl Level {
    fn new((width, height): (usize, usize), texel: impl Fn(usize, usize) -> u8 + Sync) -> Self {
        let columns = width.div_ceil(BLOCK);
        let mut texels = vec![0; columns * height.div_ceil(BLOCK) * BLOCK * BLOCK];
        let rows = texels
            .par_chunks_exact_mut(columns * BLOCK * BLOCK)
            .enumerate();
        rows.for_each(|(row, blocks)| {
            for (i, out) in blocks.iter_mut().enumerate() {
                let (block, place) = (i / (BLOCK * BLOCK), i % (BLOCK * BLOCK));
                let x = block * BLOCK + place % BLOCK;
                let y = row * BLOCK + place / BLOCK;
                if x < width && y < height {
                    *out = texel(x, y);
                }
            }
        });
        Self {
            width,
            height,
            texels,
        }
    }

    /// Index of a texel: contribution of its column,
    fn column(&self, x: usize) -> usize {
        let x = x & (self.width - 1);
        (x >> BLOCK_BITS) << (2 * BLOCK_BITS) | x & (BLOCK - 1)
    }

    /// and of its row.
    fn row(&self, y: usize) -> usize {
        let y = y & (self.height - 1);
        let blocks = (y >> BLOCK_BITS) * self.width.div_ceil(BLOCK);
        blocks << (2 * BLOCK_BITS) | (y & (BLOCK - 1)) << BLOCK_BITS
    }

    /// The texture at half the size; `None` below one texel.
    fn half(&self) -> Option<Self> {
        if self.width < 2 || self.height < 2 {
            return None;
        }
        Some(Self::new((self.width / 2, self.height / 2), |x, y| {
            let at = |dx: usize, dy: usize| {
                u16::from(self.texels[self.column(2 * x + dx) + self.row(2 * y + dy)])
            };
            ((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4) as u8
        }))
    }

    /// Texel centres are at halves; `u` and `v` are positive.
    fn bilinear(&self, u: f32, v: f32) -> f32 {
        let (u, v) = (u - 0.5, v - 0.5);
        let (iu, iv) = (u as i32, v as i32);
        let (fu, fv) = (u - iu as f32, v - iv as f32);
        // Sides are powers of two, so a mask repeats the picture in both directions.
        let (c0, c1) = (self.column(iu as usize), self.column((iu + 1) as usize));
        let (r0, r1) = (self.row(iv as usize), self.row((iv + 1) as usize));
        let texel = |i: usize| f32::from(self.texels[i]);
        let low = texel(r0 + c0) + fu * (texel(r0 + c1) - texel(r0 + c0));
        let high = texel(r1 + c0) + fu * (texel(r1 + c1) - texel(r1 + c0));
        low + fv * (high - low)
    }
}

/// Base-2 logarithm to within 0.09: exact at powers of two, linear between them, and the same on
/// every machine.
fn octave(x: f32) -> f32 {
    let bits = x.max(1.0e-6).to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let mantissa = f32::from_bits((bits & 0x007F_FFFF) | 0x3F80_0000);
    exponent as f32 + (mantissa - 1.0)
}
