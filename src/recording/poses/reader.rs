//! Poses of a camera in the world: by the transforms of `/tf`, or by nav_msgs/Odometry, with the
//! static ones between robot and camera.

use super::motion::{PoseStep, jump, steps};
use crate::bags::opened::Recording;
use crate::cameras::transforms::{Placed, StampedTransform, Transforms, plain};
use crate::message::{MessageResult, ros};
use crate::stream::channel::{Channel, EventReader, FileEvent, warn_once};
use nalgebra::Isometry3;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use svl_core::Result;

pub(crate) const ODOMETRY: &str = "nav_msgs/msg/Odometry";
/// Longest time between two poses, of which one in between is interpolated.
const MAX_GAP_NS: u64 = 500_000_000;
/// Poses of a frame are read on until one is this much later than the pair, as messages arrive out
/// of order.
const AHEAD_NS: u64 = 1_000_000_000;
/// Limit on poses of one frame: an hour at 1000 a second.
const MAX_POSES: usize = 4_000_000;
/// Poses of one frame by two topics are equal up to the noise between two of their messages.
const SAME_M: f64 = 0.1;
const SAME_RAD: f64 = 2.0_f64.to_radians();
/// Longest chain of transforms.
const MAX_CHAIN: usize = 100;

/// Reads the poses of a recording, next to its pairs.
pub(crate) struct PoseReader {
    recording: Recording,
    messages: Box<dyn EventReader>,
    next_file: usize,
    has_ended: bool,
    fixed: Transforms,
    /// By the name of the moving frame: those of `/tf`, and those of odometry, which are used where
    /// `/tf` has none.
    moving: [BTreeMap<String, Moving>; 2],
    /// Messages that cannot be used, by topic, with the first reason.
    pub(crate) faulty: BTreeMap<String, (u64, String)>,
    /// The frame that the places so far are in.
    world: Option<String>,
}

/// What the pose of a frame is for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum PoseUse {
    /// Place of the frame in the topmost frame above it.
    Place,
    /// Motion of the frame between two stamps: in the frame of the odometry, if there is one. That
    /// is continuous, and `map` jumps (REP 105).
    Motion,
}

/// The motion of a frame between two stamps.
pub(crate) enum PoseMotion {
    Known(Isometry3<f64>),
    /// The poses around the stamps jump.
    Jump(PoseStep),
    /// Poses around the stamps are missing.
    Unknown,
}

/// The step from a frame to its parent.
enum ChainLink<'a> {
    Moving(&'a Moving),
    Fixed(&'a Placed),
}

impl<'a> ChainLink<'a> {
    fn moving(&self) -> Option<&'a Moving> {
        match self {
            Self::Moving(moving) => Some(moving),
            Self::Fixed(_) => None,
        }
    }

    fn parent(&self) -> &'a str {
        match self {
            Self::Moving(moving) => &moving.parent,
            Self::Fixed((parent, _)) => parent,
        }
    }
}

/// A frame with its poses.
pub(crate) struct PosesOfFrame<'a> {
    pub frame: &'a str,
    moving: &'a Moving,
}

impl<'a> PosesOfFrame<'a> {
    pub(crate) fn topic(&self) -> &'a str {
        &self.moving.topic
    }

    pub(crate) fn parent(&self) -> &'a str {
        &self.moving.parent
    }

    /// Sorted by their stamps.
    pub(crate) fn poses(&self) -> &'a [(u64, Isometry3<f64>)] {
        &self.moving.poses
    }
}

/// The poses of a frame in its parent, sorted by their stamps.
struct Moving {
    topic: String,
    parent: String,
    poses: Vec<(u64, Isometry3<f64>)>,
}

impl PoseReader {
    /// `None` if the recording has no poses.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`], [`svl_core::Error::Format`].
    pub(crate) fn open(recording: &Recording, channels: &[&Channel]) -> Result<Option<Self>> {
        let moves =
            |channel: &&&Channel| Transforms::are_moving(channel) || channel.schema == ODOMETRY;
        let first = recording.files().next();
        let Some(first) = first.filter(|_| channels.iter().any(|channel| moves(&channel))) else {
            return Ok(None);
        };
        Ok(Some(Self {
            messages: first.messages()?,
            recording: recording.clone(),
            next_file: 1,
            has_ended: false,
            fixed: Transforms::default(),
            moving: Default::default(),
            faulty: BTreeMap::new(),
            world: None,
        }))
    }

