//! Static transforms between the frames of a robot: `/tf_static`, Foxglove's and RealSense's.

use super::topics;
use crate::decode::{image, realsense};
use crate::message::wire::decode_protobuf;
use crate::message::{MessageError, MessageResult, ros};
use crate::stream::channel::{Channel, warn_once};
use foxglove::messages::{FrameTransform, FrameTransforms};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use std::collections::{BTreeMap, BTreeSet};
use svl_core::listed;

/// Longest chain of transforms: a robot arm has ten; a corrupt tree may contain a cycle.
const MAX_CHAIN: usize = 100;
/// Limit on frames: ten times those of a robot with many arms.
const MAX_FRAMES: usize = 10_000;

/// Transform messages of ROS.
const ROS: &str = "tf2_msgs/msg/TFMessage";

/// Transforms by the name of the child frame: the parent's name, and the child's pose in it.
#[derive(Default)]
pub(crate) struct Transforms(BTreeMap<String, Placed>);

/// The parent of a frame, and the frame's pose in it.
pub(crate) type Placed = (String, Isometry3<f64>);

/// A transform of a message: child, placed, and its stamp if it has one.
pub(crate) type StampedTransform = (String, Placed, Option<u64>);

/// One transform: parent, child, translation, rotation as x, y, z, w.
type Link = (String, String, [f64; 3], [f64; 4]);

/// Transforms of one frame that differ by less are equal, up to the rounding of the programs that
/// publish them: metres, and radians.
const SAME: f64 = 1e-4;

/// A later transform of a frame that differs from the first, which is used.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Conflict {
    child: String,
    /// Parents of the first and of the later one.
    parents: [String; 2],
    apart_m: f64,
    apart_degrees: f64,
}

impl std::fmt::Display for Conflict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ([parent, other], child) = (&self.parents, &self.child);
        if parent == other {
            let (metres, degrees) = (self.apart_m, self.apart_degrees);
            write!(
                f,
                "two transforms of '{child}' in '{parent}' differ by {metres:.4} m and \
                 {degrees:.2}°"
            )
        } else {
            write!(f, "'{child}' has two parents, '{parent}' and '{other}'")
        }
    }
}

impl Transforms {
    /// True if the messages of a channel contain such transforms: those of ROS only in
    /// `/tf_static`, as `/tf` moves; Foxglove has no such convention, so the first of each frame is
    /// used.
    pub(crate) fn reads(channel: &Channel) -> bool {
        match channel.schema.as_str() {
            ROS => channel.topic.ends_with("tf_static") && channel.stamps.is_read(),
            "foxglove.FrameTransform" | "foxglove.FrameTransforms" => {
                channel.encoding == "protobuf"
            }
            _ => realsense::is_transform(channel),
        }
    }

    /// True if the messages of a channel contain transforms that may move.
    pub(crate) fn are_moving(channel: &Channel) -> bool {
        channel.schema == ROS && !channel.topic.ends_with("tf_static") && channel.stamps.is_read()
    }

    /// The topics of transforms in namespaces that hold none of the images: those of other robots,
    /// whose frames may have the same names. The only topic of its kind is of the cameras' robot.
    pub(crate) fn other_robots(channels: &[&Channel], images: [&str; 2]) -> BTreeSet<String> {
        let mut others = BTreeSet::new();
        for reads in [Self::reads, Self::are_moving] {
            let of_kind = channels.iter().filter(|c| c.schema == ROS && reads(c));
            let of_kind: BTreeSet<_> = of_kind.map(|channel| &channel.topic).collect();
            let is_near = |topic: &&&String| images.iter().any(|i| topics::is_near(topic, i));
            if of_kind.len() > 1 {
                others.extend(of_kind.iter().filter(|t| !is_near(t)).copied().cloned());
            }
        }
        others
    }

