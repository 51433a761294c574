//! Figure 5.1: the distance curve, from the thesis's measurements and from a simulated target.

use super::{Context, Experiment, Finding, stage};
use svl_core::Result;
use svl_core::depth::DistanceCurve;
use svl_core::statistics::lower_median;
use svl_core::stereo::Cell;
use svl_report::plot::distance_chart;
use svl_score::judge::Judged;

pub(super) const EXPERIMENT: Experiment = Experiment {
    figures: &["5.1"],
    place: "Figure 5.1",
    title: "Distance at disparity",
    claim: "A polynomial of degree 5, fitted to the disparities of a target measured from 130 cm \
            to 16 cm, gives the distance of every disparity (section 5.1, annex B).",
    method: "A target with a forest picture is placed at the thirteen distances of table B.1 in \
             front of the arena's stereo head. The baseline of the head is chosen so that f·B \
             fits that table best. A measurement is the median of v3's cells (6 x 3) that show \
             the target. It needs at least three such cells, as in the thesis.",
    run,
};

/// Largest relative error of a curve's distance, per cent.
const TOLERANCE: f64 = 10.0;

/// The nearest target's disparity is 81, one beyond the thesis's search.
const ALGORITHM: &str = "v3:max_disparity=96";

fn run(context: &mut Context<'_>, finding: &mut Finding) -> Result<()> {
    let target = MeasuredTarget::new(context)?;
    let thesis = DistanceCurve::annex_b()?;
    let ours = DistanceCurve::fit(&target.points)?;
    conclude([&thesis, &ours], &target, finding);
    let px = |point: Option<&(f64, f64)>| point.map_or(f64::NAN, |(_, px)| *px);
    finding.quantity("target at 16 cm", "px", "81", px(target.points.last()));
    finding.quantity("target at 130 cm", "px", "11", px(target.points.first()));
    let row = |(cm, thesis_px): (f64, f64)| {
        let true_px = target.product_cm_px / cm;
        let found_px = px(target.points.iter().find(|(at, _)| *at == cm));
        let [thesis_cm, found_cm] = [(&thesis, thesis_px), (&ours, found_px)]
            .map(|(curve, px)| curve.distance_cm(px).unwrap_or(f64::NAN));
        let values = [thesis_px, thesis_cm, true_px, found_px, found_cm];
        (format!("{cm:.0}"), values)
    };
    finding.table(
        "distance, cm | thesis: disparity, px | thesis: its curve there, cm | \
         here: true disparity, px | here: disparity, px | here: its curve there, cm",
        DistanceCurve::TABLE_B1.map(row),
    );
    // Half-pixel steps from 9 to 90 px, the range of the plot.
    let steps_px = (18..=180).map(|i| 0.5 * f64::from(i));
    let pinhole = steps_px.map(|px| (px, target.product_cm_px / px)).collect();
    let curves = vec![
        ("thesis, degree 5".into(), thesis.points()),
        ("svl, degree 5".into(), ours.points()),
        ("f·B/d".into(), pinhole),
    ];
    let measured = vec![
        ("thesis, measured".into(), DistanceCurve::TABLE_B1.to_vec()),
        ("svl, simulated".into(), target.points),
    ];
    finding.plots.push(distance_chart(curves, measured).svg());
    Ok(())
}

/// The simulated target at the distances of table B.1.
struct MeasuredTarget {
    /// The f·B of the arena's cameras, which fits the table best.
    product_cm_px: f64,
    /// Distance, cm, and disparity, px, where the target could be measured.
    points: Vec<(f64, f64)>,
    /// Largest error of a disparity; infinite if the target could not be measured somewhere.
    off_px: f64,
}

impl MeasuredTarget {
    fn new(context: &mut Context<'_>) -> Result<Self> {
        let table = DistanceCurve::TABLE_B1;
        let product_cm_px = pinhole_cm_px(&table);
        let mut config = stage::empty();
        // High above the floor, so that no cell shows the floor instead of the target.
        config.rig.above_floor_m = 0.5;
        // f·B in cm·px is fixed by the table and f by the image, so the baseline follows.
        config.rig.baseline_m = product_cm_px / 100.0 / config.rig.rectified()?.focal_px();
        let mut frames = Vec::new();
        for (cm, _) in table {
            config.world.blocks = vec![stage::block(cm / 100.0, 0.0, [0.8, 0.1, 1.0], 0.0)];
            frames.push(context.frame(&config, 0)?);
        }
        let judged = context.judged(frames, &[ALGORITHM], &stage::judge())?;
        let measured = table.iter().zip(&judged);
        let measured =
            measured.map(|((cm, _), judged)| (*cm, target_px(judged, product_cm_px / cm)));
        // A target that cannot be measured fails the condition.
        let off_px = |(cm, px): (f64, Option<f64>)| {
            px.map_or(f64::INFINITY, |px| (px - product_cm_px / cm).abs())
        };
        Ok(Self {
            product_cm_px,
            off_px: measured.clone().map(off_px).fold(0.0, f64::max),
            points: measured.filter_map(|(cm, px)| Some((cm, px?))).collect(),
        })
    }
}

