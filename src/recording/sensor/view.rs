//! Projection of another sensor's measurements into the left camera.

use super::kind::{Measured, MeasuredKind, SensorRole};
use crate::bags::opened::Recording;
use crate::cameras::camera::Calibration;
use crate::cameras::camera_track::CameraTrack;
use crate::cameras::topics;
use crate::cameras::transforms::{Conflict, Transforms, plain};
use crate::decode::{head, realsense};
use crate::message::wire::FLOOR_FRAME;
use crate::message::{MessageError, MessageResult};
use crate::pairs::truth;
use crate::stream::channel::{Channel, FileEvent, warn_of};
use nalgebra::{Isometry3, Point2, Point3, UnitQuaternion, Vector3};
use std::sync::Arc;
use svl_core::Result;
use svl_core::depth::{MIN_VALID, project, render};
use svl_core::stereo::{FloorPlane, Frame, Geometry, Intrinsics, MapDensity, Plane, Rig};

/// A depth image's camera is the left one if it has no distortion and their focal lengths and
/// principal points differ by less.
const SAME_CAMERA_PX: f64 = 0.5;

/// The left camera of pairs that svl rectified: the original camera, and the rotation of its
/// rectification, `X_rectified = rotation · X`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawCamera {
    pub intrinsics: Intrinsics,
    pub rotation: UnitQuaternion<f64>,
}

impl RawCamera {
    /// The left camera of a frame, if svl rectified it.
    pub fn from_frame(frame: &Frame) -> Option<Self> {
        let is_raw = frame.geometry == Geometry::Raw;
        let calibration = frame.calibration.as_ref().filter(|_| !is_raw)?;
        let rectification = calibration.rectification()?;
        Some(Self {
            intrinsics: *calibration.left(),
            rotation: UnitQuaternion::from_rotation_matrix(&rectification.left),
        })
    }
}

/// Everything that the projection into the left camera of a pair depends on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PairCamera {
    pub(crate) rig: Rig,
    pub(crate) size: (usize, usize),
    pub(crate) raw: Option<RawCamera>,
    /// The calibrations of the left camera and of a depth image, as published.
    left: Option<Arc<Calibration>>,
    own: Option<Arc<Calibration>>,
}

/// Pose of the sensor, and the cameras of the recording.
pub(crate) struct SensorSetup {
    /// Pose of the sensor in the left camera's frame.
    left_from_sensor: Isometry3<f64>,
    /// True if it measures in the left camera's frame.
    is_left: bool,
    /// True if its messages have the pixels of a rectified camera by definition.
    is_rectified: bool,
    left: CameraTrack,
    /// Calibrations of depth images.
    own: CameraTrack,
    /// Topics of both.
    infos: [Option<String>; 2],
    transforms: Transforms,
    /// The transforms up to the one that leads to the floor.
    with_floor: Transforms,
    /// Metres per step of the depth images, if the recording says so.
    pub(crate) unit_m: Option<f32>,
    /// Names of the left camera's frame and of the sensor's.
    frames: [String; 2],
}

/// Everything needed before the first pair.
#[derive(Default)]
struct Found {
    left_frame: Option<String>,
    left: CameraTrack,
    frame: Option<MessageResult<String>>,
    own: CameraTrack,
    /// The frame that the calibrations of depth images name.
    own_frame: Option<String>,
    unit_m: Option<f32>,
    transforms: Transforms,
    /// All transforms including those that may move, which only an error names.
    with_moving: Transforms,
}

/// The rays through a camera's pixels, turned by a rotation; not a number where there is none.
fn rays(
    camera: &Intrinsics,
    (width, height): (usize, usize),
    turn: UnitQuaternion<f64>,
) -> Vec<Vector3<f64>> {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let ray = |(x, y): (usize, usize)| {
        // `None` where the distortion model folds back: no ray, no point.
        let direction = camera.direction(Point2::new(x as f64, y as f64));
        direction.map_or_else(
            || Vector3::repeat(f64::NAN),
            |d| turn * Vector3::new(d.x, d.y, 1.0),
        )
    };
    pixels.map(ray).collect()
}

