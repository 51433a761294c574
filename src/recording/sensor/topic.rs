//! Distances that another sensor or program of the recording measured, as truth or as the map of an
//! algorithm: depth images, disparity images, point clouds, laser scans.

use super::kind::{self, Measured};
use super::measurements::{Measurements, TopicLatency};
use super::view::{PairCamera, SensorSetup, View};
use crate::bags::opened::Recording;
use crate::cameras::topics;
use crate::message::MessageError;
use crate::message::wire::topic;
use crate::pairs::pair_stamps::PairStamps;
use crate::poses::motion::PoseStep;
use crate::poses::reader::{PoseMotion, PoseReader};
use crate::sensor::kind::{SensorRole, SensorSelection};
use crate::stream::channel::{Channel, FileEvent, warn_once};
use nalgebra::UnitQuaternion;
use std::collections::{BTreeMap, BTreeSet};
use svl_core::stereo::{FloorPlane, Frame, MapDensity, Plane, Surface};
use svl_core::{Error, Result, did_you_mean, joined};

/// Difference of stamps, seconds, above which a measurement that cannot be moved is reported: 5 mm
/// at 1 m/s.
const UNMOVED_S: f64 = 0.005;

/// The measurements of a topic, for the pairs of the same recording.
pub struct SensorTopic {
    recording: Recording,
    selection: SensorSelection,
    measurements: Measurements,
    /// The surfaces of the truth that a bag of svl's has besides.
    surfaces: Option<Measurements>,
    setup: SensorSetup,
    /// The floor in the frame of the left camera, before rectification.
    floor: Option<FloorPlane>,
    /// Projection of measurements into the left camera of the last pair.
    view: Option<(PairCamera, View)>,
    poses: Option<PoseReader>,
    /// Number of pairs so far without a measurement.
    pub without: u64,
    /// Number of measurements so far that are not used, as the poses around them jump.
    pub jumped: u64,
    /// True once the user was warned of a measurement that is not of the pair's time.
    warned_of_time: bool,
}

/// Messages of a topic that are read to decide if it measures distances: one may be damaged.
const FIRST_MESSAGES: usize = 3;

/// The topics whose messages measure distances, except those of the pairs, decided by the first
/// messages of each: image topics only if they are depths. `mono16` is one by name alone, as it is
/// also that of infrared cameras.
///
/// # Errors
/// [`Error::Io`], [`Error::Format`].
pub fn truth_topics(recording: &Recording, pairs: &[String; 2]) -> Result<Vec<String>> {
    let channels = recording.channels()?;
    let is_candidate = |channel: &&&Channel| {
        !pairs.contains(&channel.topic)
            && !topics::is_copy(channel, &channels)
            // ZED's confidence map has the pixel format of its depth image.
            && !channel.topic.contains("confidence")
            && !kind::is_own_result(channel)
            && kind::find(channel).is_ok()
    };
    let candidates = channels.iter().filter(is_candidate);
    let candidates = candidates.map(|channel| (channel.topic.clone(), FIRST_MESSAGES));
    let mut unknown: BTreeMap<_, _> = candidates.collect();
    let mut found = BTreeSet::new();
    for file in recording.files() {
        let mut messages = file.messages()?;
        // Damage is reported with the pairs.
        while !unknown.is_empty()
            && let Ok(Some(event)) = messages.next()
        {
            if let FileEvent::Message(channel, log_time, data) = event
                && let Some(left) = unknown.get_mut(&channel.topic)
                && let Ok(kind) = kind::find(channel)
            {
                *left -= 1;
                let is_read = kind.read(channel, log_time, &data).is_ok();
                if is_read || *left == 0 {
                    unknown.remove(&channel.topic);
                }
                let is_named_depth = || channel.topic.to_lowercase().contains("depth");
                if is_read && (is_named_depth() || !kind::is_mono16(channel, &data)) {
                    found.insert(channel.topic.clone());
                }
            }
        }
    }
    Ok(found.into_iter().collect())
}

/// True if the messages of a channel measure distances.
pub(crate) fn measures_distances(channel: &Channel) -> bool {
    kind::find(channel).is_ok()
}

