//! Figure 5.11: windows per hash value in v4's table, and windows compared per look-up.

use super::checks::{dog_texture, smoothed, textured};
use super::measure::percent;
use super::{Context, Experiment, Finding, stage};
use svl_core::Result;
use svl_core::kernel::{NO_SUM, window_sums};
use svl_core::stereo::{Gray, Plane, StereoPair};
use svl_report::plot::{Axis, Series, SeriesStyle};

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["5.11"],
    place: "Figure 5.11",
    title: "Hash occupancy",
    claim: "A table holds the left windows by the sum of their nine pixels. A hash value has six \
            windows on average. A look-up within ±150 meets 1800 windows, 20 % of them close by, \
            so v4 compares 360 windows where a scan compares 81 (section 5.3.4).",
    method: "Smoothing and texture filter as in v4, then the sums of all textured windows. \
             Windows are close by when v4 would compare them: disparity 0 to 80, at most 2 rows \
             apart. The thesis does not give these limits. The view is what the thesis asks for, \
             neither dark nor bright and full of texture: a forest wall 0.6 m ahead.",
    run,
};

/// Hash values: nine pixels of at most 255.
const SUMS: usize = 9 * 255 + 1;
/// v4's defaults.
const SUM_TOLERANCE: usize = 150;
const ROW_TOLERANCE: usize = 2;
const DISPARITIES: usize = 81;

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let mut config = stage::empty();
    config.rig.above_floor_m = 0.5;
    config.world.blocks = vec![stage::block(0.6, 0.0, [2.0, 0.1, 1.5], 0.0)];
    let frame = context.frame(&config, 0)?;
    let wall = occupancy(&frame.pair)?;
    finding.image("the forest wall", frame.pair.left())?;
    conclude(&wall, finding);
    let mut views = vec![("arena, forest wall".to_owned(), wall)];
    views.extend(context.in_real_scenes(|frame| occupancy(&frame.pair))?);
    // One real curve suffices to compare shapes; the table has all scenes.
    let curves = views.iter().take(2).map(|(name, view)| {
        let points = view.buckets.iter().enumerate();
        let points = points.map(|(sum, &n)| (sum as f64, n as f64));
        let name = name.trim_start_matches("arena, ");
        Series::new(name, SeriesStyle::Line, points)
    });
    let x = Axis::new("hash value: sum of nine pixels").with_range(0.0, SUMS as f64);
    let axes = [x, Axis::new("textured windows")];
    finding.chart("Windows per hash value", axes, curves);
    let rows = views.into_iter().map(|(name, view)| (name, view.values()));
    let heads = "view | textured windows, % | per hash value, mean | met by a look-up | compared | \
                 times those of a scan";
    finding.table(heads, rows);
    Ok(())
}

/// Adds the results of the wall.
fn conclude(wall: &Occupancy, finding: &mut Finding) {
    let [textured, mean, met, compared, times] = wall.values();
    let is_about = |ours, thesis| (0.5 * thesis..=2.0 * thesis).contains(&ours);
    finding.condition(is_about(mean, 6.0)).says(format!(
        "A value holds about six windows in the mean, within a factor of two: {mean:.1}."
    ));
    finding.condition(is_about(met, 1800.0)).says(format!(
        "A look-up within ±150 meets about 1800 windows, within a factor of two: {met:.0}."
    ));
    finding.condition(is_about(times, 4.0)).says(format!(
        "v4 compares about four times as many windows as a scan of 81, within a factor of two: \
         {compared:.1}, {times:.2} times as many."
    ));
    let most = wall.buckets.iter().max().map_or(0.0, |&most| most as f64);
    let used = percent(wall.buckets.iter().filter(|&&n| n > 0).count(), SUMS);
    let near = 100.0 * compared / met;
    finding.quantity("windows per hash value, mean", "", "6", mean);
    finding.quantity("windows per hash value, most", "", "", most);
    finding.quantity("hash values in use", "%", "", used);
    finding.quantity("windows met by a look-up within ±150", "", "1800", met);
    finding.quantity("of them close by", "%", "20", near);
    finding.quantity("windows compared", "", "360", compared);
    finding.quantity("times those of a scan", "", "4", times);
    // The thesis's mean of 6 yields its number of textured windows, as both tables have equally
    // many hash values.
    let textured_in_thesis = 6.0 / mean * textured;
    finding.why = format!(
        "A value holds {mean:.1} windows in the mean (thesis: 6, as if {textured_in_thesis:.0} % \
         of them were textured; here {textured:.0} % are) and a look-up meets {met:.0} (1800), \
         but close by are {near:.2} % of them and not 20 %: v4 compares {compared:.1} windows, \
         {times:.2} times those of a scan and not 4."
    );
}

