//! Layers of random shapes: planes of disparity with outlines, textures and tones of many kinds.
//!
//! Nothing in them is the arena's but the camera model: surfaces are slanted planes in disparity,
//! so that their truth is exact, and the nearest layer hides the others. Every frame has new ones.

mod layer;

use super::config::{ArenaConfig, RandomScenes};
use super::noise::{Dice, NoiseStream, mix};
use super::path::Twist;
use super::render::{SAMPLES_PX, SharpImage};
use super::scene::Hit;
use super::sensor;
use super::view::{ImageSkew, PinholeView};
use layer::Layer;
use rayon::prelude::*;
use svl_core::Result;
use svl_core::stereo::{Frame, Geometry, Plane, Pose, Rig, StereoPair, Truth, Visibility};

/// A run of frames.
pub(super) struct Shapes {
    config: ArenaConfig,
    rig: Rig,
    seed: u64,
}

impl Shapes {
    /// # Errors
    /// [`Error::Invalid`] with the key of a number out of range.
    pub(super) fn new(config: &ArenaConfig, seed: u64) -> Result<Self> {
        config.check()?;
        Ok(Self {
            rig: config.rig.rectified()?,
            config: config.clone(),
            seed,
        })
    }

    pub(super) fn rig(&self) -> Rig {
        self.rig
    }

    pub(super) fn frames(&self) -> u64 {
        self.config.frames
    }

    /// Renders frame `index`: pair, rig, truth.
    ///
    /// # Errors
    /// None: all planes have the size of the images.
    pub(super) fn frame(&self, index: u64) -> Result<Frame> {
        let ArenaConfig { rig, sensor, .. } = &self.config;
        let size = (rig.width_px, rig.height_px);
        let mut dice = Dice::new(self.seed, NoiseStream::Shapes(index));
        let key = dice.bits();
        // Cameras with an exposure of their own differ by more than the head's residual.
        let right_gain_db = if dice.chance(0.3) {
            f64::from(dice.between(-6.0, 6.0))
        } else {
            sensor.right_gain_db
        };
        let layers = if self.config.random == Some(RandomScenes::Boards) {
            Layers::draw_boards(size, &self.rig, &mut dice)
        } else {
            Layers::draw(size, &mut dice)
        };
        let expose = |right: bool| {
            let skew = if right {
                rig.right_skew()
            } else {
                ImageSkew::NONE
            };
            let view = PinholeView::new(&Pose::identity(), &self.rig, skew);
            let shot = layers.shot(&view, &self.rig, size, right);
            let gain_db = sensor.gain_db + if right { right_gain_db } else { 0.0 };
            let key = mix(key ^ u64::from(right));
            sensor::expose(sensor, gain_db, &shot, &view, &Twist::STILL, key)
        };
        let (left, right) = rayon::join(|| expose(false), || expose(true));
        let geometry = Geometry::Rectified(Some(self.rig));
        Ok(Frame {
            sequence: index,
            stamp_ns: self.config.stamp_ns(index),
            truth: Some(layers.truth(size)?),
            exposure: sensor.exposure(index),
            ..Frame::new(StereoPair::new(left?, right?)?, geometry)
        })
    }
}

/// The layers of a frame; the first is the background.
struct Layers(Vec<Layer>);

impl Layers {
    fn draw(size: (usize, usize), dice: &mut Dice) -> Self {
        let mut layers = vec![Layer::background(size, dice)];
        if dice.chance(0.6) {
            layers.push(Layer::floor(size, dice));
        }
        let count = dice.between(3.0, 12.0) as usize;
        layers.extend((0..count).map(|_| Layer::shape(size, dice)));
        Self(layers)
    }

    /// One or two boards in front of a background.
    fn draw_boards(size: (usize, usize), rig: &Rig, dice: &mut Dice) -> Self {
        let mut layers = vec![Layer::background(size, dice)];
        let count = 1 + usize::from(dice.chance(0.3));
        layers.extend((0..count).map(|_| Layer::board(size, rig, dice)));
        Self(layers)
    }

    /// The nearest layer at a point of the left or right image, and its disparity.
    fn nearest(&self, x: f32, y: f32, right: bool) -> (usize, f32) {
        let mut nearest = (0, self.0[0].disparity(x, y, right));
        for (i, layer) in self.0.iter().enumerate().skip(1) {
            let disparity = layer.disparity(x, y, right);
            let left_x = if right { x + disparity } else { x };
            if disparity > nearest.1 && layer.covers(left_x, y) {
                nearest = (i, disparity);
            }
        }
        nearest
    }

    fn shot(
        &self,
        view: &PinholeView,
        rig: &Rig,
        (width, height): (usize, usize),
        right: bool,
    ) -> SharpImage {
        let focal_px = rig.focal_px() as f32;
        let focal_baseline = (rig.focal_px() * rig.baseline_m()) as f32;
        let (cx, cy) = rig.center_px();
        // The point of the exactly rectified image.
        let point = |x: f32, y: f32| {
            let (across, down) = view.slope(x, y);
            (across * focal_px + cx as f32, down * focal_px + cy as f32)
        };
        let mut radiance = vec![0.0; width * height];
        let mut hits = vec![Hit { t: 1.0, surface: 0 }; width * height];
        let rows = hits
            .par_chunks_exact_mut(width)
            .zip(radiance.par_chunks_exact_mut(width));
        rows.enumerate().for_each(|(row, (hits, radiance))| {
            for (column, (hit, value)) in hits.iter_mut().zip(radiance).enumerate() {
                let at = |dx: f32, dy: f32| point(column as f32 + dx, row as f32 + dy);
                let (x, y) = at(0.0, 0.0);
                let (surface, disparity) = self.nearest(x, y, right);
                *hit = Hit {
                    t: focal_baseline / disparity,
                    surface: surface as u16,
                };
                let light = |(dx, dy): (f32, f32)| {
                    let (x, y) = at(dx, dy);
                    let (layer, disparity) = self.nearest(x, y, right);
                    let left_x = if right { x + disparity } else { x };
                    self.0[layer].tones.at(left_x, y)
                };
                let sum: f32 = SAMPLES_PX.into_iter().map(light).sum();
                *value = sum / SAMPLES_PX.len() as f32;
            }
        });
        SharpImage {
            width,
            radiance,
            hits,
        }
    }

