//! Assembles the frames of svl's own recordings from their messages, by the stamps in
//! `/stereo/sync`.

use super::foreign::PairStamps;
use super::geometry;
use super::messages::Channel;
use super::sync::{PairGeometry, StereoSync};
use super::{PairSource, StreamFacts, TopicKind, images, truth};
use nalgebra::Matrix3x4;
use std::collections::BTreeMap;
use svl_core::counted;
use svl_core::stereo::{
    Frame, Geometry, Gray, Plane, Pose, Rgb, Rig, Side, StereoPair, Surface, Truth, Visibility,
};

/// Limit on stamps that wait for the rest of their pair. svl's writer needs one.
const WAITING: usize = 16;

/// Assembles frames from the messages of svl's own recordings.
#[derive(Default)]
pub(super) struct PairAssembler {
    /// Messages that wait for the rest of their pair, by side and stamp.
    waiting: [BTreeMap<u64, PairMessages>; 2],
    /// Images by side.
    images: [u64; 2],
    pairs: u64,
    /// Stamps of the images without a partner.
    unpaired_ns: Vec<u64>,
}

/// Messages with one stamp. The right side has only image and calibration.
#[derive(Default)]
struct PairMessages {
    image: Option<Gray>,
    color: Option<Rgb>,
    calibration: Option<Matrix3x4<f64>>,
    pose: Option<Pose>,
    depth: Option<Plane<f32>>,
    disparity: Option<Plane<f32>>,
    visibility: Option<Gray>,
    surface: Option<Gray>,
    sync: Option<StereoSync>,
}

impl PairAssembler {
    /// The messages with a stamp. Memory is bounded: the stamp that has waited longest is dropped.
    fn at(&mut self, side: Side, stamp: u64) -> &mut PairMessages {
        let waiting = &mut self.waiting[side as usize];
        if waiting.len() >= WAITING && !waiting.contains_key(&stamp) {
            let oldest = waiting.pop_first();
            let oldest = oldest.filter(|(_, one)| one.image.is_some());
            self.unpaired_ns.extend(oldest.map(|(stamp, _)| stamp));
        }
        waiting.entry(stamp).or_default()
    }

    fn add(
        &mut self,
        kind: TopicKind,
        schema: &str,
        stamp: u64,
        data: &[u8],
    ) -> Result<(), String> {
        match kind {
            TopicKind::Image(side) => {
                // Counted before decoding, so that a file of unreadable images is not reported as
                // empty.
                self.images[side as usize] += 1;
                let image = images::decode_gray(schema, data)?;
                let replaced = self.at(side, stamp).image.replace(image);
                self.unpaired_ns.extend(replaced.map(|_| stamp));
            }
            TopicKind::Color(side) => {
                self.at(side, stamp).color = Some(images::decode_color(schema, data)?);
            }
            TopicKind::Calibration(side) => {
                self.at(side, stamp).calibration =
                    Some(geometry::decode_calibration(schema, data)?);
            }
            // The calibration contains it too; this message is for viewers.
            TopicKind::Baseline => {}
            TopicKind::Pose => {
                self.at(Side::Left, stamp).pose = Some(geometry::decode_pose(schema, data)?);
            }
            TopicKind::Depth => {
                self.at(Side::Left, stamp).depth = Some(images::decode_floats(schema, data)?);
            }
            TopicKind::Disparity => {
                self.at(Side::Left, stamp).disparity = Some(images::decode_floats(schema, data)?);
            }
            TopicKind::Visibility => {
                self.at(Side::Left, stamp).visibility = Some(images::decode_gray(schema, data)?);
            }
            TopicKind::Surface => {
                self.at(Side::Left, stamp).surface = Some(images::decode_gray(schema, data)?);
            }
            TopicKind::Sync => {
                let sync = StereoSync::decode(schema, data)?;
                // log_time and the JSON are redundant; if they differ, one of them is corrupt.
                if sync.left_stamp_ns != stamp {
                    return Err(format!("it is of the pair at {} ns", sync.left_stamp_ns));
                }
                self.at(Side::Left, stamp).sync = Some(sync);
            }
        }
        Ok(())
    }

    /// The pair that the message `kind` at `stamp` completes.
    fn completed(&mut self, kind: TopicKind, stamp: u64) -> Result<Option<Frame>, String> {
        let [lefts, rights] = &mut self.waiting;
        // The right image has a stamp of its own; only the sync message names the left stamp that
        // it belongs to.
        let names = |left: &PairMessages| {
            let sync = left.sync.as_ref();
            sync.is_some_and(|sync| sync.right_stamp_ns == stamp)
        };
        let left_stamp = match kind {
            TopicKind::Image(Side::Left) | TopicKind::Sync => Some(stamp),
            TopicKind::Image(Side::Right) => {
                let mut lefts = lefts.iter();
                lefts.find(|(_, left)| names(left)).map(|(&stamp, _)| stamp)
            }
            _ => None,
        };
        let left = left_stamp.and_then(|stamp| lefts.get(&stamp));
        let Some(PairMessages {
            image: Some(_),
            sync: Some(sync),
            ..
        }) = left
        else {
            return Ok(None);
        };
        let (left_stamp, right_stamp) = (sync.left_stamp_ns, sync.right_stamp_ns);
        if rights
            .get(&right_stamp)
            .is_none_or(|right| right.image.is_none())
        {
            return Ok(None);
        }
        let (left, right) = (lefts.remove(&left_stamp), rights.remove(&right_stamp));
        let frame = frame(left.unwrap_or_default(), right.unwrap_or_default());
        self.pairs += u64::from(frame.is_ok());
        frame.map(Some)
    }

