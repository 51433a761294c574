//! Figure 5.7: the SSDPI of one subject, close and far.

use super::checks::{Check, matches};
use super::measure::{SSDPI_TOP, mean_and_median, valid};
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

/// Mean and median ln SSDPI of what is close, and of what is far.
type CloseAndFar = [[f64; 2]; 2];

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let near = subject(context, CLOSE_M, "close", finding)?;
    let far = subject(context, FAR_M, "far", finding)?;
    let line = |name, values: &[f64]| Series::new(name, SeriesStyle::Line, histogram(values));
    let histograms = [line("close", &near), line("far", &far)];
    let x = Axis::new("ln SSDPI").with_range(0.0, SSDPI_TOP);
    let y = Axis::new("fraction of the matches, %");
    finding.chart("SSDPI of one subject", [x, y], histograms);
    let arena = [near, far].map(mean_and_median);
    let [[near_mean, near_median], [far_mean, far_median]] = arena;
    finding.condition(near_median > far_median).says(format!(
        "The median ln SSDPI of the subject is higher close than far: {near_median:.2} and \
         {far_median:.2}."
    ));
    finding
        .condition(near_mean > far_mean)
        .says(format!("So is the mean: {near_mean:.2} and {far_mean:.2}."));
    let real = context.in_real_scenes(|frame| halves(&frame))?.into_iter();
    let mut views = vec![("arena".to_owned(), arena)];
    views.extend(real.filter_map(|(name, halves)| Some((name, halves?))));
    let in_scenes = conclude_scenes(&views[1..], finding);
    let values = |[near, far]: CloseAndFar| [near[1], far[1], near[0], far[0]];
    finding.table(
        "ln SSDPI | close, median | far, median | close, mean | far, mean",
        views.into_iter().map(|(name, view)| (name, values(view))),
    );
    finding.why = format!(
        "Close, the subject's ln SSDPI is {near_median:.2} in the median and {near_mean:.2} in \
         the mean, far {far_median:.2} and {far_mean:.2}{in_scenes}."
    );
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
    let frame = context.frame(&config, 0)?;
    // Unchecked matches: the checks would drop those with a high SSDPI, which are of interest here.
    let matches = matches(&frame.pair, Check::Nothing)?;
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
fn conclude_scenes(real: &[(String, CloseAndFar)], finding: &mut Finding) -> String {
    let higher = real.iter().filter(|(_, [near, far])| near[1] > far[1]);
    let (higher, scenes) = (higher.count(), real.len());
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
fn halves(frame: &Frame) -> Result<Option<CloseAndFar>> {
    let matches = matches(&frame.pair, Check::Nothing)?;
    let known = valid(&matches, frame.truth.as_ref()).filter(|pixel| pixel.true_px.is_finite());
    let mut known: Vec<_> = known.collect();
    known.sort_by(|a, b| b.true_px.total_cmp(&a.true_px));
    let (near, far) = known.split_at(known.len() / 2);
    let halves = [near, far].map(|half| mean_and_median(half.iter().map(|pixel| pixel.ln_ssdpi)));
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
