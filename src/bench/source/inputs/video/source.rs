//! Videos as a source: one of both images side by side, or one of each camera.

use super::offset;
use super::stamped::{FrameClock, StampedVideo};
use super::stream::VideoStream;
use crate::source::frames::Source;
use std::path::Path;
use svl_core::doubt::{PairCure, Subject};
use svl_core::stereo::{Exposure, Frame, Geometry};
use svl_core::{Error, Result};
use svl_files::pairing::{Nearest, WaitingStamps};
use svl_files::{BitDepth, DecodedImage, SideBySide};
use svl_recording::{StampOrigin, StreamFacts};
use svl_score::losses::Losses;

/// Extensions of videos.
const ENDINGS: &[&str] = &[
    "mp4", "m4v", "mov", "avi", "mkv", "webm", "mpg", "mpeg", "wmv", "ogv", "ts",
];

/// Largest relative difference of the frame rates of two cameras, and of their median periods,
/// which files round to milliseconds.
const RATE_TOLERANCE: f64 = 1e-3;
const PERIOD_TOLERANCE: f64 = 0.02;

/// True if a name is that of a video.
pub(crate) fn is_video(name: &str) -> bool {
    let ending = Path::new(name)
        .extension()
        .and_then(|ending| ending.to_str());
    ending.is_some_and(|ending| ENDINGS.contains(&ending.to_ascii_lowercase().as_str()))
}

/// The pairs of one or two videos, which the program `ffmpeg` decodes to 8 bits. They count as raw,
/// as a video does not declare rectification.
///
/// Stamps are the times of the frames in the file, or count them. Two videos are paired by the
/// nearest stamps. Frames that a damaged or truncated video lacks are counted.
pub struct VideoSource {
    /// Both cameras in one, or one each.
    cameras: Vec<StampedVideo>,
    /// The places of both in one.
    places: SideBySide,
    /// Origin of the stamps, if they count frames.
    numbers: Option<StampOrigin>,
    depth: BitDepth,
    /// The first pair, read when the videos were opened.
    first: Option<Pair>,
    /// Largest difference of the stamps of a pair.
    max_skew_ns: u64,
    sequence: u64,
    unpaired: u64,
    outside: u64,
}

struct Pair {
    images: [DecodedImage; 2],
    stamp_ns: u64,
    skew_ns: Option<i64>,
}

impl VideoSource {
    /// Both images of each frame side by side.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Program`] where ffmpeg is missing; [`Error::Format`] for a file that
    /// is not a video, has no frame, or frames of an odd width.
    pub fn side_by_side(path: &Path, places: SideBySide, fps: Option<f64>) -> Result<Self> {
        Self::new(vec![VideoStream::open(path)?], places, fps, None)
    }

    /// A video of each camera; `right_offset_ns` is added to the stamps of the right one. Without
    /// it the user is warned of another that fits the pixels better.
    ///
    /// # Errors
    /// The errors of [`VideoSource::side_by_side`]; [`Error::Format`] for two of other sizes, rates
    /// or times.
    pub fn pair(
        left: &Path,
        right: &Path,
        fps: Option<f64>,
        right_offset_ns: Option<i64>,
    ) -> Result<Self> {
        let videos = vec![VideoStream::open(left)?, VideoStream::open(right)?];
        Self::new(videos, SideBySide::LeftRight, fps, right_offset_ns)
    }

    fn new(
        videos: Vec<VideoStream>,
        places: SideBySide,
        fps: Option<f64>,
        right_offset_ns: Option<i64>,
    ) -> Result<Self> {
        let clock = FrameClock::new(&videos, fps);
        let numbers = clock.numbers();
        let max_skew_ns = clock.period_ns() / 2;
        if let [left, right] = &videos[..] {
            check_partners([left, right], numbers.is_none())?;
            if right_offset_ns.is_none() {
                check_times([left, right], clock)?;
                warn_of_offset([left, right], clock);
            }
        }
        // The stamps of one are later, as none is below 0.
        let offset_ns = right_offset_ns.unwrap_or_default();
        let shifts_ns = [offset_ns.saturating_neg(), offset_ns].map(|ns| ns.max(0) as u64);
        let cameras = videos.into_iter().zip(shifts_ns);
        let cameras = cameras.map(|(video, ns)| StampedVideo::new(video, clock, ns));
        let mut source = Self {
            cameras: cameras.collect(),
            places,
            numbers,
            depth: BitDepth::FULL,
            first: None,
            max_skew_ns,
            sequence: 0,
            unpaired: 0,
            outside: 0,
        };
        source.first = source.images()?;
        if let ([left, right], None) = (&source.cameras[..], &source.first) {
            return Err(apart(&left.video, &right.video));
        }
        Ok(source)
    }