impl SensorSetup {
    /// Reads until all is found; transforms are at the start of most recordings. `left`: the topics
    /// of the left images and of their calibrations.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`]. Inner: the missing part.
    pub(crate) fn find(
        recording: &Recording,
        channels: &[&Channel],
        (left, left_info): (&str, Option<String>),
        topic: &str,
        kind: &MeasuredKind,
    ) -> Result<MessageResult<Self>> {
        // The calibration nearest in the tree of topics may belong to another camera.
        let own_info = topics::calibration(channels, topic)
            .filter(|info| kind.is_depth() && Some(info) != left_info.as_ref());
        let names = channels.iter().map(|channel| &channel.topic);
        let mut units = names.filter(|unit| realsense::is_unit_topic(unit, topic));
        let unit = units.next().cloned();
        let mut wanted = SoughtTopics {
            left,
            topic,
            kind,
            infos: [left_info, own_info],
            unit,
        };
        let mut found = Found::default();
        for file in recording.files() {
            let mut messages = file.messages()?;
            // Damage is reported with the pairs.
            while !found.has_all(&wanted)
                && let Ok(Some(event)) = messages.next()
            {
                let FileEvent::Message(channel, log_time, data) = event else {
                    continue;
                };
                if let Err(reason) = found.take_in(&wanted, channel, log_time, &data) {
                    let place = format!("{} at {log_time} ns", channel.topic);
                    return Ok(Err(reason.on(&place)));
                }
            }
        }
        if let Some(Err(reason)) = found.frame.take_if(|frame| frame.is_err()) {
            return Ok(Err(reason));
        }
        if let Some(info) = wanted.infos[1].take_if(|info| found.is_of_another(info, topic)) {
            tracing::warn!(
                "{}: {info} is of frame '{}', {topic} of another: it is not used; record the \
                 camera_info of {topic} beside it, with its frame_id",
                recording.path().display(),
                found.own_frame.take().unwrap_or_default()
            );
            found.own = CameraTrack::default();
        }
        Ok(found.pose().map(|left_from_sensor| Self {
            left_from_sensor,
            is_left: left_from_sensor == Isometry3::identity(),
            is_rectified: kind.is_disparity(),
            left: found.left,
            own: found.own,
            infos: wanted.infos,
            transforms: found.transforms,
            with_floor: Transforms::default(),
            unit_m: found.unit_m,
            frames: [
                found.left_frame,
                found.frame.and_then(std::result::Result::ok),
            ]
            .map(Option::unwrap_or_default),
        }))
    }

    /// The frame of the sensor, as its first message names it.
    pub(crate) fn sensor_frame(&self) -> &str {
        plain(&self.frames[1])
    }

    /// The left camera's frame, as its first image names it.
    pub(crate) fn left_frame(&self) -> &str {
        &self.frames[0]
    }

    /// Stores a calibration of the left camera or of depth images, and the place of the floor.
    pub(crate) fn take_in(&mut self, channel: &Channel, log_time: u64, data: &[u8]) {
        if Transforms::reads(channel)
            && self
                .with_floor
                .between(FLOOR_FRAME, &self.frames[0])
                .is_none()
        {
            // An unreadable one is reported if it is needed for the sensor.
            drop(self.with_floor.add(channel, data));
        }
        for (topic, track) in self.infos.iter().zip([&mut self.left, &mut self.own]) {
            if topic.as_ref() == Some(&channel.topic) {
                track.read(channel, log_time, data);
            }
        }
    }

    /// The left camera of a frame with that rig, and that of a measurement of `measured_ns`.
    pub(crate) fn pair_camera(&self, frame: &Frame, rig: Rig, measured_ns: u64) -> PairCamera {
        PairCamera {
            rig,
            size: frame.pair.size(),
            raw: RawCamera::from_frame(frame),
            left: self.left.at(frame.stamp_ns).cloned(),
            own: self.own.at(measured_ns).cloned(),
        }
    }

    /// The rotation of the rectification.
    pub(crate) fn rotation(&self, camera: &PairCamera) -> UnitQuaternion<f64> {
        // Pairs rectified before they were recorded have the rotation in their CameraInfo; that of
        // an uncalibrated camera is all zeros.
        let own_rotation = || {
            let rotation = camera.left.as_ref()?.rotation().ok()?;
            Some(UnitQuaternion::from_rotation_matrix(&rotation))
        };
        match camera.raw {
            Some(raw) => raw.rotation,
            None => own_rotation().unwrap_or_else(UnitQuaternion::identity),
        }
    }

    /// The floor in the frame of the left camera, before rectification, if a transform leads to it.
    ///
    /// # Errors
    /// The reason why it is not below the camera.
    pub(crate) fn floor(&self) -> MessageResult<Option<FloorPlane>> {
        let Some(camera) = self.with_floor.between(FLOOR_FRAME, &self.frames[0]) else {
            return Ok(None);
        };
        FloorPlane::from_pose(&camera).map(Some).ok_or_else(|| {
            MessageError::Frames(format!(
                "by /tf_static the left camera is {:.2} m above '{FLOOR_FRAME}', which is the \
                 floor below a robot: --camera-height M says how high it is",
                camera.translation.z
            ))
        })
    }

