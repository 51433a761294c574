//! The screen: knobs on the left, metrics on the right, and below, if there is room, the
//! disparities.

use super::{TuneStepper, Tuner};
use crate::cli::commands::tune::shown::{FrameSide, SampleView, TuneState, title};
use crate::cli::shared::stepper::{ToolCanvas, picture};
use ratatui::layout::Constraint::{Fill, Length};
use ratatui::layout::{Layout, Rect};
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Wrap};
use svl::report::compare::{Change, Judgement, unitless};
use svl::score::{METRICS, Metric, MetricOrigin, MetricSource as _, MetricUnit};
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
    "estimated_right",
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
    stepper: &TuneStepper<'_>,
    canvas: &mut ToolCanvas<'_, '_>,
) -> Vec<(Rect, usize)> {
    let area = canvas.area;
    let is_roomy = area.width >= ROOMY.0 && area.height >= ROOMY.1;
    let picture = if is_roomy { PICTURE } else { 0 };
    let rows = Layout::vertical([Length(1), Fill(1), Length(picture), Length(2)]);
    let [head, body, below, words] = rows.areas(area);
    let [left, right] = Layout::horizontal([Length(KNOBS), Fill(1)]).areas(body);
    canvas.screen.render_widget(heading(tuner), head);
    let places = knobs(tuner, left, canvas);
    let lines = numbers(tuner, stepper.frame.sequence, right, canvas.shades);
    let lines = Paragraph::new(lines).wrap(Wrap { trim: false });
    canvas.screen.render_widget(lines, right);
    if is_roomy {
        pictures(&tuner.shown.sides, below, canvas);
    }
    let description = Paragraph::new(description(tuner)).wrap(Wrap { trim: true });
    canvas.screen.render_widget(description, words);
    places
}

/// The settings, and which of how many algorithms it is.
fn heading(tuner: &Tuner) -> Line<'static> {
    let [now, compared] = tuner.pair().map(|setting| title(&setting.algorithm));
    let (shown, words) = match tuner.side() {
        0 if now == compared => (now, String::new()),
        0 => (now, format!("  compared with {compared}")),
        _ => (compared, "  as compared with; a: back".to_owned()),
    };
    let (place, count) = (tuner.knobs().current + 1, tuner.begun.len());
    let place = (count > 1).then(|| format!("  ({place} of {count}, Tab)"));
    Line::from_iter([
        format!(" {shown}").bold(),
        words.into(),
        place.unwrap_or_default().into(),
    ])
}

/// The list of knobs around the chosen one; returns where each is.
fn knobs(tuner: &Tuner, area: Rect, canvas: &mut ToolCanvas<'_, '_>) -> Vec<(Rect, usize)> {
    let [now, compared] = tuner.pair();
    let shown = tuner.pair()[tuner.side()];
    // Headings take a row, too.
    let mut rows: Vec<(Option<usize>, String)> = Vec::new();
    let mut part = KnobPart::Algorithm;
    for (i, knob) in now.knobs().iter().enumerate() {
        if knob.part != part {
            part = knob.part;
            rows.push((None, part.words().to_owned()));
        }
        // Grid and cells hold for both settings.
        let other = match part {
            KnobPart::Algorithm | KnobPart::Filter => compared,
            KnobPart::Grid | KnobPart::Cells => tuner.begun(),
        };
        let (value, other) = (shown.value(knob).to_string(), other.value(knob).to_string());
        let other = (value != other).then(|| format!(" ({other})"));
        let mark = if i == tuner.chosen { '>' } else { ' ' };
        let (name, other) = (knob.name, other.unwrap_or_default());
        rows.push((Some(i), format!("{mark}{name:<18} {value}{other}")));
    }
    let is_chosen = |(knob, _): &(Option<usize>, String)| *knob == Some(tuner.chosen);
    let chosen = rows.iter().position(is_chosen).unwrap_or(0);
    let (height, width) = (usize::from(area.height), usize::from(area.width));
    let last = rows.len().saturating_sub(height);
    let first = (chosen + 2).saturating_sub(height).min(last);
    let mut places = Vec::new();
    for ((knob, text), place) in rows.into_iter().skip(first).zip(area.rows()) {
        let style = match knob {
            None => Style::new().underlined(),
            Some(i) if i == tuner.chosen => Style::new().reversed(),
            Some(_) => Style::new(),
        };
        let text: String = text.chars().take(width.saturating_sub(1)).collect();
        let line = Paragraph::new(text).style(style);
        canvas.screen.render_widget(line, place);
        places.extend(knob.map(|knob| (place, knob)));
    }
    places
}

