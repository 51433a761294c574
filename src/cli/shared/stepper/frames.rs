//! Frames of a source by their index, whatever the source: some are kept, others read again, those
//! of cameras taken as they come.

use parking_lot::{Condvar, Mutex};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::sync::Arc;
use std::thread::JoinHandle;
use svl::Error;
use svl::source::Source;
use svl::stereo::Frame;

/// Largest memory of the frames that are kept, bytes.
const MAX_KEPT_BYTES: usize = 256 << 20;

/// Opens a source from its beginning.
pub(crate) type Open<'a> = Box<dyn Fn() -> anyhow::Result<Box<dyn Source>> + 'a>;

/// Returns the source that is open already the first time, and then what `again` opens.
pub(crate) fn open_again<'a>(
    first: Box<dyn Source>,
    again: impl Fn() -> anyhow::Result<Box<dyn Source>> + 'a,
) -> Open<'a> {
    let first = RefCell::new(Some(first));
    Box::new(move || first.take().map_or_else(&again, Ok))
}

/// The frames of a source, by their index from 0. Of cameras the newest is taken, and those before
/// it are there as long as they are kept.
pub(crate) struct FrameStore<'a> {
    reads: Reads<'a>,
    /// Index of the source's next frame; `None` after an error.
    next: Option<u64>,
    /// Number of frames, where that is known.
    pub(super) count: Option<u64>,
    /// The frames read last, the newest behind.
    kept: VecDeque<(u64, Arc<Frame>)>,
    kept_bytes: usize,
    limit_bytes: usize,
    /// Error after which a damaged source has no more frames, until it is reported.
    pub(super) damage: Option<String>,
}

/// Source of the frames.
enum Reads<'a> {
    Recorded {
        open: Open<'a>,
        source: Box<dyn Source>,
    },
    Live(LiveFrames),
}

