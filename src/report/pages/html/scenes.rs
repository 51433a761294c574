//! Scenes of data sets: left image, truth, and every algorithm's disparities and errors.

use super::figures::SceneFigure;
use super::frames::{cells, numbers};
use crate::show::page::parts::{css_color, data_url};
use minijinja::{Value, context};
use svl_files::overlay::errors::{BINS, HIDDEN, SILENT, UNKNOWN};
use svl_files::overlay::viridis;

/// A scene for the template. `place`: that of an algorithm among all.
pub(crate) fn scene_view(scene: &SceneFigure, place: impl Fn(&str) -> usize) -> Value {
    let mut shots: Vec<_> = scene.shots.iter().collect();
    shots.sort_by_key(|shot| place(&shot.row.algorithm));
    let shots = shots.into_iter().map(|shot| {
        context! {
            algorithm => shot.row.algorithm, disparities => data_url(&shot.disparities),
            errors => shot.errors.as_deref().map(data_url), cells => cells(&shot.row),
            numbers => numbers(&shot.row),
        }
    });
    let (width, height) = scene.size;
    context! {
        title => scene.title, width, height, left => data_url(&scene.left),
        truth => scene.truth.as_deref().map(data_url), max_px => format!("{:.0}", scene.max_px),
        shots => shots.collect::<Vec<_>>(),
    }
}

/// The colours of the pictures, for the template of frames.
pub(crate) fn picture_colors() -> Value {
    let stops = (0..=8).map(|i| css_color(viridis(i as f32 / 8.0)));
    context! { ramp => stops.collect::<Vec<_>>().join(", "), errors => error_key() }
}

/// The colours of the error maps with their meanings: errors, and pixels without one.
fn error_key() -> Value {
    let errors = BINS.iter().enumerate().map(|(i, (end, color))| {
        // An error of size 1 is 3 px.
        let px = |size: f32| match 3.0 * size {
            px if px < 1.0 => format!("{px:.2}"),
            px => format!("{px}"),
        };
        let words = match i {
            _ if end.is_finite() => format!("<\u{202f}{}", px(*end)),
            _ => format!("≥\u{202f}{} px", px(BINS[i - 1].0)),
        };
        (css_color(*color), words)
    });
    let others = [
        (SILENT, "no estimate"),
        (
            HIDDEN,
            "not known to be visible to both cameras, not scored",
        ),
        (UNKNOWN, "truth unknown, not scored"),
    ];
    let others = others.map(|(color, words)| (css_color(color), words));
    context! { errors => errors.collect::<Vec<_>>(), others }
}