/// The metrics, or the reason why there are none.
fn numbers(tuner: &Tuner, sequence: u64, area: Rect, colors: bool) -> Vec<Line<'static>> {
    let (shown, side, is_all) = (&tuner.shown, tuner.side(), tuner.shows_all_metrics);
    if let Some(failure) = &shown.failure {
        return vec!["failed".bold().into(), Line::raw(failure.clone())];
    }
    let line = |metric| Some((metric, number_line(shown, metric, side, colors)?));
    let numbers: Vec<_> = METRICS.iter().filter_map(line).collect();
    let (why, bars) = (why_lines(shown, side, area.width), 2);
    let room = usize::from(area.height).saturating_sub(2 + bars + why.len());
    // The headline comes first.
    let place = |metric: &Metric| HEADLINE.iter().position(|name| *name == metric.name);
    let mut fitting: Vec<_> = numbers.iter().map(|(metric, _)| *metric).collect();
    fitting.retain(|metric| is_all || place(metric).is_some());
    fitting.sort_by_key(|metric| place(metric).unwrap_or(HEADLINE.len()));
    fitting.truncate(if is_all { room } else { room.min(MAX_HEADLINE) });
    let more = match (numbers.len() - fitting.len(), is_all) {
        (0, _) => String::new(),
        (more, false) => format!("and {more} more: m"),
        (more, true) => format!("and {more} more on a taller terminal"),
    };
    let numbers = numbers.into_iter();
    let numbers = numbers.filter(|(metric, _)| fitting.contains(metric));
    let mut lines = vec![sample_head(shown)];
    lines.extend(numbers.map(|(_, line)| line));
    lines.extend([more.into(), Line::default()]);
    lines.push(bar_line(&shown.sample, sequence, area.width));
    lines.extend(why.into_iter().map(Line::raw));
    lines
}

fn sample_head(shown: &TuneState) -> Line<'static> {
    let sample = match (shown.sample.done, shown.sample.frames) {
        (_, 0) => "reading".to_owned(),
        (done, frames) if done == frames => svl::counted(frames as u64, "pair"),
        (done, frames) => format!("{done}/{frames}"),
    };
    let head = format!("{:<14}{:>7}{sample:>9}{:>7}   95 %", "", "frame", "change");
    Line::styled(head, Style::new().underlined())
}

/// A change as cells of a table: before, after, the difference, its interval.
pub(super) fn change_cells(change: &Change) -> [String; 4] {
    let metric = change.metric;
    // The unit is that of the values.
    let signed = |value| unitless(metric, value);
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

/// A metric that the frame or the sample has: value, value, change and interval.
fn number_line(
    shown: &TuneState,
    metric: &'static Metric,
    side: usize,
    colors: bool,
) -> Option<Line<'static>> {
    let frame = shown.sides[side].as_ref();
    let frame = frame.and_then(|side| match metric.origin {
        MetricOrigin::Time => side.ms,
        _ => side.metrics.value(metric),
    });
    let frame = frame.map(|value| compact(metric, value));
    let mut changes = shown.sample.changes.iter();
    let change = changes.find(|change| change.metric == metric);
    if frame.is_none() && change.is_none() {
        return None;
    }
    let [base, other, difference, interval] = change.map(change_cells).unwrap_or_default();
    let (name, frame) = (metric.name, frame.unwrap_or_default());
    let sample = if side == 0 { other } else { base };
    // A mark, for eyes and terminals without colours.
    let (mark, color) = match change.map(|change| change.judgement) {
        Some(Judgement::Better) => ('+', Some(Color::Green)),
        Some(Judgement::Worse) => ('!', Some(Color::Red)),
        _ => (' ', None),
    };
    let color = color.filter(|_| colors);
    let style = color.map_or(Style::new(), |color| Style::new().fg(color));
    let change = format!("{difference:>7} {mark}{interval}");
    let values = format!("{name:<14}{frame:>7}{sample:>9}");
    Some(Line::from(vec![values.into(), Span::styled(change, style)]))
}

