//! Figure 5.1: the distance curve, from the thesis's measurements and from a simulated target.

use super::{Context, Experiment, Finding, TableValue, stage};
use svl_bench::report::plot::distance_chart;
use svl_core::Result;
use svl_core::depth::DistanceCurve;
use svl_core::statistics::lower_median;
use svl_core::stereo::{Cell, GridShape};
use svl_data::arena::ArenaConfig;
use svl_data::score::{Judge, Judged};

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
    by_default: true,
    run,
};

/// Largest relative error of a curve's distance.
const TOLERANCE: f64 = 0.10;

/// The nearest target's disparity is 81, one beyond the thesis's search.
const ALGORITHM: &str = "v3:max_disparity=96";

fn run(context: &mut Context<'_>) -> Result<Finding> {
    let table = DistanceCurve::TABLE_B1;
    let product = pinhole_cm_px(&table);
    let mut config = stage::empty();
    // High above the floor, so that no cell shows the floor instead of the target.
    config.rig.above_floor_m = 0.5;
    // f·B in cm·px is fixed by the table and f by the image, so the baseline follows.
    config.rig.baseline_m = product / 100.0 / focal_px(&config);
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
    let mut measured = Vec::new();
    let mut off_px: f64 = 0.0;
    for ((cm, _), judged) in table.into_iter().zip(&judged) {
        let true_px = product / cm;
        match target_px(judged, true_px) {
            Some(px) => {
                off_px = off_px.max((px - true_px).abs());
                measured.push((cm, px));
            }
            // A target that cannot be measured fails the condition.
            None => off_px = f64::INFINITY,
        }
    }

    let mut finding = Finding::default();
    let thesis = DistanceCurve::annex_b()?;
    let ours = DistanceCurve::fit(&measured)?;
    let at_points = worst(table.into_iter(), &thesis);
    let rise_cm = largest_rise_cm(thesis.points().into_iter().map(|(_, cm)| cm));
    let between = worst(
        ours.points().into_iter().map(|(px, _)| (product / px, px)),
        &ours,
    );

    finding.condition(
        at_points.0 <= TOLERANCE,
        format!(
            "The thesis's curve passes within 10 % of each of its own measurements: at worst \
             {:.1} %, at {:.0} px.",
            100.0 * at_points.0,
            at_points.1
        ),
    );
    finding.condition(
        rise_cm <= 1.0,
        format!(
            "A larger disparity is never farther, by more than 1 cm: the thesis's curve rises by \
             {rise_cm:.1} cm."
        ),
    );
    finding.condition(
        off_px <= 1.0,
        format!(
            "The simulated target is measured within 1 px at every distance: at worst {off_px:.2} \
             px off."
        ),
    );
    finding.condition(
        between.0 <= TOLERANCE,
        format!(
            "The curve through the simulated measurements is within 10 % of the true distance \
             between them too: at worst {:.0} % off, at {:.0} px.",
            100.0 * between.0,
            between.1
        ),
    );
    let pinhole = table
        .iter()
        .map(|(cm, px)| (product / px - cm).abs() / cm)
        .fold(0.0, f64::max);
    finding.quantity(
        "target at 16 cm",
        "px",
        "81",
        measured.last().map(|(_, px)| *px),
    );
    finding.quantity(
        "target at 130 cm",
        "px",
        "11",
        measured.first().map(|(_, px)| *px),
    );
    let rows = finding.table([
        "distance, cm",
        "thesis: disparity, px",
        "thesis: its curve there, cm",
        "here: true disparity, px",
        "here: disparity, px",
        "here: its curve there, cm",
    ]);
    for (cm, px) in table {
        let found = measured.iter().find(|(at, _)| *at == cm).map(|(_, px)| *px);
        let curve = found.and_then(|px| ours.distance_cm(px));
        let here = [Some(product / cm), found, curve].map(TableValue::from);
        let [true_px, found, curve] = here;
        rows.row(
            format!("{cm:.0}"),
            [
                px.into(),
                thesis.distance_cm(px).into(),
                true_px,
                found,
                curve,
            ],
        );
    }
    finding.why = format!(
        "A target's disparity fixes its distance to within {off_px:.1} px, but degree 5 swings \
         between the near measurements: the thesis's own curve rises by {rise_cm:.0} cm where it \
         should fall, and the one through the simulated target is {:.0} % off at {:.0} px. f·B/d \
         cannot swing, and is at most {:.0} % off at the thesis's own measurements.",
        100.0 * between.0,
        between.1,
        100.0 * pinhole
    );
    // Half-pixel steps from 9 to 90 px, the range of the plot.
    let f_b = (18..=180)
        .map(|i| (0.5 * f64::from(i), product / (0.5 * f64::from(i))))
        .collect();
    finding.plot(&distance_chart(
        vec![
            ("thesis, degree 5".into(), thesis.points()),
            ("svl, degree 5".into(), ours.points()),
            ("f·B/d".into(), f_b),
        ],
        vec![
            ("thesis, measured".into(), table.to_vec()),
            ("svl, simulated".into(), measured),
        ],
    ))?;
    Ok(finding)
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