/// Cameras, read by a thread of its own so that they are never waited for.
struct LiveFrames {
    shared: Arc<(Mutex<Newest>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

/// The frame that came last.
#[derive(Default)]
struct Newest {
    frame: Option<Frame>,
    /// Reason why no more frames come.
    ended: Option<String>,
    /// True if no more are wanted.
    stopped: bool,
}

impl LiveFrames {
    fn begin(mut source: Box<dyn Source>) -> Self {
        let shared = Arc::new((Mutex::new(Newest::default()), Condvar::new()));
        let thread_shared = Arc::clone(&shared);
        let thread = std::thread::spawn(move || {
            let (newest, came) = &*thread_shared;
            loop {
                let next = source.next();
                let mut newest = newest.lock();
                match next {
                    Ok(Some(frame)) => newest.frame = Some(frame),
                    Ok(None) => newest.ended = Some("the cameras have stopped".to_owned()),
                    Err(error) => newest.ended = Some(error.to_string()),
                }
                came.notify_all();
                if newest.stopped || newest.ended.is_some() {
                    break;
                }
            }
        });
        Self {
            shared,
            thread: Some(thread),
        }
    }

    /// The newest frame, if there is one since the last; `wait`: until there is one, or an end.
    fn take(&self, wait: bool) -> (Option<Frame>, Option<String>) {
        let mut newest = self.shared.0.lock();
        let is_awaited = |newest: &mut Newest| newest.frame.is_none() && newest.ended.is_none();
        if wait {
            self.shared.1.wait_while(&mut newest, is_awaited);
        }
        (newest.frame.take(), newest.ended.take())
    }
}

impl Drop for LiveFrames {
    fn drop(&mut self) {
        self.shared.0.lock().stopped = true;
        if let Some(thread) = self.thread.take() {
            // It ends with the next frame, or when the cameras are silent.
            let _ = thread.join();
        }
    }
}

impl<'a> FrameStore<'a> {
    pub(crate) fn new(open: Open<'a>) -> anyhow::Result<Self> {
        let source = open()?;
        let count = source.pairs();
        Ok(Self::from_reads(Reads::Recorded { open, source }, count))
    }

    /// Cameras.
    pub(crate) fn live(source: Box<dyn Source>) -> Self {
        Self::from_reads(Reads::Live(LiveFrames::begin(source)), None)
    }

    fn from_reads(reads: Reads<'a>, count: Option<u64>) -> Self {
        Self {
            count,
            reads,
            next: Some(0),
            kept: VecDeque::new(),
            kept_bytes: 0,
            limit_bytes: MAX_KEPT_BYTES,
            damage: None,
        }
    }

    /// True if frames come as time goes on.
    pub(crate) fn is_live(&self) -> bool {
        matches!(self.reads, Reads::Live(_))
    }

    /// [`Source::start_ns`] of the frames' source.
    pub(crate) fn start_ns(&self) -> Option<u64> {
        match &self.reads {
            Reads::Recorded { source, .. } => source.start_ns(),
            Reads::Live(_) => None,
        }
    }

    /// The frame at `index`, or the last one where there are fewer; none for an empty source.
    ///
    /// # Errors
    /// The errors of the source, for a frame that cannot be read. Others still can.
    pub(crate) fn at_most(&mut self, index: u64) -> anyhow::Result<Option<(u64, Arc<Frame>)>> {
        if let Reads::Live(live) = &self.reads {
            let newest = self.kept.back().map(|(newest, _)| *newest);
            // Going back needs nothing new.
            if newest.is_none_or(|newest| index > newest) {
                let (frame, ended) = live.take(newest.is_none());
                self.damage = ended.or(self.damage.take());
                if let (Some(frame), Some(next)) = (frame, self.next) {
                    self.keep(next, frame);
                    self.next = Some(next + 1);
                }
            }
            let mut kept = self.kept.iter().rev();
            let found = kept.find(|(kept, _)| *kept <= index).or(self.kept.front());
            return Ok(found.map(|(index, frame)| (*index, Arc::clone(frame))));
        }
        let mut sought = Some(index);
        while let Some(index) = sought {
            if let Some(frame) = self.at(index)? {
                return Ok(Some((index, frame)));
            }
            // Now it is known how many there are, at most.
            sought = self.count.and_then(|count| count.checked_sub(1));
        }
        Ok(None)
    }

    /// The frame whose sequence number is `sequence`, or else the next one.
    ///
    /// # Errors
    /// The errors of [`FrameStore::at_most`].
    pub(crate) fn numbered(&mut self, sequence: u64) -> anyhow::Result<Option<(u64, Arc<Frame>)>> {
        // Numbers grow at least as fast as indices do.
        let mut found = self.at_most(sequence)?;
        while let Some((index, frame)) = &found
            && frame.sequence > sequence
            && *index > 0
        {
            match self.at(index - 1)? {
                Some(before) if before.sequence >= sequence => found = Some((index - 1, before)),
                _ => break,
            }
        }
        Ok(found)
    }

    fn at(&mut self, index: u64) -> anyhow::Result<Option<Arc<Frame>>> {
        if let Some((_, frame)) = self.kept.iter().find(|(kept, _)| *kept == index) {
            return Ok(Some(Arc::clone(frame)));
        }
        if self.count.is_some_and(|count| index >= count) {
            return Ok(None);
        }
        self.go_to(index)?;
        while let Some(next) = self.next.filter(|next| *next <= index) {
            // Unknown until it is read.
            self.next = None;
            let Reads::Recorded { source, .. } = &mut self.reads else {
                return Ok(None);
            };
            match source.next() {
                Ok(Some(frame)) => self.keep(next, frame),
                Ok(None) => {
                    self.count = Some(next);
                    return Ok(None);
                }
                Err(error @ Error::Damaged { .. }) => {
                    (self.count, self.damage) = (Some(next), Some(error.to_string()));
                    return Ok(None);
                }
                Err(error) if next == index => return Err(error.into()),
                // A frame on the way that cannot be read: it counts, and is passed over.
                Err(_) => {}
            }
            self.next = Some(next + 1);
        }
        Ok(self.kept.back().map(|(_, frame)| Arc::clone(frame)))
    }

    /// Makes the source give the frame at `index`, or one before it, next.
    fn go_to(&mut self, index: u64) -> anyhow::Result<()> {
        if self.next == Some(index) {
            return Ok(());
        }
        let Reads::Recorded { open, source } = &mut self.reads else {
            return Ok(());
        };
        // Behind the end a source has no frame, and would not say where the end is.
        let sought = match self.count {
            Some(_) => source.seek(index),
            None => Ok(false),
        };
        match sought {
            Ok(true) => self.next = Some(index),
            Ok(false) if self.next.is_some_and(|next| next < index) => {}
            // Also where seeking failed: reading on from the beginning finds it, or says why not.
            Ok(false) | Err(_) => {
                self.next = None;
                *source = open()?;
                self.next = Some(0);
            }
        }
        Ok(())
    }

    fn keep(&mut self, index: u64, frame: Frame) {
        self.kept_bytes += frame.memory_bytes();
        self.kept.push_back((index, Arc::new(frame)));
        while self.kept_bytes > self.limit_bytes
            && self.kept.len() > 1
            && let Some((_, oldest)) = self.kept.pop_front()
        {
            self.kept_bytes -= oldest.memory_bytes();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;
    use svl::stereo::{Geometry, Gray, StereoPair};

    /// Frames 0, 2, 4 ... of 10x10 pixels; the one at index 3 cannot be read.
    struct Even {
        next: u64,
        count: u64,
        seeks: bool,
    }

    impl Source for Even {
        fn name(&self) -> String {
            "even".into()
        }

        fn next(&mut self) -> svl::Result<Option<Frame>> {
            let index = self.next;
            if index >= self.count {
                return Ok(None);
            }
            self.next += 1;
            if index == 3 {
                return Err(Error::Invalid("frame 6 is a cat".into()));
            }
            let image = Gray::filled(10, 10, 0)?;
            Ok(Some(Frame {
                sequence: 2 * index,
                ..Frame::new(StereoPair::new(image.clone(), image)?, Geometry::Raw)
            }))
        }

        fn pairs(&self) -> Option<u64> {
            self.seeks.then_some(self.count)
        }

        fn seek(&mut self, index: u64) -> svl::Result<bool> {
            self.next = if self.seeks { index } else { self.next };
            Ok(self.seeks)
        }
    }

    #[test]
    fn any_frame_can_be_had_in_any_order() {
        for seeks in [false, true] {
            let opened = Cell::new(0);
            let open: Open<'_> = Box::new(|| {
                opened.set(opened.get() + 1);
                Ok(Box::new(Even {
                    next: 0,
                    count: 9,
                    seeks,
                }))
            });
            // Three frames are kept.
            let mut store = FrameStore {
                limit_bytes: 600,
                ..FrameStore::new(open).unwrap()
            };
            let mut sequence = |index| {
                let found = store.at_most(index).map(|found| found.unwrap());
                found
                    .map(|(_, frame)| frame.sequence)
                    .map_err(|error| error.to_string())
            };
            assert_eq!(sequence(0), Ok(0));
            assert_eq!(sequence(5), Ok(10));
            assert_eq!(sequence(4), Ok(8));
            assert_eq!(sequence(1), Ok(2));
            assert_eq!(sequence(3), Err("frame 6 is a cat".into()));
            assert_eq!(sequence(7), Ok(14));
            assert_eq!(sequence(90), Ok(16), "the last");
            assert_eq!(store.count, Some(9));
            assert!(store.kept.len() <= 3);
            assert_eq!(
                opened.get() == 1,
                seeks,
                "a source that seeks is opened once"
            );
        }
    }

    #[test]
    fn cameras_give_their_newest_frame_and_kept_frames_stay() {
        let source = Even {
            next: 4,
            count: 7,
            seeks: false,
        };
        let mut store = FrameStore::live(Box::new(source));
        let mut sequence = |index| {
            let (index, frame) = store.at_most(index).unwrap().unwrap();
            (index, frame.sequence, store.damage.take())
        };
        let (first, earliest, ended_at_once) = sequence(0);
        assert_eq!(first, 0);
        std::thread::sleep(std::time::Duration::from_millis(100));
        // Frames in between were not taken.
        let (second, newest, ended) = sequence(1);
        assert_eq!(sequence(0).1, earliest);
        if earliest == 12 {
            assert_eq!((second, newest), (0, 12));
        } else {
            assert_eq!((second, newest), (1, 12));
        }
        let ended = ended.or(ended_at_once);
        assert_eq!(ended.unwrap(), "the cameras have stopped");
    }

    #[test]
    fn frames_are_found_by_their_numbers() {
        let open: Open<'_> = Box::new(|| {
            Ok(Box::new(Even {
                next: 0,
                count: 9,
                seeks: true,
            }))
        });
        let mut store = FrameStore::new(open).unwrap();
        let mut found = |sequence| {
            let (index, frame) = store.numbered(sequence).unwrap().unwrap();
            (index, frame.sequence)
        };
        assert_eq!(found(16), (8, 16));
        assert_eq!(found(9), (5, 10), "there is no 9");
        assert_eq!(found(0), (0, 0));
        assert_eq!(found(99), (8, 16));
    }
}
