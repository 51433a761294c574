//! A slanted plane of disparity with an outline and a texture.

use crate::arena::noise::Dice;
use crate::arena::texture::clouds;
use rayon::prelude::*;
use svl_core::stereo::{Rig, Surface};

/// Least and largest disparity of a layer, as fractions of the width.
pub(super) const FARTHEST: f32 = 0.001;
pub(super) const NEAREST: f32 = 0.25;

pub(super) struct Layer {
    outline: Outline,
    pub(super) shows: Surface,
    /// Disparity at the middle, and its change per pixel to the right and down.
    disparity_px: f32,
    slope: (f32, f32),
    middle_px: (f32, f32),
    half_px: (f32, f32),
    /// Cosine and sine of its turn.
    turn: (f32, f32),
    /// Elsewhere the plane is not there.
    limits_px: (f32, f32),
    pub(super) tones: LayerTones,
}

/// Outline of a layer, in coordinates that are -1..1 across it.
enum Outline {
    Everywhere,
    Plate,
    /// Discs: position and radius.
    Blob([(f32, f32, f32); 3]),
    /// Bars: number and fraction of the period that is filled, vertical and horizontal.
    Lattice([(f32, f32); 2]),
}

/// Light of a layer at the pixels of the left image, and to the right of it as far as the right
/// camera sees.
pub(super) struct LayerTones {
    width: usize,
    /// Fraction of a pixel by which the texture is shifted, so that neither image is sharper.
    shift: f32,
    tones: Vec<f32>,
}

impl Layer {
    /// A plane that fills the image.
    pub(super) fn background((width, height): (usize, usize), dice: &mut Dice) -> Self {
        let (w, h) = (width as f32, height as f32);
        let disparity_px = w * dice.between(0.003, 0.08);
        Self {
            outline: Outline::Everywhere,
            shows: Surface::Room,
            disparity_px,
            // Nowhere behind the camera: at most 0.6 of the disparity is lost to a corner.
            slope: (
                disparity_px / w * dice.between(-0.5, 0.5),
                disparity_px / h * dice.between(-0.7, 0.7),
            ),
            middle_px: (0.5 * w, 0.5 * h),
            half_px: (w, h),
            turn: (1.0, 0.0),
            limits_px: (FARTHEST * w, NEAREST * w),
            tones: LayerTones::draw((width, height), dice),
        }
    }

    /// A plane that rises to the camera, below a horizon.
    pub(super) fn floor((width, height): (usize, usize), dice: &mut Dice) -> Self {
        let (w, h) = (width as f32, height as f32);
        Self {
            shows: Surface::Floor,
            disparity_px: w * dice.between(0.0, 0.03),
            slope: (0.0, w / h * dice.between(0.04, 0.35)),
            middle_px: (0.5 * w, h * dice.between(0.3, 0.8)),
            ..Self::background((width, height), dice)
        }
    }