impl SensorTopic {
    /// Finds the topic, the left camera, the transform between the two, and the measurement of each
    /// pair. `topics`: those of the left and the right images; `info`: that of the left camera's
    /// calibrations.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] if the topic is missing or of another type, its first
    /// message cannot be read, no transform leads to the left camera, the stamps are from another
    /// clock, or several pairs or measurements share one.
    pub(crate) fn open(
        recording: &Recording,
        topics: &[String; 2],
        info: Option<String>,
        pairs: PairStamps,
        selection: &SensorSelection,
    ) -> Result<Self> {
        let channels = recording.channels()?;
        let topic = &selection.topic;
        let wrong = |reason: String| {
            let reason = format!("{}: {reason}", selection.asked());
            Error::format(recording.path(), reason)
        };
        let Some(channel) = channels.iter().find(|channel| channel.topic == *topic) else {
            let known = truth_topics(recording, topics)?;
            let meant = did_you_mean(topic, known.iter().map(String::as_str));
            return Err(wrong(match &known[..] {
                [] => "no such topic, and none that measures distances".to_owned(),
                known => format!("no such topic{meant}; distances are in {}", joined(known)),
            }));
        };
        let unusable = |error: MessageError| wrong(error.to_string());
        let kind = kind::find(channel).map_err(unusable)?;
        let surfaces = channels.iter().find_map(|channel| kind::surfaces(channel));
        let surfaces = surfaces.filter(|_| selection.role == SensorRole::Truth);
        let surface_pairs = surfaces.map(|_| pairs.clone());
        let left = (topics[0].as_str(), info);
        let setup = SensorSetup::find(recording, &channels, left, topic, kind)?;
        let mut setup = setup.map_err(unusable)?;
        let frame = setup.sensor_frame();
        let sensor_frame = if kind.is_own() { "" } else { frame }.to_owned();
        let sensor = (sensor_frame.as_str(), setup.unit_m);
        let mut conflict = None;
        let mut look = |channel: &Channel, log_time: u64, data: &[u8]| {
            setup.take_in(channel, log_time, data);
            if conflict.is_none() {
                let found = setup.conflict(channel, data);
                conflict = found.map(|found| format!("{}: {found}", channel.topic));
            }
        };
        let measurements = Measurements::find(
            recording, selection, &topics[0], sensor, kind, pairs, &mut look,
        )?;
        if let Some(conflict) = conflict {
            let path = recording.path().display();
            tracing::warn!(
                "{path}: {conflict}; the first one is used for {topic}: if it is wrong, remove it \
                 from the bag"
            );
        }
        let measurements = measurements.map_err(unusable)?;
        let surfaces = surfaces.zip(surface_pairs).map(|(kind, pairs)| {
            let selection = SensorSelection {
                topic: topic::SURFACE.to_owned(),
                max_skew_ns: 0,
                role: SensorRole::Truth,
            };
            let (left, any) = (&topics[0], ("", None));
            Measurements::find(
                recording,
                &selection,
                left,
                any,
                kind,
                pairs,
                &mut |_, _, _| (),
            )
        });
        // Surfaces whose pairs are unknown tell nothing.
        let surfaces = surfaces.transpose()?.and_then(std::result::Result::ok);
        let floor = setup.floor();
        if let Err(why) = &floor {
            tracing::warn!(
                "{}: {why}; floor is not told apart",
                recording.path().display()
            );
        }
        Ok(Self {
            recording: recording.clone(),
            selection: selection.clone(),
            measurements,
            surfaces,
            floor: floor.unwrap_or_default(),
            setup,
            view: None,
            poses: PoseReader::open(recording, &channels)?,
            without: 0,
            jumped: 0,
            warned_of_time: false,
        })
    }

    pub fn topic(&self) -> &str {
        &self.selection.topic
    }

    /// Log time minus stamp of the measurements and of the left images.
    pub fn latency(&self) -> &TopicLatency {
        &self.measurements.scan.latency
    }

    /// Disparities of the left image from the nearest measurement within the limit, if any.
    ///
    /// # Errors
    /// [`Error::Format`] for a pair without a rig, and for depth images whose position relative to
    /// the left image is unknown; [`Error::Io`].
    pub fn measured(&mut self, frame: &Frame) -> Result<Option<(Plane<f32>, MapDensity)>> {
        let Some(rig) = frame.rig().copied() else {
            let why = "pairs without a calibration have no distances to compare: --calib FILE";
            return Err(self.wrong(why));
        };
        let Some((stamp_ns, measured)) = self.measurements.for_pair(frame)? else {
            self.without += 1;
            return Ok(None);
        };
        let camera = self.setup.pair_camera(frame, rig, stamp_ns);
        let view = match self.view.take() {
            Some((last_camera, view)) if last_camera == camera => view,
            _ => {
                let view = self.setup.view(&self.selection.topic, &measured, &camera);
                view.map_err(|e| self.wrong(&e.to_string()))?
            }
        };
        let motion = match self.motion(stamp_ns, frame.stamp_ns, &camera) {
            PoseMotion::Known(motion) => Some(motion),
            PoseMotion::Unknown => None,
            PoseMotion::Jump(jump) => {
                self.warn_of_jump(stamp_ns, frame.stamp_ns, &jump);
                self.jumped += 1;
                self.view = Some((camera, view));
                return Ok(None);
            }
        };
        let role = self.selection.role;
        let found = view.disparities(&measured, motion.as_ref(), &rig, camera.size, role);
        self.view = Some((camera, view));
        let doubt = match (&found, &*measured) {
            // One of another size, or of another kind.
            (Err(reason), _) => {
                self.without += 1;
                Some(format!("{reason}; left out"))
            }
            (Ok((map, _)), Measured::Points(points)) if !points.is_empty() => {
                let is_seen = map.rows().flatten().any(|px| px.is_finite());
                let words = "no point of a measurement is in view of the left camera; if that is \
                             so of all, its transform in /tf_static is wrong";
                (!is_seen).then(|| words.to_owned())
            }
            _ => None,
        };
        if let Some(doubt) = doubt {
            let (path, asked) = (self.recording.path().display(), self.selection.asked());
            warn_once(format!("{path}: {asked}: {doubt}"));
        }
        Ok(found.ok())
    }

