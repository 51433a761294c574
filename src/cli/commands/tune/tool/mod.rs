//! The tool that turns knobs: its keys, their effect, and its files.

mod view;

use super::shown::{Job, TuneState, title};
use super::worker::TuneWorker;
use crate::cli::shared::stepper::Key::{self, Press};
use crate::cli::shared::stepper::{StepTool, Stepper, ToolCanvas};
use crate::cli::shared::usage;
use ratatui::crossterm::event::KeyCode::{Char, Down, Enter, Left, Right, Tab, Up};
use ratatui::layout::{Position, Rect};
use std::path::{Path, PathBuf};
use svl::filter::FilterKind;
use svl::outputs;
use svl::scenario::Scenario;
use svl::score::Metric;
use svl::tune::{Knob, TunedSetting, scenario_toml};

/// The place in the source that is tuned on.
type TuneStepper<'a> = Stepper<'a, Tuner>;

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
    /// The state now, those that an undo returns to, and behind it those of a redo.
    states: Vec<Knobs>,
    state: usize,
    /// The settings that it began with.
    begun: Vec<TunedSetting>,
    /// Place in the list of knobs.
    chosen: usize,
    shows_compared: bool,
    shows_all_metrics: bool,
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
        let begun = Knobs {
            compared: settings.clone(),
            settings: settings.clone(),
            current: 0,
        };
        Self {
            shown: worker.shown(),
            worker,
            states: vec![begun],
            state: 0,
            begun: settings,
            chosen: 0,
            shows_compared: false,
            shows_all_metrics: false,
            worst: None,
            out,
            scenario,
            filters,
            rows: Vec::new(),
            written: Vec::new(),
        }
    }

    fn knobs(&self) -> &Knobs {
        &self.states[self.state]
    }

    /// The setting that is turned, and the one that it is compared with.
    fn pair(&self) -> [&TunedSetting; 2] {
        let knobs = self.knobs();
        [&knobs.settings, &knobs.compared].map(|settings| &settings[knobs.current])
    }

    /// The setting that the current algorithm began with.
    fn begun(&self) -> &TunedSetting {
        &self.begun[self.knobs().current]
    }

    /// Which of the two is on the screen.
    fn side(&self) -> usize {
        usize::from(self.shows_compared)
    }

    fn knob(&self) -> Knob {
        let knobs = self.pair()[0].knobs();
        knobs[self.chosen.min(knobs.len() - 1)]
    }

    fn ask(&self, stepper: &TuneStepper<'_>) {
        self.worker.ask(Job {
            frame: std::sync::Arc::clone(&stepper.frame),
            settings: self.pair().map(TunedSetting::clone),
        });
    }

    /// Takes another state of the knobs, which can be undone.
    fn change(&mut self, to: Knobs, stepper: &TuneStepper<'_>) {
        self.states.truncate(self.state + 1);
        self.states.push(to);
        if self.states.len() > 1 + MAX_UNDONE {
            self.states.remove(0);
        }
        self.go_to_state(self.states.len() - 1, stepper);
    }

    fn go_to_state(&mut self, state: usize, stepper: &TuneStepper<'_>) {
        self.state = state;
        self.shows_compared = false;
        self.worst = None;
        self.chosen = self.chosen.min(self.pair()[0].knobs().len() - 1);
        self.ask(stepper);
    }

    /// Takes a new setting of the current algorithm; grid and cells hold for all.
    fn set(&mut self, setting: svl::Result<TunedSetting>, stepper: &mut TuneStepper<'_>) {
        let setting = match setting {
            Ok(setting) => setting,
            Err(error) => return stepper.say(error.to_string()),
        };
        let mut to = self.knobs().clone();
        for other in to.settings.iter_mut().chain(&mut to.compared) {
            (other.grid, other.cells) = (setting.grid, setting.cells);
        }
        to.settings[to.current] = setting;
        self.change(to, stepper);
    }

    fn turn(&mut self, up: bool, coarse: bool, stepper: &mut TuneStepper<'_>) {
        let turned = self.pair()[0].stepped(&self.knob(), up, coarse);
        self.set(turned, stepper);
    }

    fn undone(&mut self, stepper: &mut TuneStepper<'_>) {
        match self.state.checked_sub(1) {
            Some(before) => self.go_to_state(before, stepper),
            None => stepper.say("there is nothing to undo"),
        }
    }

    fn redone(&mut self, stepper: &mut TuneStepper<'_>) {
        match self.state + 1 {
            next if next < self.states.len() => self.go_to_state(next, stepper),
            _ => stepper.say("there is nothing to redo"),
        }
    }

    /// Goes to the next worse frame, or to the next better one.
    fn go_to_worst(&mut self, worse: bool, stepper: &mut TuneStepper<'_>) {
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
    fn ask_value(&self, text: String, stepper: &mut TuneStepper<'_>) {
        let Knob { name, range, .. } = self.knob();
        let question = format!("{name} ({range})");
        stepper.ask(question, text, "", |tuner, text, stepper| {
            let typed = tuner.pair()[0].typed(&tuner.knob(), &text);
            tuner.set(typed, stepper);
        });
    }

    fn ask_file(&self, stepper: &mut TuneStepper<'_>) {
        let proposed = self.out.clone().unwrap_or_else(|| {
            let others = (2..1000).map(|n| format!("tuned-{n}.toml"));
            let mut names = std::iter::once("tuned.toml".to_owned()).chain(others);
            let free = names.find(|name| !Path::new(name).exists());
            free.unwrap_or_default().into()
        });
        let text = proposed.display().to_string();
        stepper.ask("write to", text, "", |tuner, path, stepper| {
            let words = tuner.write(Path::new(&path), stepper);
            stepper.say(words.unwrap_or_else(|error| format!("{error:#}")));
        });
    }

    fn write(&mut self, path: &Path, stepper: &TuneStepper<'_>) -> anyhow::Result<String> {
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
        let markdown = self.markdown(&stepper.name);
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
        let shown = ["right", "wrong", "estimated_right", "coverage", "time"];
        for (written, changes) in self.shown.tried.iter() {
            text += &format!("\n- `{written}`:");
            for metric in shown.into_iter().filter_map(Metric::find) {
                let Some(change) = changes.iter().find(|change| change.metric == metric) else {
                    continue;
                };
                let [_, other, difference, interval] = view::change_cells(change);
                let mut compared = vec![difference, interval];
                compared.retain(|cell| !cell.is_empty());
                text += &format!(" {} {other} ({});", metric.words, compared.join(", "));
            }
        }
        text + "\n"
    }

    /// The text that is printed at the end.
    pub(super) fn farewell(&self) -> String {
        let settings = self.knobs().settings.iter().zip(&self.begun);
        let settings = settings.map(|(setting, begun)| {
            match [setting, begun].map(|setting| title(&setting.algorithm)) {
                [now, before] if now == before => now,
                [now, before] => format!("{now}  (began as {before})"),
            }
        });
        let lines = settings.chain(self.written.iter().cloned());
        lines.map(|line| line + "\n").collect()
    }

    fn go_to_next_algorithm(&mut self, stepper: &mut TuneStepper<'_>) {
        let mut to = self.knobs().clone();
        if to.settings.len() == 1 {
            return stepper.say("there is one algorithm; name more with --algo");
        }
        to.current = (to.current + 1) % to.settings.len();
        self.chosen = 0;
        self.change(to, stepper);
    }
}

