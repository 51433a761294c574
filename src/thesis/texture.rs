//! Figure 5.5: the difference-of-Gaussians filter along a row.

use super::measure::{MeanMedian, gray_picture, percent};
use super::{Context, Experiment, Finding, TableValue};
use svl_core::Result;
use svl_core::kernel::isa;
use svl_core::matcher::stage::{DeviationTexture, DogTexture, TextureFilter, VerticalSmoothing};
use svl_core::stereo::{Gray, Plane};
use svl_report::plot::{Axis, Chart, Series, SeriesStyle};
use svl_sim::arena::{Arena, ArenaConfig};

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["5.5", "5.4"],
    place: "Figure 5.5",
    title: "Texture quality filter",
    claim: "Where the coarser of two differences of Gaussians has the stronger response, the \
            image is too homogeneous to match. The filter depends less on brightness than the \
            standard deviation does (section 5.3.3).",
    method: "σ 0.4, Δ 3.35, 24 taps, as in figure 5.5, on a vertically smoothed view of the \
             arena's first checkpoint. The row crosses blocks, the gap between them and the \
             arena's wall. Contrast is the standard deviation of a pixel's 1 x 9 window. \"Half \
             as bright\" halves every grey level. The threshold of the standard deviation is \
             v2's, 4 grey levels.",
    records: false,
    run,
};

const SIGMA: f64 = 0.4;
const DELTA: f64 = 3.35;
const DEVIATION: f64 = 4.0;
/// Frame of the arena's run, and row of its image.
const VIEW: u64 = 20;
const ROW: usize = 112;

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let frame = Arena::new(&ArenaConfig::default(), 1)?.frame(VIEW)?;
    context.step()?;
    let left = smoothed(frame.pair.left())?;
    let mut finding = Finding::default();
    let arena = Filtered::new(&left)?;
    let row_kept = arena.kept.row(ROW).iter().filter(|kept| **kept).count();
    let row_percent = percent(left.width() - row_kept, left.width());
    let mut all = vec![("arena".to_owned(), arena)];
    for frame in context.real() {
        let frame = frame?;
        context.step()?;
        let filtered = Filtered::new(&smoothed(frame.pair.left())?)?;
        all.push((frame.name.unwrap_or_default(), filtered));
    }
    let rows = finding.table([
        "view",
        "pixels dropped, %",
        "median contrast of what is kept, grey levels",
        "of what is dropped, grey levels",
        "answers that half the brightness changes, %",
        "the same of the standard deviation, %",
    ]);
    for (name, filtered) in &all {
        rows.row(name, filtered.values());
    }
    add_conditions(&all, &mut finding);
    let arena = &all[0].1;
    finding.why = format!(
        "The filter drops {:.0} % of the row and {:.0} % of the image, where the median contrast \
         is {:.1} grey levels against {:.1} in what it keeps; half the brightness changes {:.1} % \
         of its answers, and {:.1} % of the standard deviation's.",
        row_percent.unwrap_or(0.0),
        arena.dropped_percent,
        arena.dropped_contrast,
        arena.kept_contrast,
        arena.dog_changes,
        arena.deviation_changes
    );
    plots(&mut finding, left.row(ROW), arena.kept.row(ROW));
    finding.show(gray_picture("the view, vertically smoothed", &left)?);
    let masked = Plane::from_fn(left.width(), left.height(), |x, y| {
        if arena.kept.get(x, y) {
            left.get(x, y)
        } else {
            0
        }
    })?;
    finding.show(gray_picture("what the filter keeps", &masked)?);
    Ok(finding)
}

/// The conditions of all views; the first is the arena.
fn add_conditions(all: &[(String, Filtered)], finding: &mut Finding) {
    if let Some((name, filtered)) = all.first() {
        finding.condition(
            filtered.dropped_contrast <= 0.5 * filtered.kept_contrast,
            format!(
                "In the {name} what is dropped has at most half the contrast of what is kept, by \
                 their medians: {:.1} and {:.1} grey levels.",
                filtered.dropped_contrast, filtered.kept_contrast
            ),
        );
        finding.condition(
            filtered.dog_changes < filtered.deviation_changes,
            format!(
                "In the {name} half the brightness changes fewer answers than the standard \
                 deviation's: {:.1} % against {:.1} % of the pixels.",
                filtered.dog_changes, filtered.deviation_changes
            ),
        );
    }
    if let [_, real @ ..] = all
        && !real.is_empty()
    {
        let flatter = real
            .iter()
            .filter(|(_, f)| f.dropped_contrast <= 0.5 * f.kept_contrast)
            .count();
        let steadier = real
            .iter()
            .filter(|(_, f)| f.dog_changes < f.deviation_changes)
            .count();
        finding.condition(
            2 * flatter > real.len() && 2 * steadier > real.len(),
            format!(
                "So it is in most real scenes: the contrast in {flatter}, the brightness in \
                 {steadier} of {}.",
                real.len()
            ),
        );
    }
}

fn plots(finding: &mut Finding, row: &[u8], kept: &[bool]) {
    let line = |name: &str, values: Vec<f64>| {
        let points = values.into_iter().enumerate();
        let points = points.map(|(x, value)| (x as f64, value));
        Series::new(name, SeriesStyle::Line, points)
    };
    let x = || Axis::new("x, px").with_range(0.0, row.len() as f64);
    finding.plot(&Chart {
        title: "A row of the image".into(),
        x: x(),
        y: Axis::new("grey level").with_range(0.0, 255.0),
        series: vec![line("", row.iter().map(|&v| f64::from(v)).collect())],
    });
    let [fine, coarse] = responses(row);
    finding.plot(&Chart {
        title: "Differences of Gaussians".into(),
        x: x(),
        y: Axis::new("response, grey levels"),
        series: vec![line("fine", fine), line("coarse", coarse)],
    });
    let scales = kept.iter().map(|&kept| if kept { 1.0 } else { 2.0 });
    finding.plot(&Chart {
        title: "Scale of the stronger response: 2 is dropped".into(),
        x: x(),
        y: Axis::new("scale").with_range(0.0, 3.0),
        series: vec![line("", scales.collect())],
    });
}