struct Occupancy {
    /// Per cent of all windows of the left image.
    textured_percent: f64,
    /// Windows per sum.
    buckets: Vec<usize>,
    /// Windows per look-up of the right image, on average: within the tolerance of sums,
    met: f64,
    /// and near enough to be compared.
    compared: f64,
}

impl Occupancy {
    /// Columns of the table: the last is windows compared, over those of a scan along the row, one
    /// per disparity.
    fn values(&self) -> [f64; 5] {
        let mean = self.buckets.iter().sum::<usize>() as f64 / SUMS as f64;
        let times = self.compared / DISPARITIES as f64;
        [self.textured_percent, mean, self.met, self.compared, times]
    }
}

fn occupancy(pair: &StereoPair) -> Result<Occupancy> {
    let (left, right) = (smoothed(pair.left())?, smoothed(pair.right())?);
    let left = sums(&left, &textured(&dog_texture(), &left)?)?;
    // v4 filters the texture of the left image only: every right window is looked up.
    let right = sums(&right, &right.map(|_| true))?;
    Ok(count(&left, &right))
}

fn sums(image: &Gray, marked: &Plane<bool>) -> Result<Plane<u16>> {
    let mut sums = Plane::filled(image.width(), image.height(), NO_SUM)?;
    (0..image.height()).for_each(|y| window_sums(image.row(y), marked.row(y), sums.row_mut(y)));
    Ok(sums)
}

/// Counts the windows of the left image that each window of the right one finds and compares.
fn count(left: &Plane<u16>, right: &Plane<u16>) -> Occupancy {
    let mut buckets = vec![0; SUMS];
    for sum in left.pixels().filter(|&sum| sum != NO_SUM) {
        buckets[usize::from(sum)] += 1;
    }
    // below[s]: windows with a sum below s. The number of windows in a range of sums is then one
    // difference, instead of a sum over 301 buckets per look-up.
    let mut below = vec![0usize; SUMS + 1];
    for (sum, n) in buckets.iter().enumerate() {
        below[sum + 1] = below[sum] + n;
    }
    let (mut lookups, mut met, mut compared) = (0usize, 0usize, 0usize);
    for y in 0..right.height() {
        let rows = y.saturating_sub(ROW_TOLERANCE)..left.height().min(y + ROW_TOLERANCE + 1);
        let sums = right.row(y).iter().enumerate();
        for (x, &sum) in sums.filter(|(_, sum)| **sum != NO_SUM) {
            let from = usize::from(sum).saturating_sub(SUM_TOLERANCE);
            let to = (usize::from(sum) + SUM_TOLERANCE + 1).min(SUMS);
            lookups += 1;
            met += below[to] - below[from];
            // The left window of a match is to the right of the right one, by its disparity.
            let columns = x..left.width().min(x + DISPARITIES);
            for row in rows.clone() {
                let sums = left.row(row)[columns.clone()].iter();
                let near = sums.filter(|sum| (from..to).contains(&usize::from(**sum)));
                compared += near.count();
            }
        }
    }
    let mean = |n: usize| n as f64 / lookups.max(1) as f64;
    // A window of nine pixels does not fit at the four columns of each end.
    let windows = left.width().saturating_sub(8) * left.height();
    Occupancy {
        textured_percent: percent(buckets.iter().sum(), windows),
        buckets,
        met: mean(met),
        compared: mean(compared),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_ups_are_counted_by_sum_row_and_disparity() {
        let plane = |sums: [[u16; 3]; 4]| Plane::from_vec(3, 4, sums.concat()).unwrap();
        const N: u16 = NO_SUM;
        let left = plane([[100, 250, N], [N, N, 251], [N, N, N], [100, N, N]]);
        // One window: among the four on the left, three are within 150 of 100, two of them at most
        // 2 rows away.
        let right = plane([[100, N, N], [N, N, N], [N, N, N], [N, N, N]]);
        let counted = count(&left, &right);
        assert_eq!(
            (counted.met, counted.compared, counted.buckets[100]),
            (3.0, 2.0, 2)
        );
        // To the right of its match: a negative disparity is not compared.
        let right = plane([[N, N, 100], [N, N, N], [N, N, N], [N, N, N]]);
        assert_eq!(
            (count(&left, &right).met, count(&left, &right).compared),
            (3.0, 0.0)
        );
    }
}