/// Adds the results of the thesis's curve of degree 5 and of the one through the simulated target.
fn conclude(curves: [&DistanceCurve; 2], target: &MeasuredTarget, finding: &mut Finding) {
    let [thesis, ours] = curves;
    let table = DistanceCurve::TABLE_B1.into_iter();
    let (at_points, at_px) = worst(table.clone(), |px| thesis.distance_cm(px));
    finding.condition(at_points <= TOLERANCE).says(format!(
        "The thesis's curve passes within 10 % of each of its own measurements: at worst \
         {at_points:.1} %, at {at_px:.0} px."
    ));
    let rise_cm = largest_rise_cm(thesis.points().into_iter().map(|(_, cm)| cm));
    finding.condition(rise_cm <= 1.0).says(format!(
        "A larger disparity is never farther, by more than 1 cm: the thesis's curve rises by \
         {rise_cm:.1} cm."
    ));
    let off_px = target.off_px;
    finding.condition(off_px <= 1.0).says(format!(
        "The simulated target is measured within 1 px at every distance: at worst {off_px:.2} px \
         off."
    ));
    let product_cm_px = target.product_cm_px;
    let between = ours.points().into_iter();
    let between = between.map(|(px, _)| (product_cm_px / px, px));
    let (between, between_px) = worst(between, |px| ours.distance_cm(px));
    finding.condition(between <= TOLERANCE).says(format!(
        "The curve through the simulated measurements is within 10 % of the true distance between \
         them too: at worst {between:.0} % off, at {between_px:.0} px."
    ));
    let (pinhole, _) = worst(table, |px| Some(product_cm_px / px));
    finding.why = format!(
        "A target's disparity fixes its distance to within {off_px:.1} px, but degree 5 swings \
         between the near measurements: the thesis's own curve rises by {rise_cm:.0} cm where it \
         should fall, and the one through the simulated target is {between:.0} % off at \
         {between_px:.0} px. f·B/d cannot swing, and is at most {pinhole:.0} % off at the \
         thesis's own measurements."
    );
}

/// The f·B, in cm·px, that best fits disparities at those distances.
fn pinhole_cm_px(pairs: &[(f64, f64)]) -> f64 {
    let above: f64 = pairs.iter().map(|(cm, px)| px / cm).sum();
    let below: f64 = pairs.iter().map(|(cm, _)| 1.0 / (cm * cm)).sum();
    above / below
}

/// The median of the medians of the cells that show the target; `None` for less than three.
fn target_px(judged: &Judged, true_px: f64) -> Option<f64> {
    let truth = judged.true_cells.as_ref()?.grid();
    let grid = &judged.estimates.first()?.estimate.grid;
    let near = |px: f32| (f64::from(px) - true_px).abs() < 0.5;
    // Both percentiles match the target's disparity: the cell shows nothing else.
    let shows = |cell: &Cell| cell.depth.is_some_and(|d| near(d.p20_px) && near(d.p80_px));
    let cells = grid.iter().zip(truth.iter());
    let medians: Vec<_> = cells
        .filter(|(_, (_, truth))| shows(truth))
        .filter_map(|((_, cell), _)| Some(f64::from(cell.depth?.median_px)))
        .collect();
    (medians.len() >= 3).then(|| lower_median(medians))?
}

/// The largest relative error, per cent, of a curve over pairs of true distance and disparity, and
/// the disparity at which it occurs.
fn worst(
    pairs: impl Iterator<Item = (f64, f64)>,
    distance_cm: impl Fn(f64) -> Option<f64>,
) -> (f64, f64) {
    let errors = pairs.filter_map(|(cm, px)| {
        let error = (distance_cm(px)? - cm).abs() / cm;
        Some((100.0 * error, px))
    });
    let worst = errors.max_by(|a, b| a.0.total_cmp(&b.0));
    worst.unwrap_or_default()
}

/// Largest increase of distance with increasing disparity.
fn largest_rise_cm(distances_cm: impl Iterator<Item = f64>) -> f64 {
    let (mut least, mut rise) = (f64::INFINITY, 0.0f64);
    for cm in distances_cm {
        least = least.min(cm);
        rise = rise.max(cm - least);
    }
    rise
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pinhole_s_product_is_found() {
        let pairs: Vec<(f64, f64)> = [20.0, 50.0, 130.0]
            .iter()
            .map(|cm| (*cm, 1300.0 / cm))
            .collect();
        assert!((pinhole_cm_px(&pairs) - 1300.0).abs() < 1e-9);
    }

    #[test]
    fn rises_are_seen_wherever_they_begin() {
        assert_eq!(largest_rise_cm([130.0, 60.0, 30.0].into_iter()), 0.0);
        assert_eq!(
            largest_rise_cm([130.0, 15.0, 20.0, 18.0, 38.0, 16.0].into_iter()),
            23.0
        );
    }
}
