//! `svl datasets`: the data sets svl reads, and their files in a folder.

use crate::cli::shared::data::{DataColumns, data_table};
use crate::cli::shared::terminal::{print, print_json, size, width, wrapped};
use serde::Serialize;
use std::path::PathBuf;
use svl::report::table::NONE;
use svl::runs::data_folder;
use svl::source::dataset::{DATASETS, Dataset, Inventory};

/// List the stereo data sets svl reads, and what is there of each
///
/// With a folder, scenes are the pairs there, with or without truth, and missing is what the
/// scenario of the same name needs. docs/data-sets.md says where each data set is and how to unpack
/// it.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  svl datasets
  svl datasets --data DATASETS
  svl datasets --json")]
pub(crate) struct Args {
    /// Folder of the data sets [default: SVL_DATASETS]
    #[arg(long, value_name = "DIR", help_heading = "Input")]
    data: Option<PathBuf>,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

const COLUMNS: DataColumns<'_> = DataColumns {
    name: ("name", "data set"),
    numbers: &[("scenes", "scenes")],
    text: ("title", "content"),
};

/// A data set, and what is there of it if a folder is known.
#[derive(Serialize)]
struct Listed {
    #[serde(flatten)]
    dataset: &'static Dataset,
    #[serde(skip_serializing_if = "Option::is_none")]
    there: Option<Inventory>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let root = data_folder(args.data.as_deref());
    if let Some(root) = &root {
        root.read_dir().map_err(|e| svl::Error::io(root, e))?;
    }
    let listed = DATASETS.iter().map(|dataset| Listed {
        dataset,
        there: root.as_deref().map(|root| Inventory::read(dataset, root)),
    });
    let listed: Vec<_> = listed.collect();
    if args.json {
        return print_json(&listed);
    }
    match root {
        Some(_) => print(&there(&listed)),
        None => print(&data_table(&listed, &COLUMNS, width())?),
    }
}

/// Column of the missing parts.
const COLUMN: usize = 34;

/// The scenes and sizes in the folder, and the parts that are missing.
fn there(listed: &[Listed]) -> String {
    let line = |name: &str, scenes: &str, size: &str, missing: &str| {
        let head = format!("{name:<14} {scenes:>6} {size:>10}");
        wrapped(&head, COLUMN, missing, width())
    };
    let mut text = line("data set", "scenes", "size", "missing");
    for Listed { dataset, there } in listed {
        let there = there.as_ref().expect("a folder to look into");
        let (scenes, size) = (there.scenes.to_string(), size(there.bytes));
        let missing = match &there.missing[..] {
            [] => NONE.to_owned(),
            missing => missing.join("; "),
        };
        text += &line(dataset.name, &scenes, &size, &missing);
    }
    text
}
