//! The tool that turns knobs: its keys, their effect, and its files.

mod view;

use super::shown::{Job, TuneState, title};
use super::worker::TuneWorker;
use crate::cli::shared::stepper::{Key, Reaction, StepTool, Stepper, ToolCanvas};
use crate::cli::shared::usage;
use ratatui::layout::{Position, Rect};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use svl::filter::FilterKind;
use svl::outputs;
use svl::scenario::Scenario;
use svl::score::Metric;
use svl::tune::{Knob, TunedSetting, scenario_toml};

/// Keys beside those of the stepper.
const KEYS: &[(&str, &str)] = &[
    ("up, down", "choose a parameter"),
    ("left, right", "turn it; with Shift ten times as far"),
    ("0.5 Enter", "type a value; Enter alone edits it"),
    ("r, R", "reset it, or all"),
    ("Tab", "the next algorithm"),
    ("[ ]", "to a worse frame, a better one"),
    ("m", "show all metrics, or six"),
    ("a", "show the setting compared with, and back"),
    ("c", "compare with this setting from now on"),
    ("u, Ctrl-R", "undo, redo"),
    ("w", "write scenario and notes"),
];

/// Largest number of changes that can be undone.
const MAX_UNDONE: usize = 1000;

/// All that keys change.
#[derive(Clone)]
struct Knobs {
    /// Per algorithm.
    settings: Vec<TunedSetting>,
    /// Settings that they are compared with.
    compared: Vec<TunedSetting>,
    current: usize,
}

/// State of the tuning session.
pub(super) struct Tuner {
    worker: TuneWorker,
    knobs: Knobs,
    /// The settings that it began with.
    begun: Vec<TunedSetting>,
    undo: Vec<Knobs>,
    redo: Vec<Knobs>,
    /// Place in the list of knobs.
    chosen: usize,
    shows_compared: bool,
    shows_all_metrics: bool,
    /// True if the line that is typed names a file; else it is a value.
    asks_file: bool,
    /// Place among the frames, the worst first.
    worst: Option<usize>,
    shown: TuneState,
    out: Option<PathBuf>,
    /// With the folder of its file.
    scenario: Option<Scenario>,
    /// Kinds of the filters, with their files.
    filters: Vec<(FilterKind, PathBuf)>,
    /// Place of the knobs on the screen.
    rows: Vec<(Rect, usize)>,
    written: Vec<String>,
}

impl Tuner {
    pub(super) fn new(
        settings: Vec<TunedSetting>,
        worker: TuneWorker,
        out: Option<PathBuf>,
        scenario: Option<Scenario>,
        filters: Vec<(FilterKind, PathBuf)>,
    ) -> Self {
        Self {
            shown: worker.shown(),
            worker,
            begun: settings.clone(),
            knobs: Knobs {
                compared: settings.clone(),
                settings,
                current: 0,
            },
            undo: Vec::new(),
            redo: Vec::new(),
            chosen: 0,
            shows_compared: false,
            shows_all_metrics: false,
            asks_file: false,
            worst: None,
            out,
            scenario,
            filters,
            rows: Vec::new(),
            written: Vec::new(),
        }
    }

    /// The setting that is turned, and the one that it is compared with.
    fn pair(&self) -> [&TunedSetting; 2] {
        let Knobs {
            settings,
            compared,
            current,
        } = &self.knobs;
        [&settings[*current], &compared[*current]]
    }

    /// The setting that the current algorithm began with.
    fn begun(&self) -> &TunedSetting {
        &self.begun[self.knobs.current]
    }

    /// Which of the two is on the screen.
    fn side(&self) -> usize {
        usize::from(self.shows_compared)
    }

    fn knob(&self) -> Knob {
        let knobs = self.pair()[0].knobs();
        knobs[self.chosen.min(knobs.len() - 1)]
    }

    fn ask(&self, stepper: &Stepper<'_>) {
        self.worker.ask(Job {
            frame: std::sync::Arc::clone(stepper.frame()),
            settings: self.pair().map(TunedSetting::clone),
        });
    }

    /// Takes another state of the knobs, which can be undone.
    fn change(&mut self, to: Knobs, stepper: &Stepper<'_>) {
        let before = std::mem::replace(&mut self.knobs, to);
        self.undo.push(before);
        if self.undo.len() > MAX_UNDONE {
            self.undo.remove(0);
        }
        self.redo.clear();
        self.changed(stepper);
    }

    fn changed(&mut self, stepper: &Stepper<'_>) {
        self.shows_compared = false;
        self.worst = None;
        self.chosen = self.chosen.min(self.pair()[0].knobs().len() - 1);
        self.ask(stepper);
    }

    /// Takes a new setting of the current algorithm; grid and cells hold for all.
    fn set(&mut self, setting: svl::Result<TunedSetting>, stepper: &mut Stepper<'_>) {
        let setting = match setting {
            Ok(setting) => setting,
            Err(error) => return stepper.say(error.to_string()),
        };
        let mut to = self.knobs.clone();
        for other in to.settings.iter_mut().chain(&mut to.compared) {
            (other.grid, other.cells) = (setting.grid, setting.cells);
        }
        to.settings[to.current] = setting;
        self.change(to, stepper);
    }

