//! The simulated arena of the thesis's tests (chapter 7): a world with exact ground truth, a robot
//! that moves through it, and the robot's stereo head.
//!
//! ```text
//! config ─▶ objects, scene (geometry, pictures) ─┐
//!        └▶ path (robot, gait) ─▶ view ─▶ render (rays, truth) ─▶ sensor (grey values) ─▶ Frame
//! ```
//!
//! Not simulated: lens distortion, since pairs are rectified; gloss, and shadows other than those
//! at the foot of objects; defocus of outlines (surfaces do blur) and exact motion blur at them;
//! fixed-pattern noise.
//!
//! Every frame is a pure function of (configuration, seed, index): it can be rendered in any order
//! and on any thread.

mod check;
mod config;
mod defaults;
mod noise;
mod objects;
mod path;
mod render;
mod scene;
mod sensor;
mod shapes;
mod solid;
mod texture;
mod view;
mod wireframe;
mod worlds;

pub use check::{NumberRange, check_range, check_ranges, number_ranges};
pub use config::{
    ArenaConfig, Ball, Block, FloorPattern, RandomScenes, RigConfig, RobotConfig, SensorConfig,
    Waypoint, WorldConfig,
};
pub use path::{Gait, Twist};
pub use wireframe::WireObject;

use nalgebra::{Translation3, Vector2, Vector3};
use noise::{Dice, NoiseStream, mix};
use objects::Objects;
use path::Walk;
use render::{Lens, SharpImage};
use scene::ArenaScene;
use shapes::Shapes;
use svl_core::stereo::{Exposure, Frame, Geometry, Plane, Pose, Rig, StereoPair};
use svl_core::{Error, Result};
use view::{ImageSkew, PinholeView};

/// Incremented when the same configuration and seed give other pixels, another truth or another
/// height of the cameras, so that cached recordings are regenerated.
pub const REVISION: u32 = 4;

/// One run of the robot through the arena, or of frames without a path.
pub struct Arena(Scenes);

enum Scenes {
    Path { world: Box<ArenaWorld>, walk: Walk },
    Shapes(Box<Shapes>),
}

/// The world of a run and its cameras, at any pose.
pub struct ArenaWorld {
    config: ArenaConfig,
    rig: Rig,
    scene: ArenaScene,
    seed: u64,
    /// Key of the sensor noise of this run.
    noise: u64,
}

impl Arena {
    /// Builds the world and paints its pictures. The seed sets the pictures, the gait's phases, the
    /// deviation from the path and the noise; the same configuration and seed give the same bytes
    /// on every machine.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the key of a number out of range, or with the position at which the
    /// robot would touch something.
    pub fn new(config: &ArenaConfig, seed: u64) -> Result<Self> {
        let config = &*config.for_seed(seed)?;
        if config.random.is_some_and(RandomScenes::are_layers) {
            let shapes = Shapes::new(config, seed)?;
            return Ok(Self(Scenes::Shapes(Box::new(shapes))));
        }
        let (walk, _) = Self::way(config, seed)?;
        // It is no longer random.
        let world = Box::new(ArenaWorld::new(config, seed)?);
        Ok(Self(Scenes::Path { world, walk }))
    }

    /// The rectified stereo head, as the truth assumes it.
    pub fn rig(&self) -> Rig {
        match &self.0 {
            Scenes::Path { world, .. } => world.rig,
            Scenes::Shapes(shapes) => shapes.rig(),
        }
    }

    /// Height of the cameras above the floor, metres; `None` without one.
    pub fn above_floor_m(&self) -> Option<f64> {
        match &self.0 {
            Scenes::Path { world, .. } => Some(world.config.rig.above_floor_m),
            Scenes::Shapes(_) => None,
        }
    }

    /// Number of frames in the run.
    pub fn frames(&self) -> u64 {
        match &self.0 {
            Scenes::Path { world, .. } => world.config.frames,
            Scenes::Shapes(shapes) => shapes.frames(),
        }
    }

    /// Pose of the left camera in the middle of the exposure of frame `index`; `None` without a
    /// path.
    pub fn pose(&self, index: u64) -> Option<Pose> {
        match &self.0 {
            Scenes::Path { world, walk } => Some(walk.pose(world.time_s(index))),
            Scenes::Shapes(_) => None,
        }
    }

    /// Renders frame `index`: pair, rig, pose, truth.
    ///
    /// # Errors
    /// [`Error::Invalid`] at or beyond [`Arena::frames`].
    pub fn frame(&self, index: u64) -> Result<Frame> {
        if index >= self.frames() {
            return Err(Error::Invalid(format!(
                "arena: frame {index} of a run of {}",
                self.frames()
            )));
        }
        match &self.0 {
            Scenes::Path { world, walk } => {
                let time_s = world.time_s(index);
                world.frame(index, walk.pose(time_s), &walk.twist(time_s))
            }
            Scenes::Shapes(shapes) => shapes.frame(index),
        }
    }