fn smoothed(image: &Gray) -> Result<Gray> {
    let mut smooth = Gray::filled(image.width(), image.height(), 0)?;
    VerticalSmoothing::new(1.0).apply(isa()?, image, &mut smooth);
    Ok(smooth)
}

/// Results of the two filters on an image, in per cent.
struct Filtered {
    kept: Plane<bool>,
    dropped_percent: f64,
    /// Medians of the standard deviations of windows, grey levels.
    kept_contrast: f64,
    dropped_contrast: f64,
    /// Pixels whose result changes if the image is half as bright.
    dog_changes: f64,
    deviation_changes: f64,
}

impl Filtered {
    fn new(image: &Gray) -> Result<Self> {
        let (width, height) = image.size();
        let (isa, dog, deviation) = (
            isa()?,
            DogTexture::new(SIGMA, DELTA),
            DeviationTexture::new(DEVIATION),
        );
        let mask = |image: &Gray, deviating: bool| {
            let mut mask = Plane::filled(width, height, false)?;
            if deviating {
                deviation.apply(isa, image, &mut mask);
            } else {
                dog.apply(isa, image, &mut mask);
            }
            Ok::<_, svl_core::Error>(mask)
        };
        // Integer halving, like the quantization of a camera with half the exposure.
        let dark = image.map(|v| v / 2);
        let kept = mask(image, false)?;
        let contrast = |which: bool| {
            let windows =
                // Windows of 1 x 9 that lie inside the image.
                (0..height).flat_map(|y| (4..width.saturating_sub(4)).map(move |x| (x, y)));
            let windows = windows.filter(|&(x, y)| kept.get(x, y) == which);
            MeanMedian::from_values(
                windows.map(|(x, y)| deviation_of(&image.row(y)[x - 4..=x + 4])),
            )
            .map_or(f64::NAN, |s| s.median)
        };
        let changes = |a: &Plane<bool>, b: &Plane<bool>| {
            let changed = a.pixels().zip(b.pixels()).filter(|(a, b)| a != b).count();
            percent(changed, width * height).unwrap_or(f64::NAN)
        };
        let dropped = kept.pixels().filter(|kept| !kept).count();
        Ok(Self {
            dropped_percent: percent(dropped, width * height).unwrap_or(f64::NAN),
            kept_contrast: contrast(true),
            dropped_contrast: contrast(false),
            dog_changes: changes(&kept, &mask(&dark, false)?),
            deviation_changes: changes(&mask(image, true)?, &mask(&dark, true)?),
            kept,
        })
    }

    fn values(&self) -> [TableValue; 5] {
        [
            self.dropped_percent,
            self.kept_contrast,
            self.dropped_contrast,
            self.dog_changes,
            self.deviation_changes,
        ]
        .map(TableValue::from)
    }
}

fn deviation_of(window: &[u8]) -> f64 {
    let n = window.len() as f64;
    let sum: f64 = window.iter().map(|&v| f64::from(v)).sum();
    let squares: f64 = window.iter().map(|&v| f64::from(v).powi(2)).sum();
    // Rounding can make the variance of equal pixels slightly negative.
    (squares / n - (sum / n).powi(2)).max(0.0).sqrt()
}

/// The fine and the coarse response along a row (annex C), ends replicated.
fn responses(row: &[u8]) -> [Vec<f64>; 2] {
    let gaussian = |sigma: f64, t: f64| {
        (-t * t / (2.0 * sigma * sigma)).exp() / (sigma * (2.0 * std::f64::consts::PI).sqrt())
    };
    let last = row.len() as i64 - 1;
    [0.0, 1.0].map(|scale| {
        // Annex C: scale s is the difference of Gaussians of width σ + s·Δ and σ + (s + 1)·Δ.
        let (a, b) = (SIGMA + scale * DELTA, SIGMA + (scale + 1.0) * DELTA);
        let tap = |x: i64, t: i64| {
            (gaussian(a, t as f64) - gaussian(b, t as f64))
                * f64::from(row[(x + t).clamp(0, last) as usize])
        };
        (0..=last)
            // 24 taps, one more to the left, as in the thesis's loop.
            .map(|x| (-12..=11).map(|t| tap(x, t)).sum::<f64>().abs())
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plotted_responses_are_those_that_decide() {
        let image = Gray::from_fn(120, 4, |x, y| {
            (128.0 + 90.0 * ((x * x + 31 * y) as f64 * 0.01).sin()) as u8
        })
        .unwrap();
        let filtered = Filtered::new(&image).unwrap();
        for y in 0..4 {
            let [fine, coarse] = responses(image.row(y));
            for x in 0..120 {
                let clear = (fine[x] - coarse[x]).abs() > 0.05;
                assert!(
                    !clear || filtered.kept.get(x, y) == (fine[x] >= coarse[x]),
                    "{x} {y}"
                );
            }
        }
    }

    #[test]
    fn contrast_is_a_standard_deviation() {
        assert_eq!((deviation_of(&[7; 9]), deviation_of(&[0, 10])), (0.0, 5.0));
    }
}
