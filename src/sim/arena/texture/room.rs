//! The laboratory around the arena: pale walls with a little furniture, out of focus and nearly
//! without texture.

use super::{Texture, fabric};
use crate::arena::noise::{Dice, NoiseStream};

/// 41 m x 5.1 m with [`TEXEL_M`].
const WIDTH: usize = 2048;
const HEIGHT: usize = 256;
const TEXEL_M: f32 = 0.02;

/// The four walls, unrolled.
pub(crate) fn room(seed: u64) -> Texture {
    let mut dice = Dice::new(seed, NoiseStream::Room);
    let paint = fabric::clouds(WIDTH, HEIGHT, 6, &mut dice);
    let mut albedo: Vec<f32> = (paint.iter().enumerate())
        .map(|(i, paint)| 0.52 + 0.10 * ((i / WIDTH) as f32 / HEIGHT as f32) + 0.006 * paint)
        .collect();
    let mut left = 0;
    while left < WIDTH {
        let gap = dice.between(15.0, 90.0) as usize;
        let width = dice.between(25.0, 80.0) as usize;
        let (bottom, top, tone) = match dice.bits() % 4 {
            0 => (45, 110, dice.between(0.78, 0.92)), // window
            1 => (
                0,
                dice.between(38.0, 95.0) as usize,
                dice.between(0.3, 0.46),
            ), // cabinet
            2 => (0, 105, dice.between(0.40, 0.5)),   // door
            _ => (62, 90, dice.between(0.40, 0.66)),  // poster
        };
        for row in bottom..top {
            for column in (left + gap)..(left + gap + width).min(WIDTH) {
                albedo[row * WIDTH + column] = tone + 0.02 * paint[row * WIDTH + column];
            }
        }
        // Furniture never overlaps, but may be cut off at the end.
        left += gap + width;
    }
    Texture::new(WIDTH, &albedo, TEXEL_M)
}
