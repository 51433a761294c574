//! The progress bars of long work, and Ctrl-C.

use super::live::LiveTable;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use svl::memory::{Counted, MemoryUse, used_by};
use svl::run::Monitor;

/// Counts what [`Progress`] says of memory.
#[global_allocator]
static ALLOCATOR: Counted = Counted;

static HANDLER: OnceLock<()> = OnceLock::new();

/// Whether Ctrl-C (or SIGTERM) came. The first asks the work to end orderly; the second ends the
/// program at once.
pub(crate) fn interrupted() -> bool {
    svl::interrupt::requested()
}

/// Begins to listen for Ctrl-C.
pub(crate) fn listen_for_interrupt() {
    HANDLER.get_or_init(|| {
        let handler = || {
            if svl::interrupt::request() {
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

/// A bar that counts pairs, with their rate.
pub(crate) struct Progress(ProgressBar, Option<LiveTable>);

impl Progress {
    /// `pairs`: how many there will be, where known.
    pub(crate) fn new(what: &str, pairs: Option<u64>, quiet: bool) -> Self {
        Self::with_table(what, pairs, quiet, None)
    }

    /// A bar that counts rows of tables.
    pub(crate) fn of_rows(what: &str, quiet: bool) -> Self {
        Self::styled(what, (None, "rows"), quiet, None)
    }

    /// With a table below it.
    pub(crate) fn with_table(
        what: &str,
        pairs: Option<u64>,
        quiet: bool,
        table: Option<&LiveTable>,
    ) -> Self {
        Self::styled(what, (pairs, "pairs"), quiet, table)
    }

    fn styled(
        what: &str,
        (count, unit): (Option<u64>, &str),
        quiet: bool,
        table: Option<&LiveTable>,
    ) -> Self {
        listen_for_interrupt();
        let bar = if quiet {
            ProgressBar::hidden()
        } else {
            count.map_or_else(ProgressBar::no_length, ProgressBar::new)
        };
        let form = match count {
            Some(_) => "{bar:16} {pos:>6}/{len} UNIT {per_sec:>7} {eta:>3} left{msg}",
            None => "{spinner} {pos:>6} UNIT {per_sec:>7}{msg}",
        };
        // The templates above are constants; the tests run both.
        let form = format!("{{prefix:<24!}} {}", form.replace("UNIT", unit));
        let style = ProgressStyle::with_template(&form).expect("a valid template");
        bar.set_style(style.with_key(
            "per_sec",
            |state: &indicatif::ProgressState, w: &mut dyn std::fmt::Write| {
                let _ = write!(w, "{:.0}/s", state.per_sec());
            },
        ));
        bar.set_prefix(what.to_owned());
        let progress = Self(bar, table.cloned());
        progress.show_table();
        progress
    }

    fn show_table(&self) {
        if let Some(table) = self.1.as_ref().filter(|_| !self.0.is_hidden()) {
            self.0.set_message(table.text());
        }
    }

    /// One pair more is done; whether to go on.
    pub(crate) fn step(&self) -> bool {
        self.0.inc(1);
        !interrupted()
    }

    /// Takes the bar away.
    pub(crate) fn clear(self) {
        self.0.finish_and_clear();
    }
}

impl Monitor for Progress {
    fn memory_of(&mut self, work: &mut dyn FnMut()) -> Option<MemoryUse> {
        Some(used_by(work))
    }

    fn failed(&mut self, failure: &str) {
        self.0.suspend(|| tracing::warn!("{failure}"));
    }

    fn go_on(&mut self, done: u64) -> bool {
        self.0.set_position(done);
        // The sinks take a batch at a time.
        if done.is_multiple_of(8) {
            self.show_table();
        }
        !interrupted()
    }
}

/// A bar that counts drives and their frames, for several threads.
pub(crate) struct DriveProgress(ProgressBar, AtomicU64);

impl DriveProgress {
    pub(crate) fn new(scenario: &str, drives: usize, quiet: bool) -> Self {
        listen_for_interrupt();
        let bar = match quiet {
            true => ProgressBar::hidden(),
            false => ProgressBar::new(drives as u64),
        };
        let form = "{prefix:<24!} {bar:16} {pos:>6}/{len} drives {eta:>4} left, {msg} pairs";
        // The template is a constant; the tests run it.
        let style = ProgressStyle::with_template(form).expect("a valid template");
        bar.set_style(style);
        bar.set_prefix(format!("score {scenario}"));
        Self(bar, AtomicU64::new(0))
    }

    /// One pair more.
    pub(crate) fn frame(&self) {
        let frames = self.1.fetch_add(1, Ordering::Relaxed) + 1;
        if frames.is_multiple_of(16) {
            self.0.set_message(frames.to_string());
        }
    }

    /// One drive more.
    pub(crate) fn done(&self) {
        self.0.inc(1);
    }

    pub(crate) fn clear(&self) {
        self.0.finish_and_clear();
    }
}

/// A bar that counts the epochs of networks, with their errors.
pub(crate) struct EpochBar(ProgressBar);

impl EpochBar {
    /// `networks` of at most so many `epochs`.
    pub(crate) fn new(what: &str, networks: usize, epochs: usize, quiet: bool) -> Self {
        listen_for_interrupt();
        let bar = match quiet {
            true => ProgressBar::hidden(),
            false => ProgressBar::new((networks * epochs) as u64),
        };
        let form = "{prefix:<16!} {bar:12} {pos:>4}/{len} epochs {eta:>3} left  {msg}";
        // The template above is a constant; the tests run it.
        bar.set_style(ProgressStyle::with_template(form).expect("a valid template"));
        bar.set_prefix(what.to_owned());
        Self(bar)
    }

    /// An epoch more of a network is done, with that validation error; whether to go on.
    pub(crate) fn step(&self, done: usize, hidden: usize, error: f64) -> bool {
        self.0.set_position(done as u64);
        self.0.set_message(format!("{hidden} neurons: {error:.4}"));
        !interrupted()
    }

    /// Takes the bar away.
    pub(crate) fn clear(self) {
        self.0.finish_and_clear();
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

    /// `done` bytes of `total`, where that is known; whether to go on.
    pub(crate) fn go_on(&self, done: u64, total: Option<u64>) -> bool {
        if let Some(total) = total.filter(|&total| self.0.length() != Some(total)) {
            self.0.set_length(total);
            // What an earlier download left is no measure of this one's rate.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_counted_at_its_peak_and_after() {
        let mut kept = Vec::new();
        let used = used_by(&mut || {
            let large = vec![1_u8; 50_000_000];
            kept = large[..10_000_000].to_vec();
        });
        // Other tests allocate and free meanwhile, but not as much.
        assert!((55_000_000..70_000_000).contains(&used.peak), "{used:?}");
        assert!((5_000_000..15_000_000).contains(&used.kept), "{used:?}");
        assert_eq!(kept.len(), 10_000_000);
    }
}
