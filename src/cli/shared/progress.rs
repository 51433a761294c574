//! The progress bars of long work, and Ctrl-C.

use super::terminal::{WarningLog, print_error};
use indicatif::{ProgressBar, ProgressFinish, ProgressState, ProgressStyle};
use std::fmt::Write;
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use svl::console::{Bar, Console, Unit};

static HANDLER: OnceLock<()> = OnceLock::new();

/// Time after the first interrupt within which others are the same one: `timeout` sends it to svl
/// and to its group.
const SAME_INTERRUPT: Duration = Duration::from_millis(200);

/// True once Ctrl-C (or SIGTERM) came. The first asks the work to end orderly; the next one ends
/// the program at once.
pub(crate) fn interrupted() -> bool {
    svl::interrupt::requested()
}

/// Begins to listen for Ctrl-C.
pub(crate) fn listen_for_interrupt() {
    HANDLER.get_or_init(|| {
        let mut first: Option<Instant> = None;
        let handler = move || {
            svl::interrupt::request();
            if first.get_or_insert_with(Instant::now).elapsed() > SAME_INTERRUPT {
                std::process::exit(130);
            }
        };
        // Without a handler Ctrl-C ends the program at once, which is no worse than a power cut:
        // files survive that.
        if let Err(error) = ctrlc::set_handler(handler) {
            tracing::warn!("Ctrl-C will end svl at once: {error}");
        }
    });
}

/// The terminal; without bars and notes if `quiet`.
pub(crate) struct Terminal {
    pub(crate) quiet: bool,
}

impl Console for Terminal {
    fn bar(&self, work: &str, unit: Unit, total: Option<u64>) -> Box<dyn Bar> {
        listen_for_interrupt();
        let bar = if self.quiet {
            ProgressBar::hidden()
        } else {
            total.map_or_else(ProgressBar::no_length, ProgressBar::new)
        };
        let form = match (unit, total) {
            (Unit::Drives, _) => "{bar:16} {pos:>6}/{len} drives {eta:>4} left, {msg} pairs",
            (Unit::Epochs, _) => "{bar:12} {pos:>4}/{len} epochs {eta:>3} left  {msg}",
            (Unit::Rows, _) => "{spinner} {pos:>6} rows {per_sec:>7}{msg}",
            (Unit::Pairs, Some(_)) => {
                "{bar:16} {pos:>6}/{len} pairs {per_sec:>7} {eta:>3} left{msg}"
            }
            (Unit::Pairs, None) => "{spinner} {pos:>6} pairs {per_sec:>7}{msg}",
        };
        let rate = |state: &ProgressState, w: &mut dyn Write| {
            let _ = write!(w, "{:.0}/s", state.per_sec());
        };
        // The templates above are constants, which the tests run.
        let style = ProgressStyle::with_template(&format!("{{prefix:<24!}} {form}"));
        bar.set_style(style.expect("a valid template").with_key("per_sec", rate));
        bar.set_prefix(work.to_owned());
        Box::new(TerminalBar(bar.with_finish(ProgressFinish::AndClear)))
    }

    fn note(&self, line: &str) {
        if !self.quiet {
            print_error(line);
        }
    }

    fn warnings(&self) -> Vec<String> {
        WarningLog::lines()
    }

    fn begin_warnings(&self) -> usize {
        WarningLog::begin_part()
    }
}

struct TerminalBar(ProgressBar);

impl Bar for TerminalBar {
    fn set(&self, done: u64) {
        self.0.set_position(done);
    }

    fn step(&self) {
        self.0.inc(1);
    }

    fn show(&self, text: String) {
        if !self.0.is_hidden() {
            self.0.set_message(text);
        }
    }

    fn suspend(&self, print: &mut dyn FnMut()) {
        self.0.suspend(print);
    }
}

/// A bar that counts bytes, with their rate.
pub(crate) struct Bytes(ProgressBar);

impl Bytes {
    pub(crate) fn new(what: &str, quiet: bool) -> Self {
        listen_for_interrupt();
        let bar = if quiet {
            ProgressBar::hidden()
        } else {
            ProgressBar::no_length()
        };
        let form =
            "{prefix:<24!} {bar:12} {bytes:>10}/{total_bytes} {bytes_per_sec:>12} {eta:>3} left";
        // The template above is a constant; the tests run it.
        bar.set_style(ProgressStyle::with_template(form).expect("a valid template"));
        bar.set_prefix(what.to_owned());
        Self(bar)
    }

    /// `done` bytes of `total`, if that is known. Returns false to end.
    pub(crate) fn go_on(&self, done: u64, total: Option<u64>) -> bool {
        if let Some(total) = total.filter(|&total| self.0.length() != Some(total)) {
            self.0.set_length(total);
            // Bytes of an earlier download are no measure of this one's rate.
            self.0.set_position(done);
            self.0.reset_eta();
        }
        self.0.set_position(done);
        !interrupted()
    }

    /// Takes the bar away.
    pub(crate) fn clear(self) {
        self.0.finish_and_clear();
    }
}
