//! A source of frames.

use std::ops::RangeInclusive;
use svl_core::Result;
use svl_core::rectify::RectificationMeter;
use svl_core::stereo::{FloorPlane, Frame};
use svl_recording::warn_of;
use svl_score::judge::Judged;
use svl_score::losses::Losses;

/// Forwards what a wrapper does not change to the source in its field `source`.
macro_rules! wraps {
    () => {
        fn wrapped(&self) -> Option<&dyn Source> {
            Some(&*self.source)
        }

        fn wrapped_mut(&mut self) -> Option<&mut dyn Source> {
            Some(&mut *self.source)
        }
    };
}
pub(super) use wraps;

/// A sequence of frames, pulled one by one.
pub trait Source: Send {
    /// The source that this one is wrapped around; what a wrapper does not change is forwarded to
    /// it.
    fn wrapped(&self) -> Option<&dyn Source> {
        None
    }

    fn wrapped_mut(&mut self) -> Option<&mut dyn Source> {
        None
    }

    /// Name of the source for the user, in one word or two.
    fn name(&self) -> String {
        self.wrapped().map(Source::name).unwrap_or_default()
    }

    /// The next frame, or none at the end.
    ///
    /// # Errors
    /// The reason why the next frame cannot be read. The source may be asked again unless the error
    /// is [`svl_core::Error::Damaged`].
    fn next(&mut self) -> Result<Option<Frame>>;

    /// Number of frames in all, if that is known.
    fn pairs(&self) -> Option<u64> {
        self.wrapped()?.pairs()
    }

    /// Numbers of the first and the last frame without a range, if they are known: of the names, or
    /// of frames without a name the sequences. The last one may be less than this.
    fn numbers(&self) -> Option<RangeInclusive<u64>> {
        let wrapped = self.wrapped().map(Source::numbers);
        wrapped.unwrap_or_else(|| Some(0..=self.pairs()?.checked_sub(1)?))
    }

    /// Makes the source give the frame at `index`, counted from 0, next. False where it can only
    /// read on: it gives then what it would have given.
    ///
    /// # Errors
    /// The errors of [`Source::next`].
    fn seek(&mut self, index: u64) -> Result<bool> {
        self.wrapped_mut()
            .map_or(Ok(false), |source| source.seek(index))
    }

    /// Leaves out up to this number of frames unread, where none of them can be lost. Returns how
    /// many. Wrappers, which may have to see every frame, leave out none.
    ///
    /// # Errors
    /// The errors of [`Source::next`].
    fn skip(&mut self, _: u64) -> Result<u64> {
        Ok(0)
    }

    /// Stamp of the source's first pair, which may be before the range that is read, once it was
    /// read; none without a range.
    fn start_ns(&self) -> Option<u64> {
        self.wrapped()?.start_ns()
    }

    /// The reason why frames have no pose though the source has poses.
    fn why_no_pose(&self) -> Option<String> {
        self.wrapped()?.why_no_pose()
    }

    /// The misalignment before and after rectification; none of pairs that are not rectified here.
    fn rectification(&self) -> Option<&RectificationMeter> {
        self.wrapped()?.rectification()
    }

    /// The floor in the frame of the left camera, if the source tells it of the truth of its last
    /// frame.
    fn floor(&self) -> Option<FloorPlane> {
        self.wrapped()?.floor()
    }

    /// True if the truth shows the floor that is told; none if none is told, and before that is
    /// decided.
    fn sees_floor(&self) -> Option<bool> {
        self.wrapped()?.sees_floor()
    }

    /// Ends the source and returns its losses. `taken`: frames that were used.
    fn finish(&mut self, taken: u64) -> Losses {
        let wrapped = self.wrapped_mut();
        wrapped.map_or_else(Losses::default, |source| source.finish(taken))
    }

    /// True if the next frame depends on the results of the last one.
    fn listens(&self) -> bool {
        self.wrapped().is_some_and(Source::listens)
    }

    /// Receives the results of the last frame; called only for a source that listens.
    fn hear(&mut self, judged: &Judged) {
        if let Some(source) = self.wrapped_mut() {
            source.hear(judged);
        }
    }
}

impl Source for &mut (dyn Source + '_) {
    fn wrapped(&self) -> Option<&dyn Source> {
        Some(&**self)
    }

    fn wrapped_mut(&mut self) -> Option<&mut dyn Source> {
        Some(&mut **self)
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        (**self).next()
    }
}

/// A source of what a function returns.
#[cfg(test)]
pub(super) struct FromFn<F: FnMut() -> Result<Option<Frame>>>(pub(super) F);

#[cfg(test)]
impl<F: FnMut() -> Result<Option<Frame>> + Send> Source for FromFn<F> {
    fn name(&self) -> String {
        "pairs".into()
    }

    fn next(&mut self) -> Result<Option<Frame>> {
        (self.0)()
    }
}

/// Warns once of the numbers of a file's rig that make no sense with the images of a frame.
pub(super) fn warn_of_rig(name: &str, frame: &Frame) {
    let checks = frame.rig().map(|rig| rig.checks(frame.pair.size()));
    let checks = checks.into_iter().flatten();
    for doubt in checks.filter_map(|check| check.doubt()) {
        warn_of(name, &doubt);
    }
}
