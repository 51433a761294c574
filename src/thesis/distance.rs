//! Figure 5.1: the distance curve, from the thesis's measurements and from a simulated target.

use super::{Context, Experiment, Finding, TableValue, stage};
use svl_core::Result;
use svl_core::depth::DistanceCurve;
use svl_core::statistics::lower_median;
use svl_core::stereo::{Cell, GridShape};
use svl_report::plot::{Chart, distance_chart};
use svl_score::judge::{Judge, Judged};
use svl_sim::arena::ArenaConfig;

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
    records: false,
    run,
};

/// Largest relative error of a curve's distance.
const TOLERANCE: f64 = 0.10;

/// The nearest target's disparity is 81, one beyond the thesis's search.
const ALGORITHM: &str = "v3:max_disparity=96";

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let target = MeasuredTarget::new(context)?;
    let curves = Curves::new(&target)?;
    let mut finding = Finding::default();
    curves.add_conditions(target.off_px, &mut finding);
    let (farthest, nearest) = (target.points.first(), target.points.last());
    finding.quantity("target at 16 cm", "px", "81", nearest.map(|(_, px)| *px));
    finding.quantity("target at 130 cm", "px", "11", farthest.map(|(_, px)| *px));
    curves.add_table(&target, &mut finding);
    finding.why = curves.why(&target);
    finding.plot(&curves.chart(target));
    Ok(finding)
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
        config.rig.baseline_m = product_cm_px / 100.0 / focal_px(&config);
        let mut frames = Vec::new();
        for (cm, _) in table {
            config.world.blocks = vec![stage::block(cm / 100.0, 0.0, [0.8, 0.1, 1.0], 0.0)];
            frames.push(context.still(&config)?);
        }
        let judge = Judge {
            grid: SHAPE.into(),
            ..Judge::default()
        };
        let judged = context.judged(frames, &[ALGORITHM], &judge)?;
        let mut points = Vec::new();
        let mut off_px: f64 = 0.0;
        for ((cm, _), judged) in table.into_iter().zip(&judged) {
            let true_px = product_cm_px / cm;
            match target_px(judged, true_px) {
                Some(px) => {
                    off_px = off_px.max((px - true_px).abs());
                    points.push((cm, px));
                }
                // A target that cannot be measured fails the condition.
                None => off_px = f64::INFINITY,
            }
        }
        Ok(Self {
            product_cm_px,
            points,
            off_px,
        })
    }
}

/// The curves of degree 5 and their errors. An error is relative, with the disparity at which it
/// occurs.
struct Curves {
    thesis: DistanceCurve,
    ours: DistanceCurve,
    /// Largest error of the thesis's curve at its own measurements.
    at_points: (f64, f64),
    /// Largest increase of the thesis's curve with increasing disparity.
    rise_cm: f64,
    /// Largest error of the other curve, also between the measurements.
    between: (f64, f64),
}

impl Curves {
    fn new(target: &MeasuredTarget) -> Result<Self> {
        let thesis = DistanceCurve::annex_b()?;
        let ours = DistanceCurve::fit(&target.points)?;
        let true_points = ours.points().into_iter();
        let true_points = true_points.map(|(px, _)| (target.product_cm_px / px, px));
        Ok(Self {
            at_points: worst(DistanceCurve::TABLE_B1.into_iter(), &thesis),
            rise_cm: largest_rise_cm(thesis.points().into_iter().map(|(_, cm)| cm)),
            between: worst(true_points, &ours),
            thesis,
            ours,
        })
    }

    fn add_conditions(&self, off_px: f64, finding: &mut Finding) {
        let ((at_points, at_px), (between, between_px)) = (self.at_points, self.between);
        let rise_cm = self.rise_cm;
        finding.condition(
            at_points <= TOLERANCE,
            format!(
                "The thesis's curve passes within 10 % of each of its own measurements: at worst \
                 {:.1} %, at {at_px:.0} px.",
                100.0 * at_points
            ),
        );
        finding.condition(
            rise_cm <= 1.0,
            format!(
                "A larger disparity is never farther, by more than 1 cm: the thesis's curve rises \
                 by {rise_cm:.1} cm."
            ),
        );
        finding.condition(
            off_px <= 1.0,
            format!(
                "The simulated target is measured within 1 px at every distance: at worst \
                 {off_px:.2} px off."
            ),
        );
        finding.condition(
            between <= TOLERANCE,
            format!(
                "The curve through the simulated measurements is within 10 % of the true distance \
                 between them too: at worst {:.0} % off, at {between_px:.0} px.",
                100.0 * between
            ),
        );
    }