    /// True disparity, visibility and surface of the left image.
    fn truth(&self, (width, height): (usize, usize)) -> Result<Truth> {
        let mut disparity = Vec::with_capacity(width * height);
        let mut visibility = Vec::with_capacity(width * height);
        let mut surface = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let (x, y) = (x as f32, y as f32);
                let (layer, value) = self.nearest(x, y, false);
                let right_x = x - value;
                let inside = right_x > -0.5 && right_x < width as f32 - 0.5;
                // A hundredth of a pixel is the rounding of a point that is seen by both.
                let is_visible = inside && self.nearest(right_x, y, true).1 < value + 0.01;
                disparity.push(value);
                visibility.push(if is_visible {
                    Visibility::Visible
                } else {
                    Visibility::Occluded
                });
                surface.push(self.0[layer].shows);
            }
        }
        let plane = Plane::from_vec(width, height, visibility)?;
        Ok(Truth {
            surface: Some(Plane::from_vec(width, height, surface)?),
            ..Truth::exact(Plane::from_vec(width, height, disparity)?, Some(plane))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::layer::{FARTHEST, NEAREST};
    use super::*;
    use crate::arena::{Arena, RandomScenes};
    use svl_core::stereo::Surface;

    fn config() -> ArenaConfig {
        ArenaConfig {
            random: Some(RandomScenes::Shapes),
            frames: 6,
            ..ArenaConfig::default()
        }
    }

    #[test]
    fn the_right_image_shows_what_the_truth_says() {
        let mut config = config();
        config.sensor.noise = false;
        // No grey value is cut off, whatever the exposure.
        config.sensor.gain_db = -14.0;
        config.sensor.vignetting = 0.0;
        config.rig.right_roll_deg = 0.0;
        config.rig.right_row_offset_px = 0.0;
        config.sensor.right_gain_db = 0.0;
        let shapes = Shapes::new(&config, 3).unwrap();
        let (width, height) = (config.rig.width_px, config.rig.height_px);
        for index in 0..config.frames {
            let frame = shapes.frame(index).unwrap();
            let truth = frame.truth.as_ref().unwrap();
            let visibility = truth.visibility.as_ref().unwrap();
            // Mean difference of the grey values, relative to that of the exposures.
            let difference = |shift: f32| {
                let mut greys = Vec::new();
                for y in 0..height {
                    let [left, right] =
                        [frame.pair.left(), frame.pair.right()].map(|image| image.row(y));
                    for (x, disparity) in truth.disparity.row(y).iter().enumerate() {
                        let at = x as f32 - disparity - shift;
                        let is_visible = visibility.row(y)[x] == Visibility::Visible;
                        if !is_visible || at < 0.0 || at as usize + 1 >= width {
                            continue;
                        }
                        let (i, f) = (at as usize, at.fract());
                        let [a, b] = [i, i + 1].map(|i| f32::from(right[i]));
                        greys.push([f32::from(left[x]), a + f * (b - a)]);
                    }
                }
                let sum = |side: usize| greys.iter().map(|grey| grey[side]).sum::<f32>();
                let gain = sum(0) / sum(1);
                let differences = greys
                    .iter()
                    .map(|[left, right]| (left - gain * right).abs());
                differences.sum::<f32>() / greys.len() as f32
            };
            let (exact, beside) = (difference(0.0), difference(3.0));
            assert!(exact < 0.3 * beside, "frame {index}: {exact}, {beside}");
        }
    }

    #[test]
    fn every_frame_is_new_and_repeatable() {
        let arena = Arena::new(&config(), 5).unwrap();
        let hash = |index| arena.frame(index).unwrap().pair.hash();
        assert_eq!(hash(0), hash(0));
        assert_ne!(hash(0), hash(1));
        let other = Arena::new(&config(), 6).unwrap();
        assert_ne!(hash(0), other.frame(0).unwrap().pair.hash());
        assert!(arena.frame(6).is_err());
        assert_eq!(arena.pose(0), None);
        // The same on every machine.
        assert_eq!(hash(0), 131_427_326_273_899_330_974_142_837_601_104_499_575);
    }

    #[test]
    fn truth_is_complete_and_in_range() {
        let arena = Arena::new(&config(), 8).unwrap();
        let width = config().rig.width_px as f32;
        let mut surfaces = Vec::new();
        for index in 0..arena.frames() {
            let truth = arena.frame(index).unwrap().truth.unwrap();
            let range = FARTHEST * width..=NEAREST * width;
            assert!(truth.disparity.pixels().all(|d| range.contains(&d)));
            surfaces.extend(truth.surface.unwrap().pixels());
        }
        for shown in [Surface::Room, Surface::Floor, Surface::Object] {
            let count = surfaces.iter().filter(|surface| **surface == shown).count();
            assert!(count > surfaces.len() / 50, "{shown:?}: {count}");
        }
    }

    #[test]
    fn shapes_are_not_in_a_world() {
        let error = crate::arena::ArenaWorld::new(&config(), 1).err().unwrap();
        assert!(error.to_string().contains("arena.random"), "{error}");
    }
}