    /// A transform between sensor and camera in a message that differs from the one used.
    pub(crate) fn conflict(&self, channel: &Channel, data: &[u8]) -> Option<Conflict> {
        let [left, sensor] = &self.frames;
        Transforms::reads(channel)
            .then(|| self.transforms.conflict((channel, data), (left, sensor)))
            .flatten()
    }

    /// The projection of measurements like `measured` into the left camera of a pair.
    ///
    /// # Errors
    /// The missing part.
    pub(crate) fn view(
        &self,
        topic: &str,
        measured: &Measured,
        camera: &PairCamera,
    ) -> MessageResult<View> {
        let &PairCamera { size, raw, .. } = camera;
        let rig = &camera.rig;
        let left_from_sensor = self.rotation(camera) * self.left_from_sensor;
        let depth = match measured {
            Measured::Depth(depth) => depth,
            Measured::Points(_) => return Ok(View::Points(left_from_sensor)),
            Measured::Disparity(map) if map.size() == size => return Ok(View::Aligned),
            Measured::Disparity(map) => {
                return Err(MessageError::MapSize(map.size(), size));
            }
        };
        let is_rectified = self.is_rectified || topics::is_of_rectified(topic);
        // Disparities, and images named so, have the pixels of the rectified camera: of raw pairs,
        // those by the projection in the left camera's CameraInfo.
        let of_left = camera.left.as_ref();
        let of_left = of_left.filter(|_| is_rectified && self.is_left && raw.is_some());
        let own = camera.own.as_ref().or(of_left).map(|own| {
            own.check_size(depth.size())
                .and_then(|()| pinhole(own, is_rectified, depth.size()))
        });
        let own = own.transpose()?;
        if let (Some((own, _)), Some(calibration)) = (&own, &camera.own) {
            let doubt = calibration.depth_doubt(own.center_px(), depth.size());
            doubt.iter().for_each(|doubt| warn_of(topic, doubt));
        }
        let is_of_rig = own.is_none_or(|(own, _)| is_same(&own, rig));
        if self.is_left && raw.is_none() && is_of_rig {
            if depth.size() == size {
                return Ok(View::Aligned);
            }
            if own.is_none() {
                let ((width, height), (w, h)) = (depth.size(), size);
                return Err(MessageError::Frames(format!(
                    "its depth images are {width}x{height}, the left images {w}x{h}, and it has no \
                     camera_info for that camera"
                )));
            }
        }
        let (camera, back) = match (own, raw) {
            (Some(own), _) => own,
            (None, Some(raw)) if self.is_left && raw.intrinsics.size() == depth.size() => {
                (raw.intrinsics, UnitQuaternion::identity())
            }
            _ => {
                let why =
                    "its depth images are from another camera, and it has no camera_info for that";
                return Err(MessageError::Missing(why));
            }
        };
        Ok(View::Camera {
            size: depth.size(),
            rays: rays(&camera, depth.size(), left_from_sensor.rotation * back),
            origin: left_from_sensor.translation.vector,
            focal_px: camera.focal_px().0,
        })
    }
}

/// The topics that are read for a view.
struct SoughtTopics<'a> {
    /// Topic of the left images.
    left: &'a str,
    /// That of the measurements, and their kind.
    topic: &'a str,
    kind: &'a MeasuredKind,
    /// Topics of the calibrations of the left camera and of the sensor.
    infos: [Option<String>; 2],
    /// That of the unit of depths.
    unit: Option<String>,
}

impl Found {
    fn has_all(&self, wanted: &SoughtTopics<'_>) -> bool {
        let [left_info, own_info] = &wanted.infos;
        (left_info.is_none() || !self.left.is_empty())
            && (own_info.is_none() || !self.own.is_empty())
            && (wanted.unit.is_none() || self.unit_m.is_some())
            && self.pose().is_ok()
    }