    /// The true geometry of a run and the path of the robot's centre, as line strips for a 3D
    /// viewer; no textures are painted for it.
    ///
    /// # Errors
    /// The errors of [`Arena::new`]; [`Error::Invalid`] for shapes, which are not in a world.
    pub fn wireframe(config: &ArenaConfig, seed: u64) -> Result<Vec<WireObject>> {
        let config = &config.for_seed(seed)?.into_owned().in_a_world()?;
        let (walk, objects) = Self::way(config, seed)?;
        Ok(wireframe::wires(&objects, &walk, &config.world))
    }

    /// The robot's path, and the objects it keeps clear of.
    fn way(config: &ArenaConfig, seed: u64) -> Result<(Walk, Objects)> {
        config.check()?;
        let (walk, objects) = (Walk::new(config, seed)?, Objects::new(&config.world));
        check_clearance(config, &walk, &objects)?;
        Ok((walk, objects))
    }
}

impl ArenaWorld {
    /// Builds the world and paints its textures, like [`Arena::new`]. The path is not checked.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the key of a number out of range.
    pub fn new(config: &ArenaConfig, seed: u64) -> Result<Self> {
        let mut world = Self::unpainted(config, seed)?;
        world.paint();
        Ok(world)
    }

    /// The geometry alone: before [`ArenaWorld::paint`] it renders no frame.
    ///
    /// # Errors
    /// The errors of [`ArenaWorld::new`].
    pub fn unpainted(config: &ArenaConfig, seed: u64) -> Result<Self> {
        let config = &config.for_seed(seed)?.into_owned().in_a_world()?;
        config.check()?;
        Ok(Self {
            rig: config.rig.rectified()?,
            config: config.clone(),
            scene: ArenaScene::new(&config.world, Objects::new(&config.world)),
            seed,
            noise: Dice::new(seed, NoiseStream::Sensor).bits(),
        })
    }

    /// Paints the textures.
    pub fn paint(&mut self) {
        self.scene.paint(&self.config.world, self.seed);
    }

    pub fn config(&self) -> &ArenaConfig {
        &self.config
    }

    /// The rectified stereo head, as the truth assumes it.
    pub fn rig(&self) -> Rig {
        self.rig
    }

    /// The middle of the exposure of frame `index`, seconds after the start.
    pub fn time_s(&self, index: u64) -> f64 {
        self.config.time_s(index)
    }

    /// The true disparities of a left camera at `pose`; the images are not rendered.
    ///
    /// # Errors
    /// None: the plane has the size of the images.
    pub fn disparity(&self, pose: &Pose) -> Result<Plane<f32>> {
        let size = (self.config.rig.width_px, self.config.rig.height_px);
        let view = PinholeView::new(pose, &self.rig, ImageSkew::NONE);
        render::disparity(&self.scene, &view, &self.rig, size)
    }

    fn lens(&self) -> Lens {
        let sensor = &self.config.sensor;
        Lens {
            focal_px: self.rig.focal_px() as f32,
            aperture_m: (sensor.aperture_mm * 1.0e-3) as f32,
            focus_m: sensor.focus_m as f32,
        }
    }

    /// Renders frame `index` of a left camera at `pose` that moves by `twist`: pair, rig, pose,
    /// truth.
    ///
    /// # Errors
    /// [`Error::Invalid`] before it is painted.
    pub fn frame(&self, index: u64, pose: Pose, twist: &Twist) -> Result<Frame> {
        if !self.scene.is_painted() {
            return Err(Error::Invalid("arena: it has no pictures yet".into()));
        }
        let ArenaConfig { rig, sensor, .. } = &self.config;
        let size = (rig.width_px, rig.height_px);
        let lens = self.lens();
        let beside = Vector3::x() * rig.baseline_m;
        let right_pose = pose * Translation3::from(beside);
        // The right camera moves as a point of the same rigid body.
        let right_twist = Twist {
            linear_m_per_s: twist.linear_m_per_s + twist.angular_rad_per_s.cross(&beside),
            angular_rad_per_s: twist.angular_rad_per_s,
        };
        let skew = rig.right_skew();
        let left_view = PinholeView::new(&pose, &self.rig, ImageSkew::NONE);
        let right_view = PinholeView::new(&right_pose, &self.rig, skew);

        let expose = |view: &PinholeView, twist: &Twist, gain_db: f64, camera: u64| {
            let shot = SharpImage::take(&self.scene, view, &lens, size);
            let key = mix(self.noise ^ mix(2 * index + camera));
            sensor::expose(sensor, gain_db, &shot, view, twist, key).map(|image| (shot, image))
        };
        // One image per thread; each renders its rows in parallel too.
        let (left, right) = rayon::join(
            || {
                let (shot, image) = expose(&left_view, twist, sensor.gain_db, 0)?;
                // The truth is that of the rectified rig, without the skew of the right image.
                let exact_right = PinholeView::new(&right_pose, &self.rig, ImageSkew::NONE);
                let truth =
                    render::truth(&self.scene, &shot, [&left_view, &exact_right], &self.rig)?;
                Ok::<_, Error>((image, truth))
            },
            || {
                expose(
                    &right_view,
                    &right_twist,
                    sensor.gain_db + sensor.right_gain_db,
                    1,
                )
                .map(|(_, image)| image)
            },
        );
        let (left, truth) = left?;
        let geometry = Geometry::Rectified(Some(self.rig));
        Ok(Frame {
            sequence: index,
            stamp_ns: self.config.stamp_ns(index),
            pose: Some(pose),
            truth: Some(truth),
            exposure: sensor.exposure(index),
            ..Frame::new(StereoPair::new(left, right?)?, geometry)
        })
    }

