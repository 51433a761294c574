//! The values of the page's template: the domain's own types, and what it cannot compute.

use super::super::gate::GateState;
use super::super::plot::AlgorithmColors;
use super::super::prior::PRIOR;
use super::super::results::Results;
use super::super::table::{Table, TableCell, TableColumn};
use super::frames::FigureView;
use super::heat::HeatMap;
use super::plots::{StressView, accuracy, maps, reliability, speed, stress, trade_offs};
use super::scenes::{ErrorKey, SceneView};
use super::shades::{ParameterShade, ShadeView, parameter_shades, swept};
use super::{CheckpointFigure, ReportPage};
use crate::page::{ImageView, PageImages, PlotView, css_color};
use serde::Serialize;
use std::cmp::Ordering::Equal;
use std::collections::{BTreeMap, BTreeSet};
use svl_core::{Result, matcher};
use svl_files::overlay::{algorithm_color, viridis};
use svl_score::judge::ColumnChoice;
use svl_score::manifest::Manifest;

#[derive(Serialize)]
pub(super) struct ReportPageView<'a> {
    manifest: &'a Manifest,
    summary: &'a Results,
    scope: String,
    answer: Vec<String>,
    order: Option<String>,
    cautions: Vec<String>,
    paragraphs: Vec<&'a str>,
    identity: Vec<(String, String)>,
    headline: Table,
    overview: HeadlineView<'a>,
    /// That of a sweep over two parameters.
    heat: Option<HeatMap>,
    metrics: Table,
    checkpoints: Option<Table>,
    speed: Option<Table>,
    accuracy: Option<Table>,
    accuracy_plot: Vec<PlotView>,
    reliability: Vec<PlotView>,
    reliability_table: Option<Table>,
    latency: Option<Table>,
    drives: Option<Table>,
    cases: Option<&'a Table>,
    stress_tables: Vec<Table>,
    /// The first is shown, the others are folded.
    trade_offs: Vec<PlotView>,
    speed_plots: Vec<PlotView>,
    stress: Vec<StressView>,
    /// Courses that an algorithm did not finish, and the others, which are folded.
    failed_maps: Vec<PlotView>,
    finished_maps: Vec<PlotView>,
    front: FrontView<'a>,
    /// State, its word, and the result.
    gate: Vec<(GateState, &'static str, &'a str)>,
    /// Ids of the figures, or of the scenes, and the words of their buttons.
    entries: Vec<(String, String)>,
    /// The id of the figure that is shown first: the first algorithm's worst checkpoint.
    first: Option<String>,
    /// Columns and rows of the grid of cells, where a frame is shown.
    grid: Option<(usize, usize)>,
    /// Figures have worst and best frames.
    is_ranked: bool,
    /// Some frame has an error map.
    has_errors: bool,
    /// Some figure shows several algorithms.
    has_choice: bool,
    figures: Vec<FigureView<'a>>,
    scenes: Vec<SceneView<'a>>,
    errors: ErrorKey,
    /// Stops of the disparities' colours, for a gradient.
    ramp: String,
    images: Vec<ImageView>,
}

/// Parts of the headline table besides its numbers.
#[derive(Serialize)]
struct HeadlineView<'a> {
    /// Per label its name, place in the run and colour.
    algorithms: BTreeMap<&'a str, AlgorithmView>,
    /// Number and name.
    checkpoints: Vec<(u32, &'a str)>,
    /// Names of algorithms without parameters, and their descriptions.
    about: Vec<(&'a str, &'static str)>,
    /// Number of near obstacles in the truth.
    near: Option<f64>,
    /// The algorithm of the example citation: the first one that may be called best.
    cited: Option<&'a str>,
    /// The labels of algorithms with pictures, in the order of the table.
    pictured: Vec<&'a str>,
    /// The least and the greatest time, ms.
    times: (f64, f64),
    is_swept: bool,
    /// Number of columns of parameters.
    swept: usize,
    shades: Vec<ShadeView>,
    has_bars: bool,
}

#[derive(Serialize)]
struct AlgorithmView {
    /// Without the settings that are columns.
    name: String,
    place: usize,
    color: String,
    is_on_front: bool,
    /// Per checkpoint the frames that pass, of all that show it.
    passes: BTreeMap<u32, (u64, u64)>,
}