    /// The reason why there was no pair.
    fn why_none(&self) -> String {
        let images = |n: u64| counted(n, "image");
        match self.images {
            [0, 0] => "has no pairs: its recording ended before the first".to_owned(),
            [n, 0] => format!(
                "has no stereo pairs: {} of the left camera, none of the right",
                images(n)
            ),
            [0, n] => format!(
                "has no stereo pairs: {} of the right camera, none of the left",
                images(n)
            ),
            [n, m] => format!(
                "has no stereo pairs: no {} says which of its images, {n} left and {m} right, \
                 belong together",
                TopicKind::Sync.topic()
            ),
        }
    }
}

impl PairSource for PairAssembler {
    fn take_in(
        &mut self,
        channel: &Channel,
        log_time: u64,
        data: &[u8],
    ) -> Result<Option<Frame>, String> {
        let Some(kind) = TopicKind::from_topic(&channel.topic) else {
            return Ok(None);
        };
        self.add(kind, &channel.schema, log_time, data)?;
        self.completed(kind, log_time)
    }

    fn end(&mut self) {
        let waiting = std::mem::take(&mut self.waiting);
        let left_over = waiting.into_iter().flatten();
        let left_over = left_over.filter(|(_, one)| one.image.is_some());
        self.unpaired_ns.extend(left_over.map(|(stamp, _)| stamp));
    }

    fn stamps(&self) -> PairStamps {
        PairStamps::Synced
    }

    fn facts(&self) -> StreamFacts {
        StreamFacts {
            topics: Side::BOTH.map(|side| TopicKind::Image(side).topic().to_owned()),
            pairs: self.pairs,
            unpaired_ns: self.unpaired_ns.clone(),
            why_none: self.why_none(),
            ..StreamFacts::default()
        }
    }
}

/// The frame made of all messages of a pair.
fn frame(left: PairMessages, right: PairMessages) -> Result<Frame, String> {
    let (Some(left_image), Some(right_image), Some(sync)) = (left.image, right.image, left.sync)
    else {
        return Err("an image or its /stereo/sync is missing".to_owned());
    };
    let pair = StereoPair::new(left_image, right_image).map_err(|e| e.to_string())?;
    // One calibration without the other does not make a rig.
    let rig = match (left.calibration, right.calibration) {
        (Some(left), Some(right)) => Some(geometry::rig(&left, &right)?),
        _ => None,
    };
    let disparity = true_disparity(left.disparity, left.depth, rig.as_ref())?;
    let truth = disparity.map(|disparity| Truth {
        disparity,
        visibility: left.visibility.map(|v| v.map(Visibility::from_code)),
        surface: left.surface.map(|s| s.map(Surface::from_code)),
        kind: sync.truth.clone(),
    });
    if let Some(Truth {
        disparity,
        visibility,
        surface,
        kind: _,
    }) = &truth
    {
        let sizes = [
            Some(disparity.size()),
            visibility.as_ref().map(Plane::size),
            surface.as_ref().map(Plane::size),
        ];
        for size in sizes.into_iter().flatten() {
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
    let color = left.color.zip(right.color).map(<[Rgb; 2]>::from);
    if color
        .iter()
        .flatten()
        .any(|color| color.size() != pair.size())
    {
        return Err("its colour images differ in size from its grey ones".to_owned());
    }
    let StereoSync {
        sequence,
        name,
        left_stamp_ns: stamp_ns,
        geometry,
        exposure,
        ..
    } = sync;
    let geometry = match geometry {
        PairGeometry::Raw => Geometry::Raw,
        PairGeometry::Rectified => Geometry::Rectified(rig),
    };
    Ok(Frame {
        sequence,
        stamp_ns,
        name,
        pose: left.pose,
        truth,
        color,
        exposure,
        ..Frame::new(pair, geometry)
    })
}

fn true_disparity(
    disparity: Option<Plane<f32>>,
    depth: Option<Plane<f32>>,
    rig: Option<&Rig>,
) -> Result<Option<Plane<f32>>, String> {
    match (disparity, depth, rig) {
        // Written if depth could not represent the truth, so it takes precedence over a depth.
        (Some(disparity), _, _) => Ok(Some(truth::from_file(&disparity))),
        (None, Some(depth), Some(rig)) => Ok(Some(truth::disparities(&depth, rig))),
        (None, Some(_), None) => {
            Err("its true depth has no calibration, which is needed for disparities".to_owned())
        }
        (None, None, _) => Ok(None),
    }
}