    /// Origin of the stamps, if not the video.
    pub fn stamps(&self) -> Option<StampOrigin> {
        self.numbers
    }

    /// Facts of the images. `places`: those of the halves, if the user named them.
    pub fn facts(&self, places: Option<SideBySide>) -> StreamFacts {
        let info = &self.cameras[0].video.info;
        let half = places.map_or(info.size, |places| places.part(info.size));
        let mut facts = StreamFacts::from_images(&self.depth, places, half);
        let both = info.places.zip(places).filter(|both| both.0 != both.1);
        facts.doubts.extend(both.map(|(stated, named)| {
            let [stated, named] = [stated, named].map(|places| places.to_string());
            PairCure::Places { stated, named }.doubt(Subject::Pairs, "layouts", 2.0, [1.0; 2])
        }));
        facts
    }

    fn images(&mut self) -> Result<Option<Pair>> {
        if self.cameras.len() == 2 {
            return self.partners();
        }
        let both = &mut self.cameras[0];
        both.fill(1)?;
        let Some((stamp_ns, image)) = both.take() else {
            return Ok(None);
        };
        let images = image
            .halves(self.places)
            .map_err(|e| Error::format(&both.video.path, e.to_string()))?;
        Ok(Some(Pair {
            images,
            stamp_ns,
            skew_ns: None,
        }))
    }

    /// The next two frames each of which is the nearest to the other.
    fn partners(&mut self) -> Result<Option<Pair>> {
        loop {
            for camera in &mut self.cameras {
                camera.fill(2)?;
            }
            let [left, right] = [0, 1].map(|camera| self.cameras[camera].waiting_ns(0));
            let (Some(left_ns), Some(right_ns)) = (left, right) else {
                return Ok(None);
            };
            let early = usize::from(right_ns < left_ns);
            let waiting = WaitingStamps {
                earliest_ns: left_ns.min(right_ns),
                next_ns: self.cameras[early].waiting_ns(1),
                other_ns: left_ns.max(right_ns),
            };
            match waiting.nearest(self.max_skew_ns, 0) {
                Nearest::TooFar | Nearest::Overtaken => {
                    self.cameras[early].take();
                    if self.cameras[1 - early].taken == 0 {
                        self.outside += 1;
                    } else {
                        self.unpaired += 1;
                    }
                }
                Nearest::Pair | Nearest::Unknown => {
                    let [left, right] = [0, 1].map(|camera| self.cameras[camera].take());
                    let skew_ns = right_ns as i64 - left_ns as i64;
                    return Ok(left.zip(right).map(|((_, left), (_, right))| Pair {
                        images: [left, right],
                        stamp_ns: left_ns,
                        skew_ns: self.numbers.is_none().then_some(skew_ns),
                    }));
                }
            }
        }
    }
}

/// Fails for two videos that make no pairs, and warns of what the user may not expect.
fn check_partners(videos: [&VideoStream; 2], by_time: bool) -> Result<()> {
    let [left, right] = videos.map(|video| video.path.display());
    let [l, r] = videos.map(|video| &video.info);
    let unlike = |what: String| {
        let reason = format!("{what} ({left}, {right})");
        Err(Error::format(&videos[0].path, reason))
    };
    if l.size != r.size {
        let ((a, b), (c, d)) = (l.size, r.size);
        return unlike(format!(
            "has frames of {a}x{b}, its partner of {c}x{d}: no pairs"
        ));
    }
    let differ = |a: f64, b: f64, tolerance: f64| (a / b - 1.0).abs() > tolerance;
    let periods = l.period_ns.zip(r.period_ns).filter(|_| by_time);
    if let (Some(a), Some(b)) = (l.rate_hz, r.rate_hz)
        && differ(a, b, RATE_TOLERANCE)
        && periods.is_none_or(|(a, b)| differ(a as f64, b as f64, PERIOD_TOLERANCE))
    {
        let cure = "convert one, as `ffmpeg -i IN -r HZ OUT` does";
        return unlike(format!(
            "has {a:.3} frames a second, its partner {b:.3}: no pairs; {cure}"
        ));
    }
    if let (false, Some(a), Some(b)) = (by_time, l.frames, r.frames)
        && a != b
    {
        tracing::warn!("{left} has {a} frames, {right} {b}: the rest has no partner");
    }
    Ok(())
}