/// The algorithms that no other one dominates.
#[derive(Serialize)]
struct FrontView<'a> {
    /// The words of the metrics.
    by: Vec<&'static str>,
    algorithms: Vec<&'a str>,
}

impl<'a> ReportPageView<'a> {
    pub(super) fn new(page: &'a ReportPage) -> Result<Self> {
        let ReportPage {
            manifest, summary, ..
        } = page;
        let colors = page.colors();
        let mut images = PageImages::default();
        let ranked = summary.ranked_algorithms();
        let place = |label: &str| ranked.iter().position(|a| a.algorithm == label);
        let place = |label: &str| place(label).unwrap_or(ranked.len());
        let figures = page.figures.iter();
        let figures = figures.map(|figure| FigureView::new(figure, &mut images, place));
        let figures: Vec<_> = figures.collect();
        let scenes = page.scenes.iter();
        let mut scenes: Vec<_> = scenes.map(|scene| SceneView::new(scene, place)).collect();
        sort_by_case(&mut scenes, page);
        let entries = entries(page, &scenes);
        let shots = page.figures.iter().flat_map(|figure| &figure.shots);
        let marks = shots.flat_map(|(_, shot)| &shot.estimate);
        let grid = marks.map(|mark| (mark.column + 1, mark.row + 1)).max();
        let stops = (0..=8).map(|i| css_color(viridis(i as f32 / 8.0)));
        let mut identity = manifest.entries();
        let note = summary.ending.note();
        identity.extend(note.map(|note| ("not scored".to_owned(), note)));
        let (by, algorithms) = summary.front();
        let front = FrontView {
            by: by.iter().map(|metric| metric.words).collect(),
            algorithms,
        };
        let headline = headline(page);
        let overview = HeadlineView::new(page, &headline, &colors, &front.algorithms);
        let gate = page.gate.iter();
        Ok(Self {
            manifest,
            summary,
            scope: summary.scope_words(),
            answer: summary.answer(),
            order: summary.order_words(),
            cautions: summary.cautions(),
            // An empty line ends a paragraph, as in Markdown.
            paragraphs: (page.description.split("\n\n").map(str::trim))
                .filter(|p| !p.is_empty())
                .collect(),
            identity,
            first: overview.first_figure(&figures),
            grid,
            overview,
            heat: HeatMap::new(page),
            headline,
            metrics: summary.all_metrics(),
            checkpoints: summary.checkpoint_table(),
            speed: summary.speed_table(),
            accuracy: summary.accuracy_table(),
            accuracy_plot: accuracy(page, &colors)?,
            reliability: reliability(page, &colors)?,
            reliability_table: summary.reliability_table(),
            latency: summary.latency_table(),
            drives: summary.drive_table(),
            cases: page.cases.as_ref(),
            stress_tables: summary.stress_tables(),
            trade_offs: trade_offs(page, &colors)?,
            speed_plots: speed(page, &colors)?,
            stress: stress(page, &colors)?,
            failed_maps: maps(page, &colors, Some(true))?,
            finished_maps: maps(page, &colors, Some(false))?,
            front,
            gate: gate
                .map(|(state, text)| (*state, state.words(), text.as_str()))
                .collect(),
            entries,
            is_ranked: page
                .figures
                .iter()
                .any(|figure| figure.checkpoint.is_some()),
            has_errors: (page.figures.iter())
                .any(|figure| figure.shots.iter().any(|(_, shot)| shot.errors.is_some())),
            has_choice: page.figures.iter().any(has_choice),
            figures,
            scenes,
            errors: ErrorKey::new(),
            ramp: stops.collect::<Vec<_>>().join(", "),
            images: images.into_views(),
        })
    }
}

/// Sorts scenes by their places in the table of cases, the worst first; those beyond the limit of
/// the table last.
fn sort_by_case(scenes: &mut [SceneView<'_>], page: &ReportPage) {
    let case = |scene: &SceneView<'_>| {
        let mut rows = page.cases.iter().flat_map(|cases| &cases.rows);
        rows.position(|row| row[0] == TableCell::Text(scene.title.to_owned()))
    };
    scenes.sort_by_key(|scene| case(scene).unwrap_or(usize::MAX));
}

