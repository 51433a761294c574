//! Assembles the frames of svl's own recordings from their messages, by the stamps in
//! `/stereo/sync`.

use super::geometry;
use super::sync::{PairGeometry, StereoSync};
use super::{TopicKind, images, truth};
use crate::counted;
use crate::stereo::{Frame, Geometry, Gray, Plane, Pose, Rig, Side, StereoPair, Truth, Visibility};
use nalgebra::Matrix3x4;
use std::collections::BTreeMap;

/// Limit of stamps that wait for the rest of their pair. svl's writer needs one.
const WAITING: usize = 16;

/// Messages that wait for the rest of their pair, by stamp.
#[derive(Default)]
pub(super) struct PairAssembler {
    left: BTreeMap<u64, LeftMessages>,
    right: BTreeMap<u64, RightMessages>,
    pairs: u64,
    unpaired: u64,
    left_images: u64,
    right_images: u64,
}

/// Messages with the left stamp.
#[derive(Default)]
struct LeftMessages {
    image: Option<Gray>,
    calibration: Option<Matrix3x4<f64>>,
    pose: Option<Pose>,
    depth: Option<Plane<f32>>,
    disparity: Option<Plane<f32>>,
    visibility: Option<Gray>,
    sync: Option<StereoSync>,
}

/// Messages with the right stamp.
#[derive(Default)]
struct RightMessages {
    image: Option<Gray>,
    calibration: Option<Matrix3x4<f64>>,
}

impl PairAssembler {
    /// Pairs assembled.
    pub(super) fn pairs(&self) -> u64 {
        self.pairs
    }

    /// Images without a partner.
    pub(super) fn unpaired(&self) -> u64 {
        self.unpaired
    }

    /// Adds one message and returns the pair that it completes.
    ///
    /// # Errors
    /// Why the message cannot be read, or the two images are not a pair.
    pub(super) fn take_in(
        &mut self,
        kind: TopicKind,
        schema: &str,
        stamp: u64,
        data: &[u8],
    ) -> Result<Option<Frame>, String> {
        match kind {
            TopicKind::Image(Side::Left) => {
                // Counted before decoding, so that a file of unreadable images is not called empty.
                self.left_images += 1;
                let replaced = self
                    .left(stamp)
                    .image
                    .replace(images::decode_gray(schema, data)?);
                self.unpaired += u64::from(replaced.is_some());
            }
            TopicKind::Image(Side::Right) => {
                self.right_images += 1;
                let replaced = self
                    .right(stamp)
                    .image
                    .replace(images::decode_gray(schema, data)?);
                self.unpaired += u64::from(replaced.is_some());
            }
            TopicKind::Calibration(Side::Left) => {
                self.left(stamp).calibration = Some(geometry::decode_calibration(schema, data)?);
            }
            TopicKind::Calibration(Side::Right) => {
                self.right(stamp).calibration = Some(geometry::decode_calibration(schema, data)?);
            }
            // The calibration has it too; this message is for viewers.
            TopicKind::Baseline => {}
            TopicKind::Pose => self.left(stamp).pose = Some(geometry::decode_pose(schema, data)?),
            TopicKind::Depth => self.left(stamp).depth = Some(images::decode_floats(schema, data)?),
            TopicKind::Disparity => {
                self.left(stamp).disparity = Some(images::decode_floats(schema, data)?)
            }
            TopicKind::Visibility => {
                self.left(stamp).visibility = Some(images::decode_gray(schema, data)?)
            }
            TopicKind::Sync => {
                let sync = StereoSync::decode(schema, data)?;
                // log_time and the JSON say the same; where they differ, one of them is damaged.
                if sync.left_stamp_ns != stamp {
                    return Err(format!("it is of the pair at {} ns", sync.left_stamp_ns));
                }
                self.left(stamp).sync = Some(sync);
            }
        }
        self.completed(kind, stamp)
    }

    /// Ends the recording: what still waits is unpaired.
    pub(super) fn end(&mut self) {
        self.unpaired += std::mem::take(&mut self.left)
            .values()
            .filter(|left| left.image.is_some())
            .count() as u64;
        self.unpaired += std::mem::take(&mut self.right)
            .values()
            .filter(|right| right.image.is_some())
            .count() as u64;
    }

    /// Why there was no pair.
    pub(super) fn why_none(&self) -> String {
        match (self.left_images, self.right_images) {
            (0, 0) => "has no pairs: its recording ended before the first".to_owned(),
            (n, 0) => format!(
                "has no stereo pairs: {} of the left camera, none of the right",
                counted(n, "image")
            ),
            (0, n) => format!(
                "has no stereo pairs: {} of the right camera, none of the left",
                counted(n, "image")
            ),
            (n, m) => {
                let sync = TopicKind::Sync.topic();
                format!(
                    "has no stereo pairs: no {sync} says which of its images, {n} left and {m} \
                     right, belong together"
                )
            }
        }
    }