    /// Adds the transforms of a message; if some contradict each other, the first is used.
    ///
    /// # Errors
    /// The reason why it cannot be read.
    pub(crate) fn add(&mut self, channel: &Channel, data: &[u8]) -> MessageResult<()> {
        for (child, link, _) in Self::read(channel, data)? {
            let is_new = self.0.len() < MAX_FRAMES && !self.0.contains_key(&child);
            let ends_cycle = |parent| {
                self.ancestors(parent)
                    .iter()
                    .any(|(name, _)| *name == child)
            };
            if is_new && !ends_cycle(&link.0) {
                self.0.insert(child, link);
            }
        }
        Ok(())
    }

    /// The first transform of a message that differs from the one in use for its frame, among those
    /// that lead `from` a frame `to` another.
    pub(crate) fn conflict(
        &self,
        (channel, data): (&Channel, &[u8]),
        (to, from): (&str, &str),
    ) -> Option<Conflict> {
        let chain = self.chain(to, from);
        let links = Self::read(channel, data).ok()?;
        links.into_iter().find_map(|(child, (other, later), _)| {
            // A frame without a parent may be positioned by the frames below it.
            let (parent, pose, way) = match self.0.get(&child) {
                Some((parent, pose)) => (parent.as_str(), *pose, vec![child.as_str()]),
                None => {
                    let pose = self.between(&other, &child)?;
                    (other.as_str(), pose, self.chain(&other, &child))
                }
            };
            let apart = pose.inverse() * later;
            let (apart_m, angle) = (apart.translation.vector.norm(), apart.rotation.angle());
            let differs = parent != other || apart_m > SAME || angle > SAME;
            (differs && way.iter().any(|frame| chain.contains(frame))).then(|| Conflict {
                parents: [parent.to_owned(), other.clone()],
                child: child.clone(),
                apart_m,
                apart_degrees: angle.to_degrees(),
            })
        })
    }

    /// The frames whose transforms lead `from` a frame `to` another: frames above both are not on
    /// the way.
    fn chain<'a>(&'a self, to: &'a str, from: &'a str) -> Vec<&'a str> {
        let [to, from] = [to, from].map(|frame| {
            let names = self.ancestors(frame).into_iter().map(|(name, _)| name);
            names.collect::<Vec<_>>()
        });
        let is_common = |name: &&str| to.contains(name) && from.contains(name);
        let both = to.iter().chain(&from).copied();
        both.filter(|name| !is_common(name)).collect()
    }

    /// The transforms of a message. Warns once of those that are invalid beside valid ones.
    ///
    /// # Errors
    /// The reason why there are none.
    pub(crate) fn read(channel: &Channel, data: &[u8]) -> MessageResult<Vec<StampedTransform>> {
        if realsense::is_transform(channel) {
            let text = ros::read(channel, data, ros::string)?;
            let (child, placed) = realsense::transform(&channel.topic, text)?;
            return Ok(vec![(child, placed, None)]);
        }
        let links: Vec<Link> = match channel.schema.as_str() {
            "foxglove.FrameTransform" => vec![link(decode_protobuf(data)?)?],
            "foxglove.FrameTransforms" => {
                let message: FrameTransforms = decode_protobuf(data)?;
                let links = message.transforms.into_iter().map(link);
                links.collect::<MessageResult<_>>()?
            }
            _ => {
                let stamped = ros::read(channel, data, ros::transforms)?;
                let stamped = stamped.into_iter();
                return valid(channel, stamped.map(|link| Self::placed(channel, link)));
            }
        };
        let placed = |link| place(link).map(|(child, placed)| (child, placed, None));
        valid(channel, links.into_iter().map(placed))
    }

    /// A transform of a ROS message.
    pub(crate) fn placed(
        channel: &Channel,
        (stamp, link): (ros::RosTime, Link),
    ) -> MessageResult<StampedTransform> {
        let (child, placed) = place(link)?;
        Ok((child, placed, image::ros_stamp(channel, stamp)?))
    }

    /// The parent of a frame, with the frame's pose in it.
    pub(crate) fn parent(&self, frame: &str) -> Option<&Placed> {
        self.0.get(frame)
    }

    /// The pose of frame `from` in frame `to`, by their common ancestor.
    pub(crate) fn between(&self, to: &str, from: &str) -> Option<Isometry3<f64>> {
        let (to, from) = (self.ancestors(to), self.ancestors(from));
        let common = |(name, up): &(&str, Isometry3<f64>)| {
            let (_, to_up) = to.iter().find(|(other, _)| other == name)?;
            Some(to_up.inverse() * up)
        };
        from.iter().find_map(common)
    }

    /// The frame itself and those above it, with its pose in each.
    fn ancestors<'a>(&'a self, frame: &'a str) -> Vec<(&'a str, Isometry3<f64>)> {
        let mut above = vec![(plain(frame), Isometry3::identity())];
        while let Some((name, pose)) = above.last().copied()
            && let Some((parent, own)) = self.0.get(name)
            && above.len() < MAX_CHAIN
        {
            above.push((parent, own * pose));
        }
        above
    }

    /// Names of the known frames, for error messages.
    pub(crate) fn listed(&self) -> String {
        let links = self
            .0
            .iter()
            .map(|(child, (parent, _))| format!("{parent} → {child}"));
        if self.0.is_empty() {
            return "no transform".to_owned();
        }
        listed(links)
    }
}

