//! One video of a source: its frames with their stamps.

use super::stream::VideoStream;
use std::collections::VecDeque;
use svl_core::Result;
use svl_files::DecodedImage;
use svl_recording::StampOrigin;

/// Origin of the stamps of a video.
#[derive(Clone, Copy)]
pub(crate) enum FrameClock {
    /// The times of its frames, from this one on, nanoseconds.
    Times { origin_ns: i64, period_ns: u64 },
    /// The numbers of its frames, as they are decoded.
    Numbers(StampOrigin),
}

impl FrameClock {
    pub(crate) fn new(videos: &[VideoStream], fps: Option<f64>) -> Self {
        let firsts: Option<Vec<i64>> = videos.iter().map(|video| video.first_ns).collect();
        let periods = videos.iter().filter_map(|video| video.info.period_ns);
        let rate = videos.iter().find_map(|video| video.info.rate_hz);
        let nominal = rate.map_or(StampOrigin::UNKNOWN, StampOrigin::Nominal);
        match (fps, firsts.and_then(|firsts| firsts.into_iter().min())) {
            (Some(hz), _) => Self::Numbers(StampOrigin::Given(hz)),
            (None, Some(origin_ns)) => Self::Times {
                origin_ns,
                period_ns: periods.min().unwrap_or(nominal.stamp_ns(1)),
            },
            (None, None) => Self::Numbers(nominal),
        }
    }

    /// Time from a frame to the next.
    pub(crate) fn period_ns(self) -> u64 {
        match self {
            Self::Times { period_ns, .. } => period_ns,
            Self::Numbers(origin) => origin.stamp_ns(1),
        }
    }

    /// Origin of the stamps, if they count frames.
    pub(crate) fn numbers(self) -> Option<StampOrigin> {
        match self {
            Self::Times { .. } => None,
            Self::Numbers(origin) => Some(origin),
        }
    }
}

/// A video, and those of its frames that wait for a partner.
pub(crate) struct StampedVideo {
    pub video: VideoStream,
    clock: FrameClock,
    /// Added to the stamps.
    shift_ns: u64,
    /// The next frames, with their stamps.
    waiting: VecDeque<(u64, DecodedImage)>,
    /// Number of frames read.
    read: u64,
    last_ns: Option<u64>,
    /// Number of frames taken.
    pub taken: u64,
    is_disordered: bool,
}

impl StampedVideo {
    pub(crate) fn new(video: VideoStream, clock: FrameClock, shift_ns: u64) -> Self {
        Self {
            video,
            clock,
            shift_ns,
            waiting: VecDeque::new(),
            read: 0,
            last_ns: None,
            taken: 0,
            is_disordered: false,
        }
    }

    /// Reads until this many frames wait, or to the end.
    ///
    /// # Errors
    /// The errors of [`VideoStream::next`].
    pub(crate) fn fill(&mut self, frames: usize) -> Result<()> {
        while self.waiting.len() < frames {
            let Some((time_ns, image)) = self.video.next()? else {
                break;
            };
            let stamp_ns = self.stamp_ns(time_ns);
            self.read += 1;
            self.last_ns = Some(stamp_ns);
            let stamp_ns = stamp_ns.saturating_add(self.shift_ns);
            self.waiting.push_back((stamp_ns, image));
        }
        Ok(())
    }

    /// The stamp of the next frame. One without a time, or before an earlier one, is a period later
    /// than the last.
    fn stamp_ns(&mut self, time_ns: Option<i64>) -> u64 {
        let (origin_ns, period_ns) = match self.clock {
            FrameClock::Numbers(origin) => return origin.stamp_ns(self.read),
            FrameClock::Times {
                origin_ns,
                period_ns,
            } => (origin_ns, period_ns),
        };
        let own = time_ns.map(|ns| u64::try_from(ns.saturating_sub(origin_ns)).unwrap_or(0));
        let next = self.last_ns.map(|last| last.saturating_add(period_ns));
        let is_later = own > self.last_ns;
        if own.is_some() && !is_later && !self.is_disordered {
            self.is_disordered = true;
            tracing::warn!(
                "{}: frame {} has a time that is not after the last: it and all such count on; \
                 --fps HZ counts all frames",
                self.video.path.display(),
                self.read + 1
            );
        }
        own.filter(|_| is_later).or(next).unwrap_or(0)
    }

    /// Stamp of the waiting frame at this position.
    pub(crate) fn waiting_ns(&self, position: usize) -> Option<u64> {
        self.waiting.get(position).map(|(stamp, _)| *stamp)
    }

    /// Takes the next frame.
    pub(crate) fn take(&mut self) -> Option<(u64, DecodedImage)> {
        let frame = self.waiting.pop_front()?;
        self.taken += 1;
        Some(frame)
    }

    /// True if there are no more frames.
    pub(crate) fn is_over(&self) -> bool {
        self.video.has_ended && self.waiting.is_empty()
    }

    /// Number of frames not taken yet, by the header of a video that has not ended.
    pub(crate) fn rest(&self) -> u64 {
        let decoded = self.video.got;
        let declared = self.video.info.frames.filter(|_| !self.video.has_ended);
        let all = declared.unwrap_or(decoded).max(decoded);
        all.saturating_sub(self.taken)
    }
}
