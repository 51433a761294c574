//! Figure 5.11: windows per hash value in v4's table, and windows compared per look-up.

use super::measure::{gray_picture, percent};
use super::{Context, Experiment, Finding, TableValue, stage};
use svl_core::Result;
use svl_core::kernel::{NO_SUM, isa, window_sums};
use svl_core::matcher::stage::{DogTexture, TextureFilter, VerticalSmoothing};
use svl_core::stereo::{Gray, Plane, StereoPair};
use svl_report::plot::{Axis, Chart, Series, SeriesStyle};

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
    records: false,
    run,
};

/// Hash values: nine pixels of at most 255.
const SUMS: usize = 9 * 255 + 1;
/// v4's defaults.
const SUM_TOLERANCE: usize = 150;
const ROW_TOLERANCE: usize = 2;
const DISPARITIES: usize = 81;

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let mut config = stage::empty();
    config.rig.above_floor_m = 0.5;
    config.world.blocks = vec![stage::block(0.6, 0.0, [2.0, 0.1, 1.5], 0.0)];
    let frame = context.still(&config)?;
    let wall = occupancy(&frame.pair)?;
    let mut finding = Finding::default();
    finding.show(gray_picture("the forest wall", frame.pair.left())?);
    let (mean, met, compared) = (wall.mean(), wall.met, wall.compared);
    let times = wall.times();
    add_counts(&wall, &mut finding);
    let mut curves = vec![Series::new("forest wall", SeriesStyle::Line, wall.points())];
    let mut rows = vec![("arena, forest wall".to_owned(), wall.values())];
    let real = context.real().collect::<Result<Vec<_>>>()?;
    for (i, frame) in real.iter().enumerate() {
        context.step()?;
        let scene = occupancy(&frame.pair)?;
        let name = frame.name.clone().unwrap_or_default();
        rows.push((name.clone(), scene.values()));
        // One real curve suffices to compare shapes; the table has all scenes.
        if i == 0 {
            curves.push(Series::new(&name, SeriesStyle::Line, scene.points()));
        }
    }
    let table = finding.table([
        "view",
        "textured windows, %",
        "per hash value, mean",
        "met by a look-up",
        "compared",
        "times those of a scan",
    ]);
    rows.into_iter()
        .for_each(|(name, values)| table.row(name, values));
    finding.why = format!(
        "A value holds {mean:.1} windows in the mean (thesis: 6, as if {:.0} % of them were \
         textured; here {:.0} % are) and a look-up meets {met:.0} (1800), but close by are {:.2} \
         % of them and not 20 %: v4 compares {compared:.1} windows, {times:.2} times those of a \
         scan and not 4.",
        // The thesis's mean of 6 yields its number of textured windows, as both tables have equally
        // many hash values.
        6.0 / mean * wall.textured_percent,
        wall.textured_percent,
        100.0 * compared / met
    );
    finding.plot(&Chart {
        title: "Windows per hash value".into(),
        x: Axis::new("hash value: sum of nine pixels").with_range(0.0, SUMS as f64),
        y: Axis::new("textured windows"),
        series: curves,
    });
    Ok(finding)
}

