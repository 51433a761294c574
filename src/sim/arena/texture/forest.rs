//! Forest pictures, side by side like the sheets on the arena's walls (thesis, figure 7.2).

use super::{Texture, fabric};
use crate::arena::noise::{Dice, NoiseStream};
use rayon::prelude::*;

/// Texels along the whole row of sheets; with [`TEXEL_M`] 18.8 m, enough that in the default arena
/// no two surfaces share a piece.
const WIDTH: usize = 16_384;
/// Texels from the floor upwards.
const HEIGHT: usize = 256;
const TEXEL_M: f32 = 0.00115;

/// A row of forest pictures, each with its own light, trees and leaves. a `contrast` of 1 is that
/// of a good print.
pub(crate) fn forest(seed: u64, contrast: f32) -> Texture {
    let mut dice = Dice::new(seed, NoiseStream::Sheets);
    let mut widths = Vec::new();
    let mut rest = WIDTH;
    while rest > 0 {
        let width = (dice.between(280.0, 460.0) as usize).min(rest);
        // Avoids a sliver of a sheet at the end.
        let width = if rest - width < 280 { rest } else { width };
        widths.push(width);
        rest -= width;
    }
    let sheets: Vec<fabric::SheetCanvas> = widths
        .par_iter()
        .enumerate()
        .map(|(i, &width)| sheet(width, contrast, &mut Dice::new(seed, NoiseStream::Sheet(i))))
        .collect();
    let mut albedo = Vec::with_capacity(WIDTH * HEIGHT);
    for row in 0..HEIGHT {
        for sheet in &sheets {
            albedo.extend_from_slice(&sheet.tones[row * sheet.width..][..sheet.width]);
        }
    }
    Texture::new(WIDTH, &albedo, TEXEL_M)
}

/// One picture, painted from far to near.
fn sheet(width: usize, contrast: f32, dice: &mut Dice) -> fabric::SheetCanvas {
    let haze = dice.between(0.45, 0.75);
    let clumps = fabric::clouds(width, HEIGHT, 6, dice);
    let fine = fabric::clouds(width, HEIGHT, 3, dice);
    let tones = (clumps.iter().zip(&fine).enumerate())
        .map(|(i, (clump, fine))| {
            let up = (i / width) as f32 / HEIGHT as f32;
            haze * (0.30 + 0.85 * up) + 0.09 * clump + 0.03 * fine
        })
        .collect();
    let mut canvas = fabric::SheetCanvas {
        width,
        height: HEIGHT,
        tones,
    };

    for _ in 0..width / 16 {
        let (x, breadth) = (dice.between(0.0, width as f32), dice.between(2.0, 6.0));
        let (lean, tone) = (dice.between(-0.04, 0.04), haze * dice.between(0.45, 0.85));
        canvas.trunk(x, breadth, lean, tone, 0.08, dice);
    }
    let foliage = dice.between(0.07, 0.13);
    leaves(&mut canvas, &clumps, (foliage, 1.0), haze, dice);
    for _ in 0..1 + width / 85 {
        let (x, breadth) = (dice.between(0.0, width as f32), dice.between(9.0, 34.0));
        let (lean, tone) = (dice.between(-0.08, 0.08), dice.between(0.10, 0.34));
        canvas.trunk(x, breadth, lean, tone, 0.16, dice);
    }
    leaves(&mut canvas, &clumps, (0.12 * foliage, 1.7), haze, dice);
    expose(&mut canvas, &fine, contrast, dice);
    canvas
}

/// Leaves of sizes distributed as r^-3, the dead-leaves model of natural images (Lee, Mumford and
/// Huang, IJCV 2001), in clumps: `per_texel` of them, `scale` times the usual size.
fn leaves(
    canvas: &mut fabric::SheetCanvas,
    clumps: &[f32],
    (per_texel, scale): (f32, f32),
    haze: f32,
    dice: &mut Dice,
) {
    const MIN_RADIUS: f32 = 1.2;
    const MAX_RADIUS: f32 = 9.0;
    let count = (per_texel * canvas.tones.len() as f32) as usize;
    for _ in 0..count {
        let x = dice.between(0.0, canvas.width as f32);
        let y = dice.between(0.0, canvas.height as f32);
        let clump = clumps[y as usize * canvas.width + x as usize];
        let up = y / canvas.height as f32;
        // Undergrowth and canopy are dense; the space between the trunks is not.
        let density = 0.40 + 0.6 * clump + if up < 0.25 { 0.5 } else { 0.0 };
        if !dice.chance(density) {
            continue;
        }
        let ratio = MIN_RADIUS / MAX_RADIUS;
        let radius =
            scale * MIN_RADIUS / (1.0 - dice.between(0.0, 1.0) * (1.0 - ratio * ratio)).sqrt();
        let tone = (0.10 + haze * (0.25 + 0.45 * up) + 0.14 * clump) * dice.between(0.45, 1.6);
        let (slimness, along) = (dice.between(0.3, 0.7), dice.direction());
        canvas.leaf((x, y), radius, slimness, along, tone);
    }
}

/// Paper grain, the print's exposure and contrast, and a pale margin at either end.
fn expose(canvas: &mut fabric::SheetCanvas, grain: &[f32], contrast: f32, dice: &mut Dice) {
    let width = canvas.width;
    let mean = canvas.tones.iter().sum::<f32>() / canvas.tones.len() as f32;
    let target = dice.between(0.34, 0.48);
    let margin = dice.between(0.0, 3.0) as usize;
    for (i, (tone, grain)) in canvas.tones.iter_mut().zip(grain).enumerate() {
        let column = i % width;
        let print = target + contrast * (1.05 * (*tone - mean) + 0.012 * grain);
        let edge = column < margin || column + margin >= width;
        *tone = if edge { 0.72 } else { print.clamp(0.03, 0.92) };
    }
}