/// Ids of the figures and the scenes, and the words of their buttons.
fn entries(page: &ReportPage, scenes: &[SceneView<'_>]) -> Vec<(String, String)> {
    let figures = page.figures.iter().zip(chips(&page.figures));
    let figures = figures.map(|(figure, chip)| (figure.checkpoint, chip));
    let chips = figures.chain(scenes.iter().map(|scene| (None, scene.title.to_owned())));
    let entry = |(i, (checkpoint, chip)): (usize, (Option<u32>, String))| {
        let id = checkpoint.map_or_else(|| format!("f{i}"), |number| format!("cp{number}"));
        (id, chip)
    };
    chips.enumerate().map(entry).collect()
}

/// The words of the figures' buttons: the time in the recording, as `0.8 s`, with the recording
/// where there are several, else the title. Times have as many decimals as tell them apart.
fn chips(figures: &[CheckpointFigure]) -> Vec<String> {
    let run = |figure: &CheckpointFigure| figure.shots.first()?.1.row.run.clone();
    let runs: BTreeSet<_> = figures.iter().map(run).collect();
    let chip = |figure: &CheckpointFigure, digits: usize| match (figure.at_s, run(figure)) {
        (None, _) => figure.title.clone(),
        (Some(at_s), Some(run)) if runs.len() > 1 => format!("{run} {at_s:.digits$} s"),
        (Some(at_s), _) => format!("{at_s:.digits$} s"),
    };
    let all = |digits| figures.iter().map(|figure| chip(figure, digits)).collect();
    let is_clear = |chips: &Vec<String>| chips.iter().collect::<BTreeSet<_>>().len() == chips.len();
    (1..3).map(all).find(is_clear).unwrap_or_else(|| all(3))
}

/// True for a figure of several algorithms.
fn has_choice(figure: &CheckpointFigure) -> bool {
    let first = figure.shots.first().map(|(_, shot)| &shot.row.algorithm);
    let mut shots = figure.shots.iter();
    shots.any(|(_, shot)| Some(&shot.row.algorithm) != first)
}

impl<'a> HeadlineView<'a> {
    fn new(
        page: &'a ReportPage,
        table: &Table,
        colors: &AlgorithmColors<'_>,
        front: &[&str],
    ) -> Self {
        let swept = swept(page);
        let view = |(place, label): (usize, &'a str)| {
            let view = AlgorithmView {
                name: name(label, &swept),
                place,
                color: css_color(colors.rgb(label).unwrap_or(algorithm_color(place))),
                is_on_front: front.contains(&label),
                passes: (page.summary.checkpoints.iter())
                    .filter(|c| c.algorithm == label)
                    .map(|c| (c.checkpoint, (c.passed, c.frames)))
                    .collect(),
            };
            (label, view)
        };
        let ranked = page.summary.ranked_algorithms();
        let times = || {
            ranked
                .iter()
                .filter_map(|a| a.p50_ms)
                .filter(|ms| *ms > 0.0)
        };
        let labels = ranked.iter().map(|a| a.algorithm.as_str());
        Self {
            algorithms: (page.manifest.labels())
                .chain(page.summary.prior.as_ref().map(|_| PRIOR))
                .enumerate()
                .map(view)
                .collect(),
            checkpoints: page.summary.checkpoint_names(),
            about: about(page, labels.clone()),
            cited: ranked
                .iter()
                .find(|a| page.summary.is_candidate(a))
                .or(ranked.first())
                .map(|a| a.algorithm.as_str()),
            near: ranked.iter().find_map(|a| a.totals.get("near")),
            pictured: labels.filter(|label| is_pictured(page, label)).collect(),
            times: (
                times().fold(f64::INFINITY, f64::min),
                times().fold(0.0, f64::max),
            ),
            is_swept: !swept.is_empty(),
            swept: swept.len(),
            shades: parameter_shades(page)
                .iter()
                .map(ParameterShade::view)
                .collect(),
            has_bars: (table.rows.iter().flatten())
                .any(|cell| matches!(cell, TableCell::Bar { .. })),
        }
    }
}

impl HeadlineView<'_> {
    /// The id of the checkpoint that the first algorithm fails most.
    fn first_figure(&self, figures: &[FigureView<'_>]) -> Option<String> {
        let label = self.pictured.first()?;
        let passes = &self.algorithms.get(label)?.passes;
        let share = |number: &u32| {
            let (passed, frames) = passes.get(number)?;
            Some(*passed as f64 / *frames as f64)
        };
        let failed = figures.iter().filter(|figure| figure.fails(label));
        let failed = failed.filter_map(|figure| figure.checkpoint);
        let worst = failed.min_by(|a, b| share(a).partial_cmp(&share(b)).unwrap_or(Equal));
        worst.map(|number| format!("cp{number}"))
    }
}

/// The headline table, with a column for each parameter that is swept.
fn headline(page: &ReportPage) -> Table {
    let mut table = match page.summary.shown.columns {
        ColumnChoice::Headline => {
            let metrics = ColumnChoice::Headline.metrics(page.summary.kind());
            let mut wide = page.summary.metric_table(&ColumnChoice::Named(metrics));
            wide.remove_optional_columns();
            wide
        }
        _ => page.summary.headline(),
    };
    for parameter in swept(page).into_iter().rev() {
        let value = |label: &str| {
            let sweeps = page.sweeps.iter().filter(|s| s.parameter == parameter);
            let mut points = sweeps.flat_map(|sweep| &sweep.points);
            let own = points.find(|(_, name)| name == label);
            own.map_or_else(String::new, |(value, _)| value.clone())
        };
        table
            .columns
            .insert(1, TableColumn::new("parameters", parameter));
        for row in &mut table.rows {
            let value = match &row[0] {
                TableCell::Text(label) => value(label),
                _ => String::new(),
            };
            row.insert(1, TableCell::Text(value));
        }
    }
    table
}

/// A label without the settings of those parameters.
fn name(label: &str, parameters: &[&str]) -> String {
    let Some((name, settings)) = label.split_once(':') else {
        return label.to_owned();
    };
    let is_column = |setting: &&str| {
        let key = setting.split('=').next().unwrap_or_default();
        parameters.contains(&key)
    };
    let others: Vec<_> = settings.split(',').filter(|s| !is_column(s)).collect();
    match others[..] {
        [] => name.to_owned(),
        _ => format!("{name}:{}", others.join(",")),
    }
}

/// Names and summaries of the algorithms behind the labels, each once.
fn about<'a>(
    page: &ReportPage,
    labels: impl Iterator<Item = &'a str>,
) -> Vec<(&'static str, &'static str)> {
    let mut about: Vec<(&str, &str)> = Vec::new();
    for label in labels {
        let records = &page.manifest.algorithms;
        let name = records.iter().find(|a| a.label == label).map(|a| &*a.name);
        let spec = name.and_then(|name| matcher::find(name).ok());
        if let Some(spec) = spec.filter(|spec| about.iter().all(|(name, _)| *name != spec.name)) {
            about.push((spec.name, spec.summary));
        }
    }
    about
}