/// Fails for two videos without a common time, and warns of one that starts later.
fn check_times(mut videos: [&VideoStream; 2], clock: FrameClock) -> Result<()> {
    videos.sort_by_key(|video| video.first_ns);
    let [early, late] = videos;
    let (None, Some(first), Some(start)) = (clock.numbers(), early.first_ns, late.first_ns) else {
        return Ok(());
    };
    let after = |end: i64| start.saturating_sub(end) > clock.period_ns() as i64 / 2;
    if early.info.last_ns.is_some_and(after) {
        return Err(apart(early, late));
    }
    if after(first) {
        tracing::warn!(
            "{}: its first frame is {:.3} s later than that of {}: their times make the pairs; \
             --fps HZ pairs by number",
            late.path.display(),
            start.saturating_sub(first) as f64 / 1e9,
            early.path.display()
        );
    }
    Ok(())
}

/// Warns of two videos whose pixels fit at another time: they were started by hand.
fn warn_of_offset([left, right]: [&VideoStream; 2], clock: FrameClock) {
    // Errors are reported with the pairs.
    if let Ok(Some((late, correlation, unmoved))) = offset::late([left, right], clock) {
        tracing::warn!(
            "{} changes as {} does with `--right-offset-ms {:.1}` (correlation of the changes \
             {correlation:.2}, and {unmoved:.2} without), which pairs images of one moment; 0 \
             leaves the times",
            right.path.display(),
            left.path.display(),
            -late as f64 * clock.period_ns() as f64 / 1e6
        );
    }
}

/// The error of two videos with no pair.
fn apart(video: &VideoStream, other: &VideoStream) -> Error {
    let reason = format!(
        "has no frame at the time of one of {}: no pairs; --fps HZ pairs by number",
        other.path.display()
    );
    Error::format(&video.path, reason)
}

impl Source for VideoSource {
    fn name(&self) -> String {
        let names: Vec<_> = self
            .cameras
            .iter()
            .map(|camera| camera.video.path.display().to_string())
            .collect();
        names.join(" and ")
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        let pair = match self.first.take() {
            Some(first) => Some(first),
            None => self.images()?,
        };
        let Some(Pair {
            images,
            stamp_ns,
            skew_ns,
        }) = pair
        else {
            return Ok(None);
        };
        let (pair, color) = self.depth.pair(images)?;
        let sequence = self.sequence;
        self.sequence += 1;
        Ok(Some(Frame {
            sequence,
            stamp_ns,
            color,
            exposure: Exposure {
                trigger_id: sequence,
                skew_ns,
                ..Exposure::default()
            },
            ..Frame::new(pair, Geometry::Raw)
        }))
    }

    fn pairs(&self) -> Option<u64> {
        let frames: Option<Vec<_>> = self.cameras.iter().map(|c| c.video.info.frames).collect();
        frames?.into_iter().min()
    }

    fn finish(&mut self, _: u64) -> Losses {
        let lost = self.cameras.iter().map(|c| c.video.missing()).sum();
        if self.numbers.is_some() && lost > 0 {
            let name = self.name();
            tracing::warn!(
                "{name}: frames are counted without the {lost} lost: if those were not the last, \
                 stamps and pairs behind them are wrong"
            );
        }
        let rest = if self.cameras.iter().any(StampedVideo::is_over) {
            self.cameras.iter().map(StampedVideo::rest).sum()
        } else {
            0
        };
        // Numbers do not tell which of the two started or stopped later.
        let (outside, unpaired) = match self.numbers {
            None => (rest, 0),
            Some(_) => (0, rest),
        };
        Losses {
            cut: lost,
            unpaired: self.unpaired + unpaired,
            outside: self.outside + outside,
            ..Losses::default()
        }
    }
}
