//! Videos as a source: one of both images side by side, or one of each camera.

mod stream;

use super::Source;
use std::path::Path;
use stream::VideoStream;
use svl_core::stereo::{Exposure, Frame, Geometry, Losses};
use svl_core::{Error, Result};
use svl_data::files::{BitDepth, DecodedImage};
use svl_data::recording::StampOrigin;

/// Extensions of videos.
const ENDINGS: &[&str] = &[
    "mp4", "m4v", "mov", "avi", "mkv", "webm", "mpg", "mpeg", "wmv", "ogv", "ts",
];

/// Rate of the stamps if none is known.
const NOMINAL_HZ: f64 = 10.0;
/// Largest relative difference of the frame rates of two cameras.
const RATE_TOLERANCE: f64 = 1e-3;

/// True if a name is that of a video.
pub(super) fn is_video(name: &str) -> bool {
    let ending = Path::new(name)
        .extension()
        .and_then(|ending| ending.to_str());
    ending.is_some_and(|ending| ENDINGS.contains(&ending.to_ascii_lowercase().as_str()))
}

/// The pairs of one or two videos, which the program `ffmpeg` decodes to 8 bits. They count as raw,
/// as a video does not declare rectification.
///
/// A video that is cut off gives the frames before; those after are counted.
pub struct VideoSource {
    /// Both cameras in one, or one each.
    streams: Vec<VideoStream>,
    stamps: Option<StampOrigin>,
    depth: BitDepth,
    /// The first pair, read when the videos were opened.
    first: Option<[DecodedImage; 2]>,
    sequence: u64,
}

impl VideoSource {
    /// Both images of each frame side by side.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Program`] where ffmpeg is missing; [`Error::Format`] for a file that
    /// is not a video, has no frame, or frames of an odd width.
    pub fn side_by_side(path: &Path, fps: Option<f64>) -> Result<Self> {
        Self::new(vec![VideoStream::open(path)?], fps)
    }

    /// A video of each camera, whose frames are pairs by their numbers.
    ///
    /// # Errors
    /// Those of [`VideoSource::side_by_side`]; [`Error::Format`] for two of other sizes or rates.
    pub fn pair(left: &Path, right: &Path, fps: Option<f64>) -> Result<Self> {
        let streams = [VideoStream::open(left)?, VideoStream::open(right)?];
        let [l, r] = [&streams[0].info, &streams[1].info];
        let unlike = |what: String| {
            let (left, right) = (left.display(), right.display());
            Err(Error::format(
                &streams[0].path,
                format!("{what} ({left}, {right})"),
            ))
        };
        if l.size != r.size {
            let ((a, b), (c, d)) = (l.size, r.size);
            return unlike(format!(
                "has frames of {a}x{b}, its partner of {c}x{d}: no pairs"
            ));
        }
        if let (Some(a), Some(b)) = (l.rate_hz, r.rate_hz)
            && (a / b - 1.0).abs() > RATE_TOLERANCE
        {
            let cure = "convert one, as `ffmpeg -i IN -r HZ OUT` does";
            return unlike(format!(
                "has {a:.3} frames a second, its partner {b:.3}: their numbers make no pairs; \
                 {cure}"
            ));
        }
        if let (Some(a), Some(b)) = (l.frames, r.frames)
            && a != b
        {
            let (left, right) = (left.display(), right.display());
            tracing::warn!("{left} has {a} frames, {right} {b}: the rest has no partner");
        }
        Self::new(streams.into(), fps)
    }

    fn new(streams: Vec<VideoStream>, fps: Option<f64>) -> Result<Self> {
        let info = &streams[0].info;
        let stamps = match (fps, info.rate_hz) {
            (Some(hz), _) => Some(StampOrigin::Given(hz)),
            (None, None) if info.stamps_ns.is_empty() => Some(StampOrigin::Nominal(NOMINAL_HZ)),
            (None, _) => None,
        };
        let mut source = Self {
            streams,
            stamps,
            depth: BitDepth::FULL,
            first: None,
            sequence: 0,
        };
        let first = source.images()?;
        if first.is_none() {
            return Err(Error::format(
                &source.streams[0].path,
                "gives no frame that can be read",
            ));
        }
        source.first = first;
        Ok(source)
    }

    /// Origin of the stamps, if not the video.
    pub fn stamps(&self) -> Option<StampOrigin> {
        self.stamps
    }

    fn images(&mut self) -> Result<Option<[DecodedImage; 2]>> {
        match &mut self.streams[..] {
            [left, right] => Ok(left.next()?.zip(right.next()?).map(Into::into)),
            streams => {
                let both = &mut streams[0];
                let Some(image) = both.next()? else {
                    return Ok(None);
                };
                let halves = image.halves();
                halves
                    .map(Some)
                    .map_err(|e| Error::format(&both.path, e.to_string()))
            }
        }
    }

    fn stamp_ns(&self, number: u64) -> u64 {
        let info = &self.streams[0].info;
        let listed = usize::try_from(number)
            .ok()
            .and_then(|i| info.stamps_ns.get(i));
        match (self.stamps, listed) {
            (Some(origin), _) => origin.stamp_ns(number),
            (None, Some(ns)) => *ns,
            (None, None) => StampOrigin::Given(info.rate_hz.unwrap_or(NOMINAL_HZ)).stamp_ns(number),
        }
    }
}

impl Source for VideoSource {
    fn name(&self) -> String {
        let names: Vec<_> = self
            .streams
            .iter()
            .map(|s| s.path.display().to_string())
            .collect();
        names.join(" and ")
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let images = match self.first.take() {
            Some(first) => Some(first),
            None => self.images()?,
        };
        let Some(images) = images else {
            return Ok(None);
        };
        let (pair, color) = self.depth.pair(images)?;
        let sequence = self.sequence;
        self.sequence += 1;
        Ok(Some(Frame {
            sequence,
            stamp_ns: self.stamp_ns(sequence),
            name: None,
            pair,
            geometry: Geometry::Raw,
            calibration: None,
            recorded: None,
            pose: None,
            truth: None,
            color,
            exposure: Exposure {
                trigger_id: sequence,
                ..Exposure::default()
            },
        }))
    }

    fn pairs(&self) -> Option<u64> {
        let frames: Option<Vec<_>> = self.streams.iter().map(|s| s.info.frames).collect();
        frames?.into_iter().min()
    }

    fn finish(&mut self, _: u64) -> Losses {
        let has_ended = self.streams.iter().any(|stream| stream.has_ended);
        // Number of frames of the longer one that the shorter one has no partner for.
        let rest = |stream: &VideoStream| {
            if has_ended && !stream.has_ended {
                stream
                    .info
                    .frames
                    .unwrap_or(stream.got)
                    .saturating_sub(self.sequence)
            } else {
                stream.got.saturating_sub(self.sequence)
            }
        };
        let read_ahead = u64::from(self.first.is_some());
        Losses {
            cut: self.streams.iter().map(VideoStream::missing).sum(),
            unpaired: self
                .streams
                .iter()
                .map(|s| rest(s).saturating_sub(read_ahead))
                .sum(),
            ..Losses::default()
        }
    }
}