/// True if a picture of the page is of that algorithm.
fn is_pictured(page: &ReportPage, label: &str) -> bool {
    let figures = page.figures.iter().flat_map(|f| &f.shots);
    let scenes = page.scenes.iter().flat_map(|scene| &scene.shots);
    let rows = figures.map(|(_, shot)| &shot.row);
    let mut rows = rows.chain(scenes.map(|shot| &shot.row));
    rows.any(|row| row.algorithm == label)
}

#[cfg(test)]
mod tests {
    use super::{CheckpointFigure, chips, name};

    #[test]
    fn chips_are_times_with_the_decimals_that_tell_them_apart() {
        let figure = |at_s| CheckpointFigure {
            checkpoint: None,
            title: "v3, course 2".into(),
            at_s,
            about: String::new(),
            shots: Vec::new(),
        };
        let chips = |times: &[Option<f64>]| {
            let figures: Vec<_> = times.iter().copied().map(figure).collect();
            chips(&figures)
        };
        assert_eq!(chips(&[Some(0.84), Some(1.0)]), ["0.8 s", "1.0 s"]);
        assert_eq!(chips(&[Some(0.84), Some(0.8)]), ["0.84 s", "0.80 s"]);
        assert_eq!(chips(&[None]), ["v3, course 2"]);
    }

    #[test]
    fn settings_in_columns_are_not_in_names() {
        let names = ["bm", "bm:uniqueness=3", "bm:uniqueness=3,size=9"];
        let named = names.map(|label| name(label, &["uniqueness"]));
        assert_eq!(named, ["bm", "bm", "bm:size=9"]);
    }
}