    /// The pose of `frame` in the topmost frame above it, if a moving one is on the way; `None` if
    /// no two poses around the stamp are near enough. All are in the frame of the first: one above
    /// it that comes later would move the places. With the pose of the robot's base in it, if that
    /// is on the way.
    pub(crate) fn at(
        &mut self,
        frame: &str,
        stamp_ns: u64,
    ) -> Option<(Isometry3<f64>, Option<Isometry3<f64>>)> {
        self.read_until(frame, PoseUse::Place, stamp_ns.saturating_add(AHEAD_NS));
        let mut links = self.chain(frame, PoseUse::Place);
        let top = links.last()?.parent().to_owned();
        if let Some(world) = self.world.as_ref().filter(|world| **world != top) {
            let end = links.iter().position(|link| link.parent() == world);
            links.truncate(end.map_or(0, |end| end + 1));
            warn_once(format!(
                "{}: poses in '{top}' begin after the first pairs, whose poses are in '{world}': \
                 all are in '{world}'; --from begins later",
                self.recording.path().display()
            ));
        }
        let base = links.iter().rposition(|link| is_robot(link.parent()));
        let base = base.and_then(|i| pose(&links[i + 1..], stamp_ns));
        let pose = pose(&links, stamp_ns)?;
        self.world.get_or_insert(top);
        Some((pose, base))
    }

    /// The pose of `frame` at the first stamp, in `frame` at the second one.
    pub(crate) fn motion(&mut self, frame: &str, [from_ns, to_ns]: [u64; 2]) -> PoseMotion {
        let [first_ns, last_ns] = [from_ns.min(to_ns), from_ns.max(to_ns)];
        self.read_until(frame, PoseUse::Motion, last_ns.saturating_add(AHEAD_NS));
        let links = self.chain(frame, PoseUse::Motion);
        let (Some(from), Some(to)) = (pose(&links, from_ns), pose(&links, to_ns)) else {
            return PoseMotion::Unknown;
        };
        let around = first_ns.saturating_sub(AHEAD_NS)..=last_ns.saturating_add(AHEAD_NS);
        if let Some(jump) = jump(&chain_steps(&links, around), [first_ns, last_ns]) {
            return PoseMotion::Jump(*jump);
        }
        let top = links.iter().rev().find_map(ChainLink::moving);
        if let Some(top) = top.filter(|top| is_map(&top.parent)) {
            warn_once(format!(
                "{}: {}: poses in '{}' move the truth, as there is none in an odometry frame: a \
                 map is corrected in jumps",
                self.recording.path().display(),
                top.topic,
                top.parent
            ));
        }
        PoseMotion::Known(to.inverse() * from)
    }

    /// Reads all poses.
    pub(crate) fn read_all(&mut self) {
        self.read_until("", PoseUse::Place, u64::MAX);
    }