/// The conditions and quantities of the wall.
fn add_counts(wall: &Occupancy, finding: &mut Finding) {
    let (mean, met, compared) = (wall.mean(), wall.met, wall.compared);
    let times = wall.times();
    finding.condition(
        (3.0..=12.0).contains(&mean),
        format!("A value holds about six windows in the mean, within a factor of two: {mean:.1}."),
    );
    finding.condition(
        (900.0..=3600.0).contains(&met),
        format!(
            "A look-up within ±150 meets about 1800 windows, within a factor of two: {met:.0}."
        ),
    );
    finding.condition(
        (2.0..=8.0).contains(&times),
        format!(
            "v4 compares about four times as many windows as a scan of 81, within a factor of \
             two: {compared:.1}, {times:.2} times as many."
        ),
    );
    finding.quantity("windows per hash value, mean", "", "6", mean);
    finding.quantity("windows per hash value, most", "", "", wall.most());
    finding.quantity("hash values in use", "%", "", wall.used());
    finding.quantity("windows met by a look-up within ±150", "", "1800", met);
    finding.quantity("of them close by", "%", "20", 100.0 * compared / met);
    finding.quantity("windows compared", "", "360", compared);
    finding.quantity("times those of a scan", "", "4", times);
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
    fn mean(&self) -> f64 {
        self.buckets.iter().sum::<usize>() as f64 / SUMS as f64
    }

    /// Windows compared, over those of a scan along the row: one per disparity.
    fn times(&self) -> f64 {
        self.compared / DISPARITIES as f64
    }

    fn values(&self) -> [TableValue; 5] {
        [
            self.textured_percent,
            self.mean(),
            self.met,
            self.compared,
            self.times(),
        ]
        .map(TableValue::from)
    }

    fn most(&self) -> f64 {
        self.buckets.iter().max().map_or(0.0, |&most| most as f64)
    }

    fn used(&self) -> Option<f64> {
        percent(self.buckets.iter().filter(|&&n| n > 0).count(), SUMS)
    }

    fn points(&self) -> Vec<(f64, f64)> {
        self.buckets
            .iter()
            .enumerate()
            .map(|(sum, &n)| (sum as f64, n as f64))
            .collect()
    }
}

fn occupancy(pair: &StereoPair) -> Result<Occupancy> {
    let (width, height) = pair.size();
    let (isa, smoothing) = (isa()?, VerticalSmoothing::new(1.0));
    let smooth = |image: &Gray| {
        let mut smooth = Gray::filled(width, height, 0)?;
        smoothing.apply(isa, image, &mut smooth);
        Ok::<_, svl_core::Error>(smooth)
    };
    let (left, right) = (smooth(pair.left())?, smooth(pair.right())?);
    let mut textured = Plane::filled(width, height, false)?;
    DogTexture::new(0.4, 3.35).apply(isa, &left, &mut textured);
    let left = sums(&left, &textured)?;
    // v4 filters the texture of the left image only: every right window is looked up.
    let right = sums(&right, &Plane::filled(width, height, true)?)?;
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
    left.pixels()
        .filter(|&sum| sum != NO_SUM)
        .for_each(|sum| buckets[usize::from(sum)] += 1);
    // below[s]: windows with a sum below s. The number of windows in a range of sums is then one
    // difference, instead of a sum over 301 buckets per look-up.
    let mut below = vec![0usize; SUMS + 1];
    for (sum, n) in buckets.iter().enumerate() {
        below[sum + 1] = below[sum] + n;
    }
    let (mut lookups, mut met, mut compared) = (0usize, 0usize, 0usize);
    for y in 0..right.height() {
        let rows = y.saturating_sub(ROW_TOLERANCE)..left.height().min(y + ROW_TOLERANCE + 1);
        for (x, &sum) in right
            .row(y)
            .iter()
            .enumerate()
            .filter(|(_, sum)| **sum != NO_SUM)
        {
            let from = usize::from(sum).saturating_sub(SUM_TOLERANCE);
            let to = (usize::from(sum) + SUM_TOLERANCE + 1).min(SUMS);
            lookups += 1;
            met += below[to] - below[from];
            // The left window of a match is to the right of the right one, by its disparity.
            let columns = x..left.width().min(x + DISPARITIES);
            let near = |row: usize| {
                left.row(row)[columns.clone()]
                    .iter()
                    .filter(|s| (from..to).contains(&usize::from(**s)))
            };
            compared += rows.clone().map(|row| near(row).count()).sum::<usize>();
        }
    }
    let mean = |n: usize| {
        if lookups == 0 {
            0.0
        } else {
            n as f64 / lookups as f64
        }
    };
    // A window of nine pixels does not fit at the four columns of each end.
    let windows = left.width().saturating_sub(8) * left.height();
    let textured_percent = percent(buckets.iter().sum(), windows).unwrap_or(f64::NAN);
    Occupancy {
        textured_percent,
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