impl StepTool for Tuner {
    const KEYS: &'static [(&'static str, &'static str)] = &[
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

    const HINT: &'static str =
        "arrows turn  , . step  [ ] worst  a c compare  u undo  w write  ? keys  q quit";

    fn show(&mut self, stepper: &mut TuneStepper<'_>) -> anyhow::Result<()> {
        self.ask(stepper);
        Ok(())
    }

    fn key(&mut self, key: Key, stepper: &mut TuneStepper<'_>) -> anyhow::Result<bool> {
        let knobs = self.pair()[0].knobs().len();
        match key {
            Press(Up) => self.chosen = self.chosen.checked_sub(1).unwrap_or(knobs - 1),
            Press(Down) => self.chosen = (self.chosen + 1) % knobs,
            Press(Left) | Key::ScrollDown => self.turn(false, false, stepper),
            Press(Right) | Key::ScrollUp => self.turn(true, false, stepper),
            Key::FarLeft => self.turn(false, true, stepper),
            Key::FarRight => self.turn(true, true, stepper),
            Press(Char(c)) if c.is_ascii_digit() || c == '-' => self.ask_value(c.into(), stepper),
            Press(Enter) => {
                let value = self.pair()[0].value(&self.knob()).written();
                self.ask_value(value, stepper);
            }
            Press(Char('r')) => {
                let (knob, begun) = (self.knob(), self.begun());
                let reset = self.pair()[0].with(&knob, &begun.value(&knob));
                self.set(reset, stepper);
            }
            Press(Char('R')) => self.set(Ok(self.begun().clone()), stepper),
            Press(Tab) => self.go_to_next_algorithm(stepper),
            Press(Char('[')) => self.go_to_worst(true, stepper),
            Press(Char(']')) => self.go_to_worst(false, stepper),
            Press(Char('m')) => self.shows_all_metrics = !self.shows_all_metrics,
            Press(Char('a')) => self.shows_compared = !self.shows_compared,
            Press(Char('c')) => {
                let mut to = self.knobs().clone();
                to.compared[to.current] = to.settings[to.current].clone();
                self.change(to, stepper);
                stepper.say("compared with this setting from now on");
            }
            Press(Char('u')) => self.undone(stepper),
            Key::Redo => self.redone(stepper),
            Press(Char('w')) => self.ask_file(stepper),
            Key::Click(column, row) => {
                let at = Position::new(column, row);
                let hit = self.rows.iter().find(|(place, _)| place.contains(at));
                self.chosen = hit.map_or(self.chosen, |(_, knob)| *knob);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn poll(&mut self, stepper: &mut TuneStepper<'_>) -> bool {
        let before = self.shown.progress();
        self.shown = self.worker.shown();
        if let Some(words) = self.shown.says.take() {
            stepper.say(words);
        }
        before != self.shown.progress()
    }

    fn settle(&mut self) {
        self.worker.settle();
    }

    fn draw(&mut self, stepper: &TuneStepper<'_>, canvas: &mut ToolCanvas<'_, '_>) {
        self.rows = view::draw(self, stepper, canvas);
    }
}