    /// True if static transforms tell the floor.
    pub fn has_floor(&self) -> bool {
        self.floor.is_some()
    }

    /// The floor by static transforms, in the rectified left camera of a frame.
    pub fn floor(&self, frame: &Frame) -> Option<FloorPlane> {
        let camera = self.setup.pair_camera(frame, *frame.rig()?, frame.stamp_ns);
        let rotation = self.setup.rotation(&camera);
        self.floor.map(|floor| floor.rotated(&rotation))
    }

    /// The surfaces of a truth that was measured for the frame, if the recording has them of the
    /// same pixels.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn surfaces(
        &mut self,
        frame: &Frame,
        disparity: &Plane<f32>,
    ) -> Result<Option<Plane<Surface>>> {
        let Some(rig) = frame.rig().copied() else {
            return Ok(None);
        };
        let camera = self.setup.pair_camera(frame, rig, frame.stamp_ns);
        let rotation = self.setup.rotation(&camera);
        if let Some(surfaces) = &mut self.surfaces
            && rotation == UnitQuaternion::identity()
            && let Some((_, codes)) = surfaces.for_pair(frame)?
            && let Measured::Disparity(codes) = &*codes
            && codes.size() == disparity.size()
        {
            return Ok(Some(codes.map(|code| Surface::from_code(code as u8))));
        }
        Ok(None)
    }

    /// The motion of points of a static world, from the rectified left camera at the measurement's
    /// time to that at the pair's; unknown if the times are equal or the poses unknown, of which
    /// the user is warned.
    fn motion(&mut self, measured_ns: u64, pair_ns: u64, camera: &PairCamera) -> PoseMotion {
        if measured_ns == pair_ns {
            return PoseMotion::Unknown;
        }
        let left = self.setup.left_frame();
        let poses = self.poses.as_mut();
        match poses.map(|poses| poses.motion(left, [measured_ns, pair_ns])) {
            Some(PoseMotion::Known(motion)) => {
                let rotation = self.setup.rotation(camera);
                return PoseMotion::Known(rotation * motion * rotation.inverse());
            }
            Some(PoseMotion::Jump(jump)) => return PoseMotion::Jump(jump),
            Some(PoseMotion::Unknown) | None => {}
        }
        let apart_s = measured_ns.abs_diff(pair_ns) as f64 / 1e9;
        if apart_s > UNMOVED_S && !std::mem::replace(&mut self.warned_of_time, true) {
            let path = self.recording.path().display();
            tracing::warn!(
                "{path}: {}: a measurement is {:.1} ms from its pair, and no pose moves it \
                 there: at 1 m/s its distance is off by {:.1} cm, at 90°/s its direction by {:.1}°",
                self.selection.asked(),
                apart_s * 1e3,
                apart_s * 1e2,
                apart_s * 90.0
            );
        }
        PoseMotion::Unknown
    }

    /// Warns once of poses that jump between a measurement and its pair.
    fn warn_of_jump(&self, measured_ns: u64, pair_ns: u64, jump: &PoseStep) {
        if self.jumped == 0 {
            tracing::warn!(
                "{}: {}: the measurement of {:.3} s, and others like it, are not used: \
                 between it and its pair the poses jump by {:.2} m and {:.1}° in {:.0} ms, and it \
                 cannot be moved to {:.3} s",
                self.recording.path().display(),
                self.selection.asked(),
                measured_ns as f64 / 1e9,
                jump.metres,
                jump.radians.to_degrees(),
                (jump.end_ns - jump.start_ns) as f64 / 1e6,
                pair_ns as f64 / 1e9,
            );
        }
    }

    fn wrong(&self, reason: &str) -> Error {
        let reason = format!("{}: {reason}", self.selection.asked());
        Error::format(self.recording.path(), reason)
    }
}
