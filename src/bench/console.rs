//! The console of a program: the display of long work.

use crate::pass::Monitor;
use crate::sink::RunningTable;
use svl_core::interrupt;
use svl_score::notice::Notice;

/// The terminal of a program.
pub trait Console: Sync {
    /// Begins to show the progress of `work` of `total` steps, if that number is known.
    fn bar(&self, work: &str, unit: Unit, total: Option<u64>) -> Box<dyn Bar>;

    /// Prints a line that is not a warning, unless the user wants none.
    fn note(&self, line: &str);
}

/// The steps of long work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    Pairs,
    Rows,
    Drives,
    /// Epochs of the training of networks.
    Epochs,
}

impl Unit {
    /// Plural name of the unit.
    pub fn words(self) -> &'static str {
        match self {
            Self::Pairs => "pairs",
            Self::Rows => "rows",
            Self::Drives => "drives",
            Self::Epochs => "epochs",
        }
    }
}

/// The progress of some work; shown until it is dropped.
pub trait Bar: Send + Sync {
    /// `done` steps are done.
    fn set(&self, done: u64);

    /// One more step is done.
    fn step(&self);

    /// Shows a text beside or below it.
    fn show(&self, text: String);

    /// Prints something above it.
    fn suspend(&self, print: &mut dyn FnMut());
}

/// Shows the progress of a run, and ends the run on Ctrl-C.
pub struct Watch {
    bar: Box<dyn Bar>,
    table: Option<RunningTable>,
}

impl Watch {
    /// A run of `pairs`, if that number is known; with a table below its bar, if there is one.
    pub fn new(
        console: &dyn Console,
        work: &str,
        pairs: Option<u64>,
        table: Option<&RunningTable>,
    ) -> Self {
        let bar = console.bar(work, Unit::Pairs, pairs);
        if let Some(table) = table {
            bar.show(table.text());
        }
        let table = table.cloned();
        Self { bar, table }
    }
}

impl Monitor for Watch {
    fn failed(&mut self, failure: &Notice) {
        self.bar.suspend(&mut || failure.warn());
    }

    fn go_on(&mut self, done: u64) -> bool {
        self.bar.set(done);
        // The sinks take a batch at a time.
        if let Some(table) = self.table.as_ref().filter(|_| done.is_multiple_of(8)) {
            self.bar.show(table.text());
        }
        !interrupt::requested()
    }
}
