//! Patterned floors as functions of position: tiles, carpet, planks, grains.

use crate::arena::config::FloorPattern;
use crate::arena::noise::{Dice, mix};

/// A pattern with all its dimensions.
pub(super) struct Pattern {
    kind: FloorPattern,
    /// Cosine and sine of its orientation.
    turn: (f32, f32),
    /// Period: side of a tile, width of a board, distance of loops, size of a grain, metres.
    period_m: f32,
    /// A second dimension: width of the joints, metres.
    joint_m: f32,
    tone: f32,
    joint_tone: f32,
    /// Variation of the tone from tile to tile, board to board or loop to loop.
    spread: f32,
    /// Variation of the tone of grains.
    grain: f32,
    /// Size of the smallest grains, metres.
    grain_m: f32,
    key: u64,
}

/// Octaves of grains.
const OCTAVES: u32 = 4;

impl Pattern {
    pub(super) fn new(kind: FloorPattern, dice: &mut Dice) -> Self {
        let period_m = match kind {
            FloorPattern::Tiles => (0.04, 0.16),
            FloorPattern::Planks => (0.04, 0.12),
            FloorPattern::Carpet => (0.005, 0.012),
            FloorPattern::Noise | FloorPattern::Linoleum => (0.002, 0.006),
        };
        let between = |dice: &mut Dice, (from, to)| dice.between(from, to);
        let tone = dice.between(0.3, 0.6);
        Self {
            kind,
            turn: dice.direction(),
            period_m: between(dice, period_m),
            joint_m: dice.between(0.002, 0.006),
            tone,
            joint_tone: tone * if dice.chance(0.5) { 0.5 } else { 1.5 },
            spread: dice.between(0.03, 0.12),
            grain: dice.between(0.06, 0.12),
            grain_m: dice.between(0.0015, 0.004),
            key: dice.bits(),
        }
    }

    /// Albedo of a point of the floor, before clipping.
    pub(super) fn albedo(&self, x_m: f32, y_m: f32) -> f32 {
        let (cos, sin) = self.turn;
        // Shifted by whole metres, so that all coordinates are positive.
        let u = 20.0 + cos * x_m + sin * y_m;
        let v = 20.0 + cos * y_m - sin * x_m;
        match self.kind {
            FloorPattern::Linoleum | FloorPattern::Noise => {
                self.tone + 1.6 * self.grain * self.grains(u, v, self.period_m)
            }
            FloorPattern::Tiles => {
                let (column, across) = part(u, self.period_m);
                let (row, along) = part(v, self.period_m);
                if across.min(along) < self.joint_m {
                    self.joint_tone + 0.5 * self.grain * self.grains(u, v, self.grain_m)
                } else {
                    let own = self.spread * self.random(column, row, 0);
                    self.tone + own + self.grain * self.grains(u, v, self.grain_m)
                }
            }
            FloorPattern::Planks => {
                let (board, across) = part(u, self.period_m);
                // Boards begin at arbitrary positions.
                let length = 8.0 * self.period_m;
                let shift = (1.0 + self.random(board, 0, 1)) * length;
                let (piece, along) = part(v + shift, length);
                if across.min(along) < 0.5 * self.joint_m {
                    0.5 * self.tone
                } else {
                    let own = self.spread * self.random(board, piece, 0);
                    // The grain of wood runs along the board.
                    let grain = self.grains(u, v / 12.0, self.grain_m);
                    let pores = self.grains(u, v, self.grain_m);
                    self.tone + own + self.grain * (grain + 0.4 * pores)
                }
            }
            FloorPattern::Carpet => {
                let (row, along) = part(v, self.period_m);
                // Every other row is shifted by half a loop.
                let (loop_, across) =
                    part(u + 0.5 * (row % 2) as f32 * self.period_m, self.period_m);
                let swell = |t: f32| 4.0 * t / self.period_m * (1.0 - t / self.period_m);
                let own = self.spread * self.random(loop_, row, 0);
                let lit = 0.55 + 0.45 * (swell(across) * swell(along)).sqrt();
                (self.tone + own) * lit + 0.5 * self.grain * self.grains(u, v, self.grain_m)
            }
        }
    }

    /// Grains with equal contrast in every octave from the size `least_m` on: mean 0, deviation
    /// about 1.
    fn grains(&self, u: f32, v: f32, least_m: f32) -> f32 {
        let octave = |octave: u32| {
            let size_m = least_m * (1u32 << octave) as f32;
            let (column, across) = part(u, size_m);
            let (row, along) = part(v, size_m);
            let (s, t) = (across / size_m, along / size_m);
            let at = |i, j| self.random(column + i, row + j, 2 + octave);
            let low = at(0, 0) + s * (at(1, 0) - at(0, 0));
            let high = at(0, 1) + s * (at(1, 1) - at(0, 1));
            low + t * (high - low)
        };
        // Interpolated uniform noise of -1..1 has about a quarter of its variance.
        (0..OCTAVES).map(octave).sum::<f32>() * (1.3 / (OCTAVES as f32).sqrt()) * 1.5
    }

    /// Uniform in -1..1, a function of position.
    fn random(&self, column: u32, row: u32, layer: u32) -> f32 {
        let place = u64::from(column) << 40 ^ u64::from(row) << 16 ^ u64::from(layer);
        (mix(self.key ^ place) >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }
}

/// The index of the period that contains a coordinate, and the fraction within it.
fn part(at_m: f32, period_m: f32) -> (u32, f32) {
    let number = (at_m / period_m).floor();
    (number as u32, at_m - number * period_m)
}
