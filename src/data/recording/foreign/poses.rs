//! Poses of a camera in the world: by the transforms of `/tf`, or by nav_msgs/Odometry, with the
//! static ones between robot and camera.

use super::transforms::{Placed, StampedTransform, Transforms, plain};
use crate::recording::Recording;
use crate::recording::messages::{Channel, EventReader, FileEvent};
use crate::recording::ros;
use nalgebra::Isometry3;
use std::collections::BTreeMap;
use svl_core::Result;

const ODOMETRY: &str = "nav_msgs/msg/Odometry";
/// Longest time between two poses, of which one in between is interpolated.
const MAX_GAP_NS: u64 = 500_000_000;
/// Poses are read on until one is this much later than the pair, as messages arrive out of order.
const AHEAD_NS: u64 = 1_000_000_000;
/// Limit on poses of one frame: an hour at 1000 a second.
const MAX_POSES: usize = 4_000_000;
/// Longest chain of transforms.
const MAX_CHAIN: usize = 100;

/// Reads the poses of a recording, next to its pairs.
pub(super) struct PoseReader {
    recording: Recording,
    messages: Box<dyn EventReader>,
    next_file: usize,
    has_ended: bool,
    /// Latest stamp of a pose so far.
    latest_ns: u64,
    fixed: Transforms,
    /// By the name of the moving frame: those of `/tf`, and those of odometry, which are used where
    /// `/tf` has none.
    moving: [BTreeMap<String, Moving>; 2],
}

/// The poses of a frame in its parent, sorted by their stamps.
struct Moving {
    parent: String,
    poses: Vec<(u64, Isometry3<f64>)>,
}

impl PoseReader {
    /// `None` if the recording has no poses.
    ///
    /// # Errors
    /// [`svl_core::Error::Io`], [`svl_core::Error::Format`].
    pub(super) fn open(recording: &Recording, channels: &[&Channel]) -> Result<Option<Self>> {
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
            latest_ns: 0,
            fixed: Transforms::default(),
            moving: Default::default(),
        }))
    }

    /// The pose of `frame` in the topmost frame above it, if a moving one is on the way; `None` if
    /// no two poses around the stamp are near enough.
    pub(super) fn at(&mut self, frame: &str, stamp_ns: u64) -> Option<Isometry3<f64>> {
        self.read_until(stamp_ns.saturating_add(AHEAD_NS));
        let (mut frame, mut pose) = (plain(frame), Isometry3::identity());
        let mut has_moved = false;
        for _ in 0..MAX_CHAIN {
            let [tf, odometry] = &self.moving;
            let moving = |of: &'_ BTreeMap<String, Moving>| {
                let moving = of.get(frame)?;
                Some((moving.parent.clone(), moving.at(stamp_ns)))
            };
            let (parent, own) = match (moving(tf), self.fixed.parent(frame), moving(odometry)) {
                (Some((parent, own)), ..) | (None, None, Some((parent, own))) => {
                    has_moved = true;
                    (parent, own?)
                }
                (None, Some((parent, own)), _) => (parent.clone(), *own),
                (None, None, None) => return has_moved.then_some(pose),
            };
            pose = own * pose;
            frame = match self.name(&parent) {
                Some(name) => name,
                None => return has_moved.then_some(pose),
            };
        }
        None
    }

    /// The frame of that name, if it has a parent.
    fn name(&self, frame: &str) -> Option<&str> {
        let [tf, odometry] = &self.moving;
        let moving = tf
            .get_key_value(frame)
            .or_else(|| odometry.get_key_value(frame));
        let moving = moving.map(|(name, _)| name.as_str());
        moving.or_else(|| self.fixed.name(frame))
    }

    /// Reads on until a pose has this stamp, or to the end of the recording.
    fn read_until(&mut self, stamp_ns: u64) {
        while !self.has_ended && self.latest_ns < stamp_ns {
            match self.messages.next() {
                Ok(Some(FileEvent::Message {
                    channel,
                    log_time,
                    data,
                })) => {
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
                    for (child, placed, stamp) in found.unwrap_or_default() {
                        let stamp = stamp.unwrap_or(log_time);
                        self.latest_ns = self.latest_ns.max(stamp);
                        add(&mut self.moving[kind], child, placed, stamp);
                    }
                }
                Ok(Some(_)) => {}
                // Damage is reported with the pairs.
                Ok(None) | Err(_) => match self.recording.files().nth(self.next_file) {
                    Some(file) => {
                        self.next_file += 1;
                        match file.messages() {
                            Ok(messages) => self.messages = messages,
                            Err(_) => self.has_ended = true,
                        }
                    }
                    None => self.has_ended = true,
                },
            }
        }
    }
}

fn add(moving: &mut BTreeMap<String, Moving>, child: String, (parent, pose): Placed, stamp: u64) {
    let own = moving.entry(child).or_insert_with(|| Moving {
        parent: parent.clone(),
        poses: Vec::new(),
    });
    // A second parent contradicts the first one.
    if own.parent == parent && own.poses.len() < MAX_POSES {
        let at = own.poses.partition_point(|(other, _)| *other <= stamp);
        own.poses.insert(at, (stamp, pose));
    }
}

/// The pose in a message of odometry: child frame, its pose in the parent, stamp.
fn odometry(channel: &Channel, data: &[u8]) -> std::result::Result<Vec<StampedTransform>, String> {
    let link = ros::read(channel, data, ros::odometry)?;
    Transforms::placed(channel, link).map(|placed| vec![placed])
}

impl Moving {
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
            add(&mut moving, "base".to_owned(), at(x), stamp * 1_000_000);
        }
        let other = ("map".to_owned(), Isometry3::identity());
        add(&mut moving, "base".to_owned(), other, 150_000_000);
        add(&mut moving, "base".to_owned(), at(9.0), 900_000_000);
        let x = |ms: u64| {
            let pose = moving["base"].at(ms * 1_000_000)?;
            Some((pose.translation.x * 1e9).round() / 1e9)
        };
        assert_eq!([100, 150, 225, 300].map(x), [1.0, 1.5, 2.25, 3.0].map(Some));
        // Before the first, in a gap, after the last.
        assert_eq!([99, 500, 901].map(x), [None; 3]);
    }
}
