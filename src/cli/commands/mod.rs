//! The subcommands: one file each, its arguments beside its run. They do not import each other.

mod algos;
mod bench;
mod calibrate;
mod columns;
mod compare;
mod datasets;
mod eval;
mod generate;
mod help;
mod info;
mod label;
mod matching;
mod record;
mod recover;
mod replay;
mod report;
mod reproduce;
mod score;
mod train;
mod tune;
mod view;

use clap::Subcommand;

#[derive(Subcommand)]
pub(super) enum Command {
    Record(record::Args),
    Replay(replay::Args),
    Score(Box<score::Args>),
    Report(report::Args),
    Compare(compare::Args),
    Reproduce(reproduce::Args),
    Match(matching::Args),
    Eval(eval::Args),
    Bench(bench::Args),
    Tune(Box<tune::Args>),
    Calibrate(calibrate::Args),
    View(view::Args),
    Label(label::Args),
    Train(train::Args),
    Info(info::Args),
    Recover(recover::Args),
    Algos(algos::Args),
    Columns(columns::Args),
    Datasets(datasets::Args),
    Generate(generate::Args),
    Help(help::Args),
}

impl Command {
    /// Default number of threads; `None` is one per core.
    pub(super) fn threads(&self) -> Option<u16> {
        matches!(self, Self::Bench(_)).then_some(bench::THREADS)
    }

    /// True for tools that wait for keys while other threads compute.
    pub(super) fn waits_for_keys(&self) -> bool {
        matches!(self, Self::Tune(_) | Self::Label(_))
    }

    /// Runs the subcommand. `threads`: the numbers of threads that are named; `program`: the whole
    /// command line, for what describes it.
    pub(super) fn run(
        self,
        quiet: bool,
        threads: &[u16],
        program: fn() -> clap::Command,
    ) -> anyhow::Result<()> {
        match self {
            Self::Record(args) => record::run(&args, quiet),
            Self::Replay(args) => replay::run(&args, quiet),
            Self::Score(args) => score::run(&args, quiet, !threads.is_empty()),
            Self::Report(args) => report::run(&args),
            Self::Compare(args) => compare::run(&args),
            Self::Reproduce(args) => reproduce::run(&args, quiet),
            Self::Match(args) => matching::run(&args),
            Self::Eval(args) => eval::run(&args),
            Self::Bench(args) => bench::run(&args, threads),
            Self::Tune(args) => tune::run(&args, quiet),
            Self::Calibrate(args) => calibrate::run(&args, quiet),
            Self::View(args) => view::run(&args),
            Self::Label(args) => label::run(&args, quiet),
            Self::Train(args) => train::run(&args, quiet),
            Self::Info(args) => info::run(&args),
            Self::Recover(args) => recover::run(&args),
            Self::Algos(args) => algos::run(&args),
            Self::Columns(args) => columns::run(&args),
            Self::Datasets(args) => datasets::run(&args),
            Self::Generate(args) => generate::run(&args, program()),
            // Printed before anything is set up.
            Self::Help(_) => Ok(()),
        }
    }
}
