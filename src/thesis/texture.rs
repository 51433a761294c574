//! Figure 5.5: the difference-of-Gaussians filter along a row.

use super::checks::{DELTA, SIGMA, dog_texture, smoothed, textured};
use super::measure::{mean_and_median, percent};
use super::{Context, Experiment, Finding};
use svl_core::Result;
use svl_core::matcher::stage::{DeviationTexture, TextureFilter};
use svl_core::stereo::{Gray, Plane};
use svl_report::plot::{Axis, Series, SeriesStyle};
use svl_sim::arena::ArenaConfig;

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
    run,
};

const DEVIATION: f64 = 4.0;
/// Frame of the arena's run, and row of its image.
const VIEW: u64 = 20;
const ROW: usize = 112;

/// Columns of the table.
const HEADS: &str = "view | pixels dropped, % | median contrast of what is kept, grey levels | \
                     of what is dropped, grey levels | answers that half the brightness changes, \
                     % | the same of the standard deviation, %";

/// Values under [`HEADS`].
type Filtered = [f64; 5];

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let frame = context.frame(&ArenaConfig::default(), VIEW)?;
    let left = smoothed(frame.pair.left())?;
    let kept = textured(&dog_texture(), &left)?;
    let mut views = vec![("arena".to_owned(), compared(&left)?)];
    views.extend(context.in_real_scenes(|frame| compared(&smoothed(frame.pair.left())?))?);
    let dropped = kept.row(ROW).iter().filter(|kept| !**kept).count();
    conclude(percent(dropped, left.width()), &views, finding);
    finding.table(HEADS, views);
    plot(left.row(ROW), kept.row(ROW), finding);
    let masked = Plane::from_fn(left.width(), left.height(), |x, y| {
        left.get(x, y) * u8::from(kept.get(x, y))
    })?;
    finding.image("the view, vertically smoothed", &left)?;
    finding.image("what the filter keeps", &masked)
}

/// Adds the conditions of the arena, the first view, of whose row `row_percent` are dropped, and of
/// the real scenes.
fn conclude(row_percent: f64, views: &[(String, Filtered)], finding: &mut Finding) {
    let is_flat = |[_, kept, dropped, ..]: Filtered| dropped <= 0.5 * kept;
    let is_steady = |[.., dog, deviation]: Filtered| dog < deviation;
    let (arena, real) = (views[0].1, &views[1..]);
    let [image_percent, kept, dropped, dog, deviation] = arena;
    finding.why = format!(
        "The filter drops {row_percent:.0} % of the row and {image_percent:.0} % of the image, \
         where the median contrast is {dropped:.1} grey levels against {kept:.1} in what it \
         keeps; half the brightness changes {dog:.1} % of its answers, and {deviation:.1} % of \
         the standard deviation's."
    );
    finding.condition(is_flat(arena)).says(format!(
        "In the arena what is dropped has at most half the contrast of what is kept, by their \
         medians: {dropped:.1} and {kept:.1} grey levels."
    ));
    finding.condition(is_steady(arena)).says(format!(
        "In the arena half the brightness changes fewer answers than the standard deviation's: \
         {dog:.1} % against {deviation:.1} % of the pixels."
    ));
    if !real.is_empty() {
        let count = |is: fn(_) -> bool| real.iter().filter(|(_, values)| is(*values)).count();
        let (flat, steady, scenes) = (count(is_flat), count(is_steady), real.len());
        finding.condition(2 * flat > scenes && 2 * steady > scenes).says(format!(
            "So it is in most real scenes: the contrast in {flat}, the brightness in {steady} of \
             {scenes}."
        ));
    }
}

fn plot(row: &[u8], kept: &[bool], finding: &mut Finding) {
    let line = |name: &str, values: Vec<f64>| {
        let points = (0..).map(f64::from).zip(values);
        Series::new(name, SeriesStyle::Line, points)
    };
    let x = || Axis::new("x, px").with_range(0.0, row.len() as f64);
    let y = Axis::new("grey level").with_range(0.0, 255.0);
    let levels = row.iter().map(|&level| f64::from(level)).collect();
    finding.chart("A row of the image", [x(), y], [line("", levels)]);
    let y = Axis::new("response, grey levels");
    let [fine, coarse] = responses(row);
    let curves = [line("fine", fine), line("coarse", coarse)];
    finding.chart("Differences of Gaussians", [x(), y], curves);
    let y = Axis::new("scale").with_range(0.0, 3.0);
    let scales = kept.iter().map(|&kept| if kept { 1.0 } else { 2.0 });
    let scales = [line("", scales.collect())];
    let title = "Scale of the stronger response: 2 is dropped";
    finding.chart(title, [x(), y], scales);
}

/// The effect on an image of the filter and of the standard deviation.
fn compared(image: &Gray) -> Result<Filtered> {
    let (width, height) = image.size();
    let kept = textured(&dog_texture(), image)?;
    // Windows of 1 x 9 that lie inside the image.
    let windows = (0..height).flat_map(|y| (4..width.saturating_sub(4)).map(move |x| (x, y)));
    let contrast = |is_kept: bool| {
        let windows = windows.clone().filter(|&(x, y)| kept.get(x, y) == is_kept);
        let windows = windows.map(|(x, y)| deviation_of(&image.row(y)[x - 4..=x + 4]));
        mean_and_median(windows)[1]
    };
    // Integer halving, like the quantization of a camera with half the exposure.
    let dark = image.map(|v| v / 2);
    let changes = |filter: &dyn TextureFilter| -> Result<f64> {
        let (bright, dark) = (textured(filter, image)?, textured(filter, &dark)?);
        let changed = bright.pixels().zip(dark.pixels()).filter(|(a, b)| a != b);
        Ok(percent(changed.count(), width * height))
    };
    let dropped = kept.pixels().filter(|kept| !kept).count();
    Ok([
        percent(dropped, width * height),
        contrast(true),
        contrast(false),
        changes(&dog_texture())?,
        changes(&DeviationTexture::new(DEVIATION))?,
    ])
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
        let kept = textured(&dog_texture(), &image).unwrap();
        for y in 0..4 {
            let [fine, coarse] = responses(image.row(y));
            for x in 0..120 {
                let clear = (fine[x] - coarse[x]).abs() > 0.05;
                assert!(
                    !clear || kept.get(x, y) == (fine[x] >= coarse[x]),
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
