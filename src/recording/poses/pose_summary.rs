//! What the poses of a recording are worth to its pairs, as `svl info` shows it.

use super::motion::{self, PoseStep};
use super::reader::{PoseReader, PosesOfFrame};
use crate::bags::opened::Recording;
use crate::stream::channel::Channel;
use std::collections::BTreeMap;
use svl_core::Result;

/// The poses of a recording, and the images that have one.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PoseSummary {
    /// Poses of each frame, by topic.
    pub frames: Vec<FramePoses>,
    /// The left images, and those among them with a pose of their camera.
    pub images: u64,
    pub placed: u64,
    /// The reason why images have none.
    pub unusable: Option<String>,
    /// Messages that cannot be used, by topic, with the first reason.
    pub faulty: BTreeMap<String, (u64, String)>,
}

/// The poses of one frame in its parent.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FramePoses {
    pub topic: String,
    pub frame: String,
    pub parent: String,
    pub poses: u64,
    /// Poses per second; `None` for fewer than two.
    pub rate_hz: Option<f64>,
    /// The largest motion between two poses that are 10 ms or more apart.
    pub largest: Option<PoseStep>,
    /// Motions that no robot makes: no truth is moved across them.
    pub jumps: u64,
}

/// Summarizes the poses of another program's recording for its left images, of that frame and at
/// these stamps; `None` if it has no poses.
///
/// # Errors
/// [`svl_core::Error::Io`], [`svl_core::Error::Format`].
pub(crate) fn pose_summary(
    recording: &Recording,
    channels: &[&Channel],
    frame: &str,
    stamps: impl Iterator<Item = u64>,
) -> Result<Option<PoseSummary>> {
    let Some(mut reader) = PoseReader::open(recording, channels)? else {
        return Ok(None);
    };
    reader.read_all();
    let (mut images, mut placed, mut range_ns) = (0, 0, [u64::MAX, 0]);
    for stamp_ns in stamps {
        images += 1;
        placed += u64::from(reader.at(frame, stamp_ns).is_some());
        range_ns = [range_ns[0].min(stamp_ns), range_ns[1].max(stamp_ns)];
    }
    let unusable = (placed < images).then(|| {
        if frame.is_empty() {
            return "the left images name no frame".to_owned();
        }
        match reader.chain_of(frame) {
            moving if moving.is_empty() => {
                format!("no transform leads from '{frame}', the left camera, to a frame that moves")
            }
            moving => moving
                .iter()
                .find_map(|poses| poses.apart_from(range_ns))
                .unwrap_or_else(|| {
                    let without = images - placed;
                    format!(
                        "{without} of {images} left images have no two poses around them that \
                             are at most 0.5 s apart"
                    )
                }),
        }
    });
    let frames = reader.frames().map(PosesOfFrame::summary).collect();
    Ok(Some(PoseSummary {
        frames,
        images,
        placed,
        unusable,
        faulty: reader.faulty.clone(),
    }))
}

impl PosesOfFrame<'_> {
    fn summary(self) -> FramePoses {
        let poses = self.poses();
        let steps = motion::steps(poses.iter().copied());
        let seconds = match poses {
            [(first, _), .., (last, _)] => (last - first) as f64 / 1e9,
            _ => 0.0,
        };
        let is_jump =
            |step: &&PoseStep| motion::jump(&steps, [step.start_ns, step.end_ns]).is_some();
        let largest = steps.iter().max_by(|a, b| a.metres.total_cmp(&b.metres));
        FramePoses {
            topic: self.topic().to_owned(),
            frame: self.frame.to_owned(),
            parent: self.parent().to_owned(),
            poses: poses.len() as u64,
            rate_hz: (seconds > 0.0).then(|| (poses.len() - 1) as f64 / seconds),
            largest: largest.copied(),
            jumps: steps.iter().filter(is_jump).count() as u64,
        }
    }

    /// In words, if all its poses are before or after that time.
    fn apart_from(&self, [from_ns, to_ns]: [u64; 2]) -> Option<String> {
        let poses = self.poses();
        let (first, last) = (poses.first()?.0, poses.last()?.0);
        let s = |ns: u64| format!("{:.3} s", ns as f64 / 1e9);
        (first > to_ns || last < from_ns).then(|| {
            format!(
                "{}: the poses of '{}' are from {} to {}, and the images from {} to {}",
                self.topic(),
                self.frame,
                s(first),
                s(last),
                s(from_ns),
                s(to_ns)
            )
        })
    }
}
