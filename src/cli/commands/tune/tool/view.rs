//! The screen: knobs on the left, metrics on the right, and below, if there is room, the
//! disparities.

use super::Tuner;
use crate::cli::commands::tune::shown::{FrameView, SampleView, TuneState, title};
use crate::cli::shared::stepper::{Stepper, ToolCanvas, picture};
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Wrap};
use svl::report::compare::{Change, Judgement, signed};
use svl::score::{METRICS, Metric, MetricOrigin, MetricUnit};
use svl::stereo::Reason;
use svl::tune::KnobPart;

/// Width of the knobs, characters.
const KNOBS: u16 = 31;

/// Rows and columns from which on pictures are drawn.
const ROOMY: (u16, u16) = (100, 32);

/// Rows of the pictures.
const PICTURE: u16 = 14;

/// Metrics that are shown unless all are, the first [`MAX_HEADLINE`] of those that are measured.
const HEADLINE: [&str; 11] = [
    "right",
    "wrong",
    "missed",
    "false",
    "time",
    "unrivalled",
    "bad2",
    "coverage",
    "known",
    "found",
    "close",
];
const MAX_HEADLINE: usize = 6;

/// Heights of a bar.
const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Draws it all; returns where the knobs are.
pub(super) fn draw(
    tuner: &Tuner,
    stepper: &Stepper<'_>,
    canvas: &mut ToolCanvas<'_, '_>,
) -> Vec<(Rect, usize)> {
    let area = canvas.area;
    let is_roomy = area.width >= ROOMY.0 && area.height >= ROOMY.1;
    let pictures = if is_roomy { PICTURE } else { 0 };
    let rows = [
        Constraint::Length(1),
        Constraint::Fill(1),
        Constraint::Length(pictures),
        Constraint::Length(2),
    ];
    let [head, body, below, words] = Layout::vertical(rows).areas(area);
    let columns = [Constraint::Length(KNOBS), Constraint::Fill(1)];
    let [left, right] = Layout::horizontal(columns).areas(body);
    canvas
        .screen
        .render_widget(Paragraph::new(heading(tuner)), head);
    let places = knobs(tuner, left, canvas);
    numbers(tuner, stepper, right, canvas);
    if is_roomy {
        draw_pictures(tuner, below, canvas);
    }
    let description = Paragraph::new(description(tuner)).wrap(Wrap { trim: true });
    canvas.screen.render_widget(description, words);
    places
}

/// The settings, and which of how many algorithms it is.
fn heading(tuner: &Tuner) -> Line<'static> {
    let [now, compared] = tuner.pair().map(|setting| title(&setting.algorithm));
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let mut spans = match tuner.side() {
        0 => vec![
            Span::styled(format!(" {now}"), bold),
            Span::raw(if now == compared {
                String::new()
            } else {
                format!("  compared with {compared}")
            }),
        ],
        _ => vec![
            Span::styled(format!(" {compared}"), bold),
            Span::raw("  as compared with; a: back"),
        ],
    };
    let (place, count) = (tuner.knobs.current + 1, tuner.knobs.settings.len());
    if count > 1 {
        spans.push(Span::raw(format!("  ({place} of {count}, Tab)")));
    }
    Line::from(spans)
}

/// The list of knobs around the chosen one; returns where each is.
fn knobs(tuner: &Tuner, area: Rect, canvas: &mut ToolCanvas<'_, '_>) -> Vec<(Rect, usize)> {
    let [now, compared] = tuner.pair();
    let shown = tuner.pair()[tuner.side()];
    let knobs = now.knobs();
    // Headings take a row, too.
    let mut rows: Vec<(Option<usize>, String)> = Vec::new();
    let mut heading = None;
    for (i, knob) in knobs.iter().enumerate() {
        let own = (knob.part != KnobPart::Algorithm).then(|| knob.part.words());
        if own != heading {
            rows.push((None, own.unwrap_or_default().to_owned()));
            heading = own;
        }
        // Grid and cells hold for both settings.
        let other = match knob.part {
            KnobPart::Algorithm | KnobPart::Filter => compared,
            KnobPart::Grid | KnobPart::Cells => tuner.begun(),
        };
        let (value, other) = (shown.value(knob).to_string(), other.value(knob).to_string());
        let value = if value == other {
            value
        } else {
            format!("{value} ({other})")
        };
        let mark = if i == tuner.chosen { '>' } else { ' ' };
        rows.push((Some(i), format!("{mark}{:<18} {value}", knob.name)));
    }
    let is_chosen = |(knob, _): &(Option<usize>, String)| *knob == Some(tuner.chosen);
    let chosen = rows.iter().position(is_chosen);
    let (height, width) = (usize::from(area.height), usize::from(area.width));
    let first = (chosen.unwrap_or(0) + 2)
        .saturating_sub(height)
        .min(rows.len().saturating_sub(height));
    let mut places = Vec::new();
    for (y, (knob, text)) in rows.iter().skip(first).take(height).enumerate() {
        let place = Rect::new(area.x, area.y + y as u16, area.width, 1);
        let style = match knob {
            None => Style::new().add_modifier(Modifier::UNDERLINED),
            Some(i) if *i == tuner.chosen => Style::new().add_modifier(Modifier::REVERSED),
            Some(_) => Style::new(),
        };
        let text: String = text.chars().take(width.saturating_sub(1)).collect();
        let text = Paragraph::new(text).style(style);
        canvas.screen.render_widget(text, place);
        places.extend(knob.map(|knob| (place, knob)));
    }
    places
}

