//! Scenes of data sets: left image, truth, and every algorithm's disparities and errors.

use super::frames::{cells, numbers};
use super::{SceneFigure, SceneResult};
use crate::page::{css_color, data_url};
use serde::Serialize;
use svl_files::overlay::errors::{BINS, HIDDEN, SILENT, UNKNOWN};

#[derive(Serialize)]
pub(super) struct SceneView<'a> {
    pub title: &'a str,
    width: usize,
    height: usize,
    left: String,
    truth: Option<String>,
    max_px: String,
    shots: Vec<SceneShotView<'a>>,
}

#[derive(Serialize)]
struct SceneShotView<'a> {
    algorithm: &'a str,
    disparities: String,
    errors: Option<String>,
    cells: String,
    numbers: String,
}

impl<'a> SceneView<'a> {
    /// `place`: that of an algorithm among all.
    pub(super) fn new(scene: &'a SceneFigure, place: impl Fn(&str) -> usize) -> Self {
        let shot = |shot: &'a SceneResult| SceneShotView {
            algorithm: &shot.row.algorithm,
            disparities: data_url(&shot.disparities),
            errors: shot.errors.as_deref().map(data_url),
            cells: cells(&shot.row),
            numbers: numbers(&shot.row),
        };
        let (width, height) = scene.size;
        let mut shots: Vec<_> = scene.shots.iter().map(shot).collect();
        shots.sort_by_key(|shot| place(shot.algorithm));
        Self {
            title: &scene.title,
            width,
            height,
            left: data_url(&scene.left),
            truth: scene.truth.as_deref().map(data_url),
            max_px: format!("{:.0}", scene.max_px),
            shots,
        }
    }
}

/// The colours of the error maps with their meanings: errors, and pixels without one.
#[derive(Serialize)]
pub(super) struct ErrorKey {
    errors: Vec<(String, String)>,
    others: Vec<(String, String)>,
}

impl ErrorKey {
    pub(super) fn new() -> Self {
        let swatch = |color, words: &str| (css_color(color), words.to_owned());
        let errors = BINS.iter().enumerate().map(|(i, (end, color))| {
            // An error of size 1 is 3 px.
            let px = |size: f32| match 3.0 * size {
                px if px < 1.0 => format!("{px:.2}"),
                px => format!("{px}"),
            };
            match i {
                _ if end.is_finite() => swatch(*color, &format!("<\u{202f}{}", px(*end))),
                _ => swatch(*color, &format!("≥\u{202f}{} px", px(BINS[i - 1].0))),
            }
        });
        let others = [
            swatch(SILENT, "no estimate"),
            swatch(
                HIDDEN,
                "not known to be visible to both cameras, not scored",
            ),
            swatch(UNKNOWN, "truth unknown, not scored"),
        ];
        Self {
            errors: errors.collect(),
            others: others.into(),
        }
    }
}