    fn left(&mut self, stamp: u64) -> &mut LeftMessages {
        if self.left.len() >= WAITING && !self.left.contains_key(&stamp) {
            // Bounded memory: the stamp that waits longest is dropped, with everything on it.
            let oldest = self.left.pop_first();
            self.unpaired += u64::from(oldest.is_some_and(|(_, left)| left.image.is_some()));
        }
        self.left.entry(stamp).or_default()
    }

    fn right(&mut self, stamp: u64) -> &mut RightMessages {
        if self.right.len() >= WAITING && !self.right.contains_key(&stamp) {
            let oldest = self.right.pop_first();
            self.unpaired += u64::from(oldest.is_some_and(|(_, right)| right.image.is_some()));
        }
        self.right.entry(stamp).or_default()
    }

    /// The pair that the message `kind` at `stamp` completes.
    fn completed(&mut self, kind: TopicKind, stamp: u64) -> Result<Option<Frame>, String> {
        // The right image has a stamp of its own; only the sync message knows which left one it is
        // of.
        let names = |left: &LeftMessages| {
            left.sync
                .as_ref()
                .is_some_and(|sync| sync.right_stamp_ns == stamp)
        };
        let left_stamp = match kind {
            TopicKind::Image(Side::Left) | TopicKind::Sync => Some(stamp),
            TopicKind::Image(Side::Right) => self
                .left
                .iter()
                .find(|(_, left)| names(left))
                .map(|(&stamp, _)| stamp),
            _ => None,
        };
        let Some(left_stamp) = left_stamp else {
            return Ok(None);
        };
        let Some(LeftMessages {
            image: Some(_),
            sync: Some(sync),
            ..
        }) = self.left.get(&left_stamp)
        else {
            return Ok(None);
        };
        let right_stamp = sync.right_stamp_ns;
        let Some(RightMessages { image: Some(_), .. }) = self.right.get(&right_stamp) else {
            return Ok(None);
        };
        let (left, right) = (
            self.left.remove(&left_stamp),
            self.right.remove(&right_stamp),
        );
        let frame = frame(left.unwrap_or_default(), right.unwrap_or_default());
        self.pairs += u64::from(frame.is_ok());
        frame.map(Some)
    }
}

/// The frame of all messages of a pair.
fn frame(left: LeftMessages, right: RightMessages) -> Result<Frame, String> {
    let (Some(left_image), Some(right_image), Some(sync)) = (left.image, right.image, left.sync)
    else {
        return Err("an image or its /stereo/sync is missing".to_owned());
    };
    let pair = StereoPair::new(left_image, right_image).map_err(|e| e.to_string())?;
    // One calibration without the other makes no rig.
    let rig = match (left.calibration, right.calibration) {
        (Some(left), Some(right)) => Some(geometry::rig(&left, &right)?),
        _ => None,
    };
    let disparity = true_disparity(left.disparity, left.depth, rig.as_ref())?;
    let truth = disparity.map(|disparity| Truth {
        disparity,
        visibility: left.visibility.map(|v| v.map(Visibility::from_code)),
    });
    if let Some(Truth {
        disparity,
        visibility,
    }) = &truth
    {
        for size in [Some(disparity.size()), visibility.as_ref().map(Plane::size)]
            .into_iter()
            .flatten()
        {
            // The hash of a pair does not cover its truth, so a wrong size would be found only by a
            // score.
            if size != pair.size() {
                let (width, height) = pair.size();
                return Err(format!(
                    "truth is {}x{}, the images are {width}x{height}",
                    size.0, size.1
                ));
            }
        }
    }
    let StereoSync {
        sequence,
        name,
        left_stamp_ns: stamp_ns,
        geometry,
        exposure,
        ..
    } = sync;
    Ok(Frame {
        sequence,
        stamp_ns,
        name,
        pair,
        geometry: match geometry {
            PairGeometry::Raw => Geometry::Raw,
            PairGeometry::Rectified => Geometry::Rectified(rig),
        },
        pose: left.pose,
        truth,
        exposure,
    })
}

fn true_disparity(
    disparity: Option<Plane<f32>>,
    depth: Option<Plane<f32>>,
    rig: Option<&Rig>,
) -> Result<Option<Plane<f32>>, String> {
    match (disparity, depth, rig) {
        // Written where depth could not stand for the truth, so it wins over a depth.
        (Some(disparity), _, _) => Ok(Some(truth::from_file(&disparity))),
        (None, Some(depth), Some(rig)) => Ok(Some(truth::disparities(&depth, rig))),
        (None, Some(_), None) => {
            Err("its true depth lacks the calibration that makes disparities of it".to_owned())
        }
        (None, None, _) => Ok(None),
    }
}
