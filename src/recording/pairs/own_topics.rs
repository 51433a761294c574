//! What svl's own recordings have of a pair besides images and calibrations: the record that joins
//! its images, pose, truth, colours and exposure.

use super::stamp_pairing::MAX_WAITING;
use super::truth;
use crate::decode::encoding::floats;
use crate::decode::head::head;
use crate::decode::image::decode;
use crate::message::MessageError::{Missing, TruthSize, Unsuited};
use crate::message::sync::{PairGeometry, StereoSync};
use crate::message::wire::topic;
use crate::message::{MessageError, MessageResult, geometry};
use crate::stream::channel::Channel;
use std::collections::BTreeMap;
use svl_core::stereo::{
    Frame, Geometry, Gray, Plane, Pose, Rgb, Rig, Side, Surface, Truth, Visibility,
};
use svl_files::DecodedImage;

/// The stamps of two images, left and right, that are a pair by a message; `None` for others.
pub(crate) type Joined = Option<[u64; 2]>;

/// Messages that wait for the images of their pair, by stamp and side.
#[derive(Default)]
pub(crate) struct OwnTopics(BTreeMap<(u64, bool), PairMessages>);

/// Messages with one stamp of one camera. The right one has only colours.
#[derive(Default)]
struct PairMessages {
    sync: Option<StereoSync>,
    color: Option<Rgb>,
    pose: Option<Pose>,
    depth: Option<Plane<f32>>,
    disparity: Option<Plane<f32>>,
    visibility: Option<Gray>,
    surface: Option<Gray>,
}

impl OwnTopics {
    /// Keeps a message for its pair. Returns the stamps, left and right, of two images that are a
    /// pair by it; `None` for a message on a topic of others, images and calibrations among them.
    ///
    /// # Errors
    /// The reason why the message cannot be read.
    pub(crate) fn take_in(
        &mut self,
        channel: &Channel,
        log_time: u64,
        data: &[u8],
    ) -> MessageResult<Option<Joined>> {
        let at = |stamp: Option<u64>| stamp.unwrap_or(log_time);
        let image = || {
            let (stamp, image) = decode(channel, data)?;
            Ok::<_, MessageError>((at(stamp), image?.image))
        };
        let codes = || match image()? {
            (stamp, DecodedImage::Gray(codes)) => Ok((stamp, codes)),
            _ => Err(Unsuited("its pixels are no codes of 8 bits")),
        };
        let values = || Ok::<_, MessageError>((at(head(channel, data)?.0), floats(channel, data)?));
        match channel.topic.as_str() {
            // The calibration contains it too; this message is for viewers.
            topic::BASELINE => {}
            topic::POSE => {
                let (stamp, pose) = geometry::decode_pose(channel, data)?;
                self.at(Side::Left, at(stamp)).pose = Some(pose);
            }
            topic::DEPTH => {
                let (stamp, depth) = values()?;
                self.at(Side::Left, stamp).depth = Some(depth);
            }
            topic::DISPARITY => {
                let (stamp, disparity) = values()?;
                self.at(Side::Left, stamp).disparity = Some(disparity);
            }
            topic::VISIBILITY => {
                let (stamp, codes) = codes()?;
                self.at(Side::Left, stamp).visibility = Some(codes);
            }
            topic::SURFACE => {
                let (stamp, codes) = codes()?;
                self.at(Side::Left, stamp).surface = Some(codes);
            }
            topic::SYNC => {
                let sync = StereoSync::decode(&channel.schema, data)?;
                let stamps = [sync.left_stamp_ns, sync.right_stamp_ns];
                self.at(Side::Left, stamps[0]).sync = Some(sync);
                return Ok(Some(Some(stamps)));
            }
            name => {
                let is_color = |side: &Side| topic::camera(*side, "color") == name;
                let Some(side) = Side::BOTH.into_iter().find(is_color) else {
                    return Ok(None);
                };
                let (stamp, color) = match image()? {
                    (stamp, DecodedImage::Color(color)) => (stamp, color),
                    (stamp, DecodedImage::Gray(grey)) => (stamp, grey.map(|value| [value; 3])),
                    _ => return Err(Unsuited("its pixels are no colours of 8 bits")),
                };
                self.at(side, stamp).color = Some(color);
            }
        }
        Ok(Some(None))
    }

    /// The messages with a stamp. Memory is bounded: the earliest ones are dropped.
    fn at(&mut self, side: Side, stamp: u64) -> &mut PairMessages {
        let key = (stamp, side == Side::Right);
        if self.0.len() >= 2 * MAX_WAITING && !self.0.contains_key(&key) {
            self.0.pop_first();
        }
        self.0.entry(key).or_default()
    }

    /// Completes the frame of two images with these stamps, left and right. `rig`: that of the
    /// calibrations with the same stamps.
    ///
    /// # Errors
    /// The reason why the messages are not those of one pair.
    pub(crate) fn complete(
        &mut self,
        frame: Frame,
        [left_ns, right_ns]: [u64; 2],
        rig: Option<Rig>,
    ) -> MessageResult<Frame> {
        let left = self.0.remove(&(left_ns, false)).unwrap_or_default();
        let right = self.0.remove(&(right_ns, true)).unwrap_or_default();
        let sync = left.sync.ok_or(Missing("its /stereo/sync is missing"))?;
        let disparity = true_disparity(left.disparity, left.depth, rig.as_ref())?;
        let truth = disparity.map(|disparity| Truth {
            disparity,
            visibility: left.visibility.map(|v| v.map(Visibility::from_code)),
            surface: left.surface.map(|s| s.map(Surface::from_code)),
            kind: sync.truth,
        });
        let size = frame.pair.size();
        // The hash of a pair does not cover its truth, so a wrong size would be found only by a
        // score.
        if let Some(truth) = &truth {
            let sizes = [
                Some(truth.disparity.size()),
                truth.visibility.as_ref().map(Plane::size),
                truth.surface.as_ref().map(Plane::size),
            ];
            if let Some(other) = sizes.into_iter().flatten().find(|other| *other != size) {
                return Err(TruthSize(other, size));
            }
        }
        let color = left.color.zip(right.color).map(<[Rgb; 2]>::from);
        if color.iter().flatten().any(|color| color.size() != size) {
            let why = "its colour images differ in size from its grey ones";
            return Err(Unsuited(why));
        }
        Ok(Frame {
            sequence: sync.sequence,
            stamp_ns: left_ns,
            name: sync.name,
            geometry: match sync.geometry {
                PairGeometry::Raw => Geometry::Raw,
                PairGeometry::Rectified => Geometry::Rectified(rig),
            },
            pose: left.pose,
            truth,
            color,
            exposure: sync.exposure,
            ..frame
        })
    }
}

fn true_disparity(
    disparity: Option<Plane<f32>>,
    depth: Option<Plane<f32>>,
    rig: Option<&Rig>,
) -> MessageResult<Option<Plane<f32>>> {
    match (disparity, depth, rig) {
        // Written if depth could not represent the truth, so it takes precedence over a depth.
        (Some(disparity), _, _) => Ok(Some(truth::from_file(&disparity))),
        (None, Some(depth), Some(rig)) => Ok(Some(truth::disparities(&depth, rig))),
        (None, Some(_), None) => {
            let why = "its true depth has no calibration, which is needed for disparities";
            Err(Missing(why))
        }
        (None, None, _) => Ok(None),
    }
}