    /// All frames that move.
    pub(crate) fn frames(&self) -> impl Iterator<Item = PosesOfFrame<'_>> {
        let all = self.moving.iter().flatten();
        all.map(|(frame, moving)| PosesOfFrame { frame, moving })
    }

    /// The frames that move on the way from `frame` to the topmost one.
    pub(crate) fn chain_of<'a>(&'a self, frame: &'a str) -> Vec<PosesOfFrame<'a>> {
        let chain = self.chain(frame, PoseUse::Place);
        let moving = chain.iter().filter_map(ChainLink::moving);
        let poses = |moving: &'a Moving| {
            let mut frames = self.frames();
            frames.find(|poses| std::ptr::eq(poses.moving, moving))
        };
        moving.filter_map(poses).collect()
    }

    /// The links above a frame; none if nothing moves there, or in a robot's own frame only.
    fn chain<'a>(&'a self, frame: &'a str, purpose: PoseUse) -> Vec<ChainLink<'a>> {
        // Odometry may move a frame that has a static parent as well: that of an inertial sensor.
        let orders = [
            ParentOrder::Transforms,
            ParentOrder::OdometryOverFixed,
            ParentOrder::Odometry,
        ];
        let mut chains = orders.map(|order| self.chain_by(frame, order));
        if purpose == PoseUse::Motion {
            for chain in &mut chains {
                let is_odometry = |link: &ChainLink<'_>| {
                    link.moving()
                        .is_some_and(|moving| is_odometry(&moving.parent))
                };
                if let Some(top) = chain.iter().rposition(is_odometry) {
                    chain.truncate(top + 1);
                    return std::mem::take(chain);
                }
            }
        }
        let moves = |links: &Vec<ChainLink<'_>>| {
            let is_in_world = links.last().is_some_and(|top| !is_robot(top.parent()));
            is_in_world && links.iter().any(|link| link.moving().is_some())
        };
        chains.into_iter().find(moves).unwrap_or_default()
    }

    fn chain_by<'a>(&'a self, frame: &'a str, order: ParentOrder) -> Vec<ChainLink<'a>> {
        let [tf, odometry] = &self.moving;
        let (mut frame, mut links) = (plain(frame), Vec::new());
        while links.len() < MAX_CHAIN {
            let (fixed, of_tf) = (self.fixed.parent(frame), tf.get(frame));
            let of_odometry = odometry.get(frame);
            let moving = match order {
                ParentOrder::Transforms => of_tf.or(of_odometry.filter(|_| fixed.is_none())),
                ParentOrder::OdometryOverFixed => of_tf.or(of_odometry),
                ParentOrder::Odometry => of_odometry.or(of_tf),
            };
            frame = match (moving, fixed) {
                (Some(moving), _) => {
                    links.push(ChainLink::Moving(moving));
                    &moving.parent
                }
                (None, Some(placed)) => {
                    links.push(ChainLink::Fixed(placed));
                    &placed.0
                }
                (None, None) => return links,
            };
        }
        // A circle.
        Vec::new()
    }

    /// True if all moving links above a frame, at least one, have poses up to that time.
    fn is_read(&self, frame: &str, purpose: PoseUse, until_ns: u64) -> bool {
        let chain = self.chain(frame, purpose);
        let is_late = |moving: &Moving| moving.poses.last().is_some_and(|last| last.0 >= until_ns);
        !chain.is_empty() && chain.iter().filter_map(ChainLink::moving).all(is_late)
    }

    /// Reads on until the frame's poses reach this time, or to the end of the recording.
    fn read_until(&mut self, frame: &str, purpose: PoseUse, until_ns: u64) {
        let mut is_read = self.is_read(frame, purpose, until_ns);
        while !self.has_ended && !is_read {
            match self.messages.next() {
                Ok(Some(FileEvent::Message(channel, log_time, data))) => {
                    if Transforms::reads(channel) {
                        // An unreadable one is reported if it is needed for the truth.
                        drop(self.fixed.add(channel, &data));
                        continue;
                    }
                    let (kind, found) = if Transforms::are_moving(channel) {
                        (0, Transforms::read(channel, &data))
                    } else if channel.schema == ODOMETRY {
                        (1, odometry(channel, &data))
                    } else {
                        continue;
                    };
                    let found = found.unwrap_or_else(|why| {
                        let why = why.to_string();
                        let path = self.recording.path().display();
                        warn_once(format!(
                            "{path}: {}: a pose is not used: {why}",
                            channel.topic
                        ));
                        let topic = channel.topic.clone();
                        self.faulty.entry(topic).or_insert((0, why)).0 += 1;
                        Vec::new()
                    });
                    for (child, placed, stamp) in found {
                        let stamp = stamp.unwrap_or(log_time);
                        let topic = &channel.topic;
                        let other = add(&mut self.moving[kind], topic, &child, placed, stamp);
                        if let Some(why) = other {
                            let path = self.recording.path().display();
                            warn_once(format!("{path}: {topic}: poses of '{child}' {why}"));
                        }
                        if let Some([used, other]) = contradiction(&self.moving, &child, stamp) {
                            warn_once(format!(
                                "{}: {other}: poses of '{child}' differ from those of {used}, \
                                 which are used",
                                self.recording.path().display()
                            ));
                        }
                    }
                    is_read = self.is_read(frame, purpose, until_ns);
                }
                Ok(Some(_)) => {}
                // Damage is reported with the pairs.
                Ok(None) | Err(_) => self.open_next(),
            }
        }
    }

    /// Goes on with the next file, if there is one.
    fn open_next(&mut self) {
        let file = self.recording.files().nth(self.next_file);
        match file.map(|file| file.messages()) {
            Some(Ok(messages)) => {
                self.next_file += 1;
                self.messages = messages;
            }
            _ => self.has_ended = true,
        }
    }
}

