//! Figure 5.7: the SSDPI of one subject, close and far.

use super::checks::Correlated;
use super::measure::{MeanMedian, SSDPI_TOP, Valid, gray_picture, ssdpi_picture, valid};
use super::{Context, Experiment, Finding, TableValue, stage};
use svl_core::Result;
use svl_core::stereo::Frame;
use svl_report::plot::{Axis, Chart, Series, SeriesStyle};

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
    records: false,
    run,
};

const CLOSE_M: f64 = 0.25;
const FAR_M: f64 = 1.0;
/// Depth of the subject.
const DEPTH_M: f64 = 0.3;

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let mut finding = Finding::default();
    let close = subject(context, CLOSE_M, "close", &mut finding)?;
    let far = subject(context, FAR_M, "far", &mut finding)?;
    let histograms = vec![("close", histogram(&close)), ("far", histogram(&far))];
    let (close, far) = (MeanMedian::or_nan(close), MeanMedian::or_nan(far));
    finding.condition(
        close.median > far.median,
        format!(
            "The median ln SSDPI of the subject is higher close than far: {:.2} and {:.2}.",
            close.median, far.median
        ),
    );
    finding.condition(
        close.mean > far.mean,
        format!("So is the mean: {:.2} and {:.2}.", close.mean, far.mean),
    );
    let mut rows = vec![("arena".to_owned(), [close, far])];
    rows.extend(real_scenes(context)?);
    let real = add_scenes(&rows, &mut finding);
    finding.why = format!(
        "Close, the subject's ln SSDPI is {:.2} in the median and {:.2} in the mean, far {:.2} \
         and {:.2}{real}.",
        close.median, close.mean, far.median, far.mean
    );
    let line = |(name, points): (&str, Vec<_>)| Series::new(name, SeriesStyle::Line, points);
    finding.plot(&Chart {
        title: "SSDPI of one subject".into(),
        x: Axis::new("ln SSDPI").with_range(0.0, SSDPI_TOP),
        y: Axis::new("fraction of the matches, %"),
        series: histograms.into_iter().map(line).collect(),
    });
    Ok(finding)
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
    let on_subject = |v: &Valid| {
        frame
            .truth
            .as_ref()
            .is_some_and(|truth| truth.disparity.get(v.at.0, v.at.1) > farthest_px)
    };
    // The wall behind is farther away than the subject's depth, so the true disparity separates
    // them.
    let values: Vec<f64> = valid(&matches)
        .filter(on_subject)
        .map(|v| v.ln_ssdpi)
        .collect();
    finding.show(gray_picture(
        format!("{name}, {ahead_m} m"),
        frame.pair.left(),
    )?);
    finding.show(ssdpi_picture(format!("ln SSDPI, {name}"), &matches)?);
    Ok(values)
}

/// The nearer and the farther half of each real scene.
fn real_scenes(context: &mut Context<'_>) -> Result<Vec<(String, [MeanMedian; 2])>> {
    let mut scenes = Vec::new();
    for frame in context.real() {
        let frame = frame?;
        context.step()?;
        if let Some(halves) = halves(&frame)? {
            scenes.push((frame.name.clone().unwrap_or_default(), halves));
        }
    }
    Ok(scenes)
}

/// Adds the table of all rows and the condition of the real scenes, which are behind the arena;
/// returns words on them.
fn add_scenes(rows: &[(String, [MeanMedian; 2])], finding: &mut Finding) -> String {
    let table = finding.table([
        "ln SSDPI",
        "close, median",
        "far, median",
        "close, mean",
        "far, mean",
    ]);
    for (name, [near, far]) in rows {
        let values = [near.median, far.median, near.mean, far.mean];
        table.row(name.clone(), values.map(TableValue::from));
    }
    let is_higher = |(_, [near, far]): &&(String, [MeanMedian; 2])| near.median > far.median;
    let scenes = rows.len() - 1;
    let higher = rows[1..].iter().filter(is_higher).count();
    if scenes == 0 {
        return String::new();
    }
    finding.condition(
        2 * higher > scenes,
        format!(
            "In most real scenes the nearer half of the matches has the higher median: in \
             {higher} of {scenes}."
        ),
    );
    format!("; in {higher} of {scenes} real scenes the nearer half has the higher median")
}

/// Fractions, in per cent, of values in bins of a quarter.
fn histogram(values: &[f64]) -> Vec<(f64, f64)> {
    let mut bins = vec![0.0; (4.0 * SSDPI_TOP) as usize];
    let last = bins.len() - 1;
    values
        .iter()
        .for_each(|v| bins[((4.0 * v) as usize).min(last)] += 100.0 / values.len() as f64);
    bins.into_iter()
        .enumerate()
        .map(|(i, share)| (0.25 * i as f64 + 0.125, share))
        .collect()
}

/// The nearer and the farther half of the matches with truth; `None` without truth.
fn halves(frame: &Frame) -> Result<Option<[MeanMedian; 2]>> {
    let Some(truth) = &frame.truth else {
        return Ok(None);
    };
    let matches = Correlated::new(&frame.pair)?.matches;
    let known = |v: Valid| {
        Some((truth.disparity.get(v.at.0, v.at.1), v.ln_ssdpi)).filter(|(d, _)| d.is_finite())
    };
    let mut known: Vec<(f32, f64)> = valid(&matches).filter_map(known).collect();
    known.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (near, far) = known.split_at(known.len() / 2);
    let spread =
        |half: &[(f32, f64)]| MeanMedian::from_values(half.iter().map(|(_, ln_ssdpi)| *ln_ssdpi));
    Ok(spread(near).zip(spread(far)).map(<[MeanMedian; 2]>::from))
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