/// The metric that frames are ranked by, over time; the frame that is shown is marked.
fn bar_line(sample: &SampleView, shown: u64, width: u16) -> Line<'static> {
    let Some((metric, _)) = sample.ranked_by else {
        return Line::default();
    };
    let head = format!("{:<14}", metric.name);
    let values = &sample.values;
    let highest = |part: &[(u64, Option<f64>)]| {
        let known = part.iter().filter_map(|(_, value)| *value);
        known.fold(0.0_f64, f64::max)
    };
    let most = highest(values);
    let room = usize::from(width).saturating_sub(head.len() + 1);
    let columns = room.min(values.len());
    let bars = (0..columns).map(|column| {
        let ends = [column, column + 1].map(|column| column * values.len() / columns);
        let part = &values[ends[0]..ends[1]];
        // Zero of a highest value of zero.
        let height = (highest(part) / most * 7.0).round() as usize;
        let bar = Span::raw(BARS[height.min(7)].to_string());
        let is_here = part.iter().any(|(sequence, _)| *sequence == shown);
        if is_here { bar.reversed() } else { bar }
    });
    Line::from_iter(std::iter::once(head.into()).chain(bars))
}

/// Invalid pixels of the frame by reason, with the change.
fn why_lines(shown: &TuneState, side: usize, width: u16) -> Vec<String> {
    if shown.sides.iter().all(Option::is_none) {
        return Vec::new();
    }
    let why = shown.sides.each_ref();
    let why = why.map(|side| side.as_ref().map_or([0.0; _], |side| side.why));
    let mut lines = vec!["no disparity:".to_owned()];
    for (i, reason) in Reason::PIXELS.iter().enumerate() {
        if *reason == Reason::Valid || why[0][i] + why[1][i] == 0.0 {
            continue;
        }
        let (name, now, before) = (reason.name(), why[side][i], why[1][i]);
        let mut words = format!("  {name} {now:.1} %");
        if (now - before).abs() >= 0.05 {
            words += &format!(" ({:+.1})", now - before);
        }
        let last = lines.last_mut().expect("one to begin with");
        if last.chars().count() + words.chars().count() > usize::from(width) {
            lines.push(words);
        } else {
            last.push_str(&words);
        }
    }
    lines.truncate(4);
    lines
}

fn pictures(sides: &[Option<FrameSide>; 2], area: Rect, canvas: &mut ToolCanvas<'_, '_>) {
    let places: [_; 2] = Layout::horizontal([Fill(1); 2]).areas(area);
    let names = ["disparities", "disparities of the setting compared with"];
    for ((place, side), name) in places.into_iter().zip(sides).zip(names) {
        let [head, room] = Layout::vertical([Length(1), Fill(1)]).areas(place);
        canvas.screen.render_widget(name, head);
        if let Some(gray) = side.as_ref().and_then(|side| side.picture.as_ref()) {
            let size = picture::fitting(gray.size(), room.as_size());
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
    let (name, range, description) = (knob.name, knob.range, knob.description);
    let default = format!("{} {}", range.default(), knob.unit);
    let default = default.trim_end();
    format!("{name}: {range}; default {default}. {description}")
}
