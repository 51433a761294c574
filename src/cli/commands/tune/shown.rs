//! The tool's view of a frame and of the sample.

use std::sync::Arc;
use svl::matcher::Algorithm;
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
    /// Counts the jobs whose frame is done.
    pub(super) done: u64,
    /// The frame, through the setting and the one compared with; `None` where an algorithm failed.
    pub(super) sides: [Option<FrameSide>; 2],
    pub(super) sample: SampleView,
    /// An error or warning, to be reported once.
    pub(super) says: Option<String>,
    /// Reason why a setting gave no result.
    pub(super) failure: Option<String>,
    /// Settings that were run over the whole sample, by what they are written as, in that order.
    pub(super) tried: Arc<Vec<(String, Vec<Change>)>>,
}

impl TuneState {
    /// Another value when there is something new to draw.
    pub(super) fn progress(&self) -> (u64, usize, usize, bool) {
        let SampleView { done, frames, .. } = self.sample;
        (self.done, done, frames, self.failure.is_some())
    }
}

/// The part of an estimate that is kept.
#[derive(Clone)]
pub(super) struct FrameSide {
    pub(super) algorithm: String,
    pub(super) metrics: MetricValues,
    /// Time of the algorithm, once it is measured.
    pub(super) ms: Option<f64>,
    /// Per cent of the pixels per reason.
    pub(super) why: [f64; Reason::PIXELS.len()],
    /// Disparities, from far and dark to near and light.
    pub(super) picture: Option<Arc<Gray>>,
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
        let known = |&(sequence, value): &(u64, Option<f64>)| Some((sequence, value?));
        let mut ranked: Vec<_> = self.values.iter().filter_map(known).collect();
        let sign = if larger_is_worse { -1.0 } else { 1.0 };
        ranked.sort_by(|(_, a), (_, b)| (sign * a).total_cmp(&(sign * b)));
        ranked
    }
}

pub(super) fn sides(judged: &Judged) -> Vec<FrameSide> {
    let sides = judged.estimates.iter().map(|scored| {
        let estimate = &scored.estimate;
        let map = estimate.disparity.disparity();
        let finite = map.pixels().filter(|d| d.is_finite());
        let nearest = finite.fold(1.0_f32, f32::max);
        let range = estimate.range_px.map_or(nearest, |range| range as f32);
        let picture = Gray::from_fn(map.width(), map.height(), |x, y| {
            let d = map.get(x, y);
            let shade = (32.0 + 223.0 * (d / range).clamp(0.0, 1.0)) as u8;
            if d.is_finite() { shade } else { 0 }
        });
        let pixels = (map.width() * map.height()) as f64;
        let tally = estimate.disparity.tally();
        FrameSide {
            algorithm: estimate.algorithm.clone(),
            metrics: scored.metrics.clone(),
            ms: None,
            why: tally.map(|count| 100.0 * count as f64 / pixels),
            picture: picture.ok().map(Arc::new),
        }
    });
    sides.collect()
}

/// The algorithm as it runs, with its filters.
pub(super) fn title(algorithm: &Algorithm) -> String {
    let filters = algorithm.filters().iter();
    let filters = filters.map(|filter| format!("+{}", filter.kind));
    algorithm.written() + &filters.collect::<String>()
}
