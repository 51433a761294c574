//! Figure 5.7: the SSDPI of one subject, close and far.

use super::checks::Correlated;
use super::measure::{MeanMedian, SSDPI_TOP, valid};
use super::{Context, Experiment, Finding, stage};
use svl_core::Result;
use svl_core::stereo::Frame;
use svl_report::plot::{Axis, Series, SeriesStyle};

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["5.7", "5.6"],
    place: "Figure 5.7",
    title: "SSDPI of a close and a far object",
    claim: "The closer an object, the more its two images differ: mean and median SSDPI are \
            higher for a close object than for the same one far away (section 5.3.3).",
    method: "A block turned by 35° and a ball, both with forest pictures, 0.25 m and 1 m in front \
             of the arena's stereo head. SSDPI is ln(SSDPI + 1) of all of v3's matches on the \
             subject, before any check. The truth says which pixels belong to the subject. Real \
             scenes cannot be moved, so there the nearer half of the matches, by the truth, is \
             compared with the farther half, which shows other things.",
    run,
};

const CLOSE_M: f64 = 0.25;
const FAR_M: f64 = 1.0;
/// Depth of the subject.
const DEPTH_M: f64 = 0.3;

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let near = subject(context, CLOSE_M, "close", finding)?;
    let far = subject(context, FAR_M, "far", finding)?;
    let line = |name, values: &[f64]| Series::new(name, SeriesStyle::Line, histogram(values));
    let histograms = [line("close", &near), line("far", &far)];
    let (close, far) = (MeanMedian::new(near), MeanMedian::new(far));
    finding.condition(close.median > far.median).says(format!(
        "The median ln SSDPI of the subject is higher close than far: {:.2} and {:.2}.",
        close.median, far.median
    ));
    finding.condition(close.mean > far.mean).says(format!(
        "So is the mean: {:.2} and {:.2}.",
        close.mean, far.mean
    ));
    let real = context.in_real_scenes(|frame| halves(&frame))?;
    let real = real
        .into_iter()
        .filter_map(|(name, halves)| Some((name, halves?)));
    let real: Vec<_> = real.collect();
    let in_scenes = conclude_scenes(&real, finding);
    let rows = std::iter::once(("arena".to_owned(), [close, far])).chain(real);
    let values = |[near, far]: [MeanMedian; 2]| [near.median, far.median, near.mean, far.mean];
    finding.table(
        "ln SSDPI | close, median | far, median | close, mean | far, mean",
        rows.map(|(name, halves)| (name, values(halves))),
    );
    finding.why = format!(
        "Close, the subject's ln SSDPI is {:.2} in the median and {:.2} in the mean, far {:.2} \
         and {:.2}{in_scenes}.",
        close.median, close.mean, far.median, far.mean
    );
    let x = Axis::new("ln SSDPI").with_range(0.0, SSDPI_TOP);
    let y = Axis::new("fraction of the matches, %");
    finding.chart("SSDPI of one subject", [x, y], histograms);
    Ok(())
}

/// The ln SSDPIs of the subject's matches at a distance.
fn subject(
    context: &mut Context<'_>,
    ahead_m: f64,
    name: &str,
    finding: &mut Finding,
) -> Result<Vec<f64>> {
    let mut config = stage::empty();
    config.world.blocks = vec![stage::block(ahead_m, 0.03, [0.16, 0.10, 0.13], 35.0)];
    config.world.balls = vec![stage::ball(ahead_m + 0.02, -0.07, 0.05)];
    let frame = context.still(&config)?;
    // Unchecked matches: the checks would drop those with a high SSDPI, which are of interest here.
    let matches = Correlated::new(&frame.pair)?.matches;
    // The rig of the arena always exists.
    let farthest_px = frame
        .rig()
        .map_or(0.0, |rig| rig.disparity_px(ahead_m + DEPTH_M)) as f32;
    finding.image(format!("{name}, {ahead_m} m"), frame.pair.left())?;
    finding.ssdpis(format!("ln SSDPI, {name}"), &matches)?;
    // The wall behind is farther away than the subject's depth, so the true disparity separates
    // them.
    let pixels = valid(&matches, frame.truth.as_ref());
    let on_subject = pixels.filter(|pixel| pixel.true_px > farthest_px);
    Ok(on_subject.map(|pixel| pixel.ln_ssdpi).collect())
}

/// Adds the condition of the real scenes; returns words on them.
fn conclude_scenes(real: &[(String, [MeanMedian; 2])], finding: &mut Finding) -> String {
    let is_higher = |(_, [near, far]): &&(String, [MeanMedian; 2])| near.median > far.median;
    let (higher, scenes) = (real.iter().filter(is_higher).count(), real.len());
    if scenes == 0 {
        return String::new();
    }
    finding.condition(2 * higher > scenes).says(format!(
        "In most real scenes the nearer half of the matches has the higher median: in {higher} of \
         {scenes}."
    ));
    format!("; in {higher} of {scenes} real scenes the nearer half has the higher median")
}

/// Fractions, in per cent, of values in bins of a quarter.
fn histogram(values: &[f64]) -> Vec<(f64, f64)> {
    let bins = (4.0 * SSDPI_TOP) as usize;
    let mut bins: Vec<_> = (0..bins).map(|i| (0.25 * i as f64 + 0.125, 0.0)).collect();
    let last = bins.len() - 1;
    for value in values {
        bins[((4.0 * value) as usize).min(last)].1 += 100.0 / values.len() as f64;
    }
    bins
}

/// The ln SSDPIs of the nearer and the farther half of the matches with truth, if both have some.
fn halves(frame: &Frame) -> Result<Option<[MeanMedian; 2]>> {
    let matches = Correlated::new(&frame.pair)?.matches;
    let known = valid(&matches, frame.truth.as_ref()).filter(|pixel| pixel.true_px.is_finite());
    let mut known: Vec<_> = known.map(|pixel| (pixel.true_px, pixel.ln_ssdpi)).collect();
    known.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (near, far) = known.split_at(known.len() / 2);
    let halves = [near, far].map(|half| MeanMedian::new(half.iter().map(|(_, ssdpi)| *ssdpi)));
    Ok((!near.is_empty()).then_some(halves))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_histogram_sums_to_all() {
        let histogram = histogram(&[0.0, 0.3, 3.1, 99.0]);
        assert_eq!(histogram.iter().map(|(_, share)| share).sum::<f64>(), 100.0);
        assert_eq!((histogram[0], histogram[1].1), ((0.125, 25.0), 25.0));
    }
}
