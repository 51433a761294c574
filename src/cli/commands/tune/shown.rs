//! The tool's view of a frame and of the sample.

use std::sync::Arc;
use svl::matcher::Algorithm;
use svl::report::Row;
use svl::report::compare::Change;
use svl::score::{Judged, Metric, MetricValues};
use svl::stereo::{Frame, Gray, Reason};
use svl::tune::TunedSetting;

/// Names of the two settings.
pub(super) const LABELS: [&str; 2] = ["now", "compared"];

/// A frame that is to be shown, with its settings.
#[derive(Clone)]
pub(super) struct Job {
    pub(super) frame: Arc<Frame>,
    /// The one that is turned, the one that it is compared with. The grid and the cells of the
    /// first hold for both.
    pub(super) settings: [TunedSetting; 2],
}

/// The state that the tool shows.
#[derive(Clone, Default)]
pub(super) struct TuneState {
    /// Counts the jobs that were asked for, and the last of them whose frame is done.
    pub(super) wanted: u64,
    pub(super) done: u64,
    pub(super) frame: Option<FrameView>,
    pub(super) sample: SampleView,
    /// An error or warning, to be reported once.
    pub(super) says: Option<String>,
    /// Reason why a setting gave no result.
    pub(super) failure: Option<String>,
    /// Settings that were run over the whole sample, by what they are written as, in that order.
    pub(super) tried: Arc<Vec<(String, Vec<Change>)>>,
}

/// The frame, through the setting and the one compared with.
#[derive(Clone)]
pub(super) struct FrameView {
    pub(super) metrics: [Option<MetricValues>; 2],
    pub(super) ms: [Option<f64>; 2],
    /// Pixels per reason.
    pub(super) why: [[usize; Reason::PIXELS.len()]; 2],
    pub(super) pixels: usize,
    /// Disparities, from far and dark to near and light.
    pub(super) pictures: [Option<Arc<Gray>>; 2],
}

/// The sample, as far as it is done.
#[derive(Clone, Default)]
pub(super) struct SampleView {
    pub(super) done: usize,
    pub(super) frames: usize,
    pub(super) changes: Vec<Change>,
    /// Metric that frames are ranked by, and whether a larger value is worse.
    pub(super) ranked_by: Option<(&'static Metric, bool)>,
    /// Frames in their order with their values by it.
    pub(super) values: Vec<(u64, Option<f64>)>,
}

impl SampleView {
    /// Frames by that metric, the worst first.
    pub(super) fn worst(&self) -> Vec<(u64, f64)> {
        let Some((_, larger_is_worse)) = self.ranked_by else {
            return Vec::new();
        };
        let ranked = self.values.iter();
        let ranked = ranked.filter_map(|(sequence, value)| Some((*sequence, (*value)?)));
        let mut ranked: Vec<_> = ranked.collect();
        ranked.sort_by(|(_, a), (_, b)| {
            if larger_is_worse {
                b.total_cmp(a)
            } else {
                a.total_cmp(b)
            }
        });
        ranked
    }
}

/// The part of an estimate that is kept.
#[derive(Clone)]
pub(super) struct Watched {
    pub(super) algorithm: String,
    why: [usize; Reason::PIXELS.len()],
    picture: Option<Arc<Gray>>,
}

pub(super) fn watch(judged: &Judged) -> Vec<Watched> {
    let estimates = judged.estimates.iter().map(|scored| &scored.estimate);
    let watched = estimates.map(|estimate| {
        let map = estimate.disparity.disparity();
        let finite = map.pixels().filter(|d| d.is_finite());
        let nearest = finite.fold(1.0_f32, f32::max);
        let range = estimate.range_px.map_or(nearest, |range| range as f32);
        let picture = Gray::from_fn(map.width(), map.height(), |x, y| {
            let d = map.get(x, y);
            if d.is_finite() {
                (32.0 + 223.0 * (d / range).clamp(0.0, 1.0)) as u8
            } else {
                0
            }
        });
        Watched {
            algorithm: estimate.algorithm.clone(),
            why: estimate.disparity.tally(),
            picture: picture.ok().map(Arc::new),
        }
    });
    watched.collect()
}

impl FrameView {
    pub(super) fn new(frame: &Frame, rows: &[Row], watched: &[Watched]) -> Self {
        let row = |label: &str| rows.iter().find(|row| row.algorithm == label);
        let find = |label: &str| watched.iter().find(|find| find.algorithm == label);
        let (width, height) = frame.pair.size();
        Self {
            metrics: LABELS.map(|label| row(label).map(|row| row.metrics)),
            ms: [None; 2],
            why: LABELS.map(|label| find(label).map_or([0; Reason::PIXELS.len()], |find| find.why)),
            pixels: width * height,
            pictures: LABELS.map(|label| find(label).and_then(|find| find.picture.clone())),
        }
    }
}

/// The algorithm as it runs, with its filters.
pub(super) fn title(algorithm: &Algorithm) -> String {
    let filters = algorithm.filters().iter();
    let filters = filters.map(|filter| format!("+{}", filter.kind));
    algorithm.written() + &filters.collect::<String>()
}