    pub(super) fn shape((width, height): (usize, usize), dice: &mut Dice) -> Self {
        let (w, h) = (width as f32, height as f32);
        let between = |dice: &mut Dice, from, to| dice.between(from, to);
        let near = dice.between(0.0, 1.0);
        // Far ones are more frequent, as they are smaller.
        let disparity_px = w * (0.006 + 0.23 * near * near.sqrt());
        let most = if dice.chance(0.3) { 0.5 } else { 0.3 };
        let mut length = |side: f32| {
            let part = dice.between(0.0, 1.0);
            side * (0.04 + most * part * part)
        };
        let mut half_px = (length(w), 1.2 * length(h));
        let outline = match dice.between(0.0, 5.0) as usize {
            0 => Outline::Blob(std::array::from_fn(|_| {
                let place = (between(dice, -0.6, 0.6), between(dice, -0.6, 0.6));
                (place.0, place.1, dice.between(0.3, 0.8))
            })),
            1 => {
                half_px = (w * dice.between(0.1, 0.5), h * dice.between(0.1, 0.6));
                let mut bars = |half_px: f32, most: f32, empty: f32| {
                    let count = 2.0 * half_px / (w * dice.between(0.025, most));
                    let filled = dice.between(0.1, 0.6);
                    (count, if dice.chance(empty) { 0.0 } else { filled })
                };
                Outline::Lattice([bars(half_px.0, 0.15, 0.0), bars(half_px.1, 0.25, 0.4)])
            }
            2 => {
                // A stand.
                half_px = (w * dice.between(0.005, 0.025), h * dice.between(0.2, 1.2));
                Outline::Plate
            }
            _ => Outline::Plate,
        };
        let slanted = dice.chance(0.4);
        let mut slope = |most: f32| {
            let slope = dice.between(-most, most);
            if slanted { slope } else { 0.0 }
        };
        let slope = (slope(0.15), slope(0.2));
        let turn = if dice.chance(0.5) {
            dice.direction()
        } else {
            // Nearly upright.
            let sin = dice.between(-0.05, 0.05);
            ((1.0 - sin * sin).sqrt(), sin)
        };
        Self {
            outline,
            shows: Surface::Object,
            disparity_px,
            slope,
            middle_px: (w * dice.between(0.0, 1.0), h * dice.between(0.0, 1.0)),
            half_px,
            turn,
            limits_px: (FARTHEST * w, NEAREST * w),
            tones: LayerTones::draw((width, height), dice),
        }
    }

    /// A board of 4 to 10 dark and light squares along its longer side of 0.2 to 0.5 m, with a
    /// margin, 0.2 to 1 m away.
    pub(super) fn board((width, height): (usize, usize), rig: &Rig, dice: &mut Dice) -> Self {
        let (w, h) = (width as f32, height as f32);
        let focal_px = rig.focal_px() as f32;
        let distance_m = dice.between(0.2, 1.0);
        let disparity_px = focal_px * rig.baseline_m() as f32 / distance_m;
        let squares = dice.between(4.0, 11.0).floor();
        let rows = (squares * dice.between(0.5, 0.9)).floor().max(3.0);
        let square_px = focal_px * dice.between(0.2, 0.5) / distance_m / squares;
        let sin = dice.between(-0.3, 0.3);
        let mut board = Self {
            outline: Outline::Plate,
            shows: Surface::Object,
            disparity_px: disparity_px.min(0.8 * NEAREST * w),
            slope: (dice.between(-0.03, 0.03), dice.between(-0.03, 0.03)),
            middle_px: (w * dice.between(0.2, 0.8), h * dice.between(0.2, 0.8)),
            half_px: (
                0.5 * (squares + 1.0) * square_px,
                0.5 * (rows + 1.0) * square_px,
            ),
            turn: ((1.0 - sin * sin).sqrt(), sin),
            limits_px: (FARTHEST * w, NEAREST * w),
            tones: LayerTones::draw((width, height), dice),
        };
        let (cos, (cx, cy)) = (board.turn.0, board.middle_px);
        let [dark, light] = [(0.02, 0.3), (0.4, 1.0)].map(|(from, to)| dice.between(from, to));
        let shift = board.tones.shift;
        let columns = board.tones.width;
        for (i, tone) in board.tones.tones.iter_mut().enumerate() {
            let x = (i % columns) as f32 - shift - cx;
            let y = (i / columns) as f32 - shift - cy;
            let u = (cos * x + sin * y) / square_px + 0.5 * squares;
            let v = (cos * y - sin * x) / square_px + 0.5 * rows;
            let is_inside = (0.0..squares).contains(&u) && (0.0..rows).contains(&v);
            let is_dark = is_inside && (u.floor() + v.floor()) % 2.0 == 0.0;
            *tone = if is_dark { dark } else { light };
        }
        board
    }

    /// Disparity of the layer's plane at a point of the left or right image.
    pub(super) fn disparity(&self, x: f32, y: f32, right: bool) -> f32 {
        let (across, down) = self.slope;
        let (cx, cy) = self.middle_px;
        let in_column = self.disparity_px + down * (y - cy);
        let left = in_column + across * (x - cx);
        // The right image's column is x = left x - disparity.
        if right { left / (1.0 - across) } else { left }
    }