fn place((parent, child, [x, y, z], [qx, qy, qz, qw]): Link) -> MessageResult<(String, Placed)> {
    let rotation = Quaternion::new(qw, qx, qy, qz);
    let numbers = [x, y, z, rotation.norm()];
    let fault = if !numbers.iter().all(|v| v.is_finite()) {
        "has numbers that are not finite"
    } else if (rotation.norm() - 1.0).abs() > 1e-3 {
        "has a quaternion whose norm is not 1"
    } else {
        ""
    };
    if !fault.is_empty() {
        // Without the numbers, which differ between messages of one fault.
        let why = format!("its transform of '{child}' in '{parent}' {fault}");
        return Err(MessageError::Transform(why));
    }
    let pose = Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_quaternion(rotation),
    );
    Ok((plain(&child).to_owned(), (plain(&parent).to_owned(), pose)))
}

/// The valid ones of a message's transforms: one that is not must not cost the others.
fn valid(
    channel: &Channel,
    all: impl Iterator<Item = MessageResult<StampedTransform>>,
) -> MessageResult<Vec<StampedTransform>> {
    let (mut found, mut faults) = (Vec::new(), Vec::new());
    for one in all {
        match one {
            Ok(transform) => found.push(transform),
            Err(fault) => faults.push(fault),
        }
    }
    match faults.into_iter().next() {
        Some(fault) if found.is_empty() => return Err(fault),
        Some(fault) => warn_once(format!("{}: {fault}; it is not used", channel.topic)),
        None => {}
    }
    Ok(found)
}

/// Names in tf 1 begin with a slash.
pub(crate) fn plain(frame: &str) -> &str {
    frame.trim_start_matches('/')
}