    fn turn(&mut self, up: bool, coarse: bool, stepper: &mut Stepper<'_>) {
        let turned = self.pair()[0].stepped(&self.knob(), up, coarse);
        self.set(turned, stepper);
    }

    fn undone(&mut self, is_redo: bool, stepper: &mut Stepper<'_>) {
        let (from, to) = if is_redo {
            (&mut self.redo, &mut self.undo)
        } else {
            (&mut self.undo, &mut self.redo)
        };
        let Some(other) = from.pop() else {
            let what = if is_redo { "redo" } else { "undo" };
            return stepper.say(format!("there is nothing to {what}"));
        };
        to.push(std::mem::replace(&mut self.knobs, other));
        self.changed(stepper);
    }

    /// Goes to the next worse frame, or to the next better one.
    fn go_to_worst(&mut self, worse: bool, stepper: &mut Stepper<'_>) {
        let ranked = self.shown.sample.worst();
        let Some(metric) = self.shown.sample.ranked_by.map(|(metric, _)| metric) else {
            return stepper.say("the sample is not run yet: its frames have no rank");
        };
        let last = ranked.len().saturating_sub(1);
        let place = match (self.worst, worse) {
            (None, _) => 0,
            (Some(place), true) => place.saturating_sub(1),
            (Some(place), false) => (place + 1).min(last),
        };
        if let Some((sequence, value)) = ranked.get(place) {
            self.worst = Some(place);
            stepper.go_to(*sequence);
            let value = if metric.counts() {
                format!("{value:.0}")
            } else {
                metric.show(*value)
            };
            let (words, number, count) = (metric.words, place + 1, ranked.len());
            stepper.say(format!("{words} {value}: worst {number} of {count}"));
        }
    }

    /// Asks for a value, with that text to begin with.
    fn ask_value(&mut self, text: String, stepper: &mut Stepper<'_>) {
        let knob = self.knob();
        let question = format!("{} ({})", knob.name, knob.range);
        self.asks_file = false;
        stepper.ask(question, text, "");
    }

    fn ask_file(&mut self, stepper: &mut Stepper<'_>) {
        let proposed = self.out.clone().unwrap_or_else(|| {
            let names = std::iter::once("tuned.toml".to_owned())
                .chain((2..1000).map(|n| format!("tuned-{n}.toml")));
            let mut free = names.filter(|name| !Path::new(name).exists());
            free.next().unwrap_or_default().into()
        });
        let text = proposed.display().to_string();
        self.asks_file = true;
        stepper.ask("write to".to_owned(), text, "");
    }

    fn write(&mut self, path: &Path, stepper: &Stepper<'_>) -> anyhow::Result<String> {
        let [now, compared] = self.pair();
        let mut algorithms = vec![now.algorithm.written()];
        let other = compared.algorithm.written();
        if !algorithms.contains(&other) {
            algorithms.push(other);
        }
        let toml = match &self.scenario {
            Some(scenario) => {
                let scenario = Scenario {
                    grid: now.grid,
                    cells: now.cells,
                    ..scenario.clone()
                };
                let on = now.algorithm.filters();
                let is_on =
                    |(kind, _): &&(FilterKind, _)| on.iter().any(|filter| filter.kind == *kind);
                let filters: Vec<_> = self.filters.iter().filter(is_on).cloned().collect();
                let folder = path.parent().unwrap_or(Path::new(""));
                scenario_toml(&scenario, &algorithms, &filters, folder)?
            }
            None => format!("# For a scenario.\nalgorithms = {algorithms:?}\n"),
        };
        let version = env!("CARGO_PKG_VERSION");
        let head = format!("# Written by `svl tune`, svl {version}.\n");
        let markdown = self.markdown(stepper.name());
        usage::ends_in(path, &["toml"])?;
        let words = outputs::write_with_page(path, &(head + &toml), &markdown)?;
        self.written.push(words.clone());
        Ok(format!("{words} written"))
    }

    /// Settings that were tried, over the sample.
    fn markdown(&self, source: &str) -> String {
        let [now, compared] = self.pair().map(|setting| title(&setting.algorithm));
        let mut text = format!(
            "# Tuned by hand on {source}\n\n`{now}`, compared with `{compared}`.\n\nOver a sample \
             of {} of the source, with the change from the setting compared with then and its 95 % \
             interval:\n",
            svl::counted(self.shown.sample.frames as u64, "pair")
        );
        let shown = ["right", "wrong", "unrivalled", "coverage", "time"].map(Metric::find);
        for (written, changes) in self.shown.tried.iter() {
            let _ = write!(text, "\n- `{written}`:");
            for metric in shown.iter().flatten() {
                let Some(change) = changes.iter().find(|change| change.metric == *metric) else {
                    continue;
                };
                let [_, other, difference, interval] = view::change_cells(change);
                let compared = [difference, interval].into_iter();
                let compared: Vec<_> = compared.filter(|cell| !cell.is_empty()).collect();
                let _ = write!(text, " {} {other} ({});", metric.words, compared.join(", "));
            }
        }
        text + "\n"
    }

