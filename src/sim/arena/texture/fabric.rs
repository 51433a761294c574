//! Elements of the textures: clouds of noise, leaves, trunks.

use crate::arena::noise::Dice;

/// A picture of random clouds with about equal contrast in every octave, like natural images
/// (Field, JOSA A 1987): variance about 1, mean 0, row-major.
pub(in crate::arena) fn clouds(
    width: usize,
    height: usize,
    octaves: u32,
    dice: &mut Dice,
) -> Vec<f32> {
    let coarse = |side: usize, octave: u32| (side >> octave).max(1) + 2;
    let (mut w, mut h) = (coarse(width, octaves), coarse(height, octaves));
    let mut plane: Vec<f32> = (0..w * h).map(|_| dice.between(-1.0, 1.0)).collect();
    for octave in (0..octaves).rev() {
        let (wide, high) = (coarse(width, octave), coarse(height, octave));
        let mut finer = Vec::with_capacity(wide * high);
        for y in 0..high {
            // Each octave doubles the previous one bilinearly and adds its own noise.
            let (low, up) = ((y / 2).min(h - 1), (y / 2 + y % 2).min(h - 1));
            for x in 0..wide {
                let (left, right) = ((x / 2).min(w - 1), (x / 2 + x % 2).min(w - 1));
                let between = plane[low * w + left]
                    + plane[low * w + right]
                    + plane[up * w + left]
                    + plane[up * w + right];
                finer.push(0.25 * between + dice.between(-1.0, 1.0));
            }
        }
        (plane, w, h) = (finer, wide, high);
    }
    let scale = 1.7 / (octaves as f32 + 1.0).sqrt();
    (0..height)
        .flat_map(|y| plane[y * w..][..width].iter().map(|v| v * scale))
        .collect()
}

/// A grey canvas to paint on, bottom row first.
pub(super) struct SheetCanvas {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) tones: Vec<f32>,
}

impl SheetCanvas {
    /// A leaf: an ellipse with a lit and a shaded half.
    pub(super) fn leaf(
        &mut self,
        (x, y): (f32, f32),
        radius: f32,
        slimness: f32,
        along: (f32, f32),
        tone: f32,
    ) {
        let span = |center: f32, side: usize| {
            let from = (center - radius).max(0.0) as usize;
            from..((center + radius).max(-1.0) + 1.0).min(side as f32) as usize
        };
        let (squash, columns) = (1.0 / slimness, span(x, self.width));
        for row in span(y, self.height) {
            let dy = row as f32 - y;
            let tones = &mut self.tones[row * self.width..][columns.clone()];
            // Without a branch per texel, so that the compiler can vectorize.
            for (column, own) in (columns.start as i32..).zip(tones) {
                let dx = column as f32 - x;
                let length = dx * along.0 + dy * along.1;
                let breadth = (dy * along.0 - dx * along.1) * squash;
                let lit = if breadth > 0.0 { 1.12 } else { 0.88 };
                let is_inside = length * length + breadth * breadth <= radius * radius;
                *own = if is_inside { tone * lit } else { *own };
            }
        }
    }

    /// A trunk from the bottom to the top: lit from one side, its bark `rough`, leaning by `lean`
    /// texels per texel.
    pub(super) fn trunk(
        &mut self,
        x: f32,
        breadth: f32,
        lean: f32,
        tone: f32,
        rough: f32,
        dice: &mut Dice,
    ) {
        let stripes = 96;
        let bark: Vec<f32> = (0..stripes * 32).map(|_| dice.between(-1.0, 1.0)).collect();
        let (mut wander, mut drift) = (0.0f32, 0.0f32);
        for row in 0..self.height {
            drift = 0.97 * drift + dice.between(-0.02, 0.02);
            wander += drift;
            // Wider at the foot.
            let foot = 1.0 + 0.5 / (1.0 + row as f32 * 0.1);
            let half = 0.5 * breadth * foot;
            let center = x + lean * row as f32 + wander;
            let from = (center - half).max(0.0) as usize;
            let to = ((center + half).max(0.0) as usize).min(self.width);
            for column in from..to {
                let across = (column as f32 - center) / half;
                let round = 1.0 - 0.35 * across - 0.4 * across * across;
                let stripe = ((across + 1.0) * 0.5 * breadth * 0.7) as usize % stripes;
                let grain = bark[stripe * 32 + (row / 9 + stripe * 5) % 32]
                    + bark[stripe * 32 + (row / 3) % 32];
                self.tones[row * self.width + column] = tone * (round + rough * grain).max(0.1);
            }
        }
    }
}
