//! The layers around a source, in their one order.

use super::alignment_monitor::AlignmentMonitor;
use super::board_truth::{BoardFinder, BoardSightings};
use super::distinct::DistinctSource;
use super::floored::{FlooredSource, ToldFloor};
use super::limited::{FirstPairs, Limited, MatchedPairs};
use super::measured::{MeasuredSource, SourceMaps};
use super::plausible::PlausibleSource;
use super::rectified::{AppliedCalibration, RectifiedSource, assumed, declared};
use super::registered::{RegisteredSource, Registration};
use super::resized::resized;
use super::stressed::{Perturbation, StressedSource};
use crate::source::frames::{Source, wraps};
use std::collections::BTreeSet;
use svl_core::Result;
use svl_core::stereo::{Frame, Rig};
use svl_score::scenario::{CropScale, PairRange, SourceOptions};

/// Declares [`Chain`]: a line per layer with its settings and the wrapped source.
macro_rules! chain {
    ($($(#[$doc:meta])+ $layer:ident($settings:ident: $type:ty), |$source:ident| $wrapped:expr;)+)
    => {
        /// The layers around a source, each with its settings; the first is next to the source.
        #[derive(Default)]
        pub struct Chain {
            $($(#[$doc])+ pub $layer: Option<$type>,)+
        }

        impl Chain {
            /// Names of all layers, from the source outwards.
            pub const LAYERS: &[&str] = &[$(stringify!($layer)),+];

            /// The source in these layers.
            ///
            /// # Errors
            /// The errors of a calibration that cannot rectify.
            pub fn over<'a>(self, source: Box<dyn Source + 'a>) -> Result<Box<dyn Source + 'a>> {
                $(let source = match self.$layer {
                    None => source,
                    Some($settings) => {
                        let $source = source;
                        Box::new($wrapped) as Box<dyn Source + 'a>
                    }
                };)+
                Ok(source)
            }

            /// Names of the layers that it has, from the source outwards.
            pub fn words(&self) -> Vec<String> {
                let layers = [$((stringify!($layer), self.$layer.is_some())),+];
                let layers = layers.into_iter().filter(|(_, is_there)| *is_there);
                layers.map(|(name, _)| name.to_owned()).collect()
            }
        }
    };
}

// Pairs outside the range are neither decoded further nor counted, so `limit` is first. Images are
// equal as they were read, so `distinct` comes before all that changes them, and so does `sight`:
// rectification crops boards. Truth and maps are of
// rectified images of full size: `measure` and `check` follow `rectify` and `declare`
// and precede `resize`. `floor` divides the truth that is scored. A copy is known by the pair as it
// was read, which every layer keeps, so `register` comes after the layers that drop pairs and
// before `perturb`, which needs the neighbours that are left. `take` counts the pairs that come
// out. The user's word that raw pairs are rectified (`assume`) and the `monitor` of vertical
// misalignment are about the pairs that are matched: they are last.
chain! {
    /// A range of the source's pairs.
    limit(range: PairRange), |source| Limited::new(source, range, None);
    /// The pairs that another run matched, by their stamps.
    matched(stamps_ns: BTreeSet<u64>), |source| MatchedPairs { source, stamps_ns };
    /// One picture twice is refused.
    distinct(_all: ()), |source| DistinctSource::new(source);
    /// A board is searched for that is the truth.
    sight(finder: BoardFinder), |source| BoardSightings::new(source, finder);
    /// Raw pairs are rectified.
    rectify(by: AppliedCalibration), |source| RectifiedSource::new(source, by)?;
    /// Raw pairs are rectified ones of that rig.
    declare(rig: Rig), |source| Mapped { source, change: declared(rig) };
    /// Truth and maps of other sensors and programs.
    measure(maps: SourceMaps), |source| MeasuredSource::new(source, maps);
    /// Impossible truths are dropped.
    check(_all: ()), |source| PlausibleSource::new(source);
    /// Images are cropped and shrunk.
    resize(window: CropScale), |source| Mapped { source, change: resized(window) };
    /// The truth tells floor from obstacles.
    floor(told: ToldFloor), |source| FlooredSource::new(source, told);
    /// Copies of pairs of other runs are dropped.
    register(run: Registration), |source| RegisteredSource::new(source, run);
    /// Pairs are perturbed.
    perturb(by: Perturbation), |source| StressedSource::new(source, by);
    /// The first pairs of what is left.
    take(first: FirstPairs), |source| Limited::new(source, first.range, first.frames);
    /// Raw pairs are declared rectified.
    assume(_all: ()), |source| Mapped { source, change: assumed };
    /// The user is warned of vertical misalignment, of images that are no pair, and of disparities
    /// below the lowest that is searched.
    monitor(lowest_px: i32), |source| AlignmentMonitor::new(source, lowest_px);
}

impl Chain {
    /// The layers that options alone describe. `is_raw`: the pairs calibrate cameras.
    pub fn for_options(options: &SourceOptions, is_raw: bool) -> Self {
        let (range, window) = (options.range(), options.window());
        Self {
            limit: (range != PairRange::default()).then_some(range),
            distinct: (!is_raw).then_some(()),
            check: (!is_raw).then_some(()),
            resize: (window != CropScale::default()).then_some(window),
            ..Self::default()
        }
    }

    /// The layers of pairs that are matched now, from the lowest disparity that all algorithms
    /// search; none where pairs are not monitored, as perturbed ones are misaligned on purpose.
    pub(crate) fn for_matching(lowest_px: Option<i32>) -> Self {
        Self {
            assume: Some(()),
            monitor: lowest_px,
            ..Self::default()
        }
    }
}

/// A source whose frames are changed one by one.
pub(crate) struct Mapped<'a, F> {
    pub source: Box<dyn Source + 'a>,
    /// From a frame of the source to the changed one.
    pub change: F,
}

impl<F: FnMut(Frame, &dyn Source) -> Result<Frame> + Send> Source for Mapped<'_, F> {
    wraps!();

    fn next(&mut self) -> Result<Option<Frame>> {
        let frame = self.source.next()?;
        let changed = |frame| (self.change)(frame, &*self.source);
        frame.map(changed).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_named_in_their_order() {
        let words = |options: &SourceOptions, is_raw| Chain::for_options(options, is_raw).words();
        assert_eq!(
            words(&SourceOptions::default(), false),
            ["distinct", "check"]
        );
        assert!(words(&SourceOptions::default(), true).is_empty());
        let options = SourceOptions {
            scale: Some(0.5),
            every: Some(2),
            ..SourceOptions::default()
        };
        assert_eq!(
            words(&options, false),
            ["limit", "distinct", "check", "resize"]
        );
        assert_eq!(Chain::for_matching(Some(0)).words(), ["assume", "monitor"]);
    }
}
