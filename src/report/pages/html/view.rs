//! The values of the page's template: the domain's own types, and what it cannot compute.

use super::figures::{CheckpointFigure, Rank, ReportPage, SceneFigure};
use super::frames::figure_view;
use super::heat::heat_map;
use super::plots::{accuracy, maps, pieces, reliability, speed, stress, trade_offs};
use super::scenes::{picture_colors, scene_view};
use super::shades::{parameter_shades, swept};
use crate::show::page::parts::{PageImages, css_color};
use crate::show::table::model::{Table, TableCell, TableColumn};
use minijinja::{Value, context};
use std::cmp::Ordering::Equal;
use std::collections::{BTreeMap, BTreeSet};
use svl_core::doubt::{Doubt, rounded};
use svl_core::matcher;
use svl_files::overlay::REFERENCE_COLOR;
use svl_score::judge::{AreaChoice, ColumnChoice, MetricSource as _};
use svl_score::manifest::AlgorithmRecord;
use svl_score::notice::grouped;

pub(crate) fn view(page: &ReportPage) -> Value {
    let ReportPage {
        manifest, summary, ..
    } = page;
    let colors = page.colors();
    let mut images = PageImages::default();
    let ranked = summary.ranked_algorithms();
    let place = |label: &str| ranked.iter().position(|a| a.algorithm == label);
    let place = |label: &str| place(label).unwrap_or(ranked.len());
    let figures = page.figures.iter();
    let figures = figures.map(|figure| figure_view(figure, &mut images, place, &page.replays));
    let figures: Vec<_> = figures.collect();
    let scenes = scenes(page);
    let mut timeline = page.timeline.clone();
    timeline.lanes.sort_by_key(|(label, _)| place(label));
    let mut identity = manifest.entries();
    let note = summary.ending.note();
    identity.extend(note.map(|note| ("not scored".to_owned(), note)));
    let shots = || page.figures.iter().flat_map(|figure| &figure.shots);
    let marks = shots().flat_map(|(_, shot)| &shot.estimate);
    let headline = headline(page);
    let heat = heat_map(page).map(|(grid, about)| context! { grid, about });
    let gate = page.gate.iter();
    let gate = gate.map(|(state, text)| (state, state.words(), text));
    let doubts = manifest.doubts.iter().map(|doubt| {
        let words = [rounded(doubt.value), doubt.usual_words(), doubt.to_string()];
        let run = doubt.run.iter().filter(|_| summary.basis.scope.runs > 1);
        let name = run.map(|run| format!("{run}: {}", doubt.name)).next();
        (name.unwrap_or_else(|| doubt.name.to_string()), words)
    });
    let said: Vec<_> = manifest.doubts.iter().map(Doubt::to_string).collect();
    let warnings = manifest.warnings.iter();
    let warnings = warnings.filter(|warning| !said.iter().any(|own| warning.contains(own)));
    let warnings = grouped(warnings.cloned());
    // An empty line ends a paragraph, as in Markdown.
    let paragraphs = page.description.split("\n\n").map(str::trim);
    context! {
        manifest, summary, identity, scope => summary.scope_words(), answer => summary.answer(),
        order => summary.order_words(), cautions => summary.cautions(),
        paragraphs => paragraphs.filter(|p| !p.is_empty()).collect::<Vec<_>>(),
        overview => overview(page, &headline), legend => summary.legend(),
        headline, heat, metrics => summary.all_metrics(),
        checkpoints => summary.checkpoint_table(), speed => summary.speed_table(),
        accuracy => summary.accuracy_tables(), accuracy_plot => accuracy(page, &colors),
        is_of_depth => is_of_depth(page),
        reliability => reliability(page, &colors),
        reliability_table => summary.reliability_table(), latency => summary.latency_table(),
        pieces => summary.piece_table(), piece_plots => pieces(page, &colors),
        drives => summary.drive_table(), cases => page.cases,
        recordings => summary.recording_table(), timeline, worst => worst(page),
        is_other_area => summary.basis.area != AreaChoice::default(),
        stress_tables => summary.stress_tables(), trade_offs => trade_offs(page, &colors),
        speed_plots => speed(page, &colors), stress => stress(page, &colors),
        failed_maps => maps(page, &colors, Some(true)),
        finished_maps => maps(page, &colors, Some(false)), gate => gate.collect::<Vec<_>>(),
        entries => entries(page, &scenes), first => first_figure(page),
        grid => marks.map(|mark| (mark.column + 1, mark.row + 1)).max(),
        is_ranked => page.figures.iter().any(|figure| figure.checkpoint.is_some()),
        runs => shots().map(|(_, shot)| shot.row.origin().run_name()).collect::<BTreeSet<_>>(),
        has_errors => shots().any(|(_, shot)| shot.errors.is_some()),
        doubts => doubts.collect::<Vec<_>>(), warnings,
        has_choice => page.figures.iter().any(has_choice), figures,
        scenes => scenes.iter().map(|scene| scene_view(scene, place)).collect::<Vec<_>>(),
        filters => [("wrong", "wrong only")],
        has_v5 => manifest.algorithms.iter().any(|own| own.name == "v5"),
        images => images.into_views(), files => page.files, ..picture_colors()
    }
}