    /// # Errors
    /// The reason why a transform cannot be read.
    fn take_in(
        &mut self,
        wanted: &SoughtTopics<'_>,
        channel: &Channel,
        log_time: u64,
        data: &[u8],
    ) -> MessageResult<()> {
        let is_on = |name: &Option<String>| name.as_ref() == Some(&channel.topic);
        if channel.topic == wanted.left && self.left_frame.is_none() {
            self.left_frame = head::head(channel, data).ok().map(|head| head.1);
        }
        if wanted.kind.is_own() {
            self.frame = self.left_frame.clone().map(Ok);
        } else if channel.topic == wanted.topic && !matches!(self.frame, Some(Ok(_))) {
            let read = wanted.kind.read(channel, log_time, data);
            let frame = read.and_then(|_| Ok(head::head(channel, data)?.1));
            // The first that can be read; the reason is that of the first of all.
            if frame.is_ok() || self.frame.is_none() {
                self.frame = Some(frame);
            }
        }
        let [left_info, own_info] = &wanted.infos;
        if is_on(left_info) {
            self.left.read(channel, log_time, data);
        }
        if is_on(own_info) {
            self.own.read(channel, log_time, data);
            self.own_frame = head::head(channel, data).ok().map(|head| head.1);
        }
        if is_on(&wanted.unit) && self.unit_m.is_none() {
            self.unit_m = realsense::unit_m(channel, data);
        }
        if Transforms::reads(channel) {
            self.transforms.add(channel, data)?;
        }
        if Transforms::reads(channel) || Transforms::are_moving(channel) {
            drop(self.with_moving.add(channel, data));
        }
        Ok(())
    }

    /// True if a calibration in a wider namespace names another frame than the measurements: it is
    /// that of another camera.
    fn is_of_another(&self, info: &str, topic: &str) -> bool {
        let named = |frame: Option<&String>| {
            let frame = plain(frame?);
            (!frame.is_empty()).then(|| frame.to_owned())
        };
        let frame = self.frame.as_ref().and_then(|frame| frame.as_ref().ok());
        let frames = named(self.own_frame.as_ref()).zip(named(frame));
        !topics::is_beside(info, topic) && frames.is_some_and(|(own, frame)| own != frame)
    }

    /// The pose of the sensor in the left camera's frame.
    fn pose(&self) -> MessageResult<Isometry3<f64>> {
        let Some(Ok(frame)) = &self.frame else {
            return Err(MessageError::Missing("has no message"));
        };
        let left = self
            .left_frame
            .as_deref()
            .ok_or(MessageError::Missing("no left image has a frame_id"))?;
        let (frame, left) = (plain(frame), plain(left));
        if frame == left {
            return Ok(Isometry3::identity());
        }
        self.transforms.between(left, frame).ok_or_else(|| {
            let listed = self.transforms.listed();
            let moving = match self.with_moving.between(left, frame) {
                Some(_) => {
                    "; /tf has one, which may move and is not read: if it is fixed, publish it on \
                     /tf_static (ros2 run tf2_ros static_transform_publisher) and record again"
                }
                None => "",
            };
            MessageError::Frames(format!(
                "no transform leads from its frame '{frame}' to '{left}' of the left images; \
                 /tf_static has {listed}{moving}"
            ))
        })
    }
}

/// The camera of a depth image and the rotation from its pixels' frame into its own: by P and R if
/// the images are rectified, else by K and the distortion.
fn pinhole(
    calibration: &Calibration,
    is_rectified: bool,
    size: (usize, usize),
) -> MessageResult<(Intrinsics, UnitQuaternion<f64>)> {
    let raw = calibration.camera();
    match raw {
        Ok(camera) if !is_rectified => return Ok((camera, UnitQuaternion::identity())),
        // Without its distortion, points would be beside their pixels.
        Err(why) if !is_rectified && calibration.distortion_model().is_some() => return Err(why),
        _ => {}
    }
    let p = calibration.projection()?;
    let camera = Intrinsics::new(
        size,
        (p[(0, 0)], p[(1, 1)]),
        (p[(0, 2)], p[(1, 2)]),
        [0.0; 5],
    )?;
    let rotation = calibration.rotation().ok();
    let rotation = rotation.map(|r| UnitQuaternion::from_rotation_matrix(&r).inverse());
    let rotation = rotation.unwrap_or_else(UnitQuaternion::identity);
    Ok((camera, rotation))
}

fn is_same(camera: &Intrinsics, rig: &Rig) -> bool {
    let ((fx, fy), (cx, cy)) = (camera.focal_px(), camera.center_px());
    let f = rig.focal_px();
    // Distorted pixels are not those of the rectified images.
    let is_plain = camera.distortion().is_none();
    let apart = [
        fx - f,
        fy - f,
        cx - rig.center_px().0,
        cy - rig.center_px().1,
    ];
    is_plain && apart.iter().all(|px| px.abs() < SAME_CAMERA_PX)
}

/// Depth that stands for infinity, metres.
const INFINITY_M: f64 = 1e60;

