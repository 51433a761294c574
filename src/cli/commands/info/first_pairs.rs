//! The facts that the first pairs of a recording or a folder show, as lines of `svl info`.

use crate::cli::shared::terminal::{FactLine, fact};
use svl::counted;
use svl::plausibility::Spread;
use svl::recording::PairGeometry;
use svl::source::{NearestDistance, SourceFacts, TruthFacts};

/// Size, cameras, range and truth, by the first pairs.
pub(super) fn lines(facts: &SourceFacts) -> Vec<FactLine> {
    let SourceFacts {
        size_px: (width, height),
        geometry,
        camera,
        rig,
        is_constant,
        vertical_misalignment,
        nearest,
        truths,
        ..
    } = facts;
    let others = if *is_constant {
        ""
    } else {
        " (the first pair; others have another size or calibration)"
    };
    let mut lines = vec![fact!("images", "{width}x{height} px{others}")];
    let focal = camera.focal_px.map(|(fx, fy)| {
        if (fy / fx - 1.0).abs() < HALF_PER_MILLE {
            format!("{fx:.2} px")
        } else {
            format!("fx {fx:.2} px, fy {fy:.2} px, fy/fx {:.3}", fy / fx)
        }
    });
    let focal = focal.unwrap_or_else(|| "not known".to_owned());
    let rectified = match (geometry, rig) {
        (PairGeometry::Raw, Some(rig)) => format!("; rectified to {:.2} px", rig.focal_px()),
        _ => String::new(),
    };
    lines.push(fact!("focal", "{focal}{rectified}"));
    lines.push(match rig {
        Some(rig) => fact!("baseline", "{:.4} m", rig.baseline_m()),
        None => {
            fact!(
                "baseline",
                "not known, so no distances; svl replay and score accept --calib"
            )
        }
    });
    lines.push(match vertical_misalignment {
        Some(found) => fact!(
            "misaligned",
            "{:.2} px vertically (median of {} in {}; `svl calibrate check` shows more)",
            found.median_abs_px,
            counted(found.matches as u64, "point"),
            counted(found.pairs as u64, "pair")
        ),
        None => fact!("misaligned", "not measured: too few points match"),
    });
    lines.extend(nearest.as_ref().map(
        |NearestDistance {
             algorithm,
             max_disparity_px,
             distance_m,
         }| {
            fact!(
                "nearest",
                "{distance_m:.3} m, at the {max_disparity_px} px that {algorithm} \
                 searches by default"
            )
        },
    ));
    lines.extend(truths.iter().map(truth));
    if truths.is_empty() {
        lines.push(fact!("truth", "none"));
    }
    lines
}

/// Focal lengths that differ by less are one, to 0.1 %.
const HALF_PER_MILLE: f64 = 0.0005;

fn truth(facts: &TruthFacts) -> FactLine {
    let TruthFacts {
        topic,
        is_asked_for,
        pairs,
        scored_pairs,
        cells,
        scored_cells,
        disparity_px,
        distance_m,
        impossible_pixels,
        error,
    } = facts;
    let option = if *is_asked_for { "--truth " } else { "" };
    let topic = topic.as_deref().unwrap_or("in the folder");
    if let Some(error) = error {
        return fact!("truth", "{option}{topic}: {error}");
    }
    let among_pairs = match pairs {
        1 => "the first pair".to_owned(),
        n => format!("{scored_pairs} of the first {n} pairs"),
    };
    let spread = |spread: &Spread, unit: &str, digits: usize| {
        let Spread { min, median, max } = spread;
        format!("; {min:.digits$} .. {max:.digits$} {unit}, median {median:.digits$} {unit}")
    };
    let distance = distance_m.as_ref().map(|metres| spread(metres, "m", 3));
    let disparity = disparity_px.as_ref().map(|px| spread(px, "px", 1));
    let impossible = (*impossible_pixels > 0).then(|| {
        let pixels = counted(*impossible_pixels, "pixel");
        format!("; {pixels} impossible, or zeros in place of none: not used")
    });
    fact!(
        "truth",
        "{option}{topic}: scores {scored_cells} of {cells} cells, in {among_pairs}{}{}",
        distance.or(disparity).unwrap_or_default(),
        impossible.unwrap_or_default()
    )
}