/// The scenes by their places in the table of cases, the worst first; those beyond the limit of the
/// table last.
fn scenes(page: &ReportPage) -> Vec<&SceneFigure> {
    let case = |scene: &&SceneFigure| {
        let mut rows = page.cases.iter().flat_map(|cases| &cases.rows);
        rows.position(|row| row[0] == TableCell::Text(scene.title.clone()))
    };
    let mut scenes: Vec<_> = page.scenes.iter().collect();
    scenes.sort_by_key(|scene| case(scene).unwrap_or(usize::MAX));
    scenes
}

/// Ids of the figures and the scenes, and the words of their buttons.
fn entries(page: &ReportPage, scenes: &[&SceneFigure]) -> Vec<(String, String)> {
    let figures = page.figures.iter().zip(chips(&page.figures));
    let figures = figures.map(|(figure, chip)| (figure.checkpoint, chip));
    let chips = figures.chain(scenes.iter().map(|scene| (None, scene.title.clone())));
    let entry = |(i, (checkpoint, chip)): (usize, (Option<u32>, String))| {
        let id = checkpoint.map_or_else(|| format!("f{i}"), |number| format!("cp{number}"));
        (id, chip)
    };
    chips.enumerate().map(entry).collect()
}

/// The words of the figures' buttons: the time in the recording, as `0.8 s`, or the frame, with the
/// recording where there are several, else the title. Times have the decimals that tell them apart.
fn chips(figures: &[CheckpointFigure]) -> Vec<String> {
    let run = |figure: &CheckpointFigure| {
        let row = &figure.shots.first()?.1.row;
        let seed = || row.seed.map(|seed| format!("seed {seed},"));
        row.run.clone().or_else(seed)
    };
    let runs: BTreeSet<_> = figures.iter().map(run).collect();
    let chip = |figure: &CheckpointFigure, digits: usize| match (figure.at_s, run(figure)) {
        (None, Some(run)) if runs.len() == 1 => {
            let frame = figure.title.strip_prefix(&format!("{run}, "));
            frame.unwrap_or(&figure.title).to_owned()
        }
        (None, _) => figure.title.clone(),
        (Some(at_s), Some(run)) if runs.len() > 1 => format!("{run} {at_s:.digits$} s"),
        (Some(at_s), _) => format!("{at_s:.digits$} s"),
    };
    let all = |digits| figures.iter().map(|figure| chip(figure, digits)).collect();
    let is_clear = |chips: &Vec<String>| chips.iter().collect::<BTreeSet<_>>().len() == chips.len();
    (1..3).map(all).find(is_clear).unwrap_or_else(|| all(3))
}

/// Per algorithm the figures of its worst frames, the worst first, and their words.
fn worst(page: &ReportPage) -> BTreeMap<&str, Vec<(usize, String)>> {
    let chips = chips(&page.figures);
    let mut worst: BTreeMap<&str, Vec<(usize, usize, String)>> = BTreeMap::new();
    for (i, figure) in page.figures.iter().enumerate() {
        for (rank, shot) in &figure.shots {
            if let Rank::Failed(rank) = rank {
                let count = |name| shot.row.metrics.get(name).filter(|cells| *cells > 0.0);
                let words = ["missed", "wrong"]
                    .into_iter()
                    .filter_map(|name| Some(format!("{} {name}", count(name)?)));
                let words = shot.failures.iter().cloned().chain(words);
                let words = words.collect::<Vec<_>>().join(", ");
                let own = worst.entry(&shot.row.algorithm).or_default();
                own.push((*rank, i, format!("{}: {words}", chips[i])));
            }
        }
    }
    let sorted = worst.into_iter().map(|(label, mut own)| {
        own.sort();
        let own = own.into_iter().map(|(_, figure, words)| (figure, words));
        (label, own.collect())
    });
    sorted.collect()
}

/// True for a figure of several algorithms.
fn has_choice(figure: &CheckpointFigure) -> bool {
    let mut shots = figure.shots.windows(2);
    shots.any(|two| two[0].1.row.algorithm != two[1].1.row.algorithm)
}

/// True for a report of a camera: an algorithm is depth that was recorded.
fn is_of_depth(page: &ReportPage) -> bool {
    let mut records = page.manifest.algorithms.iter();
    records.any(AlgorithmRecord::is_recorded)
}