fn numbers(tuner: &Tuner, stepper: &Stepper<'_>, area: Rect, canvas: &mut ToolCanvas<'_, '_>) {
    let shown = &tuner.shown;
    let side = tuner.side();
    let mut lines = vec![sample_head(shown)];
    let numbers = number_lines(shown, side, canvas.shades);
    let (why, bars) = (why_lines(shown, side, area.width), 2);
    let room = usize::from(area.height).saturating_sub(2 + bars + why.len());
    let names = shown_names(&numbers, room, tuner.shows_all_metrics);
    let more = numbers.len() - names.len();
    let fitting = numbers.into_iter().filter(|(name, _)| names.contains(name));
    lines.extend(fitting.map(|(_, line)| line));
    lines.push(match (more, tuner.shows_all_metrics) {
        (0, _) => Line::default(),
        (more, false) => Line::raw(format!("and {more} more: m")),
        (more, true) => Line::raw(format!("and {more} more on a taller terminal")),
    });
    lines.push(Line::default());
    lines.push(bar_line(&shown.sample, stepper, area.width));
    lines.extend(why);
    if let Some(failure) = &shown.failure {
        lines = vec![
            Line::styled("failed", Style::new().add_modifier(Modifier::BOLD)),
            Line::raw(failure.clone()),
        ];
    }
    let lines = Paragraph::new(lines).wrap(Wrap { trim: false });
    canvas.screen.render_widget(lines, area);
}

/// The names of the metrics that are shown in so many lines: those of the headline first.
fn shown_names(
    numbers: &[(&'static str, Line<'static>)],
    room: usize,
    is_all: bool,
) -> Vec<&'static str> {
    let is_measured = |name: &&str| numbers.iter().any(|(measured, _)| measured == name);
    let mut names: Vec<_> = HEADLINE.into_iter().filter(is_measured).collect();
    if is_all {
        let others = numbers.iter().map(|(name, _)| *name);
        names.extend(others.filter(|name| !HEADLINE.contains(name)));
    }
    names.truncate(if is_all { room } else { room.min(MAX_HEADLINE) });
    names
}

fn sample_head(shown: &TuneState) -> Line<'static> {
    let SampleView { done, frames, .. } = shown.sample;
    let sample = match (done, frames) {
        (_, 0) => "reading".to_owned(),
        (done, frames) if done == frames => svl::counted(frames as u64, "pair"),
        (done, frames) => format!("{done}/{frames}"),
    };
    Line::styled(
        format!("{:<14}{:>7}{sample:>9}{:>7}   95 %", "", "frame", "change"),
        Style::new().add_modifier(Modifier::UNDERLINED),
    )
}

/// A change as cells of a table: before, after, the difference, its interval.
pub(super) fn change_cells(change: &Change) -> [String; 4] {
    let metric = change.metric;
    // The unit is that of the values.
    let signed = |value| {
        let text = signed(metric, value);
        text.split(' ').next().unwrap_or_default().to_owned()
    };
    let interval = change.interval.map_or(String::new(), |(low, high)| {
        format!("{}..{}", signed(low), signed(high))
    });
    let [base, other] = [change.base, change.other].map(|value| compact(metric, value));
    match change.judgement {
        Judgement::Equal => [base, other, "=".to_owned(), String::new()],
        _ => [base, other, signed(change.difference), interval],
    }
}

/// A value in few characters.
fn compact(metric: &Metric, value: f64) -> String {
    match metric.unit {
        MetricUnit::Ms if value >= 10.0 => format!("{value:.0}ms"),
        _ => metric.show(value).replace(' ', ""),
    }
}

/// Lines of the metrics that the frame or the sample has, by their names: value, value, change and
/// interval.
fn number_lines(
    shown: &TuneState,
    side: usize,
    colors: bool,
) -> Vec<(&'static str, Line<'static>)> {
    let line = |metric: &'static Metric| {
        let frame = shown.frame.as_ref();
        let frame = frame.and_then(|frame| frame_value(frame, metric, side));
        let mut changes = shown.sample.changes.iter();
        let change = changes.find(|change| change.metric == metric);
        if frame.is_none() && change.is_none() {
            return None;
        }
        let [base, other, difference, interval] =
            change.map_or_else(<[String; 4]>::default, change_cells);
        let (name, frame) = (metric.name, frame.unwrap_or_default());
        let sample = if side == 0 { other } else { base };
        // A mark, for eyes and terminals without colours.
        let (mark, color) = match change.map(|change| change.judgement) {
            Some(Judgement::Better) => ('+', Color::Green),
            Some(Judgement::Worse) => ('!', Color::Red),
            _ => (' ', Color::Reset),
        };
        let style = if colors && mark != ' ' {
            Style::new().fg(color)
        } else {
            Style::new()
        };
        let line = Line::from(vec![
            Span::raw(format!("{name:<14}{frame:>7}{sample:>9}")),
            Span::styled(format!("{difference:>7} {mark}{interval}"), style),
        ]);
        Some((name, line))
    };
    METRICS.iter().filter_map(line).collect()
}

