//! The values of the page's template, numbers as text.

use super::super::gate::GateState;
use super::super::plot::CourseMap;
use super::super::table::Table;
use super::frames::FigureView;
use super::plots::{PlotView, StressView, accuracy, coverage, speed, stress};
use super::scenes::{ErrorKey, SceneView};
use super::{PartLink, ReportPage};
use crate::report::page::{ImageView, PageImages};
use serde::Serialize;
use svl_core::Result;
use svl_data::overlay::viridis;

#[derive(Serialize)]
pub(super) struct ReportPageView<'a> {
    title: &'a str,
    paragraphs: Vec<&'a str>,
    incomplete: Option<&'a str>,
    warnings: &'a [String],
    caution: Option<String>,
    identity: &'a [(String, String)],
    summary: Option<Table>,
    accuracy: Vec<PlotView>,
    coverage: Vec<PlotView>,
    checkpoints: Option<Table>,
    /// State, its word, and the result.
    gate: Vec<(GateState, &'static str, &'a str)>,
    speed: Option<Table>,
    speed_plots: Vec<PlotView>,
    figures: Vec<FigureView<'a>>,
    scenes: Vec<SceneView<'a>>,
    tables: Vec<Table>,
    maps: Vec<String>,
    stress: Vec<StressView>,
    parts: &'a [PartLink],
    /// Which algorithms have no pictures, if any.
    left_out: Option<String>,
    errors: ErrorKey,
    /// Stops of the disparities' colours, for a gradient.
    ramp: String,
    images: Vec<ImageView>,
}

impl<'a> ReportPageView<'a> {
    pub(super) fn new(page: &'a ReportPage) -> Result<Self> {
        let mut images = PageImages::default();
        let figures = page
            .figures
            .iter()
            .map(|figure| FigureView::new(figure, &mut images))
            .collect();
        let summary = &page.summary;
        let stops = (0..=8)
            .map(|i| viridis(i as f32 / 8.0))
            .map(|[r, g, b]| format!("rgb({r} {g} {b})"));
        Ok(Self {
            title: &page.title,
            incomplete: summary.ending.incomplete.as_deref(),
            warnings: &summary.warnings,
            caution: summary.caution(),
            paragraphs: page
                .description
                // An empty line ends a paragraph, as in Markdown.
                .split("\n\n")
                .map(str::trim)
                .filter(|p| !p.is_empty())
                .collect(),
            identity: &page.identity,
            summary: Some(summary.all_metrics()).filter(|table| !table.rows.is_empty()),
            accuracy: accuracy(page)?,
            coverage: coverage(page)?,
            checkpoints: summary.checkpoint_table(),
            gate: (page.gate.iter())
                .map(|(state, text)| (*state, state.words(), text.as_str()))
                .collect(),
            speed: summary.speed_table(),
            speed_plots: speed(page)?,
            figures,
            scenes: page.scenes.iter().map(SceneView::new).collect(),
            tables: summary.side_tables(),
            maps: page
                .maps
                .iter()
                .map(CourseMap::svg)
                .collect::<Result<_>>()?,
            stress: stress(page)?,
            parts: &page.parts,
            left_out: left_out(page),
            errors: ErrorKey::new(),
            ramp: stops.collect::<Vec<_>>().join(", "),
            images: images.into_views(),
        })
    }
}

/// Which algorithms have pictures, where not all have.
fn left_out(page: &ReportPage) -> Option<String> {
    let figures = page
        .figures
        .iter()
        .flat_map(|f| f.shots.iter().map(|(_, s)| s.row.algorithm.as_str()));
    let mut pictured: Vec<_> = figures
        .chain(
            page.scenes
                .iter()
                .flat_map(|s| s.shots.iter().map(|s| s.row.algorithm.as_str())),
        )
        .collect();
    pictured.sort_unstable();
    pictured.dedup();
    let all = page
        .summary
        .algorithms
        .iter()
        .filter(|a| a.pairs > 0)
        .count();
    (!pictured.is_empty() && pictured.len() < all).then(|| {
        format!(
            "Pictures of {} of the {all} algorithms; the tables have all.",
            pictured.len()
        )
    })
}