/// The id of the checkpoint that the first algorithm with pictures fails most, or of its worst
/// frame.
fn first_figure(page: &ReportPage) -> Option<String> {
    let ranked = page.summary.ranked_algorithms();
    let mut labels = ranked.iter().map(|a| &a.algorithm);
    let label = labels.find(|label| is_pictured(page, label))?;
    let fails = |figure: &&CheckpointFigure| {
        let own = figure.shots.iter();
        let mut own = own.filter(|(_, shot)| shot.row.algorithm == *label);
        own.any(|(rank, shot)| *rank == Rank::Worst && shot.passed == Some(false))
    };
    let failed = page.figures.iter().filter(fails);
    let failed = failed.filter_map(|figure| figure.checkpoint);
    let share = |number: &u32| {
        let (passed, frames) = page.summary.passes(label, Some(*number));
        passed as f64 / frames as f64
    };
    let worst = failed.min_by(|a, b| share(a).partial_cmp(&share(b)).unwrap_or(Equal));
    let checkpoint = worst.map(|number| format!("cp{number}"));
    // Without checkpoints its worst frame.
    let frame = || {
        Some(format!(
            "f{}",
            self::worst(page).get(label.as_str())?.first()?.0
        ))
    };
    checkpoint.or_else(frame)
}

/// Parts of the headline table besides its numbers.
fn overview(page: &ReportPage, table: &Table) -> Value {
    let (summary, swept, colors) = (&page.summary, swept(page), page.colors());
    let view = |(place, label)| {
        let color = css_color(colors.rgb(label).unwrap_or(REFERENCE_COLOR));
        let own = summary.checkpoints.iter().filter(|c| c.algorithm == label);
        let passes = own.map(|c| (c.checkpoint, (c.passed, c.frames)));
        let passes = passes.collect::<BTreeMap<_, _>>();
        // The name is without the settings that are columns.
        (
            label,
            context! { name => name(label, &swept), place, color, passes },
        )
    };
    let ranked = summary.ranked_algorithms();
    let labels = ranked.iter().map(|a| a.algorithm.as_str());
    let times = || {
        let ranked = ranked.iter().filter_map(|a| a.p50_ms);
        ranked.filter(|ms| *ms > 0.0)
    };
    let all = page.manifest.labels();
    let all = all.chain(summary.references.iter().map(|own| own.algorithm.as_str()));
    context! {
        algorithms => all.enumerate().map(view).collect::<BTreeMap<_, _>>(),
        checkpoints => summary.checkpoint_names(), about => about(page, labels.clone()),
        // The first one that may be called best.
        cited => summary.cited(),
        near => summary.most_near(),
        pictured => labels.filter(|label| is_pictured(page, label)).collect::<Vec<_>>(),
        times => (times().fold(f64::INFINITY, f64::min), times().fold(0.0, f64::max)),
        is_swept => !swept.is_empty(), swept => swept.len(), shades => parameter_shades(page),
        has_bars => table.rows.iter().flatten().any(|cell| matches!(cell, TableCell::Bar { .. })),
    }
}

/// The headline table, with a column for each parameter that is swept.
fn headline(page: &ReportPage) -> Table {
    let summary = &page.summary;
    let mut table = match summary.shown.columns {
        ColumnChoice::Headline => {
            let metrics = ColumnChoice::Headline.metrics(summary.kind());
            let mut wide = summary.metric_table(&ColumnChoice::Named(metrics));
            wide.remove_optional_columns();
            wide
        }
        _ => summary.headline(),
    };
    for parameter in swept(page).into_iter().rev() {
        let sweeps = || {
            let sweeps = page.sweeps.iter();
            sweeps.filter(|sweep| sweep.parameter == parameter)
        };
        table
            .columns
            .insert(1, TableColumn::new("parameters", parameter));
        for row in &mut table.rows {
            let mut points = sweeps().flat_map(|sweep| &sweep.points);
            let own = points.find(|(_, name)| row[0] == TableCell::Text(name.clone()));
            let value = own.map_or_else(String::new, |(value, _)| value.clone());
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
        let mut records = page.manifest.algorithms.iter();
        let spec = records.find(|a| a.label == label);
        let spec = spec.and_then(|a| matcher::find(&a.name).ok());
        about.extend(
            spec.map(|spec| (spec.name, spec.summary))
                .filter(|own| !about.contains(own)),
        );
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
    use super::super::figures::CheckpointFigure;
    use super::{chips, name};

    #[test]
    fn chips_are_times_with_the_decimals_that_tell_them_apart() {
        let figure = |at_s| CheckpointFigure {
            title: "v3, course 2".into(),
            at_s,
            ..CheckpointFigure::default()
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