    /// The clearance of a body of that height on the floor at `at_m`: the distance of its axis from
    /// the nearest object, and that object. Negative inside a wall.
    pub fn clearance(&self, at_m: [f64; 2], height_m: f64) -> (f64, &str) {
        let objects = self.scene.objects.named();
        let distances = objects.map(|(name, solid)| (solid.distance_below(at_m, height_m), name));
        let nearest = distances.min_by(|a, b| a.0.total_cmp(&b.0));
        // The walls are always there.
        nearest.unwrap_or((f64::INFINITY, ""))
    }

    /// Outlines in the plane of everything lower than `height_m`, walls included: closed strips of
    /// points, metres.
    pub fn plan(&self, height_m: f64) -> Vec<Vec<[f64; 2]>> {
        let solids = self.scene.objects.solids.iter();
        solids
            .filter_map(|solid| solid.outline_below(height_m))
            .collect()
    }
}

impl ArenaConfig {
    fn time_s(&self, index: u64) -> f64 {
        index as f64 / self.rate_hz
    }

    fn stamp_ns(&self, index: u64) -> u64 {
        (self.time_s(index) * 1.0e9).round() as u64
    }

    /// # Errors
    /// [`Error::Invalid`] for shapes.
    fn in_a_world(self) -> Result<Self> {
        match self.random {
            Some(RandomScenes::Shapes | RandomScenes::Boards) => Err(Error::Invalid(
                "arena.random: shapes are not in a world; use \"worlds\"".into(),
            )),
            _ => Ok(self),
        }
    }
}

impl RigConfig {
    /// The exactly rectified head.
    ///
    /// # Errors
    /// The errors of [`Rig::new`].
    pub fn rectified(&self) -> Result<Rig> {
        let (width, height) = (self.width_px as f64, self.height_px as f64);
        Rig::new(
            0.5 * width / (0.5 * self.field_of_view_deg.to_radians()).tan(),
            (0.5 * (width - 1.0), 0.5 * (height - 1.0)),
            self.baseline_m,
            0.0,
        )
    }

    fn right_skew(&self) -> ImageSkew {
        ImageSkew {
            sin_roll: self.right_roll_deg.to_radians().sin() as f32,
            row_offset_px: self.right_row_offset_px as f32,
        }
    }
}

impl SensorConfig {
    fn exposure(&self, index: u64) -> Exposure {
        Exposure {
            trigger_id: index,
            skew_ns: Some(0),
            shutter_us: self.shutter_us,
            gain_mdb: (self.gain_db * 1.0e3).round() as i32,
            drops: 0,
        }
    }
}

/// The points of the robot's way on the floor, and the head's centre there.
fn heads(walk: &Walk, rig: &RigConfig) -> impl Iterator<Item = (Vector2<f64>, Vector3<f32>)> {
    // Every centimetre: half-widths are several centimetres.
    let steps = (walk.length_m() / 0.01).ceil() as u64;
    (0..=steps).map(move |step| {
        let middle = walk.middle(walk.length_m() * step as f64 / steps as f64);
        let head = Vector3::new(middle.x, middle.y, rig.above_floor_m);
        (middle, head.cast())
    })
}

/// The robot's head keeps half its width from every object and stays inside the arena.
fn check_clearance(config: &ArenaConfig, walk: &Walk, objects: &Objects) -> Result<()> {
    let half_width_m = config.robot.half_width_m;
    for (middle, head) in heads(walk, &config.rig) {
        let place = format!("({:.2}, {:.2})", middle.x, middle.y);
        if let Some((name, _)) = objects
            .named()
            .find(|(_, solid)| f64::from(solid.distance(&head)) < half_width_m)
        {
            return Err(Error::Invalid(format!(
                "arena: robot.path comes nearer than robot.half_width_m = {half_width_m} to \
                 '{name}' at {place}"
            )));
        }
        let (x, y) = (0.0..=config.world.width_m, 0.0..=config.world.length_m);
        if !x.contains(&middle.x) || !y.contains(&middle.y) {
            return Err(Error::Invalid(format!(
                "arena: robot.path leaves the arena at {place}"
            )));
        }
    }
    Ok(())
}