    /// True if the layer is at a point of the left image.
    pub(super) fn covers(&self, x: f32, y: f32) -> bool {
        let (least, most) = self.limits_px;
        if !(least..most).contains(&self.disparity(x, y, false)) {
            return false;
        }
        let (dx, dy) = (x - self.middle_px.0, y - self.middle_px.1);
        let (cos, sin) = self.turn;
        let u = (cos * dx + sin * dy) / self.half_px.0;
        let v = (cos * dy - sin * dx) / self.half_px.1;
        let in_plate = u.abs() < 1.0 && v.abs() < 1.0;
        match &self.outline {
            Outline::Everywhere => true,
            Outline::Plate => in_plate,
            Outline::Blob(discs) => discs.iter().any(|(x, y, radius)| {
                let (du, dv) = (u - x, v - y);
                du * du + dv * dv < radius * radius
            }),
            Outline::Lattice([vertical, horizontal]) => {
                let in_bar = |at: f32, (count, filled): (f32, f32)| {
                    let place = 0.5 * (at + 1.0) * count;
                    place - place.floor() < filled
                };
                in_plate && (in_bar(u, *vertical) || in_bar(v, *horizontal))
            }
        }
    }
}

impl LayerTones {
    fn draw((width, height): (usize, usize), dice: &mut Dice) -> Self {
        let width = width + (NEAREST * width as f32) as usize + 4;
        let height = height + 2;
        // From fine to coarse grain, and any mixture.
        let grains = [1, 3, 6].map(|octaves| {
            let part = dice.between(0.0, 1.0);
            (part * part, clouds(width, height, octaves, dice))
        });
        let stripes = dice.chance(0.15).then(|| {
            let (x, y) = dice.direction();
            let per_px = 1.0 / dice.between(4.0, 34.0);
            (x * per_px, y * per_px)
        });
        let gradient = dice
            .chance(0.3)
            .then(|| (dice.between(-0.2, 0.2), dice.between(-0.2, 0.2)));
        let contrast = {
            let part = dice.between(0.0, 1.0);
            let plain = dice.between(0.0, 1.0);
            let fraction = match plain {
                0.0..0.25 => 0.04,
                0.25..0.4 => 0.25,
                _ => 1.0,
            };
            0.25 * part * part.sqrt() * fraction
        };
        let mean = if dice.chance(0.8) {
            dice.between(0.0, 1.0)
        } else {
            dice.between(0.03, 0.08)
        };
        let weight: f32 = grains.iter().map(|(part, _)| part * part).sum();
        let scale = contrast / weight.sqrt().max(1.0e-3);
        let tone = |i: usize| {
            let (x, y) = ((i % width) as f32, (i / width) as f32);
            let mut tone = mean;
            for (part, grain) in &grains {
                tone += scale * part * grain[i];
            }
            if let Some((across, down)) = stripes {
                let place = x * across + y * down;
                let is_dark = place - place.floor() < 0.5;
                tone += if is_dark { -contrast } else { contrast };
            }
            if let Some((across, down)) = gradient {
                tone += across * x / width as f32 + down * y / height as f32;
            }
            tone.clamp(0.0, 1.0)
        };
        Self {
            width,
            shift: dice.between(0.0, 1.0),
            tones: (0..width * height).into_par_iter().map(tone).collect(),
        }
    }

    /// Light at a point of the left image.
    pub(super) fn at(&self, x: f32, y: f32) -> f32 {
        let height = self.tones.len() / self.width;
        let u = (x + self.shift).clamp(0.0, (self.width - 2) as f32);
        let v = (y + self.shift).clamp(0.0, (height - 2) as f32);
        let (column, row) = (u as usize, v as usize);
        let (fu, fv) = (u - column as f32, v - row as f32);
        let [low, high] = [0, 1].map(|down| {
            let texels = &self.tones[(row + down) * self.width + column..][..2];
            texels[0] + fu * (texels[1] - texels[0])
        });
        low + fv * (high - low)
    }
}
