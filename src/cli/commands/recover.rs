//! `svl recover`: the intact part of a truncated or corrupt recording.

use crate::cli::shared::data::{DataField, data_text, events, field};
use crate::cli::shared::terminal::{print_value, size, width};
use crate::cli::shared::usage;
use std::path::PathBuf;
use svl::counted;
use svl::outputs::Outputs;
use svl::recording::{Recording, Recovery};

/// Recover the intact part of a truncated or corrupt recording
///
/// Copies all intact topics, schemas, messages, attachments and metadata into a new file, chunk by
/// chunk, whichever program wrote them. A chunk that does not match its CRC is skipped; where a
/// length is damaged, reading resynchronizes at the next record that proves to be one. Exit status
/// 4 reports that the file has more than could be copied; the incomplete record in which it ends
/// does not count. The damaged file is not changed.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  svl recover killed.mcap -o saved.mcap && svl info saved.mcap")]
pub(crate) struct Args {
    /// The recording; any other MCAP file will do, or the folder of a ROS 2 bag of one file
    file: PathBuf,
    /// File to write
    #[arg(
        short, long, value_name = "OUT.mcap", value_parser = usage::ending(&["mcap"]),
        help_heading = "Output"
    )]
    output: PathBuf,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    force: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let damaged = Recording::open(&args.file)?;
    let input = damaged.only_path()?;
    let mut outputs = Outputs::claim(args.force, [input], [args.output.as_path()])?;
    outputs.begin()?;
    let recovery = damaged.recover(&outputs.place(&args.output))?;
    outputs.commit()?;
    print_value(args.json, &recovery, || text(args, &recovery))?;
    check_all_saved(args, &recovery)
}

/// # Errors
/// [`svl::losses::Incomplete`] if the damaged file has more than was saved.
fn check_all_saved(args: &Args, recovery: &Recovery) -> anyhow::Result<()> {
    if !recovery.partial {
        return Ok(());
    }
    let missing: u64 = recovery.missing.values().sum();
    let missing = match missing {
        0 => String::new(),
        _ => format!(", {} missing", counted(missing, "message")),
    };
    let (file, lost) = (args.file.display(), recovery.losses.len());
    let lost = counted(lost, "damaged part");
    let words = format!("{file}: recovered, but for {lost}{missing}");
    Err(usage::incomplete(words))
}

const FIELDS: &[DataField] = &[
    events("pairs", "pairs"),
    field("messages", "messages"),
    field("attachments", "attachments"),
    field("metadata", "metadata"),
    field("checksums", "checksums"),
    field("losses", "damaged parts"),
    field("missing", "missing"),
];

fn text(args: &Args, recovery: &Recovery) -> anyhow::Result<String> {
    let bytes = size(args.output.metadata()?.len());
    let fields = data_text(recovery, FIELDS, width())?;
    Ok(format!("{}: {bytes}\n{fields}", args.output.display()))
}