    fn add_table(&self, target: &MeasuredTarget, finding: &mut Finding) {
        let rows = finding.table([
            "distance, cm",
            "thesis: disparity, px",
            "thesis: its curve there, cm",
            "here: true disparity, px",
            "here: disparity, px",
            "here: its curve there, cm",
        ]);
        for (cm, px) in DistanceCurve::TABLE_B1 {
            let found = target.points.iter().find(|(at, _)| *at == cm);
            let found = found.map(|(_, px)| *px);
            let curve = found.and_then(|px| self.ours.distance_cm(px));
            let here = [Some(target.product_cm_px / cm), found, curve].map(TableValue::from);
            let [true_px, found, curve] = here;
            let thesis_cm = self.thesis.distance_cm(px).into();
            rows.row(
                format!("{cm:.0}"),
                [px.into(), thesis_cm, true_px, found, curve],
            );
        }
    }

    fn why(&self, target: &MeasuredTarget) -> String {
        let pinhole = DistanceCurve::TABLE_B1
            .iter()
            .map(|(cm, px)| (target.product_cm_px / px - cm).abs() / cm)
            .fold(0.0, f64::max);
        format!(
            "A target's disparity fixes its distance to within {:.1} px, but degree 5 swings \
             between the near measurements: the thesis's own curve rises by {:.0} cm where it \
             should fall, and the one through the simulated target is {:.0} % off at {:.0} px. \
             f·B/d cannot swing, and is at most {:.0} % off at the thesis's own measurements.",
            target.off_px,
            self.rise_cm,
            100.0 * self.between.0,
            self.between.1,
            100.0 * pinhole
        )
    }

    fn chart(&self, target: MeasuredTarget) -> Chart {
        // Half-pixel steps from 9 to 90 px, the range of the plot.
        let steps_px = (18..=180).map(|i| 0.5 * f64::from(i));
        let pinhole = steps_px.map(|px| (px, target.product_cm_px / px)).collect();
        distance_chart(
            vec![
                ("thesis, degree 5".into(), self.thesis.points()),
                ("svl, degree 5".into(), self.ours.points()),
                ("f·B/d".into(), pinhole),
            ],
            vec![
                ("thesis, measured".into(), DistanceCurve::TABLE_B1.to_vec()),
                ("svl, simulated".into(), target.points),
            ],
        )
    }
}

const SHAPE: GridShape = GridShape {
    columns: 6,
    rows: 3,
};

/// The f·B, in cm·px, that best fits disparities at those distances.
fn pinhole_cm_px(pairs: &[(f64, f64)]) -> f64 {
    let (above, below) = pairs.iter().fold((0.0, 0.0), |(a, b), (cm, px)| {
        (a + px / cm, b + 1.0 / (cm * cm))
    });
    above / below
}

fn focal_px(config: &ArenaConfig) -> f64 {
    0.5 * config.rig.width_px as f64 / (0.5 * config.rig.field_of_view_deg.to_radians()).tan()
}

/// The median of the medians of the cells that show the target; `None` for less than three.
fn target_px(judged: &Judged, true_px: f64) -> Option<f64> {
    let truth = judged.true_cells.as_ref()?.grid();
    let grid = &judged.estimates.first()?.estimate.grid;
    let near = |px: f32| (f64::from(px) - true_px).abs() < 0.5;
    // Both percentiles match the target's disparity: the cell shows nothing else.
    let shows = |cell: &Cell| cell.depth.is_some_and(|d| near(d.p20_px) && near(d.p80_px));
    let cells = grid
        .iter()
        .zip(truth.iter())
        .filter(|(_, (_, truth))| shows(truth));
    let medians: Vec<f64> = cells
        .filter_map(|((_, cell), _)| Some(f64::from(cell.depth?.median_px)))
        .collect();
    (medians.len() >= 3).then(|| lower_median(medians))?
}

/// The largest relative error of the curve over pairs of true distance and disparity, and the
/// disparity at which it occurs.
fn worst(pairs: impl Iterator<Item = (f64, f64)>, curve: &DistanceCurve) -> (f64, f64) {
    let error = |(cm, px): (f64, f64)| Some(((curve.distance_cm(px)? - cm).abs() / cm, px));
    pairs.filter_map(error).fold(
        (0.0, 0.0),
        |worst, next| if next.0 > worst.0 { next } else { worst },
    )
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