/// The disparities of the samples of a depth image of another camera or time: points, each with the
/// side of the square that its pixel covers.
fn map_from_samples(
    samples: impl Iterator<Item = (Point3<f64>, f64)>,
    rig: &Rig,
    size: (usize, usize),
    role: SensorRole,
) -> (Plane<f32>, MapDensity) {
    match role {
        SensorRole::Map => (render(samples, rig, size), MapDensity::Dense),
        SensorRole::Truth => {
            let points = samples.map(|(point, _)| point);
            (project(points, rig, size), MapDensity::Sparse)
        }
    }
}

/// The disparities of a cloud. A stereo camera's has a point per pixel, and none is hidden behind
/// those of its neighbours; a lidar's has few, between which the camera does not see what it does.
fn map_from_points(
    points: impl Iterator<Item = Point3<f64>> + Clone,
    rig: &Rig,
    size: (usize, usize),
    role: SensorRole,
) -> (Plane<f32>, MapDensity) {
    if role == SensorRole::Map {
        let pixels = points
            .clone()
            .map(|point| (point, point.z / rig.focal_px()));
        let disparity = render(pixels, rig, size);
        let known = disparity.pixels().filter(|d| d.is_finite()).count();
        if known as f64 >= MIN_VALID * (size.0 * size.1) as f64 {
            return (disparity, MapDensity::Dense);
        }
    }
    (project(points, rig, size), MapDensity::Sparse)
}

/// Projection of the measurements into the left camera.
pub(crate) enum View {
    /// Depth images with the left camera's own pixels.
    Aligned,
    /// Depth images of another camera: per pixel the ray for a depth of 1, and the position of the
    /// camera, in the rectified left camera's frame.
    Camera {
        size: (usize, usize),
        rays: Vec<Vector3<f64>>,
        origin: Vector3<f64>,
        /// Focal length of the camera, pixels.
        focal_px: f64,
    },
    /// Points of a sensor with that pose in the rectified left camera's frame.
    Points(Isometry3<f64>),
}

impl View {
    /// The disparities of a measurement, with their density. `motion` moves the points to the left
    /// camera at the time of the pair.
    ///
    /// # Errors
    /// For a depth image of another size than the first.
    pub(crate) fn disparities(
        &self,
        measured: &Measured,
        motion: Option<&Isometry3<f64>>,
        rig: &Rig,
        size: (usize, usize),
        role: SensorRole,
    ) -> MessageResult<(Plane<f32>, MapDensity)> {
        let depth_of = |z: f32| match z {
            f32::INFINITY => INFINITY_M,
            z => f64::from(z),
        };
        let moved = |point: Point3<f64>| motion.map_or(point, |motion| motion * point);
        let expected = match self {
            Self::Camera { size, .. } => *size,
            _ => size,
        };
        match (self, measured) {
            (_, Measured::Depth(depth)) if depth.size() != expected => {
                Err(MessageError::DepthSize(depth.size(), expected))
            }
            (
                Self::Camera {
                    rays,
                    origin,
                    focal_px,
                    ..
                },
                Measured::Depth(depth),
            ) => {
                let depth = role.depths(depth);
                let depths = depth.rows().flatten().zip(rays);
                let sample = |(&z, ray): (&f32, &Vector3<f64>)| {
                    let z = depth_of(z);
                    (moved(Point3::from(ray * z + origin)), z / focal_px)
                };
                Ok(map_from_samples(depths.map(sample), rig, size, role))
            }
            (Self::Aligned, Measured::Depth(depth)) if motion.is_some() => {
                let depth = role.depths(depth);
                let (focal, (cx, cy)) = (rig.focal_px(), rig.center_px());
                let pixels = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
                let samples = pixels.map(|(x, y)| {
                    let z = depth_of(depth.get(x, y));
                    let [u, v] = [x as f64 - cx, y as f64 - cy].map(|at| at / focal * z);
                    (moved(Point3::new(u, v, z)), z / focal)
                });
                Ok(map_from_samples(samples, rig, size, role))
            }
            (_, Measured::Depth(depth)) => {
                let disparity = truth::disparities(&role.depths(depth), rig);
                Ok((disparity, MapDensity::Dense))
            }
            (Self::Points(pose), Measured::Points(points)) => {
                let points = points.iter().map(|point| moved(pose * point));
                Ok(map_from_points(points, rig, size, role))
            }
            (_, Measured::Disparity(map)) => Ok((map.clone(), MapDensity::Dense)),
            (_, Measured::Points(_)) => {
                Err(MessageError::Unsuited("points instead of depth images"))
            }
        }
    }
}