    /// The text that is printed at the end.
    pub(super) fn farewell(&self) -> String {
        let mut text = String::new();
        for (setting, begun) in self.knobs.settings.iter().zip(&self.begun) {
            let [now, before] = [setting, begun].map(|setting| title(&setting.algorithm));
            let _ = if now == before {
                writeln!(text, "{now}")
            } else {
                writeln!(text, "{now}  (began as {before})")
            };
        }
        for words in &self.written {
            let _ = writeln!(text, "{words}");
        }
        text
    }

    fn go_to_next_algorithm(&mut self, stepper: &mut Stepper<'_>) {
        let mut to = self.knobs.clone();
        to.current = (to.current + 1) % to.settings.len();
        match to.settings.len() {
            1 => stepper.say("there is one algorithm; name more with --algo"),
            _ => {
                self.chosen = 0;
                self.change(to, stepper);
            }
        }
    }
}

impl StepTool for Tuner {
    fn keys(&self) -> &'static [(&'static str, &'static str)] {
        KEYS
    }

    fn hint(&self) -> &'static str {
        "arrows turn  , . step  [ ] worst  a c compare  u undo  w write  ? keys  q quit"
    }

    fn show(&mut self, stepper: &mut Stepper<'_>) -> anyhow::Result<()> {
        self.ask(stepper);
        Ok(())
    }

    fn key(&mut self, key: Key, stepper: &mut Stepper<'_>) -> anyhow::Result<Reaction> {
        let knobs = self.pair()[0].knobs().len();
        match key {
            Key::Up => self.chosen = self.chosen.checked_sub(1).unwrap_or(knobs - 1),
            Key::Down => self.chosen = (self.chosen + 1) % knobs,
            Key::Left | Key::ScrollDown => self.turn(false, false, stepper),
            Key::Right | Key::ScrollUp => self.turn(true, false, stepper),
            Key::FarLeft => self.turn(false, true, stepper),
            Key::FarRight => self.turn(true, true, stepper),
            Key::Char(c) if c.is_ascii_digit() || c == '-' => self.ask_value(c.into(), stepper),
            Key::Enter => {
                let value = self.pair()[0].value(&self.knob()).written();
                self.ask_value(value, stepper);
            }
            Key::Char('r') => {
                let knob = self.knob();
                let reset = self.pair()[0].with(&knob, &self.begun().value(&knob));
                self.set(reset, stepper);
            }
            Key::Char('R') => {
                let begun = self.begun().clone();
                self.set(Ok(begun), stepper);
            }
            Key::Tab => self.go_to_next_algorithm(stepper),
            Key::Char('[') => self.go_to_worst(true, stepper),
            Key::Char(']') => self.go_to_worst(false, stepper),
            Key::Char('m') => self.shows_all_metrics = !self.shows_all_metrics,
            Key::Char('a') => self.shows_compared = !self.shows_compared,
            Key::Char('c') => {
                let mut to = self.knobs.clone();
                to.compared[to.current] = to.settings[to.current].clone();
                self.change(to, stepper);
                stepper.say("compared with this setting from now on");
            }
            Key::Char('u') => self.undone(false, stepper),
            Key::Redo => self.undone(true, stepper),
            Key::Char('w') => self.ask_file(stepper),
            Key::Click(column, row) => {
                let at = Position::new(column, row);
                let hit = self.rows.iter().find(|(place, _)| place.contains(at));
                self.chosen = hit.map_or(self.chosen, |(_, knob)| *knob);
            }
            Key::Char('q') => return Ok(Reaction::Quit),
            _ => return Ok(Reaction::Ignored),
        }
        Ok(Reaction::Taken)
    }

    fn answer(&mut self, text: &str, stepper: &mut Stepper<'_>) -> anyhow::Result<()> {
        if self.asks_file {
            let words = self.write(Path::new(text), stepper);
            stepper.say(words.unwrap_or_else(|error| format!("{error:#}")));
        } else {
            let typed = self.pair()[0].typed(&self.knob(), text);
            self.set(typed, stepper);
        }
        Ok(())
    }

    fn poll(&mut self, stepper: &mut Stepper<'_>) -> bool {
        let before = (
            self.shown.done,
            self.shown.sample.done,
            self.shown.sample.frames,
            self.shown.failure.is_some(),
        );
        self.shown = self.worker.shown();
        if let Some(words) = self.shown.says.take() {
            stepper.say(words);
        }
        let sample = &self.shown.sample;
        let is_failed = self.shown.failure.is_some();
        before != (self.shown.done, sample.done, sample.frames, is_failed)
    }

    fn settle(&mut self) {
        self.worker.settle();
    }

    fn draw(&mut self, stepper: &Stepper<'_>, canvas: &mut ToolCanvas<'_, '_>) {
        self.rows = view::draw(self, stepper, canvas);
    }
}