fn frame_value(frame: &FrameView, metric: &Metric, side: usize) -> Option<String> {
    match metric.origin {
        MetricOrigin::Time => frame.ms[side].map(|ms| compact(metric, ms)),
        _ => {
            let value = frame.sides[side].as_ref()?.metrics.value(metric);
            value.map(|value| compact(metric, value))
        }
    }
}

/// The metric that frames are ranked by, over time; the frame that is shown is marked.
fn bar_line(sample: &SampleView, stepper: &Stepper<'_>, width: u16) -> Line<'static> {
    let Some((metric, _)) = sample.ranked_by else {
        return Line::default();
    };
    let head = format!("{:<14}", metric.name);
    let values = sample.values.iter();
    let values: Vec<_> = values.map(|(_, value)| value.unwrap_or(0.0)).collect();
    let most = values.iter().fold(0.0_f64, |a, v| a.max(*v));
    let columns = usize::from(width)
        .saturating_sub(head.len() + 1)
        .min(values.len());
    let mut spans = vec![Span::raw(head)];
    for column in 0..columns {
        let part = column * values.len() / columns..(column + 1) * values.len() / columns;
        let value = values[part.clone()].iter().fold(0.0_f64, |a, v| a.max(*v));
        let height = if most > 0.0 { value / most } else { 0.0 };
        let bar = BARS[((height * 7.0).round() as usize).min(7)];
        let is_here = sample.values[part]
            .iter()
            .any(|(at, _)| *at == stepper.frame().sequence);
        let style = if is_here {
            Style::new().add_modifier(Modifier::REVERSED)
        } else {
            Style::new()
        };
        spans.push(Span::styled(bar.to_string(), style));
    }
    Line::from(spans)
}

/// Invalid pixels of the frame by reason, with the change.
fn why_lines(shown: &TuneState, side: usize, width: u16) -> Vec<Line<'static>> {
    let Some(frame) = &shown.frame else {
        return Vec::new();
    };
    let why = [0, 1].map(|side| frame.sides[side].as_ref().map_or([0; _], |side| side.why));
    let share = |side: usize, i: usize| 100.0 * why[side][i] as f64 / frame.pixels as f64;
    let words = Reason::PIXELS.iter().enumerate().filter_map(|(i, reason)| {
        let (now, before) = (share(side, i), share(1, i));
        let is_shown = *reason != Reason::Valid && (why[0][i] > 0 || why[1][i] > 0);
        let change = if (now - before).abs() < 0.05 {
            String::new()
        } else {
            format!(" ({:+.1})", now - before)
        };
        is_shown.then(|| format!("{} {now:.1} %{change}", reason.name()))
    });
    let mut lines = vec!["no disparity:".to_owned()];
    for word in words {
        let last = lines.last_mut().expect("one to begin with");
        if last.chars().count() + word.chars().count() + 2 > usize::from(width) {
            lines.push(format!("  {word}"));
        } else {
            last.push_str("  ");
            last.push_str(&word);
        }
    }
    lines.truncate(4);
    lines.into_iter().map(Line::raw).collect()
}

fn draw_pictures(tuner: &Tuner, area: Rect, canvas: &mut ToolCanvas<'_, '_>) {
    let Some(frame) = &tuner.shown.frame else {
        return;
    };
    let halves = [Constraint::Fill(1); 2];
    let sides = Layout::horizontal(halves).areas::<2>(area);
    let names = ["disparities", "disparities of the setting compared with"];
    for ((place, side), name) in sides.into_iter().zip(&frame.sides).zip(names) {
        let [head, room] =
            Layout::vertical([Constraint::Length(1), Constraint::Fill(1)]).areas(place);
        canvas.screen.render_widget(Paragraph::new(name), head);
        if let Some(gray) = side.as_ref().and_then(|side| side.picture.as_ref()) {
            let size = picture::fitting((gray.width(), gray.height()), room.as_size());
            let place = Rect::from((room.as_position(), size));
            picture::draw(gray, place, canvas.shades, canvas.screen.buffer_mut());
        }
    }
}

/// The chosen knob in words.
fn description(tuner: &Tuner) -> String {
    let knobs = tuner.pair()[0].knobs();
    let Some(knob) = knobs.get(tuner.chosen) else {
        return String::new();
    };
    let unit = match knob.unit {
        "" => String::new(),
        unit => format!(" {unit}"),
    };
    let (name, range, description) = (knob.name, knob.range, knob.description);
    let default = range.default();
    format!("{name}: {range}; default {default}{unit}. {description}")
}