/// Where a frame has several parents: which of them is used.
#[derive(Clone, Copy)]
enum ParentOrder {
    /// That of `/tf`, a static one, that of odometry.
    Transforms,
    /// That of `/tf`, that of odometry, a static one.
    OdometryOverFixed,
    /// That of odometry, that of `/tf`, a static one.
    Odometry,
}

/// True for the world frame of an odometry: `odom`, `robot1/odom`, `camera_odom_frame`.
fn is_odometry(frame: &str) -> bool {
    frame.to_ascii_lowercase().contains("odom")
}

/// True for a robot's own frame, in which a head moves and the robot does not: `base_link`,
/// `robot1/base_footprint`.
fn is_robot(frame: &str) -> bool {
    ["base_link", "base_footprint"]
        .iter()
        .any(|name| frame.ends_with(name))
}

/// True for the frame of a map, in which poses are corrected.
fn is_map(frame: &str) -> bool {
    let frame = frame.to_ascii_lowercase();
    ["map", "earth", "utm"]
        .iter()
        .any(|name| frame.contains(name))
}

/// The pose of the lowest frame of a chain in its topmost one.
fn pose(links: &[ChainLink<'_>], stamp_ns: u64) -> Option<Isometry3<f64>> {
    let mut pose = (!links.is_empty()).then(Isometry3::identity)?;
    for link in links {
        pose = match link {
            ChainLink::Fixed((_, own)) => *own * pose,
            ChainLink::Moving(moving) => moving.at(stamp_ns)? * pose,
        };
    }
    Some(pose)
}

/// The motions of the lowest frame of a chain between all of its poses in that time.
fn chain_steps(links: &[ChainLink<'_>], within_ns: RangeInclusive<u64>) -> Vec<PoseStep> {
    let moving = links.iter().filter_map(ChainLink::moving);
    let stamps: BTreeSet<u64> = moving
        .flat_map(|moving| moving.stamps(&within_ns))
        .collect();
    steps(
        stamps
            .into_iter()
            .filter_map(|at| Some((at, pose(links, at)?))),
    )
}

/// The topics of `/tf` and of odometry, if these contradict each other on the pose of a frame.
fn contradiction<'a>(
    moving: &'a [BTreeMap<String, Moving>; 2],
    child: &str,
    stamp_ns: u64,
) -> Option<[&'a str; 2]> {
    let [tf, odometry] = moving.each_ref().map(|frames| frames.get(child));
    let (tf, odometry) = (tf?, odometry?);
    let is_same = is_same(&tf.at(stamp_ns)?, &odometry.at(stamp_ns)?);
    (!is_same && tf.parent == odometry.parent).then_some([&tf.topic, &odometry.topic])
}

/// True if two poses differ by less than the noise of an estimate.
fn is_same(one: &Isometry3<f64>, other: &Isometry3<f64>) -> bool {
    let apart = one.inverse() * other;
    apart.translation.vector.norm() <= SAME_M && apart.rotation.angle() <= SAME_RAD
}

/// Adds a pose. Returns the reason why it is not used: two tracks of a frame would be one that
/// jumps, and of poses with one stamp tf2 keeps the first, too.
fn add(
    moving: &mut BTreeMap<String, Moving>,
    topic: &str,
    child: &str,
    (parent, pose): Placed,
    stamp: u64,
) -> Option<String> {
    let own = moving.entry(child.to_owned()).or_insert_with(|| Moving {
        topic: topic.to_owned(),
        parent: parent.clone(),
        poses: Vec::new(),
    });
    if own.topic != topic {
        let first = &own.topic;
        return Some(format!("are those of {first} too, which are used"));
    }
    if own.parent != parent {
        let first = &own.parent;
        return Some(format!(
            "are in '{parent}' too; those in '{first}' are used"
        ));
    }
    if own.poses.len() < MAX_POSES {
        let at = own.poses.partition_point(|(other, _)| *other <= stamp);
        let last = at.checked_sub(1).map(|i| own.poses[i]);
        if let Some((_, first)) = last.filter(|(other, _)| *other == stamp) {
            let words = "differ at one stamp; the first of each stamp is used";
            return (!is_same(&first, &pose)).then(|| words.to_owned());
        }
        own.poses.insert(at, (stamp, pose));
    }
    None
}

/// The pose in a message of odometry: child frame, its pose in the parent, stamp.
fn odometry(channel: &Channel, data: &[u8]) -> MessageResult<Vec<StampedTransform>> {
    let link = ros::read(channel, data, ros::odometry)?;
    Transforms::placed(channel, link).map(|placed| vec![placed])
}

impl Moving {
    /// The stamps of its poses in that time.
    fn stamps(&self, within_ns: &RangeInclusive<u64>) -> impl Iterator<Item = u64> {
        let first = self
            .poses
            .partition_point(|(stamp, _)| stamp < within_ns.start());
        let end = self
            .poses
            .partition_point(|(stamp, _)| stamp <= within_ns.end());
        self.poses[first..end.max(first)]
            .iter()
            .map(|(stamp, _)| *stamp)
    }

    /// The pose at that time, between those before and after it.
    fn at(&self, stamp_ns: u64) -> Option<Isometry3<f64>> {
        let after = self.poses.partition_point(|(stamp, _)| *stamp < stamp_ns);
        let next = self.poses.get(after);
        if let Some((stamp, pose)) = next
            && *stamp == stamp_ns
        {
            return Some(*pose);
        }
        let (before, (end, last)) = (self.poses.get(after.checked_sub(1)?)?, next?);
        let (start, first) = before;
        if end - start > MAX_GAP_NS {
            return None;
        }
        let part = (stamp_ns - start) as f64 / (end - start) as f64;
        // Opposite rotations have none in between.
        first.try_lerp_slerp(last, part, 1e-6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_in_between_are_interpolated() {
        let mut moving = BTreeMap::new();
        let at = |x: f64| ("odom".to_owned(), Isometry3::translation(x, 0.0, 0.0));
        for (stamp, x) in [(300, 3.0), (100, 1.0), (200, 2.0)] {
            add(&mut moving, "/tf", "base", at(x), stamp * 1_000_000);
        }
        let other = ("map".to_owned(), Isometry3::identity());
        let second = add(&mut moving, "/tf", "base", other, 150_000_000);
        assert!(second.unwrap().contains("are in 'map' too; those in"));
        let first = add(&mut moving, "/odom", "base", at(7.0), 150_000_000);
        assert!(first.unwrap().contains("those of /tf too"));
        // The first of poses at one stamp is kept, as by tf2.
        assert_eq!(add(&mut moving, "/tf", "base", at(2.0), 200_000_000), None);
        let second = add(&mut moving, "/tf", "base", at(7.0), 200_000_000);
        assert!(second.unwrap().contains("differ at one stamp"));
        add(&mut moving, "/tf", "base", at(9.0), 900_000_000);
        let x = |ms: u64| {
            let pose = moving["base"].at(ms * 1_000_000)?;
            Some((pose.translation.x * 1e9).round() / 1e9)
        };
        assert_eq!([100, 150, 225, 300].map(x), [1.0, 1.5, 2.25, 3.0].map(Some));
        // Before the first, in a gap, after the last.
        assert_eq!([99, 500, 901].map(x), [None; 3]);
    }
}