fn link(message: FrameTransform) -> MessageResult<Link> {
    let FrameTransform {
        parent_frame_id,
        child_frame_id,
        translation: Some(t),
        rotation: Some(q),
        ..
    } = message
    else {
        return Err(MessageError::Missing("it lacks translation or rotation"));
    };
    let rotation = [q.x, q.y, q.z, q.w];
    Ok((parent_frame_id, child_frame_id, [t.x, t.y, t.z], rotation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

    fn tree(links: &[(&str, &str, [f64; 3], f64)]) -> Transforms {
        let link = |&(parent, child, [x, y, z], yaw): &(&str, &str, [f64; 3], f64)| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
            let pose = Isometry3::from_parts(Translation3::new(x, y, z), turn);
            (child.to_owned(), (parent.to_owned(), pose))
        };
        Transforms(links.iter().map(link).collect())
    }

    #[test]
    fn frames_are_joined_by_their_common_ancestor() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let transforms = tree(&[
            ("base", "camera", [1.0, 0.0, 0.0], 0.0),
            ("base", "mast", [0.0, 2.0, 0.0], quarter),
            ("mast", "lidar", [1.0, 0.0, 0.0], 0.0),
        ]);
        // Pose of the lidar's origin: a metre along the mast's x, which is base's y.
        let pose = transforms.between("camera", "/lidar").unwrap();
        let origin = pose * Point3::origin();
        let expected = Point3::new(-1.0, 3.0, 0.0);
        assert!((origin - expected).norm() < 1e-12, "{origin}");
        let back = transforms.between("lidar", "camera").unwrap();
        assert!((back * origin).coords.norm() < 1e-12);
        assert_eq!(transforms.between("camera", "elsewhere"), None);
        let own = transforms.between("camera", "camera");
        assert_eq!(own, Some(Isometry3::identity()));
        assert!(transforms.listed().contains("mast → lidar"));
    }

    #[test]
    fn transforms_that_differ_on_the_way_are_a_conflict() {
        let transforms = tree(&[
            ("world", "base", [0.0; 3], 0.0),
            ("base", "camera", [1.0, 0.0, 0.0], 0.0),
            ("base", "lidar", [0.0, 2.0, 0.0], 0.0),
        ]);
        let message = |parent: &str, child: &str, x: f64| {
            let message = FrameTransform {
                parent_frame_id: parent.to_owned(),
                child_frame_id: child.to_owned(),
                translation: Some(foxglove::messages::Vector3 { x, y: 2.0, z: 0.0 }),
                rotation: Some(foxglove::messages::Quaternion {
                    w: 1.0,
                    ..Default::default()
                }),
                ..FrameTransform::default()
            };
            let mut data = Vec::new();
            foxglove::Encode::encode(&message, &mut data).unwrap();
            let names = ["/tf_static", "foxglove.FrameTransform", "protobuf"];
            let [topic, schema, encoding] = names.map(str::to_owned);
            (Channel::new(topic, schema, encoding), data)
        };
        let conflict = |parent: &str, child: &str, x: f64| {
            let (channel, data) = message(parent, child, x);
            transforms.conflict((&channel, &data), ("camera", "/lidar"))
        };
        assert_eq!(conflict("base", "lidar", 0.0), None);
        assert_eq!(conflict("base", "lidar", 1e-6), None, "rounding");
        let apart = conflict("base", "/lidar", 0.1).unwrap();
        assert!((apart.apart_m - 0.1).abs() < 1e-12, "{apart}");
        assert_eq!(conflict("mast", "lidar", 0.0).unwrap().parents[1], "mast");
        // Above both, and off the way.
        assert_eq!(conflict("world", "base", 5.0), None);
        assert_eq!(conflict("base", "arm", 5.0), None);
        // A cycle: the first transforms are used, and one that contradicts them is detected.
        let first = |x: f64| {
            let mut first = Transforms::default();
            let links = [("lidar", "camera", 0.5), ("camera", "lidar", x)];
            let messages = links.map(|(parent, child, x)| message(parent, child, x));
            for (channel, data) in &messages {
                first.add(channel, data).unwrap();
            }
            let [_, (channel, data)] = &messages;
            let conflict = first.conflict((channel, data), ("camera", "lidar"));
            let pose = first.between("camera", "lidar").unwrap();
            (pose.translation.vector, conflict.map(|c| c.apart_m))
        };
        let (used, apart) = first(2.5);
        assert_eq!((used, apart), (Vector3::new(-0.5, -2.0, 0.0), Some(5.0)));
    }

    #[test]
    fn a_circle_ends() {
        let circle = tree(&[("a", "b", [0.0; 3], 0.0), ("b", "a", [0.0; 3], 0.0)]);
        assert_eq!(circle.between("a", "c"), None);
    }
}
