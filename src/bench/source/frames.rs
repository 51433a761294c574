//! A source of frames.

use nalgebra::{Matrix3, Point2, Vector3};
use std::ops::RangeInclusive;
use svl_core::Result;
use svl_core::rectify::RectificationMeter;
use svl_core::statistics::lower_median;
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

/// Largest residual of a corner that fits the plane: 3 standard deviations, and pixels.
const MAX_DEVIATIONS: f64 = 3.0 * 1.4826;
const MAX_CLOSE_PX: f64 = 0.06;

/// The board of a pair that is rectified.
pub struct BoardPlane {
    /// Left and right corners, in the order of [`Board::corners`].
    pub corners: [Vec<Point2<f64>>; 2],
    /// The disparity is `x · [0] + y · [1] + [2]`.
    plane: Vector3<f64>,
    pub rms_px: f64,
}

impl BoardPlane {
    /// Fits the plane to the disparities of corners, robustly; `None` where they are degenerate.
    pub fn new(corners: [Vec<Point2<f64>>; 2]) -> Option<Self> {
        let [left, right] = &corners;
        let points = left.iter().zip(right);
        let points: Vec<_> = points
            .map(|(l, r)| (Vector3::new(l.x, l.y, 1.0), l.x - r.x))
            .collect();
        let (mut plane, mut limit_px) = (Vector3::zeros(), f64::INFINITY);
        for _ in 0..3 {
            let (mut squares, mut sums) = (Matrix3::zeros(), Vector3::zeros());
            let residual = |(at, px): &(Vector3<f64>, f64)| (px - plane.dot(at)).abs();
            for (at, px) in points.iter().filter(|own| residual(own) <= limit_px) {
                squares += at * at.transpose();
                sums += at * *px;
            }
            plane = squares.lu().solve(&sums)?;
            let residuals = points.iter().map(|(at, px)| (px - plane.dot(at)).abs());
            limit_px = MAX_CLOSE_PX.max(MAX_DEVIATIONS * lower_median(residuals)?);
        }
        let squares = points.iter().map(|(at, px)| (px - plane.dot(at)).powi(2));
        let rms_px = (squares.sum::<f64>() / points.len() as f64).sqrt();
        Some(Self {
            corners,
            plane,
            rms_px,
        })
    }

    /// The disparity of the board's plane at a pixel of the left image.
    pub fn px(&self, at: &Point2<f64>) -> f64 {
        self.plane.dot(&at.coords.push(1.0))
    }
}

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

    /// The board that the last frame shows, where one is the truth.
    fn board(&self) -> Option<&BoardPlane> {
        self.wrapped()?.board()
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

    /// True if a newer frame takes the place of one that waits: none may wait behind it.
    fn keeps_newest(&self) -> bool {
        self.wrapped().is_some_and(Source::keeps_newest)
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
